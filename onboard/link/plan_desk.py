"""The robot's handling of plans: offers, transfers, and what it says of the plan on board."""

import asyncio
import logging
from collections.abc import Callable
from typing import NamedTuple

from onboard.link.mission_receiver import Complete, MissionReceiver, Refused, Request, Step
from onboard.link.plan_store import PlanStore
from robot_link.clock import Clock
from robot_link.mavlink import telemetry
from robot_link.mavlink.codec import STATION_COMPONENT, STATION_SYSTEM, WireMessage
from robot_link.mavlink.command import PLAN_DIGITS
from robot_link.mavlink.wire import grace
from robot_link.messages import CommandKind, OnboardPlanState, PlanHash
from robot_link.mission import Mission
from robot_link.robot_program import CommandOutcome, RobotProgram
from robot_link.timing import LinkTiming

_WAITING_OR_FLYING = (OnboardPlanState.ON_BOARD, OnboardPlanState.RUNNING)
_NOT_KEPT = "the robot's memory does not take the plan; the one before stays on board"
_START_REFUSALS = {
    CommandOutcome.NOT_NOW: "the plan is on board, but the robot cannot start it now",
    CommandOutcome.WRONG_PLAN: "the robot holds another plan than the one to start",
    CommandOutcome.UNSUPPORTED: "the robot does not know how to start a plan",
}


_log = logging.getLogger(__name__)


class PlanOnBoard(NamedTuple):
    """What the robot says of the plan that it holds."""

    sha256: PlanHash | None
    state: OnboardPlanState
    leg: int
    """Leg being flown, from 0."""
    legs: int
    energy_used: float
    reason: str
    """One sentence where the state is FAILED, else empty."""


