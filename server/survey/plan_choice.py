"""Another plan in the place of a draft: one of its runners-up, or what a longer search finds."""

from dataclasses import replace

from autonomy.planner.config import PlannerConfig
from db.query.mission.plans import PlanRecord
from server.base.foundation import Foundation
from server.base.problem import FieldError, conflict, unprocessable
from server.fleet.fleet import Fleet
from server.fleet.status import FOLLOW_TARGET
from server.plan.document import (
    candidate_of_draft,
    candidates_of,
    legs_of,
    search_document,
)
from server.plan.drafting import outdated_by
from server.plan.ledger import PlanLedger
from server.plan.planning import Planning
from server.plan.search.request import SearchRequest, as_set
from server.plan.search.survey_round import AHEAD_OF
from server.survey.mission_ledger import MissionLedger

_WAITS = ("ready", "stopped", "failed")
"""States of a mission whose draft a person may exchange."""


class PlanChoices:
    """Exchanges drafts for other plans. Belongs to one event loop.

    The old draft stays a draft until the new plan is one, and then is superseded with it; whatever
    becomes of the new plan before that leaves the old one as it was.
    """

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        plans: PlanLedger,
        missions: MissionLedger,
        planning: Planning,
    ) -> None:
        self._clock = foundation.clock
        self._fleet = fleet
        self._plans = plans
        self._missions = missions
        self._planning = planning

    async def choose(self, plan: str, runner_up: int, *, by: str) -> PlanRecord:
        """Begin a draft of a runner-up, after a dry run as any other.

        Raises:
            UnknownIdError: If there is no such plan.
            Problem: 409 if it is not a draft that waits for a person, 422 if there is no such
                runner-up, 503 while storage fails.
        """
        record = await self._draft(plan)
        others = candidates_of(record.document)
        if not 0 <= runner_up < len(others):
            last = f"0 to {len(others) - 1}" if others else "none: there are no runners-up"
            raise unprocessable(
                f"{plan} has no runner-up {runner_up}.",
                [FieldError(loc=["runner_up"], msg=f"must be {last}")],
            )
        chosen = others[runner_up]
        if not chosen.legs:
            raise conflict(
                f"{plan} was made by a version that kept no legs of runners-up; plan again."
            )
        config = PlannerConfig.model_validate(record.config)
        rest = [one for number, one in enumerate(others) if number != runner_up]
        found = search_document(
            config.objective,
            f"Number {runner_up + 2} of what {plan} found, chosen by {by}.",
            chosen,
            (candidate_of_draft(record.document), *rest),
            (),
        )
        found["history"] = record.document["history"]
        await self._reopen(record, f"{by} chose another plan.")
        return await self._planning.take_candidate(_request(record, config, by), chosen, found)

    async def go_on(self, plan: str, planning_time_s: float | None, *, by: str) -> PlanRecord:
        """Begin to search on from a draft and its runners-up.

        Raises:
            UnknownIdError: If there is no such plan.
            Problem: 409 if it is not a draft that waits for a person or was not searched for, 503
                while storage fails.
        """
        record = await self._draft(plan)
        found = outdated_by(self._fleet.status(record.robot), record, self._clock.now())
        if found:
            reasons = " ".join(one.message for one in found)
            raise conflict(f"{plan} is outdated: {reasons} Plan again.")
        config = as_set(record)
        config_id = record.document["config_id"]
        if planning_time_s not in {None, config.planning_time_s}:
            config = config.model_copy(update={"planning_time_s": planning_time_s})
            config_id = None
        legs = legs_of(record.document)
        warm = (legs, *(one.legs for one in candidates_of(record.document) if one.legs))
        request = replace(
            _request(record, config, by),
            config_id=config_id,
            start_xy=legs[0].start_ned[:2],
            warm=warm,
            attempt=record.document.get("attempt", 0) + 1,
        )
        await self._reopen(record, f"{by} searches on.")
        return await self._planning.plan_survey(request)

    async def _draft(self, plan: str) -> PlanRecord:
        record = await self._plans.get(plan)
        if record.state != "draft":
            state = record.state.replace("_", " ")
            raise conflict(f"{plan} is {state}; only a draft can be exchanged. Plan again.")
        if record.kind == FOLLOW_TARGET:
            raise conflict(f"{plan} follows a target; there is no search to go on with.")
        if record.document.get("objective") is None:
            raise conflict(f"{plan} was laid out by hand; there is no search to go on with.")
        if record.mission is not None:
            mission = await self._missions.get(record.mission)
            if mission.state not in _WAITS:
                raise conflict(f"{mission.id} is {mission.state}; stop it first.")
        self._refuse_second(record, await self._plans.of_robot(record.robot, ("planning",)))
        return record

    @staticmethod
    def _refuse_second(record: PlanRecord, others: list[PlanRecord]) -> None:
        for other in others:
            if other.document.get("replaces") == record.id:
                raise conflict(f"{other.id} is being made in its place; wait, or cancel that.")

    async def _reopen(self, record: PlanRecord, message: str) -> None:
        if record.mission is not None:
            await self._missions.move(record.mission, "planning", message, automation=False)


def _request(record: PlanRecord, config: PlannerConfig, by: str) -> SearchRequest:
    """Return the request of a plan that takes the place of a draft."""
    return SearchRequest(
        robot=record.robot,
        config=config,
        config_id=record.document["config_id"],
        by=by,
        mission=record.mission,
        round_number=record.round,
        budget=record.document.get("budget"),
        attempt=record.document.get("attempt", 0),
        ahead_of=record.document.get(AHEAD_OF),
        replaces=record.id,
        settings_filter=as_set(record).position_filter,
        current_text=record.document.get("current_text", ""),
    )
