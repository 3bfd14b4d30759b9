"""Whether the network takes a message for a modem, and why not."""

from dataclasses import dataclass
from enum import Enum


@dataclass(frozen=True, slots=True)
class Accepted:
    """A message for a modem is in its queue."""

    message_id: int
    mtmsn: int
    position: int


class Reason(Enum):
    """Why the network refuses a message for a modem."""

    UNKNOWN_IMEI = "no such modem"
    NO_LINE_RENTAL = "no line rental"
    NO_CREDIT = "insufficient credit"
    TOO_LONG = "message too long"
    EMPTY = "no data"
    QUEUE_FULL = "queue full"
    RING_DISABLED = "rings are disabled"
    NOT_ATTACHED = "the modem is not attached"
    BAD_MTMSN = "message number out of range"


class RefusedError(Exception):
    """The network does not take a message."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.value)
        self.reason = reason
