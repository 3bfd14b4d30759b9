"""Tags that the receiver on board hears: placed, dated, and given to the link to bring ashore."""

import asyncio
from collections import Counter
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any, Protocol

from onboard.flight.navigation import Estimate
from onboard.log import OnboardLog
from onboard.node.client import NodeClient
from onboard.node.tag_receiver import HEARD, REFUSED, STATUS
from robot_link.clock import Clock
from robot_link.messages import RobotId
from robot_link.report import ReceiverReport
from robot_link.sample_log import HeardTag
from robot_link.tag.receiver_line import LineFault

CLOCK_OFF_MAX = timedelta(seconds=60)
"""A receiver's clock that is farther off is not used."""
_REPORT_S = 60.0
"""Wall time between two reports of a receiver that hears nothing."""
_WAITING = 200
"""Lines that wait for their reader."""


class Place(Protocol):
    """Who knows where the robot is."""

    @property
    def estimate(self) -> Estimate:
        """What the robot believes of itself."""
        ...


class TagLink(Protocol):
    """What the listener says to the station; ``onboard.link.robot_link.RobotLink`` is one."""

    def record_detection(self, heard: HeardTag) -> int:
        """Keep a heard tag until it is stored ashore; return its number."""
        ...

    def report_receiver(self, report: ReceiverReport) -> None:
        """Say how the receiver fares."""
        ...


class TagListener:
    """Takes what the receiver's node publishes.

    The receiver tells the time of a transmission by its own clock, to the second. Where that is off
    by more than ``CLOCK_OFF_MAX`` against the robot's, the robot's time is used, and it says so.
    Lines that are not believed are counted, and kept as they came in the robot's own log.

    Args:
        robot: Its name.
        program: Where it is.
        node: The receiver's node, which somebody else runs.
        link: What brings detections ashore.
        clock: The robot's clock.
        log: The robot's own log.
    """

    def __init__(
        self,
        robot: RobotId,
        program: Place,
        node: NodeClient,
        link: TagLink,
        clock: Clock,
        log: OnboardLog,
    ) -> None:
        self._robot = robot
        self._program = program
        self._link = link
        self._clock = clock
        self._log = log
        self._topics = {
            topic: node.subscribe(topic, _WAITING) for topic in (HEARD, STATUS, REFUSED)
        }
        self._receiver = 0
        self._heard = 0
        self._refused: Counter[str] = Counter()
        self._offset: timedelta | None = None

    async def run(self) -> None:
        """Listen until cancelled."""
        async with asyncio.TaskGroup() as group:
            takers = {HEARD: self._take_heard, STATUS: self._take_time, REFUSED: self._refuse}
            for topic, take in takers.items():
                group.create_task(self._take(topic, take), name=f"{topic} of the tag receiver")
            group.create_task(self._report_often(), name="tag receiver reports")

    async def _take(self, topic: str, take: Callable[[dict[str, Any]], object]) -> None:
        async for said in self._topics[topic]:
            take(said)

    async def _report_often(self) -> None:
        while True:
            await asyncio.sleep(_REPORT_S)
            self._report()

    def _take_time(self, said: dict[str, Any]) -> datetime:
        """Hold the receiver's clock against the robot's; return when a line was said."""
        now = self._clock.now()
        at = datetime.fromisoformat(said["at"])
        was_off = self._is_off
        self._receiver, self._offset = int(said["receiver"]), at - now
        if self._is_off != was_off:
            off_s = self._offset.total_seconds()
            told = f"{off_s:+.0f} s off: the robot's is used" if self._is_off else "right again"
            self._log.note(f"clock of tag receiver {self._receiver} is {told}")
            self._report()
        return now.replace(microsecond=0) if self._is_off else at

    @property
    def _is_off(self) -> bool:
        limit = CLOCK_OFF_MAX * max(1.0, self._clock.speed)
        return self._offset is not None and abs(self._offset) > limit

    def _take_heard(self, said: dict[str, Any]) -> None:
        at = self._take_time(said)
        estimate = self._program.estimate
        sensor = said["sensor"]
        heard = HeardTag(
            receiver=self._receiver,
            tag=str(said["tag"]),
            sensor=None if sensor is None else int(sensor),
            position_ned=estimate.position_ned,
            position_std_m=estimate.position_std_m,
            measured_at=at,
        )
        try:
            self._link.record_detection(heard)
        except ValueError as error:
            self._refused[LineFault.CODE.name.lower()] += 1
            self._log.note(f"tag receiver: {heard.tag} not kept: {error}")
            return
        self._heard += 1
        self._report()

    def _refuse(self, said: dict[str, Any]) -> None:
        fault = str(said["fault"])
        self._refused[fault] += 1
        line = bytes.fromhex(said["line"]).decode("ascii", errors="backslashreplace").rstrip()
        self._log.note(f"tag receiver: {LineFault[fault.upper()].value}: {line}")
        self._report()

    def _report(self) -> None:
        now = self._clock.now()
        self._link.report_receiver(
            ReceiverReport(
                robot=self._robot,
                measured_at=now,
                received_at=now,
                receiver=self._receiver,
                heard=self._heard,
                refused_sum=self._refused["sum"],
                refused_date=self._refused["date"],
                refused_code=self._refused["code"],
                clock_offset_s=None if self._offset is None else self._offset.total_seconds(),
            )
        )
