"""The way in: everything that a link decoded, into the database first and then to who waits.

Samples are lossless: a robot is told to forget one only after it was committed or, while the
database fails, is in the bridge journal; one that comes twice is stored once. What waits for the
database is told of when it has come from there. Gauges and alarms are latest-wins and wait for
neither.
"""

import asyncio
import logging
import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from datetime import datetime
from functools import partial
from typing import NamedTuple, Protocol, TypeVar

from autonomy.channel import Channel, key_at_station
from autonomy.site import Site
from db.fault import StoreError
from db.ingest import Telemetry
from db.query.station.events import add_event
from db.store import Store
from db.writer import Kept
from robot_link.channel_table import ChannelPage, TableVersion, version_text
from robot_link.clock import Clock
from robot_link.messages import (
    CommandReport,
    LinkReport,
    PlanQueue,
    PlanReport,
    RawFrame,
    RobotId,
    Sample,
    StateReport,
    UploadReport,
)
from robot_link.report import (
    ActuatorReport,
    ControlAsked,
    ControlReport,
    CurrentReport,
    Detection,
    LinkEvent,
    Reading,
    ReceiverReport,
    RobotReport,
    TargetReport,
    VehicleReport,
    VehicleWord,
)
from robot_link.sample_log import SampleKey
from server.base.channels import Channels
from server.base.event_bus import EventBus
from server.fleet.clock_fault import AHEAD_MAX, ClockJudge, Told
from server.fleet.fleet import Fleet
from server.fleet.plausibility import (
    fault_of_actuators,
    fault_of_current,
    fault_of_detection,
    fault_of_gappy_state,
    fault_of_reading,
    fault_of_receiver,
    fault_of_sample,
    fault_of_state,
    fault_of_target,
)
from server.fleet.words import level_of, mode_text
from server.link.channel_tables import ChannelTables
from server.link.event import (
    CommandReported,
    ControlReported,
    ControlRequested,
    DetectionsStored,
    PlanQueueReported,
    PlanReported,
    ReadingsStored,
    ReceiverReported,
    SamplesStored,
    StateReported,
    TargetReported,
    TelemetryBridged,
    UploadReported,
    ValuesStored,
)

log = logging.getLogger(__name__)

Value = TypeVar("Value")
Judged = TypeVar("Judged", bound=RobotReport | ChannelPage, contravariant=True)


class FaultOf(Protocol[Judged]):
    """Says why a report cannot be true, ``None`` if it can."""

    def __call__(self, report: Judged, /, *, now: datetime, speed: float) -> str | None:
        """Judge a report by the station's clock."""
        ...


CLOCK_OFF_MAX_S = 60.0
"""A tag receiver whose clock is farther off is not dated by it (``onboard.tag_listener``)."""
GATHER_S = 0.05
"""Telemetry is handed to the database in pieces of this length; each costs a transaction."""


class _Told(NamedTuple):
    """What is told once it is kept."""

    samples: SamplesStored
    heard: DetectionsStored
    readings: list[Reading]
    robots: set[RobotId]


