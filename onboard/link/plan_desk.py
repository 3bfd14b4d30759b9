"""The robot's handling of plans: offers, transfers, what waits, and what it says of them."""

import asyncio
import logging
from collections.abc import Callable
from typing import NamedTuple

from onboard.link.mission_receiver import Complete, MissionReceiver, Refused, Request, Step
from onboard.link.plan_queue import PlanQueueDesk
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
_DONE = OnboardPlanState.DONE
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
    that was flown, it makes the plan wait again. A plan that comes while another is flown waits
    behind it where its sender says that it may; at a surfacing it takes the place of the other if
    START named it before, and else it waits on. An order to surface lets none wait. ``reply`` is
    called with each answer.
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
        self._may_wait = False
        """Whether the mission that was offered may wait."""
        self.queue = PlanQueueDesk(plans, clock)
        """The plan that waits."""
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
        if state is OnboardPlanState.FAILED:
            self.queue.hold_back()
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

    def obey(self, kind: CommandKind, plan_digits: str) -> CommandOutcome:
        """Act on a command; START may name the plan that waits, and SURFACE lets none wait."""
        if kind is CommandKind.SURFACE:
            self.queue.drop()
            self.changed.set()
        elif kind is CommandKind.START and self._names_next(plan_digits):
            return self._start_next()
        return self._program.obey(kind, plan_digits)

    def begin_next(self) -> None:
        """Fly the plan that waits for this surfacing, in place of the one on board."""
        waiting = self.queue.waiting
        if waiting is None or not waiting.starts:
            return
        if refusal := self._program.switch_refusal(waiting.mission) or self._keep(waiting.mission):
            _log.warning("the waiting plan does not begin: %s", refusal)
            self.queue.hold_back()
            self.changed.set()
            return
        last, is_done = telemetry.plan_hash(self.said.sha256), self.said.state == _DONE
        self.queue.drop()
        self.queue.note_switch(last, is_done=is_done)
        self._program.switch_plan(waiting.mission)
        self.said = self._waiting()
        self.report(OnboardPlanState.RUNNING, leg=0, energy_used=0.0, reason="")

    def take_mission(self, mission: Mission, *, start: bool, may_wait: bool = False) -> str:
        """Replace the plan on board by a whole mission; return why not, or "".

        Args:
            mission: The mission.
            start: Whether to fly it at once, or at the next surfacing where it waits.
            may_wait: Whether it may wait behind a plan that is flown.
        """
        sha256 = mission.sha256()
        is_held = sha256 == self.plan_hash
        if not (is_held and self.said.state in _WAITING_OR_FLYING):
            if refusal := self._program.plan_refusal():
                if not (may_wait and self._program.is_flying):
                    return refusal
                return self._keep_next(mission, starts=start)
            if not is_held and (failure := self._keep(mission)):
                return failure
            self._take(mission)
        if start and self.said.state != OnboardPlanState.RUNNING:
            outcome = self.obey(CommandKind.START, sha256[:PLAN_DIGITS])
            return _START_REFUSALS.get(outcome, "")
        return ""

    def take_offer(self, offer: grace.MAVLink_grace_plan_offer_message, now_s: float) -> None:
        """Answer an offer; one without a hash is none."""
        sha256 = telemetry.plan_hash(offer.sha256)
        if sha256 is None:
            return
        is_held = sha256 == self.plan_hash
        waiting = self.queue.waiting if sha256 == self.queue.next_hash else None
        refusal = self._program.plan_refusal()
        self._may_wait = bool(offer.may_wait)
        if is_held and self.said.state in _WAITING_OR_FLYING:
            self._reply(self.said)
        elif refusal and not self._can_wait:
            self._answer(sha256, OnboardPlanState.REFUSED, refusal)
        elif waiting is not None and refusal:
            self._answer(sha256, OnboardPlanState.WAITING)
        elif waiting is not None and not (refusal := self._keep(waiting.mission)):
            self._take(waiting.mission)
        elif is_held and not refusal and (mission := self._plans.load()) is not None:
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
                self._complete(sha256, mission)
            case None:
                pass

    def _complete(self, sha256: PlanHash, mission: Mission) -> None:
        """Put a mission on board, or let it wait; say which."""
        refusal = self._program.plan_refusal()
        waits = bool(refusal) and self._can_wait
        failure = self._keep_next(mission, starts=False) if waits else refusal
        failure = failure or ("" if waits else self._keep(mission))
        if failure:
            self._end_transfer(grace.MAV_MISSION_DENIED)
            self._answer(sha256, OnboardPlanState.REFUSED, failure)
            return
        self._end_transfer(grace.MAV_MISSION_ACCEPTED)
        if waits:
            self._answer(sha256, OnboardPlanState.WAITING)
        else:
            self._take(mission)

    @property
    def _can_wait(self) -> bool:
        return self._may_wait and self._program.is_flying

    def _names_next(self, plan_digits: str) -> bool:
        sha256 = self.queue.next_hash
        return sha256 is not None and sha256.startswith(plan_digits[:PLAN_DIGITS] or "-")

    def _start_next(self) -> CommandOutcome:
        """Have the waiting plan begin at the next surfacing, or now where nothing is flown."""
        waiting = self.queue.waiting
        if waiting is None or self._program.switch_refusal(waiting.mission):
            return CommandOutcome.NOT_NOW
        if self._program.is_flying:
            failure = self._keep_next(waiting.mission, starts=True)
            return CommandOutcome.NOT_NOW if failure else CommandOutcome.DONE
        if self._program.plan_refusal() or self._keep(waiting.mission):
            return CommandOutcome.NOT_NOW
        self._take(waiting.mission)
        return self._program.obey(CommandKind.START, waiting.mission.sha256()[:PLAN_DIGITS])

    def _keep_next(self, mission: Mission, *, starts: bool) -> str:
        """Let a mission wait; return why that failed, or "". A START once given holds."""
        waiting = self.queue.waiting
        held = waiting is not None and waiting.mission == mission and waiting.starts
        try:
            self.queue.keep(mission, starts=starts or held)
        except OSError as error:
            _log.error("a plan that is to wait was not kept: %s", error)
            return _NOT_KEPT
        self.changed.set()
        return ""

    def _keep(self, mission: Mission) -> str:
        """Make a mission the plan on board; return why that failed, or ""."""
        try:
            self._plans.replace(mission)
        except OSError as error:
            _log.error("a plan was not kept: %s", error)
            return _NOT_KEPT
        return ""

    def _take(self, mission: Mission) -> None:
        """Have a mission that is kept on board wait for START; a plan from before waits no more."""
        self.queue.drop()
        self.queue.forget_last()
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
