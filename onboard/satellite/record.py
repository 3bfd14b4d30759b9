"""What the robot says in one record by satellite: itself, its plan, its answers and its samples."""

from dataclasses import replace
from typing import Protocol

from onboard.link.plan_desk import PlanOnBoard
from robot_link.clock import Clock
from robot_link.mavlink import current, target
from robot_link.messages import RobotId, Sample, StateReport, SystemId
from robot_link.onboard_settings import DigestSettings
from robot_link.report import CurrentReport, TargetReport
from robot_link.sample_log import SampleKey, SampleLog
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

PLAN_DIGITS = 16
"""Digits of a plan's hash that a record carries."""


class PlanTeller(Protocol):
    """Who knows the plan on board."""

    def plan_report(self) -> PlanOnBoard:
        """Return what is to be said of the plan on board."""
        ...


class StateTeller(Protocol):
    """Who knows where the robot is, and what its mission asked to be told."""

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


class RecordWriter:
    """Writes the records of one robot, and remembers which samples went ashore in them.

    Args:
        robot: Its name.
        system: Its MAVLink system id.
        key: Its key.
        link: Who knows its plan.
        program: Who knows its state.
        samples: What it measured.
        clock: Its clock.
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
    ) -> None:
        self._robot = robot
        self._system = system
        self._key = key
        self._link = link
        self._program = program
        self._samples = samples
        self._clock = clock
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
            room = sample_room(content, most_bytes)
            chosen = choose(self._not_ashore(), self._program.digest_settings, room)
            content = replace(content, samples=chosen)
        return compose(content, self._key, self._system, most_bytes)

    def taken_ashore(self, record: bytes) -> None:
        """Note which samples a record carried that was taken ashore: they need not go again."""
        content = read_mobile_originated(
            record, self._key, self._system, self._robot, self._clock.now()
        )
        self._ashore |= {SampleKey(one.log, one.sequence) for one in content.samples}
        self._ashore &= set(self._samples.kept())

    def _not_ashore(self) -> list[Sample]:
        samples: list[Sample] = []
        for key in self._samples.kept():
            measured = self._samples.get(key)
            if measured is not None and key not in self._ashore:
                samples.append(
                    Sample(
                        robot=self._robot,
                        log=key.log,
                        sequence=key.sequence,
                        variable=measured.variable,
                        value=measured.value,
                        position_ned=measured.position_ned,
                        position_std_m=measured.position_std_m,
                        measured_at=measured.measured_at,
                        received_at=measured.measured_at,
                    )
                )
        return samples
