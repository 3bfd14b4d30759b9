"""Settings of satellite traffic, and of which link carries what."""

from typing import Literal

from autonomy.configuration import Configuration, quantity

PlanRoute = Literal["auto", "radio", "satellite"]


class Tariff(Configuration):
    """What the gateway charges."""

    bytes_per_credit: int = quantity(50, "B", title="Bytes per credit", ge=1, le=2000)
    """A message is charged for each begun portion of this many bytes."""
    price_per_credit: float = quantity(0.12, title="Price of a credit", ge=0.0, le=1000.0)
    """In the currency below; only shown, never paid here."""
    currency: str = quantity("GBP", title="Currency")
    """Name of the currency that prices are shown in."""
    credits_per_day: int = quantity(100, title="Credits per day", ge=0, le=100_000)
    """Budget of one robot for one day (UTC). When it is spent, nothing more is sent until midnight
    but an order to surface and the word that calls a plan back."""


class SatelliteConfig(Configuration):
    """How one robot uses the satellite."""

    tariff: Tariff = quantity(Tariff(), title="Tariff and budget")
    """What messages cost, and how much may be spent."""
    digest_bytes: int = quantity(205, "B", title="Size of a robot's message", ge=70, le=340)
    """Most bytes of one message of the robot: what state and answers leave free is filled with the
    samples that change the map most. 70, 205 and 340 fill whole segments over the air. The robot
    goes by its parameter SAT_BYTES, which begins with this."""
    messages_per_day: int = quantity(200, title="Robot's messages per day", ge=24, le=20_000)
    """A robot that called this often within 24 hours calls only once an hour, whatever rings or
    waits to be said; an order by satellite then waits that long, too. So no fault on board and no
    gateway that rings without end spends the account. The robot goes by its parameter SAT_DAY_MAX,
    which begins with this."""
    expiry_h: float = quantity(96.0, "h", title="Plans expire after", gt=0.0, le=118.0)
    """A plan that the robot has not confirmed by then is given up. The gateway deletes messages
    after five days."""
    contact_expiry_h: float = quantity(48.0, "h", title="Contact expires after", gt=0.0, le=8760.0)
    """A robot that was not heard on any link for this long gets no message by satellite unless
    the operator insists."""
    session_period_s: float = quantity(
        1800.0, "s", title="Time between sessions", ge=40.0, le=86400.0
    )
    """How often a robot at the surface, out of reach of radio, calls by satellite; the station
    expects its next call by this. The robot goes by its parameter SAT_PERIOD_S, which begins with
    this."""
    radio_silence_s: float = quantity(
        20.0, "s", title="Radio silence before a call", ge=1.0, le=86400.0
    )
    """A robot at the surface calls by satellite once it has not heard its station by radio for
    this long. The robot goes by its parameter SAT_SILENCE_S, which begins with this."""


class RoutingConfig(Configuration):
    """Which link carries what to a robot. Streams, parameters and files never use the satellite."""

    plan: PlanRoute = quantity("auto", title="Plans go by")
    """auto: by radio while the robot is in reach, else by satellite."""
    command: PlanRoute = quantity("auto", title="Commands go by")
    """auto: by radio while the robot is in reach, else by satellite; surface always by all."""
