"""What the rules of alarm cost: 200 rules of a team over 30 channels of 20 robots, once a second.

Beside these stand the delivered rules. Values wander about the limits, so that alarms come and go.
The flood raises 10,000 causes on a station's own board and database, as fast as it takes them.
``ALARM_SECONDS`` tells how many seconds of the fleet are judged.
"""

import asyncio
import os
import random
import tempfile
import time
from contextlib import AsyncExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path

from autonomy.channel import CHANNELS, Channel, ChannelCatalogue
from autonomy.site import LAKE
from benchmarks.field.field import at_most
from db.query.fleet.robots import RobotRecord
from robot_link.clock import SystemClock
from robot_link.messages import RobotId
from robot_link.report import Reading
from server.alarm.delivered import delivered
from server.alarm.engine import Engine
from server.alarm.rule import AlarmRule
from server.base.foundation import open_foundation
from server.base.settings import Settings
from server.base.wakeups import Wakeups
from server.fleet.status import RobotStatus
from server.fleet.trail import Track

AREA = "alarm"
SECONDS = int(os.environ.get("ALARM_SECONDS", "30"))
RULES, CHANNELS_OF_ONE, ROBOTS, CAUSES = 200, 30, 20, 10_000
RAISED_AT_ONCE = 50
WHAT = f"{RULES} rules, {CHANNELS_OF_ONE} channels, {ROBOTS} robots, 1 Hz"
T0 = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)
_KINDS = ("limit", "expression", "rate", "absence")


class _StillBoard:
    """A board that keeps nothing, so that the rules alone are timed."""

    def __init__(self) -> None:
        self.steps = 0

    def standing(self, cause: str, robot: str | None) -> None:
        del cause, robot

    def raise_(self, cause: str, text: str, **others: object) -> None:
        del cause, text, others
        self.steps += 1

    def clear(self, cause: str, **others: object) -> None:
        del cause, others


class _Fleet:
    def __init__(self, statuses: dict[str, RobotStatus]) -> None:
        self._statuses = statuses

    @property
    def statuses(self) -> list[RobotStatus]:
        return list(self._statuses.values())

    def knows(self, robot: str) -> bool:
        return robot in self._statuses

    def status(self, robot: str) -> RobotStatus:
        return self._statuses[robot]


def _own_channels() -> ChannelCatalogue:
    own = [
        Channel(f"own_{n}", f"Own {n}", "1", 128 + n, kind="housekeeping", can_map=False)
        for n in range(CHANNELS_OF_ONE)
    ]
    return CHANNELS.with_own(own)


def _rule(number: int) -> AlarmRule:
    name, kind = f"own_{number % CHANNELS_OF_ONE}", _KINDS[number % len(_KINDS)]
    other = f"own_{(number + 7) % CHANNELS_OF_ONE}"
    fields = {
        "key": f"rule {number}",
        "title": f"Rule {number}",
        "kind": kind,
        "reads": "" if kind == "expression" else name,
        "expression": f"{name} > 95 and {other} < 50 or abs({name} - {other}) > 98",
        "limits": [{"level": "watch", "high": 96.0}, {"level": "severe", "high": 99.0}],
        "hysteresis": 1.0,
        "delay_s": 2.0,
        "text": "{robot}: {title} is {value}.",
    }
    if kind != "expression":
        fields.pop("expression")
    else:
        fields["limits"] = [{"level": "warning", "high": 0.5}]
    return AlarmRule.model_validate(fields)


def share_of_core() -> float:
    """Return which share of one core the rules take, percent."""
    names = [RobotId(f"robot-{n}") for n in range(ROBOTS)]
    records = [RobotRecord(one, one, "miniglider", "real", None, (), LAKE, T0) for one in names]
    fleet = {one.id: RobotStatus(one, Track(0.01, (0.05, 0.12))) for one in records}
    clock, channels = SystemClock(), _own_channels()
    engine = Engine(_Fleet(fleet), _StillBoard(), clock, Wakeups(clock))
    rules = [*delivered(channels).values(), *map(_rule, range(RULES))]
    engine.set_rules(rules, channels, frozenset())
    draw = random.Random()
    used_s = 0.0
    for second in range(SECONDS + 1):
        at = T0 + timedelta(seconds=second)
        for name in names:
            for n in range(CHANNELS_OF_ONE):
                key = f"own_{n}"
                reading = Reading(name, key, draw.uniform(0.0, 100.0), at, at)
                fleet[name].readings[key] = reading
        begun_s = time.process_time()
        for name in names:
            engine.judge(name)
        if second:  # the first look makes what is remembered of each robot
            used_s += time.process_time() - begun_s
    return 100.0 * used_s / SECONDS


async def _flood(folder: Path) -> tuple[float, int]:
    async with AsyncExitStack() as stack:
        foundation = await open_foundation(Settings(data_dir=folder), stack)
        board, begun_s = foundation.alarms, time.monotonic()
        for first in range(0, CAUSES, RAISED_AT_ONCE):
            numbers = range(first, first + RAISED_AT_ONCE)
            await asyncio.gather(*(board.raise_(f"cause {n}", f"Cause {n}.") for n in numbers))
        return time.monotonic() - begun_s, len(board.open)


def measure() -> list[dict[str, object]]:
    """Return the rows of this area."""
    with tempfile.TemporaryDirectory() as folder:
        flood_s, alarms = asyncio.run(_flood(Path(folder)))
    return [
        at_most(AREA, WHAT, share_of_core(), "% of a core", 10.0),
        at_most(AREA, f"{CAUSES} causes raised and kept", flood_s, "s", 60.0),
        at_most(AREA, "alarms of these causes", float(alarms), "alarms", float(CAUSES)),
    ]
