"""One robot as the station sees it: its radio, its last word, and the health of the road to it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import datetime
from functools import partial

from robot_link.clock import Clock, monotonic_s
from robot_link.delivery import deliver
from robot_link.mavlink.codec import Codec, WireMessage, packets
from robot_link.messages import (
    LinkReport,
    LinkState,
    RawFrame,
    RobotId,
    RobotMode,
    SystemId,
)
from robot_link.timing import LinkTiming
from robot_link.transport.datagram import (
    BROADCAST,
    Address,
    DatagramTransport,
    Fate,
    Received,
)

ATTEMPTS = 3
"""How often a datagram that asks or answers is handed to the radio before a time-out decides."""

_UNDER_WATER = frozenset(
    (RobotMode.DIVING, RobotMode.GLIDING, RobotMode.SPIRALLING, RobotMode.ABORTING)
)


@dataclass(frozen=True, slots=True)
class RobotEndpoint:
    """Where a robot is to be found."""

    system: SystemId
    uri: str
    """The transport that reaches it."""
    address: Address | None = None
    """Its radio; None binds the first radio that speaks under its system id."""


class Peer:
    """Belongs to the event loop of its ``StationLink``."""

    def __init__(
        self,
        robot: RobotId,
        endpoint: RobotEndpoint,
        transport: DatagramTransport,
        codec: Codec,
        clock: Clock,
        on_raw: Callable[[RawFrame], None],
        timing: LinkTiming,
    ) -> None:
        self.robot = robot
        self.system = endpoint.system
        self.transport = transport
        self.clock = clock
        self.timing = timing
        self.mode: RobotMode | None = None
        """What the robot last said that it does."""
        self.address = endpoint.address
        """The robot's radio; None until one has spoken under its system id."""
        self._codec = codec
        self._on_raw = on_raw
        self._heard_s: float | None = None
        self._heard_at: datetime | None = None
        self._rssi_dbm: float | None = None
        self._frames_received = 0
        self._frames_bad = 0

    def heard(self, received: Received, frames: int) -> None:
        """Note that valid frames came from the robot's radio."""
        self.address = received.address
        self._heard_s = monotonic_s()
        self._heard_at = self.clock.now()
        self._frames_received += frames
        if received.rssi_dbm is not None:
            self._rssi_dbm = received.rssi_dbm

    def count_bad(self, frames: int) -> None:
        """Count frames that were dropped."""
        self._frames_bad += frames

    def link_report(self) -> LinkReport:
        """Return what is known of the road to the robot now."""
        return LinkReport(
            robot=self.robot,
            carrier=self.transport.carrier,
            state=self._state(),
            heard_at=self._heard_at,
            rssi_dbm=self._rssi_dbm,
            frames_received=self._frames_received,
            frames_bad=self._frames_bad,
        )

    async def deliver(
        self,
        messages: Iterable[WireMessage],
        on_taken: Callable[[], None] = lambda: None,
        is_wanted: Callable[[], bool] = lambda: True,
    ) -> bool:
        """Send messages together, as few datagrams as they fit.

        Args:
            messages: What to say; must mean the same if heard twice.
            on_taken: Called when the radio has taken a datagram.
            is_wanted: Asked before each attempt whether they shall still be sent.

        Returns:
            Whether the robot's radio confirmed all of them. A robot whose radio is not known yet
            is called by broadcast, which nobody confirms.
        """
        address = BROADCAST if self.address is None else self.address
        frames = [self._codec.pack(message) for message in messages]
        confirmed = address != BROADCAST
        for packet in packets(frames, self.transport.max_payload):
            delivery = await deliver(
                self.transport,
                address,
                packet,
                attempts=ATTEMPTS,
                on_taken=partial(self._taken, packet, on_taken),
                is_wanted=is_wanted,
            )
            confirmed = confirmed and delivery.fate is Fate.DELIVERED
        return confirmed

    def _taken(self, packet: bytes, on_taken: Callable[[], None]) -> None:
        on_taken()
        self._on_raw(
            RawFrame(
                robot=self.robot,
                carrier=self.transport.carrier,
                outgoing=True,
                data=packet,
                at=self.clock.now(),
            )
        )

    def _state(self) -> LinkState:
        if not self.transport.max_payload:
            return LinkState.PORT_CLOSED
        if self._heard_s is None:
            return LinkState.NEVER_HEARD
        silence_s = monotonic_s() - self._heard_s
        is_diving = self.mode in _UNDER_WATER
        if silence_s <= (self.timing.submerged_s if is_diving else self.timing.stale_s):
            return LinkState.LIVE
        return LinkState.SUBMERGED if is_diving else LinkState.STALE
