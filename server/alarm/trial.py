"""A rule tried on the past: when it would have fired, by the same course that judges live."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Final

from sqlalchemy.orm import Session

from autonomy.channel import Channel
from db.query.measured.telemetry import StatePast, history, state_past
from robot_link.messages import STATE
from server.alarm.rule import AlarmRule
from server.alarm.trial_task import Fired, Past, PastValue
from server.alarm.value import VALUES
from server.base.foundation import Foundation
from server.base.job import JobError, JobProgress
from server.base.problem import FieldError, unprocessable
from server.base.worker import WORKER_FAILURES
from server.fleet.fleet import Fleet

KIND: Final = "alarm-trial"
_TASK: Final = "server.alarm.trial_task:replay"
_ALL_POINTS: Final = 1 << 40
_POINTS_MAX: Final = 3_000_000


@dataclass(frozen=True, slots=True)
class _Series:
    """Where the past of a name is kept."""

    channel: str
    factor: float = 1.0


class Trials:
    """Starts jobs that try rules. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._foundation = foundation
        self._fleet = fleet

    async def start(self, rule: AlarmRule, days: int, by: str) -> str:
        """Begin to try a rule on the last days of every robot that it is about.

        Raises:
            Problem: 422 if it watches what nobody keeps.
        """
        channels = dict(self._foundation.channels.catalogue)
        series = _series(rule, channels)
        now = self._foundation.clock.now()
        known = [status.record.id for status in self._fleet.statuses]
        robots = [one for one in known if not rule.robots or one in rule.robots]

        async def work(progress: JobProgress) -> Mapping[str, Any]:
            fired: list[Fired] = []
            judged, begin = 0, now - timedelta(days=days)
            for number, robot in enumerate(robots):
                progress.report(number / len(robots), f"reading what {robot} told")
                past, modes = await self._foundation.store.query(
                    lambda session, robot=robot: _past(
                        session, robot, rule, series, channels, begin, now
                    )
                )
                judged += sum(len(one.values) for one in past.values())
                if judged > _POINTS_MAX:
                    raise JobError(f"That is more than {_POINTS_MAX} values; try fewer days.")
                progress.report(number / len(robots), f"judging {judged} values of {robot}")
                problem = Past(robot, rule, channels, past, modes, now)
                try:
                    fired += await self._foundation.study_workers.run(_TASK, problem)
                except WORKER_FAILURES as error:
                    raise JobError(str(error)) from error
            return {
                "rule": rule.key,
                "begin": begin.isoformat(),
                "end": now.isoformat(),
                "values": judged,
                "robots": robots,
                "fired": [one.document() for one in fired],
            }

        return (await self._foundation.jobs.start(KIND, work, by=by)).id


def _series(rule: AlarmRule, channels: Mapping[str, Channel]) -> dict[str, _Series]:
    """Return where the past of what a rule reads is kept."""
    found: dict[str, _Series] = {}
    for name in sorted(rule.names):
        value, channel = VALUES.get(name), channels.get(name)
        if value is not None and value.history is not None:
            found[name] = _Series(*value.history)
        elif value is None and (name in STATE.gauges or (channel and not channel.is_derived)):
            found[name] = _Series(name)
        else:
            msg = f"The past of {name!r} is not kept; see when its alarms were raised in the log."
            wrong = FieldError(loc=["rule", "reads"], msg=msg)
            raise unprocessable(msg, [wrong])
    return found


def _past(
    session: Session,
    robot: str,
    rule: AlarmRule,
    series: Mapping[str, _Series],
    channels: Mapping[str, Channel],
    begin: datetime,
    end: datetime,
) -> tuple[dict[str, PastValue], PastValue]:
    """Return what a robot told of each name, and what it did, as the live rules were told it."""
    of_state = sorted({one.channel for one in series.values()} & STATE.gauges.keys())
    states = StatePast([], [], {})
    if of_state or rule.modes:
        states = state_past(session, robot, of_state, begin, end)
    past: dict[str, PastValue] = {}
    for name, kept in series.items():
        if kept.channel in states.values:
            values = [value * kept.factor for value in states.values[kept.channel]]
            past[name] = PastValue(states.measured_at, values)
        else:
            past[name] = _possible(session, robot, channels[kept.channel], begin, end)
    modes = [float(mode) for mode in states.mode] if rule.modes else []
    return past, PastValue(states.measured_at if rule.modes else [], modes)


def _possible(
    session: Session, robot: str, channel: Channel, begin: datetime, end: datetime
) -> PastValue:
    """Return the values of a channel but those that cannot be true, which no alarm uses."""
    found = history(session, robot, channel.key, begin, end, _ALL_POINTS)
    told = [
        (at, value)
        for at, value in zip(found.measured_at, found.value, strict=True)
        if channel.fault(value) is None
    ]
    return PastValue([at for at, _ in told], [value for _, value in told])
