"""What is left of the plan that a robot flies, from the surfacing at which another may begin."""

from dataclasses import dataclass
from datetime import datetime

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.planner.plan import Leg
from db.query.mission.plans import PlanRecord
from server.base.problem import conflict
from server.fleet.status import RobotStatus
from server.plan.ahead import planned_rest
from server.plan.document import legs_of
from server.schedule.replan.view import Surfacing

SEARCHED = "adaptive_survey"


@dataclass(frozen=True, slots=True, eq=False)
class Present:
    """The plan that goes on if nothing is sent."""

    plan: PlanRecord
    surfacing: Surfacing
    begins_ne_m: tuple[float, float]
    """Where another plan would begin."""
    rest: tuple[Leg, ...]
    """Its legs from there on."""
    before: FloatArray
    """Where the robot samples until then, whatever comes after, shape ``(m, 5)``."""
    leg: int
    """Leg of the plan that is flown at which another would begin."""
    fix_at: datetime | None
    """Of the position that another would begin at; ``None`` where that is the plan's."""
    fix_std_m: float | None


def present_of(status: RobotStatus, surfacing: Surfacing) -> Present:
    """Return what is left of a robot's plan from one of its surfacings on.

    Args:
        status: The robot.
        surfacing: ``now``, while it lies at the surface between two dives, or ``next``.

    Raises:
        Problem: 409 if nothing can be suggested; the sentence says why.
    """
    robot, hand, leg = status.record.id, status.plan, status.leg_now
    if hand is None or leg is None or hand.state != "running":
        raise conflict(f"{robot} has said of no plan that it flies one; make it a new one.")
    plan = hand.record
    refuse_without_aim(plan)
    ends = [k for k, one in enumerate(hand.legs) if one.end_ned[2] <= 0.0]
    nxt = next((k for k in ends if k >= leg), None)
    if nxt is None:
        raise conflict(f"{plan.id} has no surfacing left at which another plan could begin.")
    waiting = status.next_plan
    if surfacing == "now":
        if not status.is_between_dives:
            raise conflict(f"{robot} does not lie at the surface between two dives of {plan.id}.")
        if waiting is not None:
            raise conflict(f"{waiting.id} waits on board of {robot} and begins now.")
        return _now(status, plan, hand.legs, leg)
    end_ned = hand.legs[nxt].end_ned
    before = _until(plan, status, hand.legs, nxt)
    if waiting is not None:
        refuse_without_aim(waiting)
        legs = legs_of(waiting.document)
        return Present(waiting, "next", end_ned[:2], legs, before, nxt + 1, None, None)
    rest = hand.legs[nxt + 1 :]
    if not rest:
        text = f"{plan.id} ends with the dive that {robot} is about; there is nothing to replace."
        raise conflict(text)
    return Present(plan, "next", end_ned[:2], rest, before, nxt + 1, None, None)


def refuse_without_aim(plan: PlanRecord) -> None:
    """Refuse a plan that aims at something else than information.

    Raises:
        Problem: 409, with the reason.
    """
    if plan.kind == SEARCHED and plan.document.get("objective") is not None:
        return
    what = {
        "track_target": "follows a target",
        "design": "was drawn by hand",
        "primitives": "was laid out leg by leg",
    }.get(plan.kind, "was not searched for")
    raise conflict(
        f"{plan.id} {what}: it has no aim that another plan could be held against. Suggestions are "
        "made for plans that the planner searched for."
    )


def fix_of(status: RobotStatus) -> tuple[datetime | None, float | None]:
    """Return when a robot at the surface took its position, and how surely."""
    state = status.state
    if state is None or not state.has_fix:
        return None, None
    return state.measured_at, state.position_std_m


def _now(status: RobotStatus, plan: PlanRecord, legs: tuple[Leg, ...], leg: int) -> Present:
    state, rest = status.state, legs[leg:]
    here = rest[0].start_ned[:2] if state is None else state.position_ned[:2]
    fix_at, fix_std_m = fix_of(status)
    return Present(plan, "now", here, rest, np.empty((0, 5)), leg, fix_at, fix_std_m)


def _until(
    plan: PlanRecord, status: RobotStatus, legs: tuple[Leg, ...], surfacing: int
) -> FloatArray:
    """Return where the robot still samples before the end of a leg, shape ``(m, 5)``."""
    ends_s = float(sum(one.duration_s for one in legs[: surfacing + 1]))
    rest = planned_rest(plan, status.plan_report)
    return rest[rest[:, 0] <= ends_s + 1e-6]
