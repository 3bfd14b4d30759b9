"""The links of a robot, and what crossed a satellite gateway."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from robot_link.messages import LinkState
from server.base.view import View, one_of

LinkStateName = Annotated[str, one_of(*LinkState)]


@dataclass(frozen=True, slots=True)
class RobotLinkView(View):
    """One of the links that a robot has."""

    uri: str
    carrier: str
    """What carries it, such as ``xbee``, ``rockblock`` or ``micromodem``."""
    kind: Annotated[str, one_of("radio", "satellite", "acoustic", "camera")]
    """``radio``, ``satellite``, ``acoustic`` or ``camera``."""
    state: LinkStateName
    """``never_heard``, ``live``, ``stale``, ``submerged``, ``mute`` (the station's own radio does
    not answer), ``port_closed`` or ``unplugged``."""
    is_plugged: bool
    """Whether the operator lets the station use it."""
    heard_at: datetime | None
    rssi_dbm: float | None
    frames_received: int
    frames_bad: int
    is_signed: bool | None
    """Whether a radio's frames are signed; without, whoever has such a radio can pose as the robot
    or as this station. ``null`` of other kinds: satellite messages always carry a proof, and the
    modem's ranges and cameras none."""
    text: str
    """Its state in one sentence."""
    carries: list[str]
    """Which kinds of message take this link now: ``telemetry``, ``plan``, ``command``,
    ``surface``, ``parameters``, ``files``, ``range`` or ``position``."""


@dataclass(frozen=True, slots=True)
class SatelliteMessageCostView(View):
    """One message that a plan needs."""

    index: int
    bytes: int
    credits: int


@dataclass(frozen=True, slots=True)
class AutoRouteView(View):
    """The link that a plan would take by itself."""

    route: Annotated[str, one_of("radio", "satellite")]
    """``radio`` or ``satellite``."""
    reason: str


@dataclass(frozen=True, slots=True)
class SatelliteQuoteView(View):
    """What sending a plan by satellite takes, before anything is sent."""

    sha256: str
    bytes: int
    """Size of what travels, without the messages' own headers."""
    messages: list[SatelliteMessageCostView]
    credits: int
    """Of one attempt; a part that is lost costs again."""
    price: float
    currency: str
    credits_left_today: int
    """Of the robot's budget for this UTC day."""
    credits_per_day: int
    earliest_delivery_at: datetime | None
    """``null`` while nobody knows when the robot will be heard."""
    text: str
    refusal: str | None
    """Why it cannot be sent by satellite now; ``null`` if it can."""
    may_force: bool
    """Whether the refusal is one that an operator who insists may overrule."""
    auto: AutoRouteView


@dataclass(frozen=True, slots=True)
class TransferPartView(View):
    """One message of a plan that travels by satellite."""

    index: int
    bytes: int
    credits: int
    """Of one sending."""
    sends: int
    """How often it was handed to the gateway."""
    level: Annotated[str, one_of("waiting", "queued", "radio")]
    """``waiting``, ``queued`` (the gateway took it) or ``radio`` (the robot's modem has it)."""
    message_id: str | None
    """The gateway's number of the newest sending."""
    mtmsn: int | None
    """The number under which the satellite network delivers it, where the gateway tells."""
    queued_at: datetime | None
    radio_at: datetime | None


@dataclass(frozen=True, slots=True)
class OutgoingMessageView(View):
    """One message that was handed to a gateway, or waits to be."""

    at: datetime
    kind: Annotated[str, one_of("plan", "order", "withdrawal")]
    """``plan``, ``order`` or ``withdrawal`` (the robot is to refuse what is left of a plan)."""
    bytes: int
    credits: int
    state: Annotated[str, one_of("sending", "taken", "radio", "refused", "dropped", "unknown")]
    """``sending``, ``taken``, ``radio``, ``refused``, ``dropped`` or ``unknown`` (nobody knows
    whether the gateway has it)."""
    message_id: str | None
    mtmsn: int | None
    text: str


@dataclass(frozen=True, slots=True)
class IncomingMessageView(View):
    """One message from a robot."""

    session_at: datetime
    """When the robot's modem spoke with the satellite."""
    arrived_at: datetime
    """When the gateway's delivery was stored here."""
    momsn: int
    mtmsn: int | None
    """The message that the robot fetched in the same session, where the gateway tells."""
    bytes: int
    credits: int
    """What it costs by the robot's tariff; not counted against the budget."""
    is_duplicate: bool
    """Whether the gateway delivered it more than once; it had an effect once."""
    is_decoded: bool
    text: str


@dataclass(frozen=True, slots=True)
class SatelliteView(View):
    """A robot's satellite link: its budget and what crossed it, the newest first."""

    imei: str | None
    """``null`` for a robot without a satellite link."""
    carrier: str
    credits_today: int
    """Spent since 00:00 UTC."""
    credits_per_day: int
    credits_left: int
    credits_heard_today: int
    """What the robot's own messages of this UTC day cost; the budget does not hold them back."""
    next_session_at: datetime | None
    """When the robot is expected to speak next; ``null`` while nobody knows."""
    outgoing: list[OutgoingMessageView]
    incoming: list[IncomingMessageView]
