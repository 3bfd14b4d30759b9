"""Asks the rules about each robot whose status changed, and about the station itself.

Only rules that read what changed are asked, those over values of the station's own at every look,
and those of which time alone may change the answer when it may.
"""

import asyncio
from collections import defaultdict
from collections.abc import Awaitable, Callable, Iterable, Mapping
from datetime import datetime
from typing import Final

from autonomy.channel import Channel
from robot_link.clock import Clock
from robot_link.messages import STATE, LinkState, StateReport
from server.alarm.course import CompiledRule, Course, Look, Told
from server.alarm.rule import AlarmRule, Suppression
from server.alarm.station_condition import StationCondition
from server.alarm.value import VALUES, Found, Watch
from server.base.alarm_board import AlarmBoard, AlarmEvidence
from server.base.wakeups import Wakeups
from server.fleet.fleet import Fleet
from server.fleet.status import RobotStatus

STATION: Final = ""
"""Key of the station itself among robots."""


class Memory:
    """What the rules know of one robot: its newest values, and where each rule stands."""

    def __init__(self, robot: str, rules: Iterable[CompiledRule]) -> None:
        self.robot = robot
        self.told: dict[str, Told] = {}
        self._seen: dict[str, object] = {}
        self._state: StateReport | None = None
        self.courses = [Course(one) for one in rules]
        self._by_name: dict[str, list[Course]] = defaultdict(list)
        for course in self.courses:
            for name in course.compiled.names:
                self._by_name[name].append(course)
        self._always = [one for one in self.courses if one.compiled.reads_station]
        self._is_new = True

    def take(self, status: RobotStatus) -> list[str]:
        """Take the newest values of a robot; return the names of those that are new."""
        changed: list[str] = []
        for source in (status.derived, status.samples, status.readings):
            for key, sample in source.items():
                if self._seen.get(key) is not sample:
                    self._seen[key] = sample
                    self.told[key] = Told(sample.value, sample.measured_at, sample.received_at)
                    changed.append(key)
        report, state = status.vehicle_report, status.state
        for key, value in () if report is None else report.values.items():
            if self._seen.get(key) is not value:
                self._seen[key] = value
                self.told[key] = Told(value.value, value.at, value.at)
                changed.append(key)
        if state is not None and state is not self._state:
            self._state = state
            for key, number in STATE.shown(state).items():
                self.told[key] = Told(number, state.measured_at, state.received_at)
                changed.append(key)
        return changed

    def asked(self, changed: Iterable[str], now: datetime) -> list[Course]:
        """Return the rules that are to be asked after some values changed."""
        if self._is_new:
            self._is_new = False
            return self.courses
        found = {id(one): one for one in self._always}
        for name in changed:
            found.update((id(one), one) for one in self._by_name.get(name, ()))
        found.update((id(one), one) for one in self.courses if _may_differ(one, now))
        return list(found.values())


def _may_differ(course: Course, now: datetime) -> bool:
    """Tell whether time, or what the robot does, may change what a rule says without a value."""
    is_due = course.due is not None and course.due <= now
    return is_due or (course.verdict is not None and course.compiled.is_conditional)


