"""The way in: everything that a link decoded, into the database first and then to who waits.

Samples are lossless: a robot is told to forget one only after it was committed, and one that comes
twice is stored once. Gauges are latest-wins and do not wait for the database.
"""

import asyncio
import logging
from collections.abc import Sequence
from concurrent.futures import Future
from datetime import datetime
from functools import partial
from typing import Protocol, TypeVar

from autonomy.site import Site
from db.fault import StoreError
from db.ingest import Telemetry
from db.query.events import add_event
from db.store import Store
from robot_link.clock import Clock
from robot_link.messages import (
    CommandReport,
    LinkReport,
    PlanReport,
    RawFrame,
    RobotId,
    Sample,
    StateReport,
    UploadReport,
)
from robot_link.report import ActuatorReport, CurrentReport, LinkEvent, RobotReport, TargetReport
from server.base.event_bus import EventBus
from server.fleet.clock_fault import AHEAD_MAX, ClockJudge, Told
from server.fleet.fleet import Fleet
from server.fleet.plausibility import (
    fault_of_actuators,
    fault_of_current,
    fault_of_sample,
    fault_of_state,
    fault_of_target,
)
from server.link.event import (
    CommandReported,
    PlanReported,
    SamplesStored,
    TargetReported,
    UploadReported,
    ValuesStored,
)

log = logging.getLogger(__name__)

Judged = TypeVar("Judged", bound=RobotReport, contravariant=True)


class FaultOf(Protocol[Judged]):
    """Says why a report cannot be true, ``None`` if it can."""

    def __call__(self, report: Judged, /, *, now: datetime, speed: float) -> str | None:
        """Judge a report by the station's clock."""
        ...


GATHER_S = 0.05
"""Telemetry is handed to the database in pieces of this length."""


