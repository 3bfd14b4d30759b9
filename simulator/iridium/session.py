"""A session between modem and network, as each end knows it."""

from dataclasses import dataclass
from datetime import datetime
from enum import IntEnum

_LAST_SUCCESS = 4


class MobileOriginatedStatus(IntEnum):
    """First number of +SBDIX."""

    OK = 0
    TOO_MANY_SEGMENTS = 12
    ACCESS_DENIED = 15
    LINK_LOST = 18
    NO_NETWORK = 32
    BUSY = 35


class MobileTerminatedStatus(IntEnum):
    """Third number of +SBDIX."""

    NONE = 0
    RECEIVED = 1
    ERROR = 2


@dataclass(frozen=True, slots=True)
class Place:
    """Where a modem is."""

    latitude_deg: float
    longitude_deg: float


@dataclass(frozen=True, slots=True)
class SessionResult:
    """What a modem knows after a session: the numbers of +SBDIX and the message fetched."""

    mo_status: int
    momsn: int
    mt_status: int = MobileTerminatedStatus.NONE
    mtmsn: int = 0
    mt_data: bytes | None = None
    queued: int = 0
    """Messages that wait still."""

    @property
    def is_ok(self) -> bool:
        """Whether the modem believes that its message is at the gateway."""
        return self.mo_status <= _LAST_SUCCESS


@dataclass(frozen=True, slots=True)
class MobileOriginatedMessage:
    """What a gateway is told about a session, to push to its customer."""

    record_id: int
    """The gateway's own number; unique in the network."""
    imei: str
    session_at: datetime
    session_status: int
    """0, or 13 of a session that broke off."""
    momsn: int
    mtmsn: int
    data: bytes
    latitude_deg: float
    longitude_deg: float
    cep_km: int
    """Radius of the circle that holds the modem in 80 of 100 cases."""
