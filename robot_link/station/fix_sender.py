"""Fixes by cameras on their way to a robot: the newest one, once, within a small part of the radio.

A fix that waits for its turn is replaced by a newer one. None is repeated, and none travels while
the robot's clock is known less well than it may have moved in the meantime.
"""

import asyncio
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from robot_link.camera.fix import CameraFix
from robot_link.camera.received_fix import AGE_MAX_S
from robot_link.clock import monotonic_s
from robot_link.mavlink.fix import fix_message
from robot_link.messages import LinkState
from robot_link.service.clock_sync import ClockOffset, ClockSource
from robot_link.station.peer import Peer
from robot_link.transport.datagram import DatagramTransport

PERIOD_S: Final = 0.2
"""Shortest time between two fixes of one robot, of the wall."""
CLOCK_UNSURE_S: Final = 0.2
"""A clock that may be wrong by more cannot say where the robot was when."""
SHARE_OF_TELEMETRY: Final = 0.2
"""Fixes of all robots behind a radio may take so much of what it carries of telemetry, which is at
most half of what it carries at all."""

OnSent = Callable[[datetime], None]
"""Called with the station's time when the radio took a fix."""


class FixPace:
    """Shares the part of each radio that fixes may take among its robots; on one event loop."""

    def __init__(self) -> None:
        self._free_s: dict[Hashable, float] = {}

    def pause_s(self, transport: DatagramTransport) -> float:
        """Return how long this radio must not be given a fix."""
        return max(0.0, self._free_s.get(transport, 0.0) - monotonic_s())

    def spend(self, transport: DatagramTransport, octets: int) -> None:
        """Note that a fix of so many bytes goes to this radio now."""
        share = SHARE_OF_TELEMETRY * transport.bytes_per_s
        self._free_s[transport] = monotonic_s() + octets / share


@dataclass(frozen=True, slots=True)
class _Waiting:
    fix: CameraFix
    on_sent: OnSent


class FixSender:
    """Sends fixes to one robot of ours; on one event loop.

    Args:
        peer: The robot.
        offset: Returns what is known of its clock.
        pace: What fixes may take of the radios, shared by all robots.
    """

    def __init__(self, peer: Peer, offset: Callable[[], ClockOffset | None], pace: FixPace) -> None:
        self._peer = peer
        self._offset = offset
        self._pace = pace
        self._newest: _Waiting | None = None
        self._has_one = asyncio.Event()
        self._next_s = 0.0

    def send(self, fix: CameraFix, on_sent: OnSent) -> str:
        """Take the newest fix.

        Args:
            fix: Where the robot was seen.
            on_sent: Called if and when the radio took it; never, where a newer one came first.

        Returns:
            Why it will not be sent, a sentence; empty where it waits for its turn.
        """
        if reason := self._obstacle(fix):
            return reason
        self._newest = _Waiting(fix, on_sent)
        self._has_one.set()
        return ""

    async def run(self) -> None:
        """Send until cancelled."""
        while True:
            await self._has_one.wait()
            transport = self._peer.best_path().transport
            pause_s = max(self._next_s - monotonic_s(), self._pace.pause_s(transport))
            if pause_s > 0.0:
                await asyncio.sleep(pause_s)
                continue
            waiting, self._newest = self._newest, None
            self._has_one.clear()
            if waiting is not None and not self._obstacle(waiting.fix):
                await self._send(waiting, transport)

    async def _send(self, waiting: _Waiting, transport: DatagramTransport) -> None:
        offset = self._offset()
        if offset is None:
            return
        self._next_s = monotonic_s() + PERIOD_S
        await self._peer.say_once(
            fix_message(waiting.fix, self._peer.system, offset.offset_s),
            lambda frame: self._pace.spend(transport, len(frame)),
            lambda: waiting.on_sent(self._peer.clock.now()),
        )

    def _obstacle(self, fix: CameraFix) -> str:
        """Return why a fix cannot be sent now, or ""."""
        if self._peer.best_path().state(self._peer.mode) is not LinkState.LIVE:
            return f"{self._peer.robot} is not in radio contact"
        offset = self._offset()
        if offset is None or offset.source is not ClockSource.TIMESYNC:
            return f"the clock of {self._peer.robot} was not compared yet"
        if offset.uncertainty_s > CLOCK_UNSURE_S:
            return (
                f"the clock of {self._peer.robot} is only known to {offset.uncertainty_s:.1f} s,"
                f" which must be {CLOCK_UNSURE_S:g} s"
            )
        age_s = (self._peer.clock.now() - fix.measured_at).total_seconds()
        if age_s > AGE_MAX_S:
            return f"the fix is {age_s:.1f} s old, more than {AGE_MAX_S:g} s"
        try:
            fix_message(fix, self._peer.system, offset.offset_s)
        except ValueError as error:
            return str(error)
        return ""
