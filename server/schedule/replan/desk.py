"""The newest suggestion of a robot as it stands now: in time, late, sent, or not to be had."""

from dataclasses import asdict
from datetime import datetime

from db.query.mission.plans import ENDED_STATES, PlanRecord
from server.base.foundation import Foundation
from server.base.problem import Problem
from server.fleet.fleet import Fleet
from server.fleet.status import RobotStatus
from server.fleet.words import clock_time
from server.plan.ledger import PlanLedger
from server.schedule.replan.suggestions import Suggestions
from server.schedule.replan.told import Told
from server.schedule.replan.view import AutomationView, JudgedView, PlanSuggestionView
from server.schedule.replan.words import deadline_text
from server.schedule.schedule import Allowance, Schedule

_MANNERS = {
    "asked": "Suggestions are made when a person asks.",
    "offered": "Suggestions are made at surfacings and offered; a person sends them.",
    "sent": "Suggestions are made at surfacings and sent by themselves.",
}
_SENT = ("sent", "waiting", "on_board", "running", "done")


class SuggestionDesk:
    """Tells of suggestions. Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        ledger: PlanLedger,
        schedule: Schedule,
        suggestions: Suggestions,
    ) -> None:
        self._clock = foundation.clock
        self._fleet = fleet
        self._ledger = ledger
        self._schedule = schedule
        self._suggestions = suggestions

    async def view(self, robot: str) -> PlanSuggestionView:
        """Return the newest suggestion of a robot, and whether another can be asked for.

        Raises:
            Problem: 404 if there is no such robot.
        """
        status = self._fleet.status(robot)
        told, job = self._suggestions.newest(robot), self._suggestions.job(robot)
        failure = self._suggestions.failure(robot)
        why_not = await self._why_not(robot)
        automation = automation_view(await self._schedule.allowance(robot))
        plan = None
        if told is not None and told.plan is not None:
            plan = await self._ledger.get(told.plan)
        state, text = "none", f"Nothing was suggested to {robot} yet."
        if told is not None:
            state, text = told.verdict, told.text
        if failure:
            state, text = "failed", failure
        if job is not None:
            state, text = "searching", f"A new plan for {robot} is searched for."
        shown = told if job is None and not failure else None
        timeliness, says = _timeliness(status, shown, plan, self._clock.now())
        return PlanSuggestionView(
            robot=robot,
            state=state,
            text=text,
            basis="" if shown is None else shown.basis,
            can_ask=not why_not and job is None,
            why_not=why_not,
            job=job,
            plan=None if shown is None else shown.plan,
            plan_state=None if plan is None or shown is None else plan.state,
            instead_of=None if shown is None else shown.instead_of,
            surfacing=None if shown is None else shown.surfacing,
            begins_ne_m=None if shown is None else shown.begins_ne_m,
            gain=None if shown is None else shown.gain,
            measure="" if shown is None else shown.measure,
            keep=None if shown is None else JudgedView(**asdict(shown.keep)),
            new=None if shown is None or shown.new is None else JudgedView(**asdict(shown.new)),
            judged_at=None if shown is None else shown.judged_at,
            fix_at=None if shown is None else shown.fix_at,
            fix_std_m=None if shown is None else shown.fix_std_m,
            samples=None if shown is None else shown.samples,
            newest_sample_at=None if shown is None else shown.newest_sample_at,
            until=None if shown is None else shown.until,
            timeliness=timeliness,
            timeliness_text=says,
            automation=automation,
        )

    async def _why_not(self, robot: str) -> str:
        try:
            await self._suggestions.opportunity(robot)
        except Problem as problem:
            return problem.detail
        return ""


def automation_view(allowance: Allowance) -> AutomationView:
    """Return what the station may do of itself for a robot."""
    config = allowance.config
    most, sent = config.most_sends_per_hour, allowance.sent
    text = (
        f"{_MANNERS[config.suggestions]} In the last hour {sent} of at most {most} plans were sent "
        "by themselves, for whatever reason"
    )
    if allowance.free_at is not None:
        text += f"; the next may be from {clock_time(allowance.free_at)} on"
    return AutomationView(
        suggestions=config.suggestions,
        least_gain=config.least_gain,
        most_sends_per_hour=most,
        sent_last_hour=sent,
        free_at=allowance.free_at,
        text=f"{text}.",
    )


def _timeliness(
    status: RobotStatus, told: Told | None, plan: PlanRecord | None, now: datetime
) -> tuple[str | None, str]:
    if told is None or told.verdict != "replace" or plan is None:
        return None, ""
    if plan.state in _SENT:
        return "sent", f"{plan.id} is {plan.state.replace('_', ' ')}."
    if plan.state in ENDED_STATES:
        return "gone", f"{plan.id} is {plan.state}; ask anew."
    is_late = _is_past(status, told) or (told.until is not None and now > told.until)
    says = deadline_text(
        told.until, is_late=is_late, name=told.instead_of, surfacing=told.surfacing
    )
    return ("late" if is_late else "in_time"), says


def _is_past(status: RobotStatus, told: Told) -> bool:
    """Tell whether the robot has gone on from the surfacing that a suggestion was for."""
    hand, leg = status.plan, status.leg_now
    if hand is None or hand.plan_id != told.flown or leg is None:
        return True
    return leg > told.leg or (leg == told.leg and not status.is_between_dives)
