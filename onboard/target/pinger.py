"""Pings the target that the onboard program follows, and hands it the ranges."""

import asyncio
from typing import Protocol

from autonomy.tracking.config import RangingConfig
from onboard.node.client import NodeClient
from onboard.node.wire import NodeError, NodeGoneError, NodeSilentError
from robot_link.clock import Clock, monotonic_s

_LOOK_S = 0.05
"""Wall time between two questions whether a range is wanted."""
_LONGEST_S = 10.0
"""Wall time after which the acoustic node itself is given up for this ping."""


class RangeUser(Protocol):
    """What the pinger asks of the onboard program."""

    @property
    def time_s(self) -> float:
        """Seconds that the program has lived."""
        ...

    @property
    def ranging(self) -> RangingConfig | None:
        """How the mission under way takes ranges; None where it takes none."""
        ...

    def wants_range(self) -> int | None:
        """Return whom to ping now, or None."""
        ...

    def hear_range(self, range_m: float | None, age_s: float) -> None:
        """Take a slant range, or None for a ping that nobody answered."""
        ...


class Pinger:
    """One ping at a time, at the period of the mission by the robot's clock, or as fast as it can.

    A range belongs to the moment at which the sound met the target: the middle between question
    and answer, but for half of what the far modem took to answer.

    Args:
        program: Who wants the ranges.
        node: The acoustic node, which somebody else runs.
        clock: The robot's clock, for how fast it runs.
    """

    def __init__(self, program: RangeUser, node: NodeClient, clock: Clock) -> None:
        self._program = program
        self._node = node
        self._clock = clock

    async def run(self) -> None:
        """Ping until cancelled."""
        due_s = monotonic_s()
        while True:
            address, ranging = self._program.wants_range(), self._program.ranging
            if address is None or ranging is None:
                await asyncio.sleep(_LOOK_S)
                due_s = monotonic_s()
                continue
            await self._ping(address, ranging.sound_speed_m_s)
            now_s = monotonic_s()
            due_s = max(due_s + ranging.period_s / self._clock.speed, now_s)
            await asyncio.sleep(due_s - now_s)

    async def _ping(self, address: int, sound_speed_m_s: float) -> None:
        asked_s = self._program.time_s
        try:
            answer = await self._node.ask("ping", peer=address, timeout_s=_LONGEST_S)
        except (NodeError, NodeGoneError, NodeSilentError):
            answer = {}
            await asyncio.sleep(_LOOK_S)
        if self._program.wants_range() != address:
            return
        age_s = (self._program.time_s - asked_s) / 2.0
        travel_s = answer.get("travel_time_s") if answer.get("is_valid") else None
        self._program.hear_range(None if travel_s is None else travel_s * sound_speed_m_s, age_s)
