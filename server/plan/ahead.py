"""When the next round is planned while the robot still flies, and what it still has to fly."""

from datetime import datetime, timedelta

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.edge import POINT_DOWN, POINT_EAST, POINT_NORTH, POINT_TIME
from autonomy.planner.plan import Leg
from db.query.mission.plans import PlanRecord
from robot_link.messages import PlanReport
from server.plan.document import legs_of, points_of, report_of
from server.plan.expected import expected_ends_s, expected_of

MARGIN_S = 10.0
"""Wall time that a round ahead may take beyond its search: its dry run, and a map to make."""


def flown_leg(plan: PlanRecord, report: PlanReport | None) -> int:
    """Return the leg that a robot is on, by what it said last; 0 while it has not begun."""
    said = report_of(plan, report)
    if said is not None:
        return said.leg
    kept = plan.document.get("onboard") or {}
    return kept.get("leg", 0)


def unflown(plan: PlanRecord, report: PlanReport | None) -> tuple[Leg, ...]:
    """Return the legs that a robot has not ended, none once the plan was flown."""
    if plan.state == "done":
        return ()
    return legs_of(plan.document)[flown_leg(plan, report) :]


def planned_rest(plan: PlanRecord, report: PlanReport | None) -> FloatArray:
    """Return where a plan will still sample, shape ``(m, 5)``; all of it before it began.

    The robot samples on its expected track, at the plan's times and as surely as that promises.
    """
    points, expected = points_of(plan.document), expected_of(plan.document)
    if expected is not None:
        for k in (POINT_NORTH, POINT_EAST, POINT_DOWN):
            points[:, k] = np.interp(points[:, POINT_TIME], expected[:, POINT_TIME], expected[:, k])
    if plan.state != "running":
        return points
    legs = legs_of(plan.document)
    flown_s = sum(leg.duration_s for leg in legs[: flown_leg(plan, report)])
    return points[points[:, 0] > flown_s]


def remaining_s(
    plan: PlanRecord, config: PlannerConfig, report: PlanReport | None, now: datetime
) -> float:
    """Return about how long a robot flies on, s of its clock.

    It counts the leg it is on from its last word on, so that it is rather too long.
    """
    planned_s = _left_s(plan, config, report)
    said = report_of(plan, report)
    since = plan.running_at if said is None else said.measured_at
    passed_s = 0.0 if since is None else max(0.0, (now - since).total_seconds())
    return max(0.0, planned_s - passed_s)


def _left_s(plan: PlanRecord, config: PlannerConfig, report: PlanReport | None) -> float:
    """Return how long a plan takes from the beginning of the leg that its robot is on."""
    legs, ends_s = unflown(plan, report), expected_ends_s(plan.document)
    if legs and ends_s:
        begun = len(ends_s) - len(legs)
        return ends_s[-1] - (ends_s[begun - 1] if begun else 0.0)
    dives = sum(leg.start_ned[2] <= 0.0 for leg in legs[1:])
    return sum(leg.duration_s for leg in legs) + dives * config.mission.turn_time_s


def is_due(
    plan: PlanRecord,
    config: PlannerConfig,
    report: PlanReport | None,
    now: datetime,
    clock_speed: float,
) -> bool:
    """Tell whether the round after a running plan should be planned now.

    It should once the last leg has begun, or when the time left is what planning takes.

    Args:
        plan: What the robot flies.
        config: Settings of the round to come.
        report: What the robot said last of the plan on board.
        now: The robots' time.
        clock_speed: How much faster that runs than a wall clock, by which planning takes its time.
    """
    if plan.state != "running":
        return False
    if len(unflown(plan, report)) <= 1:
        return True
    return remaining_s(plan, config, report, now) <= _lead_s(config, clock_speed)


def due_at(
    plan: PlanRecord,
    config: PlannerConfig,
    report: PlanReport | None,
    now: datetime,
    clock_speed: float,
) -> datetime:
    """Return when ``is_due`` comes true of a running plan if its robot says nothing more."""
    wait_s = remaining_s(plan, config, report, now) - _lead_s(config, clock_speed)
    return now + timedelta(seconds=max(0.0, wait_s), milliseconds=1)


def _lead_s(config: PlannerConfig, clock_speed: float) -> float:
    """Return how long before its end planning must begin, s of the robot's clock."""
    return (config.planning_time_s + MARGIN_S) * max(1.0, clock_speed)