class PlanDesk:
    """Decides on offers and replaces the plan on board, whole or not at all.

    An offer of the plan that is on board and waits or flies is answered with its state; of one
    that was flown, it makes the plan wait again. ``reply`` is called with each answer.
    """

    def __init__(
        self,
        plans: PlanStore,
        program: RobotProgram,
        clock: Clock,
        timing: LinkTiming,
        reply: Callable[[WireMessage], None],
    ) -> None:
        self._plans = plans
        self._program = program
        self._clock = clock
        self._reply = reply
        self._receiver = MissionReceiver(timing.answer_s, timing.upload_s)
        self.changed = asyncio.Event()
        """Set when there is something new to say; cleared by who says it."""
        self.said = self._waiting()
        """What is to be said of the plan on board."""

    @property
    def plan_hash(self) -> PlanHash | None:
        """Hash of the plan on board."""
        return telemetry.plan_hash(self.said.sha256)

    def report(self, state: OnboardPlanState, *, leg: int, energy_used: float, reason: str) -> None:
        """Set what is to be said of the plan on board."""
        self.said = telemetry.plan_report_message(
            measured_at=self._clock.now(),
            sha256=self.plan_hash,
            state=state,
            leg=leg,
            legs=self.said.legs,
            energy_used=energy_used,
            reason=reason,
        )
        self.changed.set()

    def mission(self) -> Mission | None:
        """Return the plan on board."""
        return self._plans.load()

    def expects(self, message: WireMessage) -> bool:
        """Tell whether a count or an item belongs to a plan that the station offered."""
        match message:
            case grace.MAVLink_mission_count_message():
                return self._receiver.is_offered(message.count)
            case _:
                return self._receiver.is_receiving

    def on_board(self) -> PlanOnBoard:
        """Return what is to be said of the plan on board."""
        said = self.said
        state = OnboardPlanState(said.state)
        return PlanOnBoard(
            self.plan_hash, state, said.leg, said.legs, said.energy_used, said.reason
        )

    def take_mission(self, mission: Mission, *, start: bool) -> str:
        """Replace the plan on board by a whole mission; return why not, or ""."""
        sha256 = mission.sha256()
        is_held = sha256 == self.plan_hash
        if not (is_held and self.said.state in _WAITING_OR_FLYING):
            if refusal := self._program.plan_refusal():
                return refusal
            if not is_held and (failure := self._keep(mission)):
                return failure
            self._take(mission)
        if start and self.said.state != OnboardPlanState.RUNNING:
            outcome = self._program.obey(CommandKind.START, sha256[:PLAN_DIGITS])
            return _START_REFUSALS.get(outcome, "")
        return ""

    def take_offer(self, offer: grace.MAVLink_grace_plan_offer_message, now_s: float) -> None:
        """Answer an offer; one without a hash is none."""
        sha256 = telemetry.plan_hash(offer.sha256)
        if sha256 is None:
            return
        is_held = sha256 == self.plan_hash
        if is_held and self.said.state in _WAITING_OR_FLYING:
            self._reply(self.said)
        elif refusal := self._program.plan_refusal():
            self._answer(sha256, OnboardPlanState.REFUSED, refusal)
        elif is_held and (mission := self._plans.load()) is not None:
            self._take(mission)
        else:
            self._receiver.offer(sha256, offer.items, now_s)
            self._answer(sha256, OnboardPlanState.RECEIVING)

    def take_count(self, message: grace.MAVLink_mission_count_message, now_s: float) -> None:
        """Begin or continue to ask for the items of the offered mission."""
        self._go_on(self._receiver.count(message.count, now_s))

    def take_item(self, message: grace.MAVLink_mission_item_int_message, now_s: float) -> None:
        """Take an item of the offered mission."""
        self._go_on(self._receiver.item(message, now_s))

    def tick(self, now_s: float) -> None:
        """Ask again for an item that stays away."""
        self._go_on(self._receiver.tick(now_s))

    def _go_on(self, step: Step | None) -> None:
        match step:
            case Request(sequence):
                self._reply(
                    grace.MAVLink_mission_request_int_message(
                        target_system=STATION_SYSTEM,
                        target_component=STATION_COMPONENT,
                        seq=sequence,
                        mission_type=grace.MAV_MISSION_TYPE_MISSION,
                    )
                )
            case Refused(sha256, reason):
                self._end_transfer(grace.MAV_MISSION_INVALID)
                self._answer(sha256, OnboardPlanState.REFUSED, reason)
            case Complete(sha256, mission):
                if refusal := self._program.plan_refusal() or self._keep(mission):
                    self._end_transfer(grace.MAV_MISSION_DENIED)
                    self._answer(sha256, OnboardPlanState.REFUSED, refusal)
                else:
                    self._end_transfer(grace.MAV_MISSION_ACCEPTED)
                    self._take(mission)
            case None:
                pass

    def _keep(self, mission: Mission) -> str:
        """Make a mission the plan on board; return why that failed, or ""."""
        try:
            self._plans.replace(mission)
        except OSError as error:
            _log.error("a plan was not kept: %s", error)
            return _NOT_KEPT
        return ""

    def _take(self, mission: Mission) -> None:
        self._program.take_plan(mission)
        self.said = self._waiting()
        self.changed.set()

    def _waiting(self) -> grace.MAVLink_grace_plan_report_message:
        """Return what is said of the plan in memory before it is flown."""
        mission = self._plans.load()
        return telemetry.plan_report_message(
            measured_at=self._clock.now(),
            sha256=None if mission is None else mission.sha256(),
            state=OnboardPlanState.NONE if mission is None else OnboardPlanState.ON_BOARD,
            legs=0 if mission is None else len(mission.legs),
        )

    def _end_transfer(self, result: int) -> None:
        self._reply(
            grace.MAVLink_mission_ack_message(
                target_system=STATION_SYSTEM,
                target_component=STATION_COMPONENT,
                type=result,
                mission_type=grace.MAV_MISSION_TYPE_MISSION,
            )
        )

    def _answer(self, sha256: PlanHash, state: OnboardPlanState, reason: str = "") -> None:
        self._reply(
            telemetry.plan_report_message(
                measured_at=self._clock.now(), sha256=sha256, state=state, reason=reason
            )
        )
