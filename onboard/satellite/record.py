"""What the robot says in one record by satellite: itself, its plan, its answers and its samples."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Protocol

from autonomy.channel import CHANNELS
from onboard.link.channel_announcer import TableInForce
from onboard.link.plan_desk import PlanOnBoard
from robot_link.channel_table import ChannelPage, TableVersion, pages, rows_of
from robot_link.clock import Clock
from robot_link.mavlink import current, target
from robot_link.mavlink.detection import detection_of
from robot_link.messages import RobotId, Sample, StateReport, SystemId
from robot_link.onboard_settings import DigestSettings
from robot_link.report import CurrentReport, Detection, Reading, TargetReport
from robot_link.sample_log import HeardTag, SampleKey, SampleLog
from robot_link.satellite.channel_code import ChannelPart
from robot_link.satellite.detection_code import detections_that_fit
from robot_link.satellite.digest import choose
from robot_link.satellite.record import (
    CommandAnswer,
    MobileOriginatedContent,
    Reason,
    ShortPlanReport,
    TransferAck,
    compose,
    read_mobile_originated,
    sample_room,
)
from robot_link.satellite.sample_code import packed_samples

PAGE_OCTETS = 100
"""Rows of a page: a record of 205 bytes has room for it beside state and plan."""
PLAN_DIGITS = 16
"""Digits of a plan's hash that a record carries."""


class PlanTeller(Protocol):
    """Who knows the plan on board."""

    def plan_report(self) -> PlanOnBoard:
        """Return what is to be said of the plan on board."""
        ...

    @property
    def channels(self) -> "ChannelTeller":
        """Who knows what the robot measures."""
        ...


class ChannelTeller(Protocol):
    """Who knows what the robot measures."""

    @property
    def in_force(self) -> TableInForce | None:
        """The table of its channels, None before it is known."""
        ...


class StateTeller(Protocol):
    """Who knows where the robot is, and what its mission asked to be told."""

    @property
    def variable(self) -> str:
        """The field that is mapped, whose samples go before those of other channels."""
        ...

    @property
    def digest_settings(self) -> DigestSettings | None:
        """What tells which samples change the map most, where a mission brought it."""
        ...

    def state_report(self) -> StateReport:
        """Return what the robot believes of itself."""
        ...

    def target_report(self) -> TargetReport | None:
        """Return how the robot holds its target; None while it follows none."""
        ...

    def current_report(self) -> CurrentReport:
        """Return what the robot believes of the current."""
        ...

    @property
    def newest_condition(self) -> tuple[Mapping[str, float], datetime] | None:
        """What the robot last read of itself, by channel, and when; None before the first."""
        ...


