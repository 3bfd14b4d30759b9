"""Alarms about what robots measure, by the limits of the catalogue of channels."""

from collections.abc import Mapping

from autonomy.channel import AlarmLimit, Channel
from robot_link.messages import RobotId
from server.alarm.rules import Verdict
from server.base.alarm_board import AlarmBoard
from server.base.channels import Channels
from server.fleet.status import RobotStatus

CAUSE = "channel"
"""Begins the cause of such an alarm; the channel's key follows."""


class ChannelAlarms:
    """Judges the newest value of every channel that a robot tells. Belongs to one event loop.

    An alarm has the value with which its limit was crossed, and stands until a value is normal:
    silence proves nothing.
    """

    def __init__(self, channels: Channels, alarms: AlarmBoard) -> None:
        self._channels = channels
        self._alarms = alarms
        self._told: dict[tuple[RobotId, str], Verdict] = {}

    async def judge(self, status: RobotStatus) -> None:
        """Raise and clear the alarms of one robot."""
        robot, known = status.record.id, self._channels.catalogue
        newest = {**status.derived, **status.samples, **status.readings}
        values = {key: sample.value for key, sample in newest.items()}
        if status.vehicle_report is not None:
            values |= {key: told.value for key, told in status.vehicle_report.values.items()}
        found = crossings(robot, values, known)
        for key, verdict in found.items():
            told = self._told.get((robot, key))
            if told is None or told.level != verdict.level:
                self._told[robot, key] = told = verdict
            await self._alarms.raise_(_cause(key), told.text, level=told.level, robot=robot)
        for alarm in self._alarms.open:
            kind, _, key = alarm.cause.partition(" ")
            if kind != CAUSE or alarm.robot != robot or key in found:
                continue
            self._told.pop((robot, key), None)
            if alarm.cleared_at is None and (key in values or key not in known):
                await self._alarms.clear(alarm.cause, robot=robot)


def crossings(
    robot: str, values: Mapping[str, float], channels: Mapping[str, Channel]
) -> dict[str, Verdict]:
    """Return what deserves an alarm among the values of a robot, by channel."""
    verdicts: dict[str, Verdict] = {}
    for key, value in values.items():
        channel = channels.get(key)
        limit = None if channel is None else channel.crossed(value)
        if channel is not None and limit is not None:
            verdicts[key] = Verdict(limit.level, _sentence(robot, channel, value, limit))
    return verdicts


def _sentence(robot: str, channel: Channel, value: float, limit: AlarmLimit) -> str:
    told = channel.words(value)
    if channel.kind == "switch":
        return f"{robot}: {channel.title} says {told}."
    side = "above" if limit.high is not None and value > limit.high else "below"
    words = channel.words(_end(limit, value))
    return f"{robot}: {channel.title} is {told}, {side} its limit of {words}."


def _end(limit: AlarmLimit, value: float) -> float:
    """Return the end of a limit that a value has crossed."""
    if limit.high is not None and value > limit.high:
        return limit.high
    return value if limit.low is None else limit.low


def _cause(key: str) -> str:
    return f"{CAUSE} {key}"
