"""Asks the delivered rules about one status, as the station does at its first look."""

from collections.abc import Mapping
from datetime import datetime

from autonomy.channel import CHANNELS, Channel
from server.alarm.course import CompiledRule, Course, Look, Told, Verdict
from server.alarm.delivered import delivered
from server.alarm.value import VALUES, Watch
from server.fleet.status import RobotStatus


def verdicts(
    status: RobotStatus, watch: Watch, channels: Mapping[str, Channel] = CHANNELS
) -> dict[str, Verdict]:
    """Return what each delivered rule says of a robot, by cause; ``watch.due`` is kept."""
    robot, found = status.record.id, dict[str, Verdict]()
    told = told_of({key: sample.value for key, sample in status.samples.items()}, watch.now)
    look = Look(robot, watch.now, told, lambda name: VALUES[name].found(status, watch))
    for rule in delivered(channels).values():
        compiled = CompiledRule(rule, channels)
        if compiled.is_of_station:
            continue
        course = Course(compiled)
        verdict = course.look(look)
        watch.wait_for(course.due)
        if verdict is not None:
            found[rule.key] = verdict
    return found


def told_of(values: Mapping[str, float], now: datetime) -> dict[str, Told]:
    """Return values as if they came just now."""
    return {key: Told(value, now, now) for key, value in values.items()}


def crossings(
    robot: str, values: Mapping[str, float], channels: Mapping[str, Channel], now: datetime
) -> dict[str, Verdict]:
    """Return what the rules of channels say of some values, by channel."""
    look = Look(robot, now, told_of(values, now), lambda name: None)
    found: dict[str, Verdict] = {}
    for rule in delivered(channels).values():
        if rule.kind == "catalogue":
            verdict = Course(CompiledRule(rule, channels)).look(look)
            if verdict is not None:
                found[rule.reads] = verdict
    return found