class Ingest:
    """Takes link events in the order in which they happened. Belongs to one event loop."""

    def __init__(self, store: Store, fleet: Fleet, clock: Clock, bus: EventBus) -> None:
        self._store = store
        self._fleet = fleet
        self._clock = clock
        self._bus = bus
        self._rows: list[Telemetry] = []
        self._samples: list[Sample] = []
        self._refused: list[Sample] = []
        self._flush: asyncio.TimerHandle | None = None
        self._stored: Future[None] | None = None
        """What was handed to the database last."""
        self._clocks: dict[RobotId, ClockJudge] = {}
        self._plans_told: dict[RobotId, datetime] = {}
        """When each robot said its newest word on its plan by radio."""
        self._told_faults: set[tuple[str, str]] = set()
        self._notes: set[asyncio.Task[None]] = set()

    def take(self, event: LinkEvent, *, is_prompt: bool = True) -> None:
        """Take one event of a link.

        Args:
            event: The event.
            is_prompt: Whether it came as soon as the robot said it; not so by satellite.
        """
        if not isinstance(event, RawFrame) and not self._fleet.knows(event.robot):
            return
        match event:
            case RawFrame():
                self._append(event)
            case StateReport():
                self._take_state(event, is_prompt=is_prompt)
            case Sample():
                self._take_sample(event)
            case PlanReport():
                self._take_plan_report(event, is_prompt=is_prompt)
            case LinkReport():
                self._fleet.take_link(event)
            case TargetReport():
                self._take_target(event)
            case CurrentReport():
                self._take_current(event)
            case ActuatorReport():
                self._take_actuators(event)
            case UploadReport():
                self._bus.publish(UploadReported(event))
            case CommandReport():
                self._bus.publish(CommandReported(event))

    async def store(self, events: Sequence[LinkEvent]) -> None:
        """Take what may have been long on its way; return once everything is committed.

        Raises:
            StoreError: If it was not; whoever brings the events must bring them again.
        """
        for event in events:
            self.take(event, is_prompt=False)
        stored = self.flush()
        if stored is not None:
            await asyncio.wrap_future(stored)

    async def settle(self) -> None:
        """Return once everything that was taken before is committed, or is known not to be."""
        self.flush()
        if self._stored is not None:
            await asyncio.gather(asyncio.wrap_future(self._stored), return_exceptions=True)

    def flush(self) -> "Future[None] | None":
        """Hand everything that waits to the database now; ``None`` if nothing waits."""
        if self._flush is not None:
            self._flush.cancel()
            self._flush = None
        if not self._rows:
            return None
        rows, samples, refused = self._rows, self._samples, self._refused
        robots = {row.robot for row in rows if isinstance(row, StateReport | Sample)}
        self._rows, self._samples, self._refused = [], [], []
        loop = asyncio.get_running_loop()

        def committed(future: "Future[None]") -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(self._committed, future, samples, refused, robots)

        stored = self._store.append(rows)
        stored.add_done_callback(committed)
        self._stored = stored
        return stored

    def _clock_of(self, robot: RobotId) -> ClockJudge:
        return self._clocks.setdefault(robot, ClockJudge(self._clock.speed))

    def _append(self, row: Telemetry) -> None:
        self._rows.append(row)
        if self._flush is None:
            self._flush = asyncio.get_running_loop().call_later(GATHER_S, self.flush)

    def _take_plan_report(self, report: PlanReport, *, is_prompt: bool) -> None:
        """Take a word on the plan; one by radio from before the newest by radio changes nothing."""
        report = self._clock_of(report.robot).dated(report)
        self._append(report)
        if is_prompt:
            newest = self._plans_told.get(report.robot, report.measured_at)
            if newest - report.measured_at > AHEAD_MAX * max(1.0, self._clock.speed):
                return
            self._plans_told[report.robot] = max(newest, report.measured_at)
        self._fleet.take_plan_report(report)
        self._bus.publish(PlanReported(report))

    def _take_state(self, report: StateReport, *, is_prompt: bool) -> None:
        judge = self._clock_of(report.robot)
        judge.hear(report, is_prompt=is_prompt)
        self._fleet.set_clock_fault(report.robot, judge.fault)
        told = self._believed(report, "state", partial(fault_of_state, site=self._site(report)))
        if told is not None:
            self._append(told)
            self._fleet.take_state(told)

    def _take_target(self, report: TargetReport) -> None:
        told = self._believed(report, "track", partial(fault_of_target, site=self._site(report)))
        if told is not None:
            self._append(told)
            self._fleet.take_target(told)
            self._bus.publish(TargetReported(told))

    def _take_actuators(self, report: ActuatorReport) -> None:
        told = self._believed(report, "actuators", fault_of_actuators)
        if told is not None:
            self._append(told)
            self._fleet.take_actuators(told)

    def _take_current(self, report: CurrentReport) -> None:
        told = self._believed(report, "current", fault_of_current)
        if told is None:
            return
        before = self._fleet.status(told.robot).current_report
        self._append(told)
        self._fleet.take_current(told)
        if before is not None and told.fixes_refused > before.fixes_refused:
            text = f"{told.robot} did not believe a fix: it lay farther off than it could believe."
            self._say(told.robot, "fix.refused", text)

    def _take_sample(self, sample: Sample) -> None:
        told = self._believed(sample, "sample", partial(fault_of_sample, site=self._site(sample)))
        if told is None:
            # Its bytes are in the journal; without an answer the robot would send it for ever.
            self._refused.append(sample)
            return
        self._append(told)
        self._samples.append(told)

    def _site(self, report: RobotReport) -> Site:
        return self._fleet.status(report.robot).record.site

    def _believed(self, report: Told, what: str, fault_of: "FaultOf[Told]") -> Told | None:
        """Return a report dated by the station's clock, ``None`` for one that cannot be true."""
        report = self._clock_of(report.robot).dated(report)
        fault = fault_of(report, now=self._clock.now(), speed=self._clock.speed)
        if fault is not None:
            self._refuse(report.robot, what, fault)
            return None
        self._told_faults.discard((report.robot, what))
        return report

    def _committed(
        self,
        future: "Future[None]",
        samples: list[Sample],
        refused: list[Sample],
        robots: set[RobotId],
    ) -> None:
        error = future.exception()
        if error is not None:
            log.error("telemetry was not stored: %s", error)
            return
        for sample in samples:
            self._fleet.take_sample(sample)
        if samples or refused:
            self._bus.publish(SamplesStored(samples, refused))
        for robot in robots:
            self._bus.publish(ValuesStored(robot))

    def _refuse(self, robot: RobotId, what: str, fault: str) -> None:
        """Count a value that cannot be true, and say so once until a good one came."""
        self._fleet.count_refused(robot)
        if (robot, what) in self._told_faults:
            return
        self._told_faults.add((robot, what))
        text = f"{robot} sent {fault}; the {what} is in the journal but is not used."
        self._say(robot, f"{what}.refused", text)

    def _say(self, robot: RobotId, kind: str, text: str) -> None:
        """Write a sentence into the event log soon."""
        task = asyncio.create_task(self._note(robot, kind, text), name=f"note {kind} of {robot}")
        self._notes.add(task)
        task.add_done_callback(self._notes.discard)

    async def _note(self, robot: RobotId, kind: str, text: str) -> None:
        at = self._clock.now()
        try:
            await self._store.write(
                lambda session: add_event(session, at, kind, text, level="watch", robot=robot)
            )
        except StoreError:
            log.warning("%s", text)