class Ingest:
    """Takes link events in the order in which they happened. Belongs to one event loop."""

    def __init__(
        self,
        store: Store,
        fleet: Fleet,
        clock: Clock,
        bus: EventBus,
        channels: Channels,
        tables: ChannelTables,
    ) -> None:
        self._store = store
        self._fleet = fleet
        self._clock = clock
        self._bus = bus
        self._channels = channels
        self._tables = tables
        self._rows: list[Telemetry] = []
        self._samples: list[Sample] = []
        self._refused: list[Sample] = []
        self._heard: list[Detection] = []
        self._heard_refused: list[Detection] = []
        self._readings: list[Reading] = []
        self._flush: asyncio.TimerHandle | None = None
        self._stored: Future[Kept] | None = None
        """What was handed to the database last."""
        self._clocks: dict[RobotId, ClockJudge] = {}
        self._plans_told: dict[RobotId, datetime] = {}
        """When each robot said its newest word on its plan by radio."""
        self._told_faults: set[tuple[str, str]] = set()
        self._receivers_off: set[RobotId] = set()
        """Robots whose tag receiver's clock is wrong, as was told."""
        self._notes: set[asyncio.Task[None]] = set()
        store.add_bridged_listener(self._on_loop(self._come_from_the_bridge))

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
            case Detection():
                self._take_detection(event)
            case ReceiverReport():
                self._take_receiver(event)
            case Reading():
                self._take_reading(event)
            case ChannelPage():
                self._take_page(event)
            case TableVersion():
                self._take_version(event)
            case PlanReport():
                self._take_plan_report(event, is_prompt=is_prompt)
            case PlanQueue():
                self._take_plan_queue(event)
            case LinkReport():
                self._fleet.take_link(event)
            case TargetReport():
                self._take_target(event)
            case CurrentReport():
                self._take_current(event)
            case ActuatorReport():
                self._take_actuators(event)
            case VehicleReport():
                self._take_vehicle(event)
            case VehicleWord():
                self._take_word(event)
            case UploadReport():
                self._bus.publish(UploadReported(event))
            case CommandReport():
                self._bus.publish(CommandReported(event))
            case ControlReport():
                self._bus.publish(ControlReported(event))
            case ControlAsked():
                self._bus.publish(ControlRequested(event))

    async def store(self, events: Sequence[LinkEvent]) -> None:
        """Take what may have been long on its way; return once everything is kept.

        Raises:
            StoreError: If it was not; whoever brings the events must bring them again.
        """
        for event in events:
            self.take(event, is_prompt=False)
        stored = self.flush()
        if stored is not None:
            await asyncio.wrap_future(stored)

    async def settle(self) -> None:
        """Return once everything that was taken before is kept, or is known not to be."""
        self.flush()
        if self._stored is not None:
            await asyncio.gather(asyncio.wrap_future(self._stored), return_exceptions=True)

    def flush(self) -> "Future[Kept] | None":
        """Hand everything that waits to the database now; ``None`` if nothing waits."""
        if self._flush is not None:
            self._flush.cancel()
            self._flush = None
        if not self._rows:
            return None
        rows = self._rows
        told = _Told(
            SamplesStored(self._samples, self._refused),
            DetectionsStored(self._heard, self._heard_refused),
            self._readings,
            _robots(rows),
        )
        self._rows, self._samples, self._refused, self._readings = [], [], [], []
        self._heard, self._heard_refused = [], []
        stored = self._store.append(rows)
        stored.add_done_callback(self._on_loop(partial(self._kept, told)))
        self._stored = stored
        return stored

    @staticmethod
    def _on_loop(take: Callable[[Value], None]) -> Callable[[Value], None]:
        """Return what has a value taken on this event loop, from whatever thread it comes."""
        loop = asyncio.get_running_loop()

        def tell(value: Value) -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(take, value)

        return tell

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
        self._bus.publish(PlanReported(report, is_prompt))

    def _take_plan_queue(self, queue: PlanQueue) -> None:
        """Take a word on the waiting plan; whoever brings it leaves out what is overtaken."""
        queue = self._clock_of(queue.robot).dated(queue)
        self._append(queue)
        self._fleet.take_plan_queue(queue)
        self._bus.publish(PlanQueueReported(queue))

    def _take_state(self, report: StateReport, *, is_prompt: bool) -> None:
        if self._fleet.status(report.robot).record.is_foreign:
            self._take_foreign_state(report)
            return
        judge = self._clock_of(report.robot)
        judge.hear(report, is_prompt=is_prompt)
        self._fleet.set_clock_fault(report.robot, judge.fault)
        told = self._believed(report, "state", partial(fault_of_state, site=self._site(report)))
        if told is not None:
            self._append(told)
            self._fleet.take_state(told)
            self._bus.publish(StateReported(told, is_prompt))

    def _take_foreign_state(self, report: StateReport) -> None:
        """Take the state of a vehicle of another maker, dated by its arrival, maybe with gaps."""
        fault = fault_of_gappy_state(report, self._site(report))
        if fault is not None:
            self._refuse(report.robot, "state", fault)
            return
        self._told_faults.discard((report.robot, "state"))
        self._append(report)
        if all(map(math.isfinite, report.position_ned)):
            self._fleet.take_state(report)

    def _take_vehicle(self, report: VehicleReport) -> None:
        before = self._fleet.status(report.robot).vehicle_report
        self._fleet.take_vehicle(report)
        was = None if before is None else (before.mode, before.is_armed)
        if report.mode and was != (report.mode, report.is_armed):
            text = f"{report.robot} is {mode_text(report)}."
            self._say(report.robot, "vehicle.mode", text, "info")

    def _take_word(self, word: VehicleWord) -> None:
        level = level_of(word.severity)
        self._say(word.robot, "vehicle.said", f"{word.robot} says: {word.text}", level)
        if level != "info":
            self._fleet.take_word(word)

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
        catalogue = self._channels.catalogue
        key = key_at_station(sample.variable, catalogue)
        told = self._believed(sample, "sample", partial(fault_of_sample, site=self._site(sample)))
        if told is None or key is None:
            if key is None:
                self._refuse_channel(sample.robot, sample.variable)
            # Its bytes are in the journal; without an answer the robot would send it for ever.
            self._refused.append(sample)
            return
        name = SampleKey(sample.log, sample.sequence)
        if fault := self._tables.fault_of_sample(sample.robot, catalogue[key], name):
            self._refuse_unit(sample.robot, key, fault)
            self._refused.append(sample)
            return
        told = replace(told, variable=key)
        self._append(told)
        if self._is_possible(told.robot, catalogue[key], told.value):
            self._samples.append(told)
            self._fleet.take_sample(told)
        else:
            self._refused.append(told)

    def _take_reading(self, reading: Reading) -> None:
        catalogue = self._channels.catalogue
        key = key_at_station(reading.channel, catalogue)
        told = self._believed(reading, "reading", fault_of_reading)
        if key is None:
            self._refuse_channel(reading.robot, reading.channel)
        if told is None or key is None:
            return
        if fault := self._tables.fault_of_reading(told.robot, catalogue[key], told.measured_at):
            self._refuse_unit(told.robot, key, fault)
            return
        told = replace(told, channel=key)
        self._append(told)
        if self._is_possible(told.robot, catalogue[key], told.value):
            self._readings.append(told)
            self._fleet.take_reading(told)

    def _refuse_channel(self, robot: RobotId, key: str) -> None:
        """Say once of each channel that nobody here knows what its values mean."""
        text = (
            f"{robot} sent values of channel {key}, which the catalogue does not have: add it in"
            " Settings, Channels. They are in the journal but are not used."
        )
        self._tell_once(robot, f"channel {key}", "channel.refused", text)

    def _refuse_unit(self, robot: RobotId, key: str, fault: str) -> None:
        """Keep a value that means something else than the catalogue says out of everything."""
        self._fleet.count_refused(robot)
        text = f"{robot}: {fault}; its values are in the journal but are not used."
        self._tell_once(robot, f"meaning of {key}", "sample.refused", text)

    def _take_page(self, page: ChannelPage) -> None:
        try:
            self._tables.take(self._clock_of(page.robot).dated(page))
        except ValueError as error:
            text = f"{page.robot} announced channels, but {error}; it is not used."
            self._tell_once(page.robot, "table", "channels.refused", text)
        else:
            self._told_faults.discard((page.robot, "table"))

    def _take_version(self, said: TableVersion) -> None:
        """Say so where a robot measures by a table that did not come."""
        if self._tables.knows(said.robot, said.version):
            self._told_faults.discard((said.robot, "version"))
            return
        text = (
            f"{said.robot} measures by a table of channels that has not come, version"
            f" {version_text(said.version)}; its values are judged by the one before."
        )
        self._tell_once(said.robot, "version", "channels.missing", text)

    def _is_possible(self, robot: RobotId, channel: Channel, value: float) -> bool:
        """Tell whether a value can be true; one that cannot is kept as told, used for nothing."""
        fault = channel.fault(value)
        if fault is None:
            self._told_faults.discard((robot, channel.key))
            return True
        self._fleet.count_impossible(robot, channel.key)
        text = f"{robot} told: {fault}; kept, not used in maps and alarms."
        self._tell_once(robot, channel.key, "sample.refused", text)
        return False

    def _take_detection(self, detection: Detection) -> None:
        fault_of = partial(fault_of_detection, site=self._site(detection))
        told = self._believed(detection, "detection", fault_of)
        if told is None:
            self._heard_refused.append(detection)
            return
        self._append(told)
        self._heard.append(told)

    def _take_receiver(self, report: ReceiverReport) -> None:
        told = self._believed(report, "receiver", fault_of_receiver)
        if told is None:
            return
        self._append(told)
        self._bus.publish(ReceiverReported(told))
        is_off = told.clock_offset_s is not None and abs(told.clock_offset_s) > CLOCK_OFF_MAX_S
        if is_off and told.robot not in self._receivers_off:
            text = (
                f"The clock of the tag receiver of {told.robot} is off by "
                f"{told.clock_offset_s:+.0f} s; detections are dated by the robot's."
            )
            self._say(told.robot, "receiver.clock", text)
        (self._receivers_off.add if is_off else self._receivers_off.discard)(told.robot)

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

    def _kept(self, told: _Told, future: "Future[Kept]") -> None:
        error = future.exception()
        if error is not None:
            log.error("telemetry was not stored: %s", error)
        elif future.result() is Kept.BRIDGE:
            self._bus.publish(TelemetryBridged(told.samples, told.heard))
        else:
            self._tell(told)

    def _come_from_the_bridge(self, rows: Sequence[Telemetry]) -> None:
        """Tell of rows that waited in the bridge journal and are in the database now."""
        catalogue = self._channels.catalogue
        samples: tuple[list[Sample], list[Sample]] = [], []
        readings: list[Reading] = []
        for row in rows:
            match row:
                case Sample(variable=key) if key in catalogue:
                    samples[catalogue[key].fault(row.value) is not None].append(row)
                case Reading(channel=key) if key in catalogue:
                    if catalogue[key].fault(row.value) is None:
                        readings.append(row)
                case _:
                    pass
        heard = [row for row in rows if isinstance(row, Detection)]
        stored = SamplesStored(*samples), DetectionsStored(heard, [])
        self._tell(_Told(*stored, readings, _robots(rows)))

    def _tell(self, told: _Told) -> None:
        samples, heard = told.samples, told.heard
        if samples.samples or samples.refused:
            self._bus.publish(samples)
        if told.readings:
            self._bus.publish(ReadingsStored(told.readings))
        if heard.detections or heard.refused:
            self._bus.publish(heard)
        for robot in told.robots:
            self._bus.publish(ValuesStored(robot))

    def _refuse(self, robot: RobotId, what: str, fault: str) -> None:
        """Count a value that cannot be true, and say so once until a good one came."""
        self._fleet.count_refused(robot)
        text = f"{robot} sent {fault}; the {what} is in the journal but is not used."
        self._tell_once(robot, what, f"{what}.refused", text)

    def _tell_once(self, robot: RobotId, what: str, kind: str, text: str) -> None:
        """Write a sentence about a robot's value, once until a good one came."""
        if (robot, what) not in self._told_faults:
            self._told_faults.add((robot, what))
            self._say(robot, kind, text)

    def _say(self, robot: RobotId, kind: str, text: str, level: str = "watch") -> None:
        """Write a sentence into the event log soon."""
        task = asyncio.create_task(
            self._note(robot, kind, text, level), name=f"note {kind} of {robot}"
        )
        self._notes.add(task)
        task.add_done_callback(self._notes.discard)

    async def _note(self, robot: RobotId, kind: str, text: str, level: str) -> None:
        at = self._clock.now()
        try:
            await self._store.write(
                lambda session: add_event(session, at, kind, text, level=level, robot=robot)
            )
        except StoreError:
            log.warning("%s", text)


def _robots(rows: Sequence[Telemetry]) -> set[RobotId]:
    """Return the robots whose values are among rows."""
    return {row.robot for row in rows if isinstance(row, StateReport | Sample | Reading)}
