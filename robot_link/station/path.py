"""The links to one robot: which radios reach it, and what each has brought so far."""

from dataclasses import dataclass
from datetime import datetime
from typing import Self

from robot_link.clock import Clock, monotonic_s
from robot_link.messages import LinkReport, LinkState, RobotId, RobotMode, SystemId
from robot_link.service.duplicate import NumberWatch
from robot_link.standard_config import StandardCommandConfig
from robot_link.timing import LinkTiming
from robot_link.transport.datagram import Address, DatagramTransport, Received
from robot_link.transport.uri import LinkUri

_UNDER_WATER = frozenset(
    (RobotMode.DIVING, RobotMode.GLIDING, RobotMode.SPIRALLING, RobotMode.ABORTING)
)


@dataclass(frozen=True, slots=True)
class RadioPath:
    """One radio by which a robot is reached."""

    uri: str
    """As the robot's link was registered; what follows a ``#`` is not the transport's."""
    address: Address | None = None
    """The robot's radio; None binds the first radio that speaks under its system id."""

    @classmethod
    def of(cls, uri: str) -> Self:
        """Read a link as it is registered: the 64-bit address of the radio may follow a ``#``.

        ``xbee:///dev/ttyUSB0#0013A20041F00002`` is the radio of that address alone.

        Raises:
            ValueError: If what follows a ``#`` is no address.
        """
        return cls(uri, LinkUri(uri).address if "#" in uri else None)

    @property
    def transport_uri(self) -> str:
        """What names the transport; robots that share a radio at the station share it."""
        return self.uri.partition("#")[0]


@dataclass(frozen=True, slots=True)
class RobotEndpoint:
    """Where a robot is to be found."""

    system: SystemId
    paths: tuple[RadioPath, ...]
    """Its radios, the preferred one first; at least one."""
    key_number: int = 0
    """Changes when its signing key does: it is then a robot with other links."""
    standard: StandardCommandConfig | None = None
    """How a vehicle of another maker is told our orders; None for our own robots."""
    origin_deg: tuple[float, float] | None = None
    """Latitude and longitude of its water's origin, in whose frame a standard vehicle is placed."""


class PeerPath:
    """What is known of one link to one robot. Belongs to the event loop of its ``Peer``."""

    def __init__(
        self, path: RadioPath, transport: DatagramTransport, clock: Clock, timing: LinkTiming
    ) -> None:
        self.uri = path.uri
        self.transport = transport
        self.address = path.address
        """The robot's radio; None until one has spoken under its system id."""
        self.numbers = NumberWatch()
        """Of the robot's frames, where the line has no addresses."""
        self.stranger = ""
        """Sentence on who else spoke as the robot where the line has one far end."""
        self.stranger_s = 0.0
        self.unproved = ""
        """Where what is not signed with the robot's key came from, or ""."""
        self.unproved_s = 0.0
        self._clock = clock
        self._timing = timing
        self._heard_s: float | None = None
        self._heard_at: datetime | None = None
        self._rssi_dbm: float | None = None
        self._frames_received = 0
        self._frames_bad = 0

    def heard(self, received: Received, frames: int) -> None:
        """Note that valid frames came from the robot's radio."""
        self.address = received.address
        self._heard_s = monotonic_s()
        self._heard_at = self._clock.now()
        self._frames_received += frames
        if received.rssi_dbm is not None:
            self._rssi_dbm = received.rssi_dbm

    def is_fresh(self, limit_s: float) -> bool:
        """Tell whether the robot was heard here within the last seconds."""
        return self._heard_s is not None and monotonic_s() - self._heard_s <= limit_s

    def count_bad(self, frames: int) -> None:
        """Count frames that were dropped."""
        self._frames_bad += frames

    def state(self, mode: RobotMode | None) -> LinkState:
        """Return what is known of this link to a robot that last said it was in ``mode``."""
        if not self.transport.is_enabled:
            return LinkState.DISABLED
        if not self.transport.max_payload:
            return LinkState.MUTE if self.transport.is_mute else LinkState.PORT_CLOSED
        if self._heard_s is None:
            return LinkState.NEVER_HEARD
        silence_s = monotonic_s() - self._heard_s
        is_diving = mode in _UNDER_WATER
        if silence_s <= (self._timing.submerged_s if is_diving else self._timing.stale_s):
            return LinkState.LIVE
        return LinkState.SUBMERGED if is_diving else LinkState.STALE

    def report(self, robot: RobotId, mode: RobotMode | None) -> LinkReport:
        """Return the health of this link now."""
        return LinkReport(
            robot=robot,
            carrier=self.transport.carrier,
            state=self.state(mode),
            heard_at=self._heard_at,
            rssi_dbm=self._rssi_dbm,
            frames_received=self._frames_received,
            frames_bad=self._frames_bad,
            uri=self.uri,
            is_enabled=self.transport.is_enabled,
            radio="" if not self.address else f"{self.address:016X}",
        )
