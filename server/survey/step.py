"""The one step that a survey takes next (thesis section 5.4.4, Fig. 5.3).

Plan with a part of the budget, fly, map, and again, until the budget is spent or the map is good
enough. A step looks at the mission and its plans in the database and nowhere else, so it may be
taken any number of times, and after the station was killed.
"""

from datetime import datetime

from sqlalchemy.orm import Session

from autonomy.planner.config import PlannerConfig
from autonomy.planner.plan import Leg
from db.query.mission.missions import MissionRecord, get_mission
from db.query.mission.plans import PlanRecord
from robot_link.messages import PlanReport
from server.base.foundation import Foundation
from server.base.problem import Problem, conflict
from server.fleet.fleet import Fleet
from server.plan.ahead import due_at, is_due, unflown
from server.plan.document import candidates_of, legs_of, report_of
from server.plan.drafting import broken_off, outdated_by
from server.plan.ledger import PlanLedger
from server.plan.planning import Planning
from server.plan.search.request import SearchRequest
from server.plan.search.survey_round import (
    AHEAD_OF,
    ENDED_BADLY,
    SurveyStatus,
    config_of_round,
    planned_energy,
    survey_status,
    unusable_rest,
)
from server.survey.map_quality import SurveyMaps
from server.survey.mission_ledger import ENDED, MissionLedger
from server.transfer.machine import BEGUN
from server.transfer.transfers import Transfers

QUIET_S = 1.5
QUIET_LIMIT_S = 20.0
"""Wall time without a sample after which a round counts as received, and the longest wait."""
Warm = tuple[tuple[Leg, ...], ...]


