"""What every satellite gateway offers to the station, and how it can refuse.

Errors by what the caller can do::

    ValueError                 the message itself cannot be sent; nothing left the station
    GatewayRefusal             the gateway said no
        retry == "never"       stop and tell the operator
        retry == "later"       the same bytes may be taken later
    GatewayUnreachableError    nobody knows whether it was taken: try again with the SAME bytes
    HeldBackError              the other way: the station does not take what a gateway brings
"""

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Final, Literal, Protocol

MT_BYTES_MAX: Final = 270
"""Longest message that a robot's modem takes (Iridium 9602)."""
MO_BYTES_MAX: Final = 340
"""Longest message that a robot's modem sends (Iridium 9602)."""
_FIRST_RETRY_S: Final = 5.0
_LONGEST_RETRY_S: Final = 600.0

Retry = Literal["never", "later"]


class GatewayFault(StrEnum):
    """Why a gateway did not take a message."""

    LOGIN = "login"
    UNKNOWN_IMEI = "unknown_imei"
    NO_LINE_RENTAL = "no_line_rental"
    NO_CREDIT = "no_credit"
    BAD_DATA = "bad_data"
    TOO_LONG = "too_long"
    EMPTY = "empty"
    QUEUE_FULL = "queue_full"
    RING_DISABLED = "ring_disabled"
    NOT_ATTACHED = "not_attached"
    BUSY = "busy"
    """The gateway lacks resources at the moment."""
    ADDRESS_REFUSED = "address_refused"
    """The gateway does not take messages from this station's network address."""
    PROTOCOL = "protocol"
    """The gateway did not understand the station."""
    SEQUENCE = "sequence"
    """The sequence number that was to be given to the message is out of range."""
    NO_ACCOUNT = "no_account"
    """The station has no account, or half of one, with this gateway."""
    OTHER = "other"


class GatewayRefusal(Exception):  # noqa: N818 - an answer, not a fault of the program
    """A gateway said no.

    Args:
        fault: Why.
        sentence: What the operator is told.
        retry: Whether the same bytes may be taken later.
    """

    def __init__(self, fault: GatewayFault, sentence: str, retry: Retry = "never") -> None:
        super().__init__(sentence)
        self.fault = fault
        self.sentence = sentence
        self.retry: Retry = retry


class GatewayUnreachableError(Exception):
    """No answer, or none that says what became of the message; the argument is a sentence."""

    @property
    def sentence(self) -> str:
        """What the operator is told."""
        return str(self)


class HeldBackError(Exception):
    """The station takes no messages of this robot now; the gateway must keep them.

    Raised by whoever keeps incoming messages, such as while the operator has disabled the link;
    the argument is a sentence.
    """


@dataclass(frozen=True, slots=True)
class Taken:
    """A gateway has the message; the robot has not."""

    message_id: str
    """The gateway's name for it."""
    mtmsn: int | None
    """Sequence number that the robot's modem will tell, where the gateway says it."""
    position: int | None
    """Place in the robot's queue, where the gateway says it; 1 is next."""


@dataclass(frozen=True, slots=True)
class MobileOriginated:
    """One message that a robot's modem sent, as a gateway tells it."""

    carrier: str
    """``rockblock``, ``directip`` or ``cloudloop``."""
    imei: str
    """Of the robot's modem: 15 digits."""
    momsn: int
    """The modem's sequence number, 0..65535; it wraps."""
    mtmsn: int | None
    """Sequence number of the message that the same session brought to the modem, if any."""
    session_at: datetime
    """When the session was, by the network's clock; aware UTC."""
    arrived_at: datetime
    """When the station got it; aware UTC."""
    data: bytes
    """The payload, 0..340 bytes; of a payload that could not be read, what stood there."""
    latitude_deg: float | None
    """Where the network believes the modem to be."""
    longitude_deg: float | None
    cep_km: float | None
    """Radius of the circle that holds the modem in 80 % of cases."""
    session_status: int = 0
    """As DirectIP numbers it: 0 to 2 brought the payload; -1 where it is not told."""
    fault: str = ""
    """Why the payload could not be read; empty when it could."""


class SatelliteGateway(Protocol):
    """A gateway's sending side; belongs to one event loop."""

    @property
    def carrier(self) -> str:
        """``rockblock``, ``directip`` or ``cloudloop``."""
        ...

    async def send(
        self, imei: str, data: bytes, *, client_id: int, flush: bool = False, priority: int = 5
    ) -> Taken:
        """Hand one message over; it is not sent twice by itself.

        Args:
            imei: Modem of the robot.
            data: 1..270 bytes.
            client_id: Number of this message, 1..65535; the same when it is tried again.
            flush: Throw away what waits for this modem first.
            priority: 1 (first) to 5, where the gateway knows priorities.

        Raises:
            ValueError: If the message cannot be sent at all; nothing left the station.
            GatewayRefusal: If the gateway says no.
            GatewayUnreachableError: If nobody knows whether it was taken.
        """
        ...

    async def close(self) -> None:
        """Give connections up."""
        ...


def check_message(imei: str, data: bytes, client_id: int, priority: int) -> None:
    """Refuse what no gateway takes, before any network.

    Raises:
        ValueError: With a sentence that names the argument and its limit.
    """
    if not is_imei(imei):
        raise ValueError(f"an IMEI has 15 digits, unlike {imei!r}")
    if not 1 <= len(data) <= MT_BYTES_MAX:
        raise ValueError(
            f"a message to a robot has 1 to {MT_BYTES_MAX} bytes; this one has {len(data)}"
        )
    if not 1 <= client_id <= 0xFFFF:
        raise ValueError(f"a client id is 1 to 65535, not {client_id}")
    if not 1 <= priority <= 5:
        raise ValueError(f"a priority is 1 to 5, not {priority}")


def is_imei(text: str) -> bool:
    """Tell whether this is the number of a modem."""
    return len(text) == 15 and text.isascii() and text.isdecimal()


def retry_after_s(attempts: int) -> float:
    """Return how long to wait after so many attempts found nobody: 5 s, doubling to 10 min."""
    return min(_FIRST_RETRY_S * 2.0 ** min(max(attempts, 1) - 1, 10), _LONGEST_RETRY_S)
