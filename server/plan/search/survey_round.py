"""Where the rounds of a survey stand, read from the mission's plans and from nothing else."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from autonomy.planner.config import PlannerConfig, exploitation_at
from db.query.mission.plans import PlanRecord

AHEAD_OF = "ahead_of"
"""Key of a plan's document: the plan whose end it begins at, until the survey goes on with it."""
REPLACES = "replaces"
"""Key of a plan's document: the draft whose place it takes as soon as it is a draft itself."""
NOTHING_FEASIBLE = "nothing_feasible"
"""Key of a failed plan's document: it was searched for, and nothing kept every limit."""
ENDED_BADLY = ("failed", "cancelled", "superseded")


@dataclass(frozen=True, slots=True)
class SurveyStatus:
    """The plan that decides what a survey does next, and the one that was made ahead of it."""

    plan: PlanRecord
    ahead: PlanRecord | None
    """Of the round after ``plan``, begun while the robot flew that; maybe failed or cancelled."""

    @property
    def open_ahead(self) -> PlanRecord | None:
        """The plan made ahead, while it is being made or waits as a draft."""
        ahead = self.ahead
        return ahead if ahead is not None and ahead.state in {"planning", "draft"} else None

    @property
    def next_round(self) -> int:
        """Number of the round that is planned next: the same again until it was flown."""
        return self.plan.round + (self.plan.state == "done")


def survey_status(plans: Sequence[PlanRecord]) -> SurveyStatus | None:
    """Return where a survey stands.

    Args:
        plans: Every plan of the mission, the newest first.

    Returns:
        None before the first plan.
    """
    by_id = {plan.id: plan for plan in plans}
    valid = [plan for plan in plans if not _came_to_nothing(plan, by_id)]
    if not valid:
        return None
    newest = valid[0]
    before = by_id.get(newest.document.get(AHEAD_OF) or "")
    if before is None or newest.sent_at is not None or newest.running_at is not None:
        return SurveyStatus(newest, None)
    return SurveyStatus(before, newest)


def counted(plans: Sequence[PlanRecord]) -> list[PlanRecord]:
    """Return the plans that are rounds of a survey, in the same order.

    Left out are those that were made ahead and not used, those that were to replace a draft and
    ended before they did, and a last one for which too little of the budget was left.
    """
    by_id = {plan.id: plan for plan in plans}
    return [
        plan
        for plan in plans
        if not _came_to_nothing(plan, by_id)
        and not _was_made_in_vain(plan)
        and unusable_rest(plan, PlannerConfig.model_validate(plan.config)) is None
    ]


def config_of_round(config: PlannerConfig, spent_share: float) -> PlannerConfig:
    """Return a survey's settings for a round: the exploitation follows its schedule.

    Args:
        config: The survey's settings.
        spent_share: Part of the total budget that is spent when the round begins, 0 to 1.
    """
    exploitation = exploitation_at(config, min(max(spent_share, 0.0), 1.0))
    ergodic = config.ergodic.model_copy(update={"exploitation": exploitation})
    return config.model_copy(update={"ergodic": ergodic})


def unusable_rest(plan: PlanRecord, config: PlannerConfig) -> float | None:
    """Return what was left of a survey's budget if nothing can be flown with it, else None.

    Such a survey has done what it was asked for; one whose full round cannot be planned has not.
    """
    budget = plan.document.get("budget", config.round_budget)
    is_rest = plan.round > 1 and budget < config.round_budget
    return budget if is_rest and plan.document.get(NOTHING_FEASIBLE) else None


def planned_energy(plan: PlanRecord) -> float:
    """Return the energy units that a plan accounts for, 0 while it is being made."""
    account: dict[str, Any] = plan.document.get("account") or {}
    return account.get("energy", 0.0)


def _was_made_in_vain(plan: PlanRecord) -> bool:
    """Tell whether a plan was made ahead and ended without being flown."""
    is_unused = plan.state in ENDED_BADLY and plan.running_at is None
    return is_unused and bool(plan.document.get(AHEAD_OF))


def _came_to_nothing(plan: PlanRecord, by_id: dict[str, PlanRecord]) -> bool:
    """Tell whether a plan was to replace a draft, but ended before it could.

    What became of the other since, it may have been sent or replaced by another, is its own matter.
    """
    replaced = by_id.get(plan.document.get(REPLACES) or "")
    return plan.state in ENDED_BADLY and plan.draft_at is None and replaced is not None
