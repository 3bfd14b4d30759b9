"""The station's own clock: whether something keeps it right, and whether somebody moved it.

Everything that the station keeps is dated by it. Three things are watched: what the kernel says of
its synchronisation, the wall clock against one that nobody sets, and robots that agree with each
other and not with the station. A demo's clock is the wall's, made faster: of such a station only
the wall is watched.
"""

import asyncio
import ctypes
import statistics
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

from prometheus_client.core import Metric

from server.base.foundation import Foundation
from server.base.metric.metrics import gauge

PERIOD_S: Final = 5.0
JUMP_MIN_S: Final = 1.0
"""What keeps a clock right moves it by less than this in a period, half a thousandth at most."""
UNSYNCHRONISED_S: Final = 900.0
"""So long a clock may be without: after the machine was switched on, or while a line is down."""
WITNESSES_MIN: Final = 2
AGREE_S: Final = 5.0
WRONG_S: Final = 30.0
"""A station whose clock is off by more is said to be wrong, if robots agree on it."""
LATELY_S: Final = 600.0
SYNC, ROBOTS = "station_clock.sync", "station_clock.robots"
_READ_S: Final = 0.05
"""Two clocks that were read within this belong together."""
_STA_UNSYNC: Final = 0x40
_MICRO: Final = 1e-6

Witness: TypeAlias = Callable[[], Mapping[str, float]]
"""Returns by how much the clocks of robots are ahead of the station's, s."""


