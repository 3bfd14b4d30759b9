"""How bad the satellite service is."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SatelliteConditions:
    """How bad the service is; probabilities hold for one message."""

    loss: float = 0.0
    """Probability that a message which a session fetches, or a ring, does not reach the modem."""
    mobile_originated_loss: float = 0.0
    """Probability that a session goes wrong: it breaks off before the gateway has the message,
    or after that, or it ends well and the message is lost ashore; each as often."""
    duplication: float = 0.0
    """Probability that a message comes twice: to the modem, or from the gateway."""
    reordering: float = 0.0
    """Probability that a message is overtaken by a later one."""
    latency_s: float = 5.0
    """Shortest time from the gateway's door into the queue, and from the session to the push."""
    jitter_s: float = 5.0
    """Greatest extra time, uniformly distributed."""
    session_s: float = 15.0
    """Length of a session."""
    outage: bool = False
    """No modem finds the network."""
    gateway_outage: bool = False
    """The gateways answer nobody and push nothing until it ends."""
    answer_loss: float = 0.0
    """Probability that a gateway takes a message and its answer gets lost."""
    gateway_failure: float = 0.0
    """Probability that a gateway fails to take a message, for no fault of the message."""
    ring: bool = True
    """Rings are sent."""