class SurveySteps:
    """Takes the steps of surveys. Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        missions: MissionLedger,
        plans: PlanLedger,
        planning: Planning,
        transfers: Transfers,
        maps: SurveyMaps,
    ) -> None:
        self._clock = foundation.clock
        self._fleet = fleet
        self._missions = missions
        self._plans = plans
        self._planning = planning
        self._transfers = transfers
        self._maps = maps

    async def take(self, mission: str) -> bool:
        """Take the next step of a survey; return whether to look again at once.

        Raises:
            Problem: If it cannot go on; the sentence says why.
        """
        record, plans = await self._missions.get(mission), await self._missions.plans(mission)
        survey = survey_status(plans)
        if record.state in ENDED:
            if survey is not None and survey.plan.state in ENDED_BADLY:
                await self._let_go(survey, f"{mission} has ended.")
            return False
        if survey is None:
            await self.next_round(record, plans, 1)
            return False
        plan = survey.plan
        match plan.state:
            case "planning":
                return False
            case "draft" if not record.automation:
                await self._missions.advance(mission, "ready", f"{plan.id} is ready to be sent.")
            case "draft" if self._is_outdated(plan):
                why = self._why_outdated(plan)
                if await self.next_round(record, plans, plan.round, warm=self._warm_from(plan)):
                    await self._planning.cancel(plan.id, f"{why} Planning again.")
            case "draft" if broken_off(plan) and not self._transfers.is_under_way(plan.robot):
                await self._plan_instead(record, plans, plan)
            case "sent" | "on_board" if self._has_begun(plan):
                return False  # its word is on its way to the plan, which will be looked at then
            case "draft" | "sent" | "on_board":
                if record.automation:
                    return await self._send(record, plan)
            case "running":
                await self._missions.advance(mission, "running", _round_text(plan, record))
                await self._plan_ahead(record, plans, survey)
            case "done":
                return await self._round_ended(record, plans, survey)
            case _:
                await self._plan_ended_badly(record, plans, survey)
        return False

    def flown_in_survey(self, robot: str) -> PlanRecord | None:
        """Return the round of a survey that a robot flies, if it flies one."""
        hand = self._fleet.status(robot).plan
        if hand is None or hand.record.mission is None or hand.state != "running":
            return None
        return hand.record

    def is_ahead_due(self, plan: PlanRecord) -> bool:
        """Tell whether the round after the one that is flown should be planned now."""
        config = PlannerConfig.model_validate(plan.config)
        return is_due(plan, config, self._report(plan), self._clock.now(), self._clock.speed)

    def ahead_due_at(self, plan: PlanRecord) -> datetime:
        """Return when the round after the one that is flown should be planned by time alone."""
        config = PlannerConfig.model_validate(plan.config)
        return due_at(plan, config, self._report(plan), self._clock.now(), self._clock.speed)

    async def next_round(
        self,
        record: MissionRecord,
        plans: list[PlanRecord],
        round_number: int,
        warm: Warm = (),
        attempt: int = 0,
    ) -> bool:
        """Begin to plan a round from where the robot is.

        Returns:
            Whether it was begun; it is not once someone has ended the survey.

        Raises:
            Problem: If nothing can be planned from there.
        """
        config = PlannerConfig.model_validate(record.config)
        spent = self._missions.spent(record.robot, plans)
        await self._missions.advance(record.id, "replanning", f"Planning round {round_number}.")
        if (await self._missions.get(record.id)).state in ENDED:
            return False
        await self._planning.plan_survey(
            request_of(
                record,
                round_number,
                spent=spent,
                warm=warm if config.adaptive.warm_start else (),
                attempt=attempt,
            )
        )
        return True

    def _is_outdated(self, plan: PlanRecord) -> bool:
        """Tell whether a draft that nobody sends yet was made for another place or time."""
        is_waiting = not self._transfers.is_under_way(plan.robot)
        return is_waiting and bool(self._why_outdated(plan))

    def _why_outdated(self, plan: PlanRecord) -> str:
        """Return why a draft no longer fits the robot, sentences, "" if it does."""
        found = outdated_by(self._fleet.status(plan.robot), plan, self._clock.now())
        return " ".join(one.message for one in found)

    async def _plan_instead(
        self, record: MissionRecord, plans: list[PlanRecord], plan: PlanRecord
    ) -> None:
        """Search once more in the place of a draft that its dry run did not fly to its end.

        The draft of a second search is left to a person.
        """
        attempt = plan.document.get("attempt", 0)
        reasons = " ".join(one.message for one in broken_off(plan))
        if attempt == 0:
            if await self.next_round(record, plans, plan.round, attempt=1):
                await self._planning.cancel(plan.id, f"{reasons} Planning again.")
            return
        text = f"{plan.id} is not sent without a person's word. {reasons}"
        await self._missions.give_up(record.id, "stopped", text)

    async def _send(self, record: MissionRecord, plan: PlanRecord) -> bool:
        try:
            await self._transfers.send(
                plan.id,
                start=True,
                check=lambda session: _check_on(session, record.id),
                goes_on=plan.round > 1,
            )
        except Problem:
            now = await self._plans.get(plan.id)
            is_late_word = now.state == "draft" and self._is_outdated(now)
            is_late_word = is_late_word or self._has_begun(now)
            if now.state == plan.state and not is_late_word:
                raise
            # The robot, or its word on where it is, was faster than this look: look again.
            return True
        await self._missions.advance(record.id, "running", _round_text(plan, record))
        return False

    async def _plan_ahead(
        self, record: MissionRecord, plans: list[PlanRecord], survey: SurveyStatus
    ) -> None:
        """Plan the next round from the end of the one that the robot flies, if it is time to."""
        config, plan = PlannerConfig.model_validate(record.config), survey.plan
        wanted = record.automation and config.adaptive.plan_ahead
        if not (wanted and _has_none_ahead(survey) and self.is_ahead_due(plan)):
            return
        before = [other for other in plans if other.id != plan.id]
        spent = self._missions.spent(record.robot, before) + planned_energy(plan)
        if config.total_budget - spent < self._planning.settings.least_energy(record.robot, config):
            return
        end = legs_of(plan.document)[-1].end_ned
        warm = self._warm_from(plan) if config.adaptive.warm_start else ()
        await self._planning.plan_survey(
            request_of(
                record,
                plan.round + 1,
                spent=spent,
                warm=warm,
                start_xy=end[:2],
                ahead_of=plan.id,
            )
        )

    async def _round_ended(
        self, record: MissionRecord, plans: list[PlanRecord], survey: SurveyStatus
    ) -> bool:
        plan, ahead = survey.plan, survey.open_ahead
        # The last samples of the round may still be on their way.
        await self._maps.settle(record.robot, QUIET_S, QUIET_LIMIT_S)
        map_std = await self._maps.note_std(record, plan.id)
        config = PlannerConfig.model_validate(record.config)
        remaining = config.total_budget - self._missions.spent(record.robot, plans)
        reason = ""
        if map_std is not None and config.target_std > 0.0 and map_std <= config.target_std:
            reason = f"The map is good enough: its standard deviation is {map_std:.3g}"
        elif remaining < self._planning.settings.least_energy(record.robot, config):
            reason = "The budget is spent"
        if reason:
            await self._let_go(survey, f"{reason}.")
            await self._maps.end(record, config, reason)
        elif ahead is None:
            await self.next_round(record, plans, plan.round + 1, self._warm_from(plan))
        elif ahead.state == "planning":
            text = f"Round {ahead.round} is still being planned."
            await self._missions.advance(record.id, "replanning", text)
        elif self._is_outdated(ahead) or planned_energy(ahead) > remaining:
            why = self._why_outdated(ahead) or "The budget that is left is less than it takes."
            await self._planning.cancel(ahead.id, f"{why} Planning again.")
            await self.next_round(record, plans, ahead.round, self._warm_from(ahead))
        else:
            await self._plans.note(ahead.id, {AHEAD_OF: None}, only_from=("draft",))
            return True
        return False

    async def _plan_ended_badly(
        self, record: MissionRecord, plans: list[PlanRecord], survey: SurveyStatus
    ) -> None:
        plan = survey.plan
        message = plan.document["message"]
        await self._let_go(survey, f"{plan.id}, at whose end it begins, was not flown to its end.")
        config = PlannerConfig.model_validate(record.config)
        rest = unusable_rest(plan, config)
        if plan.document.get("interrupted"):
            await self.next_round(record, plans, plan.round)
        elif rest is not None:
            text = f"The {rest:.3g} energy units that are left are too little for a further round"
            await self._maps.end(record, config, text)
        elif plan.state == "failed" and plan.running_at is None:
            await self._missions.give_up(record.id, "failed", message)
        else:
            await self._missions.advance(record.id, "stopped", message, automation=False)

    async def _let_go(self, survey: SurveyStatus, reason: str) -> None:
        """Throw away a plan made ahead of one that did not end as planned, or was the last."""
        if survey.open_ahead is not None:
            await self._planning.cancel(survey.open_ahead.id, reason)

    def _warm_from(self, plan: PlanRecord) -> Warm:
        """Return what a plan leaves to begin with: what was not flown of it, its runners-up."""
        others = (one.legs for one in candidates_of(plan.document))
        rest = unflown(plan, self._report(plan))
        return tuple(legs for legs in (rest, *others) if legs)

    def _has_begun(self, plan: PlanRecord) -> bool:
        """Tell whether the robot says that it flies a plan that was sent, or has flown it."""
        said = report_of(plan, self._report(plan))
        return plan.state != "draft" and said is not None and said.state in BEGUN

    def _report(self, plan: PlanRecord) -> PlanReport | None:
        return self._fleet.status(plan.robot).plan_report


def _has_none_ahead(survey: SurveyStatus) -> bool:
    """Tell whether no plan was made ahead, or the station stopped while it was made."""
    ahead = survey.ahead
    return ahead is None or bool(ahead.state == "failed" and ahead.document.get("interrupted"))


def request_of(
    record: MissionRecord,
    round_number: int,
    *,
    spent: float,
    warm: Warm = (),
    start_xy: tuple[float, float] | None = None,
    ahead_of: str | None = None,
    attempt: int = 0,
) -> SearchRequest:
    """Return a round of a survey as the planner takes it.

    Args:
        record: The mission.
        round_number: Which round.
        spent: Energy units that are spent when it begins.
        warm: Trajectories to begin with.
        start_xy: Where it begins, north and east, m; by default where the robot is.
        ahead_of: The plan at whose end it begins, while that is flown.
        attempt: How often it was searched for before.
    """
    config = PlannerConfig.model_validate(record.config)
    total = config.total_budget
    return SearchRequest(
        robot=record.robot,
        config=config_of_round(config, spent / total),
        config_id=record.document["config_id"],
        by=record.created_by if round_number == 1 else "the station",
        mission=record.id,
        round_number=round_number,
        budget=min(config.round_budget, total - spent),
        start_xy=start_xy,
        warm=warm,
        attempt=attempt,
        ahead_of=ahead_of,
        in_turn=len(record.document.get("fleet") or ()) > 1,
    )


def _check_on(session: Session, mission: str) -> None:
    if not get_mission(session, mission).automation:
        raise conflict(f"{mission} was stopped.")


def _round_text(plan: PlanRecord, record: MissionRecord) -> str:
    return f"Round {plan.round} of {record.robot} is {plan.id}."