class Engine:
    """Belongs to one event loop; ``run`` is its task.

    Args:
        fleet: The robots.
        alarms: Where alarms are raised.
        clock: The robots' clock.
        looks: Names each robot whose status changed, and ``STATION``.
    """

    def __init__(self, fleet: Fleet, alarms: AlarmBoard, clock: Clock, looks: Wakeups) -> None:
        self._fleet = fleet
        self._alarms = alarms
        self._clock = clock
        self._looks = looks
        self._rules: list[CompiledRule] = []
        self._out: frozenset[tuple[str, str | None]] = frozenset()
        self._memories: dict[str, Memory] = {}
        self._since = clock.now()
        self._misses: dict[str, Found] = {}
        self._condition: StationCondition | None = None

    def set_rules(
        self,
        rules: Iterable[AlarmRule],
        channels: Mapping[str, Channel],
        out_of_service: frozenset[tuple[str, str | None]],
    ) -> None:
        """Judge by other rules from now on; alarms that stand go on by them."""
        known = {*channels, *STATE.gauges, *VALUES}
        self._rules = [CompiledRule(one, channels) for one in rules if one.names <= known]
        self._out = out_of_service
        self._memories.clear()
        for robot in (STATION, *(one.record.id for one in self._fleet.statuses)):
            self._looks.wake(robot)

    def take_miss(self, robot: str, ellipse_units: float) -> None:
        """Take what the newest judged prediction of a robot was worth."""
        self._misses[robot] = Found(ellipse_units)
        self._looks.wake(robot)

    def take_condition(self, condition: StationCondition) -> None:
        """Take how the station's machine is."""
        self._condition = condition
        self._looks.wake(STATION)

    async def run(self) -> None:
        """Raise and clear alarms until cancelled."""
        self._since = self._clock.now()
        while True:
            steps: list[Awaitable[object]] = []
            for robot in await self._looks.next():
                steps += self._gone() if robot == STATION else []
                steps += self.judge(robot)
            await asyncio.gather(*steps)

    def judge(self, robot: str) -> list[Awaitable[object]]:
        """Ask the rules about a robot, or the station; return what is to be done at the board."""
        status = None
        if robot != STATION:
            if not self._fleet.knows(robot):
                self._memories.pop(robot, None)
                return []
            status = self._fleet.status(robot)
        memory = self._memories.get(robot)
        if memory is None:
            memory = self._memories[robot] = self._remembered(robot)
        watch = Watch(
            self._clock.now(), self._since, self._clock.speed,
            list(self._fleet.statuses), self._misses, self._condition,
        )  # fmt: skip
        changed = [] if status is None else memory.take(status)
        look = Look(robot or "the station", watch.now, memory.told, _reader(status, watch))
        steps = [
            step
            for course in memory.asked(changed, watch.now)
            if (step := self._step(course, look, status)) is not None
        ]
        for course in memory.courses:
            watch.wait_for(course.due)
        self._looks.set_due(robot, watch.due)
        return steps

    def _remembered(self, robot: str) -> Memory:
        of = [one for one in self._rules if one.is_of_station == (robot == STATION)]
        memory = Memory(robot, of)
        for course in memory.courses:
            alarm = self._alarms.standing(course.compiled.rule.key, robot or None)
            if alarm is not None:
                course.resume(alarm.level, alarm.text)
        return memory

    def _step(
        self, course: Course, look: Look, status: RobotStatus | None
    ) -> Awaitable[object] | None:
        """Ask one rule; return what follows from its answer, ``None`` if nothing."""
        rule, robot = course.compiled.rule, None if status is None else status.record.id
        stands = self._alarms.standing(rule.key, robot)
        if {(rule.key, None), (rule.key, robot)} & self._out:
            course.forget()
            park = AlarmEvidence.OUT_OF_SERVICE
            return None if stands is None else self._alarms.park(rule.key, robot, park)
        is_meant = not rule.robots or robot in rule.robots
        is_meant = is_meant and not (status is not None and status.is_retired)
        verdict = course.look(look) if is_meant else course.forget()
        if verdict is None:
            if stands is None:
                return None
            over = course.compiled.value.over if course.compiled.value is not None else None
            text = "" if over is None or status is None else over(status)
            return self._alarms.clear(rule.key, robot=robot, text=text)
        if status is not None and is_suppressed(rule, status):
            if stands is None:
                return None
            return self._alarms.park(rule.key, robot, AlarmEvidence.SUPPRESS)
        is_parked = stands is not None and stands.state in ("suppressed", "out_of_service")
        same = stands is not None and (stands.text, stands.level) == (verdict.text, verdict.level)
        if same and not is_parked:
            return None
        return self._alarms.raise_(
            rule.key, verdict.text, level=verdict.level, robot=robot, action=rule.action,
            rule=rule.key,
        )  # fmt: skip

    def _gone(self) -> list[Awaitable[object]]:
        """Clear the alarms of rules that there are no longer."""
        known = {one.rule.key for one in self._rules}
        return [
            self._alarms.clear(alarm.cause, robot=alarm.robot)
            for alarm in self._alarms.open
            if alarm.rule is not None and alarm.rule not in known
        ]


def is_suppressed(rule: AlarmRule, status: RobotStatus) -> bool:
    """Tell whether what a rule finds of a robot is no alarm by design now."""
    if rule.modes and (status.state is None or status.state.mode.name.lower() not in rule.modes):
        return True
    return any(_HOLDS[one](status) for one in rule.suppressed)


def _has_planned_dive(status: RobotStatus) -> bool:
    return status.link_state is LinkState.SUBMERGED and status.next_surfacing() is not None


_HOLDS: Final[Mapping[Suppression, Callable[[RobotStatus], bool]]] = {
    "workshop": lambda status: status.is_in_workshop,
    "under_water": lambda status: status.link_state is LinkState.SUBMERGED,
    "planned_dive": _has_planned_dive,
}


def _reader(status: RobotStatus | None, watch: Watch) -> Callable[[str], Found | None]:
    def read(name: str) -> Found | None:
        return VALUES[name].found(status, watch)

    return read