class _Timex(ctypes.Structure):
    """``struct timex`` of Linux up to what is read, and room for the rest."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_byte * 256),
    )


@dataclass(frozen=True, slots=True)
class KernelClock:
    """What the kernel says of its clock."""

    is_synchronised: bool
    max_error_s: float


def kernel_clock() -> KernelClock | None:
    """Ask the kernel; ``None`` where it does not say.

    Source:
        Linux manual, adjtimex(2): with ``modes`` 0 it changes nothing and needs no privilege.
    """
    if not sys.platform.startswith("linux"):
        return None
    timex = _Timex()
    if ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(timex)) < 0:
        return None
    return KernelClock(not timex.status & _STA_UNSYNC, timex.maxerror * _MICRO)


def wall_and_steady_s() -> tuple[float, float]:
    """Return the wall clock, and one that nobody sets and that goes on while the machine sleeps."""
    steady = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
    while True:
        before_s = time.clock_gettime(steady)
        wall_s = time.time()
        if time.clock_gettime(steady) - before_s < _READ_S:
            return wall_s, before_s


def disagreement_s(offsets_s: Mapping[str, float]) -> float | None:
    """Return how far robots that agree are ahead of the station; ``None`` unless it is wrong.

    Args:
        offsets_s: By how much each robot's clock is ahead, s.
    """
    if len(offsets_s) < WITNESSES_MIN:
        return None
    middle_s = statistics.median(offsets_s.values())
    agree = sum(abs(offset_s - middle_s) <= AGREE_S for offset_s in offsets_s.values())
    is_wrong = abs(middle_s) > WRONG_S and agree > len(offsets_s) / 2 and agree >= WITNESSES_MIN
    return middle_s if is_wrong else None


class StationClock:
    """Watches the clock of the machine and raises alarms about it. Belongs to one event loop.

    A jump is an alarm by a rule of the station (``clock_step``), which reads it here.

    Args:
        foundation: What the station stands on.
        read: Returns the wall clock and a steady one, s.
        ask: Returns what the kernel says.
    """

    def __init__(
        self,
        foundation: Foundation,
        read: Callable[[], tuple[float, float]] = wall_and_steady_s,
        ask: Callable[[], KernelClock | None] = kernel_clock,
    ) -> None:
        self._alarms = foundation.alarms
        self._is_scaled = foundation.settings.clock_file is not None
        self._expects_sync = foundation.settings.clock_sync_expected
        self._read, self._ask = read, ask
        self._before: tuple[float, float] | None = None
        self._jumped: deque[tuple[float, float]] = deque()
        """Moments of the steady clock, and by how much the other jumped then."""
        self._unsynchronised_since_s: float | None = None
        self._witnesses: list[Witness] = []
        self._jumps = foundation.metrics.counter("clock_jumps", "Jumps of the station's clock.")
        self.kernel: KernelClock | None = ask()
        self.newest_jump_s = 0.0
        """By how much the clock jumped last; 0 if it never did."""
        foundation.metrics.add(self._figures)

    def add_witness(self, witness: Witness) -> None:
        """Hold the station's clock against the clocks of robots too."""
        self._witnesses.append(witness)

    @property
    def jump_lately_s(self) -> float:
        """By how much the clock jumped within the last ten minutes, the largest; 0 if it did not.

        Slow steering of it, and a machine that slept, are no jump.
        """
        return max((abs(jump_s) for _, jump_s in self._jumped), default=0.0)

    @property
    def text(self) -> str:
        """What is wrong with the clock now, in one sentence; "" for nothing that is known."""
        standing = (self._alarms.standing(cause, None) for cause in (SYNC, ROBOTS))
        return next((alarm.text for alarm in standing if alarm is not None), "")

    async def run(self) -> None:
        """Look until cancelled."""
        while True:
            await self.look()
            await asyncio.sleep(PERIOD_S)

    async def look(self) -> None:
        """Look once at everything that tells of the clock."""
        wall_s, steady_s = self._read()
        self._note_jump(wall_s, steady_s)
        self.kernel = self._ask()
        if not self._is_scaled:
            await self._judge_sync(steady_s)
            await self._judge_robots()

    def _note_jump(self, wall_s: float, steady_s: float) -> None:
        while self._jumped and self._jumped[0][0] < steady_s - LATELY_S:
            self._jumped.popleft()
        before, self._before = self._before, (wall_s, steady_s)
        if before is None:
            return
        jump_s = (wall_s - before[0]) - (steady_s - before[1])
        if abs(jump_s) < JUMP_MIN_S:
            return
        self.newest_jump_s = jump_s
        self._jumped.append((steady_s, jump_s))
        self._jumps.inc()

    async def _judge_sync(self, steady_s: float) -> None:
        if not self._expects_sync or self.kernel is None or self.kernel.is_synchronised:
            self._unsynchronised_since_s = None
            await self._alarms.clear(SYNC)
            return
        if self._unsynchronised_since_s is None:
            self._unsynchronised_since_s = steady_s
        if steady_s - self._unsynchronised_since_s >= UNSYNCHRONISED_S:
            text = "The station's clock is not synchronised: nothing keeps it right."
            action = "See whether the time service of the machine (such as chrony) reaches it."
            await self._alarms.raise_(SYNC, text, action=action)

    async def _judge_robots(self) -> None:
        offsets_s = {
            robot: offset_s for witness in self._witnesses for robot, offset_s in witness().items()
        }
        ahead_s = disagreement_s(offsets_s)
        if ahead_s is None:
            await self._alarms.clear(ROBOTS)
            return
        side = "behind" if ahead_s > 0.0 else "ahead of"
        text = (
            f"The station's clock is about {10 * round(abs(ahead_s) / 10)} s {side} the clocks of "
            f"{len(offsets_s)} robots, which agree with each other."
        )
        action = "Compare the clock of this machine with a clock that you trust."
        await self._alarms.raise_(ROBOTS, text, action=action)

    def _figures(self) -> Iterator[Metric]:
        kernel = self.kernel
        if kernel is not None:
            text = "Whether something keeps the station's clock right, as the kernel says."
            yield gauge("clock_synchronised", text, float(kernel.is_synchronised))
            text = "How wrong the station's clock may be, as the kernel says."
            yield gauge("clock_max_error_seconds", text, kernel.max_error_s)
        text = "By how much the station's clock jumped last."
        yield gauge("clock_last_jump_seconds", text, self.newest_jump_s)