class RecordWriter:
    """Writes the records of one robot, and remembers what of its log went ashore in them.

    Args:
        robot: Its name.
        system: Its MAVLink system id.
        key: Its key.
        link: Who knows its plan.
        program: Who knows its state.
        samples: What it measured.
        clock: Its clock.
        health_s: Returns the least time between two records that tell its own condition; 0 lets
            records say nothing of that, nor of its channels.
    """

    def __init__(
        self,
        robot: RobotId,
        system: SystemId,
        key: bytes,
        link: PlanTeller,
        program: StateTeller,
        samples: SampleLog,
        clock: Clock,
        health_s: Callable[[], float],
    ) -> None:
        self._robot = robot
        self._system = system
        self._key = key
        self._link = link
        self._program = program
        self._samples = samples
        self._clock = clock
        self._health_s = health_s
        self._health_at: datetime | None = None
        """When the condition was told ashore last."""
        self._pages_ashore: set[tuple[int, SampleKey, int]] = set()
        """Pages of tables that were taken ashore: version, beginning and number."""
        self._ashore: set[SampleKey] = set()

    def record(
        self,
        counter: int,
        acks: tuple[TransferAck, ...],
        answers: tuple[CommandAnswer, ...],
        most_bytes: int,
        *,
        is_full: bool,
    ) -> bytes:
        """Return a record.

        Args:
            counter: Its counter, which no other record has.
            acks: Words on missions.
            answers: Words on orders.
            most_bytes: How long it may be.
            is_full: Whether it carries the state, the current, the target, and as many samples
                as fit, too.
        """
        followed = self._program.target_report() if is_full else None
        water = self._program.current_report() if is_full else None
        plan = self._link.plan_report()
        content = MobileOriginatedContent(
            counter=counter,
            state=self._program.state_report() if is_full else None,
            plan=ShortPlanReport(
                (plan.sha256 or "")[:PLAN_DIGITS],
                plan.state,
                plan.leg,
                plan.legs,
                plan.energy_used,
                Reason.of(plan.reason),
            ),
            acks=acks,
            answers=answers,
            target=None if followed is None or not target.can_travel(followed) else followed,
            current=None if water is None or not current.can_travel(water) else water,
        )
        if is_full:
            content = replace(content, channels=self._channels())
            room = sample_room(content, most_bytes)
            heard, samples = self._not_ashore()
            tags_room = room // 2 if samples else room
            content = replace(content, detections=detections_that_fit(heard, tags_room))
            room = sample_room(content, most_bytes)
            content = replace(content, samples=self._chosen(samples, room))
        return compose(content, self._key, self._system, most_bytes)

    def _channels(self) -> ChannelPart:
        """Return the version of the table, a page that is not ashore, and how the robot is."""
        health_s, told = self._health_s(), self._link.channels.in_force
        if not health_s:
            return ChannelPart()
        now = self._clock.now()
        version = None if told is None else TableVersion(self._robot, told.table.version, now, now)
        page = None if told is None else self._page(told)
        newest = self._program.newest_condition
        is_due = self._health_at is None or now - self._health_at >= timedelta(seconds=health_s)
        return ChannelPart(version, page, self._readings(*newest) if newest and is_due else ())

    def _page(self, told: TableInForce) -> ChannelPage | None:
        """Return the first page of a table that is not ashore."""
        try:
            cut = pages(told.table, PAGE_OCTETS, is_short=True)
        except ValueError:  # texts that no team needs; the radio tells them
            return None
        version, since, at = told.table.version, told.since, told.since_at
        for number, octets in enumerate(cut):
            if (version, since, number) not in self._pages_ashore:
                rows, place = rows_of(octets), (number, len(cut))
                return ChannelPage(
                    self._robot, version, *since, *place, rows, is_short=True,
                    measured_at=at, received_at=at,
                )  # fmt: skip
        return None

    def _readings(self, values: Mapping[str, float], at: datetime) -> tuple[Reading, ...]:
        """Return readings, those first that deserve an alarm, then switches."""

        def rank(key: str) -> tuple[bool, bool]:
            channel = CHANNELS[key]
            return channel.crossed(values[key]) is None, channel.kind != "switch"

        keys = sorted((key for key, value in values.items() if math.isfinite(value)), key=rank)
        return tuple(Reading(self._robot, key, values[key], at, at) for key in keys)

    def _chosen(self, samples: list[Sample], room: int) -> tuple[Sample, ...]:
        """Return what changes the planned map most; other channels share what room that leaves."""
        by_channel: dict[str, list[Sample]] = {self._program.variable: []}
        for sample in samples:
            by_channel.setdefault(sample.variable, []).append(sample)
        planned, *others = by_channel.values()
        chosen = choose(planned, self._program.digest_settings, room)
        for number, beside in enumerate(others):
            left = room - len(packed_samples(chosen))
            chosen += choose(beside, None, left // (len(others) - number))
        return chosen

    def taken_ashore(self, record: bytes) -> None:
        """Note which samples a record carried that was taken ashore: they need not go again."""
        content = read_mobile_originated(
            record, self._key, self._system, self._robot, self._clock.now()
        )
        if content.channels.readings:
            self._health_at = self._clock.now()
        if (page := content.channels.page) is not None:
            since = SampleKey(page.log, page.sequence)
            self._pages_ashore.add((page.version, since, page.page))
        told = (*content.samples, *content.detections)
        self._ashore |= {SampleKey(one.log, one.sequence) for one in told}
        self._ashore &= set(self._samples.kept())

    def _not_ashore(self) -> tuple[list[Detection], list[Sample]]:
        detections: list[Detection] = []
        samples: list[Sample] = []
        for key in self._samples.kept():
            entry = self._samples.get(key)
            if entry is None or key in self._ashore:
                continue
            if isinstance(entry, HeardTag):
                detections.append(detection_of(entry, self._robot, key.log, key.sequence))
                continue
            samples.append(
                Sample(
                    robot=self._robot,
                    log=key.log,
                    sequence=key.sequence,
                    variable=entry.variable,
                    value=entry.value,
                    position_ned=entry.position_ned,
                    position_std_m=entry.position_std_m,
                    measured_at=entry.measured_at,
                    received_at=entry.measured_at,
                )
            )
        return detections, samples
