"""At which surfacing another plan could begin in time, and how long the search for it may take."""

from dataclasses import dataclass
from datetime import datetime, timedelta

from autonomy.planner.config import PlannerConfig
from server.base.problem import conflict
from server.fleet.status import RobotStatus
from server.plan.dry_run import WAITED_S
from server.schedule.replan.present import Present, present_of
from server.schedule.replan.view import ContactWindowView

LEAST_SEARCH_S = 1.0
MARGIN_S = 10.0
"""Wall time that a dry run and the way to the robot take at least."""


@dataclass(frozen=True, slots=True)
class Opportunity:
    """What can be suggested, and in what time."""

    present: Present
    search_s: float
    """Wall time of the search."""
    until: datetime | None
    """When the robot must have it, as expected; ``None`` where nobody can say."""
    ahead_s: float
    """In how long the new plan begins, s of the robots' clock."""


def opportunity_of(
    status: RobotStatus,
    contact: ContactWindowView,
    now: datetime,
    speed: float,
    planning_s: float,
) -> Opportunity:
    """Return the surfacing that a suggestion is made for: this one if time allows, else the next.

    Args:
        status: The robot.
        contact: Its window.
        now: By the robots' clock.
        speed: How much faster that runs than the wall's.
        planning_s: How long a search may take by the settings of now, wall time.

    Raises:
        Problem: 409 if nothing can be suggested; the sentence says why.
    """
    if status.is_between_dives and status.next_plan is None:
        present = present_of(status, "now")
        closes = None if contact.closes is None else contact.closes.at
        config = PlannerConfig.model_validate(present.plan.config)
        needed_s = planning_s + (WAITED_S if config.adaptive.rehearse else 0.0)
        if closes is None or (closes - now).total_seconds() / speed >= needed_s:
            return Opportunity(present, planning_s, closes, 0.0)
    present = present_of(status, "next")
    config = PlannerConfig.model_validate(present.plan.config)
    if contact.opens is None:
        robot = status.record.id
        raise conflict(f"Nobody can say when {robot} comes up next; {present.plan.id} goes on.")
    ahead_s = (contact.opens.at - now).total_seconds()
    search_s = min(planning_s, ahead_s / speed - MARGIN_S)
    if search_s < LEAST_SEARCH_S:
        raise conflict(
            f"There is no time: search, dry run and the way to {status.record.id} take "
            f"{LEAST_SEARCH_S + MARGIN_S:.0f} s at least, and it comes up in "
            f"{max(ahead_s, 0.0) / speed:.0f} s of the station. {present.plan.id} goes on."
        )
    until = contact.opens.at + timedelta(seconds=config.mission.turn_time_s)
    return Opportunity(present, search_s, until, max(ahead_s, 0.0))
