"""One robot as the station sees it: its radios, its last word, and which link reaches it best."""

import asyncio
import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Final

from robot_link.clock import Clock
from robot_link.delivery import deliver
from robot_link.mavlink.codec import Codec, WireMessage, packets
from robot_link.messages import LinkReport, LinkState, RawFrame, RobotId, RobotMode
from robot_link.station.path import PeerPath, RobotEndpoint
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

_BEST_FIRST: Final = (
    LinkState.LIVE,
    LinkState.SUBMERGED,
    LinkState.STALE,
    LinkState.NEVER_HEARD,
    LinkState.MUTE,
    LinkState.PORT_CLOSED,
    LinkState.DISABLED,
)
_LEFT: Final = frozenset((Fate.DELIVERED, Fate.UNCONFIRMED))
"""Fates after which no other link needs to be tried."""


class Peer:
    """Belongs to the event loop of its ``StationLink``.

    Where several radios reach the robot, the one that is live is used; of several live ones the
    one that its endpoint names first, and the others when that one does not get through.
    """

    def __init__(
        self,
        robot: RobotId,
        endpoint: RobotEndpoint,
        transports: Mapping[str, DatagramTransport],
        codec: Codec,
        clock: Clock,
        on_raw: Callable[[RawFrame], None],
        timing: LinkTiming,
    ) -> None:
        if not endpoint.paths:
            raise ValueError(f"{robot} has no radio")
        self.robot = robot
        self.system = endpoint.system
        self.clock = clock
        self.timing = timing
        self.mode: RobotMode | None = None
        """What the robot last said that it does."""
        self.paths = tuple(
            PeerPath(path, transports[path.transport_uri], clock, timing) for path in endpoint.paths
        )
        self.taken_by = ""
        """Kind of the radio that last took something."""
        self.confirmed_by = ""
        """Kind of the radio that last confirmed something."""
        self.heard_by = ""
        """Kind of the radio that last brought something."""
        self._jitter = random.Random(endpoint.system)
        self._codec = codec
        self._on_raw = on_raw

    def best_path(self) -> PeerPath:
        """Return the link that would be taken now."""
        return min(self.paths, key=self._rank)

    def path_on(self, transport: DatagramTransport) -> PeerPath | None:
        """Return the link that a radio of the station is part of."""
        for path in self.paths:
            if path.transport is transport:
                return path
        return None

    def speaks_at(self, transport: DatagramTransport, address: Address) -> bool:
        """Tell whether this radio is known to be the robot's."""
        path = self.path_on(transport)
        return path is not None and path.address == address

    def is_unbound_on(self, transport: DatagramTransport) -> bool:
        """Tell whether any radio may still turn out to be the robot's there."""
        path = self.path_on(transport)
        return path is not None and path.address is None

    def heard(self, transport: DatagramTransport, received: Received, frames: int) -> None:
        """Note that valid frames came from the robot's radio."""
        if (path := self.path_on(transport)) is not None:
            self.heard_by = transport.carrier
            path.heard(received, frames)

    def count_bad(self, transport: DatagramTransport, frames: int) -> None:
        """Count frames that were dropped; those of radios that do not reach it are not counted."""
        if (path := self.path_on(transport)) is not None:
            path.count_bad(frames)

    def link_report(self) -> LinkReport:
        """Return what is known of the best link to the robot now."""
        return self.best_path().report(self.robot, self.mode)

    def link_reports(self) -> list[LinkReport]:
        """Return what is known of every link to the robot now, in the order of its endpoint."""
        return [path.report(self.robot, self.mode) for path in self.paths]

    async def deliver(
        self,
        messages: Iterable[WireMessage],
        on_taken: Callable[[], None] = lambda: None,
        is_wanted: Callable[[], bool] = lambda: True,
        *,
        on_every_path: bool = False,
    ) -> bool:
        """Send messages together, as few datagrams as they fit.

        Args:
            messages: What to say; must mean the same if heard twice.
            on_taken: Called when the radio has taken a datagram.
            is_wanted: Asked before each attempt whether they shall still be sent.
            on_every_path: Whether to say it on every link at once.

        Returns:
            Whether the robot's radio confirmed all of them. A robot whose radio is not known yet
            is called by broadcast, which nobody confirms; nor does a line without radios that
            confirm.
        """
        frames = [self._codec.pack(message) for message in messages]
        send = partial(self._deliver_on, frames=frames, on_taken=on_taken, is_wanted=is_wanted)
        if on_every_path:
            async with asyncio.TaskGroup() as group:
                sent = [group.create_task(send(path)) for path in self.paths]
            return any(task.result() is Fate.DELIVERED for task in sent)
        for path in self._roads():
            fate = await send(path)
            if fate in _LEFT:
                return fate is Fate.DELIVERED
        return False

    async def say_once(
        self,
        message: WireMessage,
        on_packed: Callable[[bytes], None],
        on_taken: Callable[[], None] = lambda: None,
    ) -> None:
        """Send what counts at this moment alone: by the best link, once; nobody repeats it.

        Args:
            message: What to say.
            on_packed: Called with the frame before it goes to the radio.
            on_taken: Called when the radio has taken it.
        """
        path = self.best_path()
        frame = self._codec.pack(message)
        on_packed(frame)
        address = BROADCAST if path.address is None else path.address
        taken = partial(self._taken, path, frame, on_taken)
        await deliver(path.transport, address, frame, on_taken=taken)

    def _rank(self, path: PeerPath) -> int:
        return _BEST_FIRST.index(path.state(self.mode))

    def _roads(self) -> Sequence[PeerPath]:
        """Return the best link, and behind it the other live ones."""
        best = self.best_path()
        others = [
            path
            for path in self.paths
            if path is not best and path.state(self.mode) is LinkState.LIVE
        ]
        return (best, *others)

    async def _deliver_on(
        self,
        path: PeerPath,
        frames: Sequence[bytes],
        on_taken: Callable[[], None],
        is_wanted: Callable[[], bool],
    ) -> Fate:
        """Return the worst fate of the datagrams on one link."""
        address = BROADCAST if path.address is None else path.address
        worst = Fate.DELIVERED
        for packet in packets(frames, path.transport.max_payload):
            delivery = await deliver(
                path.transport,
                address,
                packet,
                attempts=ATTEMPTS,
                on_taken=partial(self._taken, path, packet, on_taken),
                is_wanted=is_wanted,
                pause_s=self._pause_s,
            )
            if delivery.fate is not Fate.DELIVERED:
                worst = delivery.fate
        if worst is Fate.DELIVERED:
            if address == BROADCAST:
                return Fate.UNCONFIRMED
            self.confirmed_by = path.transport.carrier
        return worst

    def _pause_s(self) -> float:
        return self.timing.repeat_jitter_s * self._jitter.random()

    def _taken(self, path: PeerPath, packet: bytes, on_taken: Callable[[], None]) -> None:
        self.taken_by = path.transport.carrier
        on_taken()
        self._on_raw(
            RawFrame(
                robot=self.robot,
                carrier=path.transport.carrier,
                outgoing=True,
                data=packet,
                at=self.clock.now(),
            )
        )
