"""Distances of a robot that rules judge, each less what its position uncertainty explains."""

import math
from collections.abc import Iterable
from datetime import datetime, timedelta
from typing import Final

import numpy as np

from autonomy.arrays import FloatArray
from robot_link.messages import RobotMode, StateReport
from server.fleet.status import RobotStatus

_SIGMAS: Final = 2.0
_HEARD_WITHIN: Final = timedelta(minutes=5)


def _is_in_open_water(status: RobotStatus) -> bool:
    return status.record.site.kind != "tank" and not status.is_in_workshop


def _std_m(state: StateReport) -> float:
    return state.position_std_m if math.isfinite(state.position_std_m) else 0.0


def off_plan_m(status: RobotStatus) -> float | None:
    """Return how far a robot is from the nearest of its planned legs; ``None`` where nobody knows.

    The way to where a plan begins belongs to no leg.
    """
    hand, state, leg = status.plan, status.state, status.leg_now
    if hand is None or state is None or leg is None or len(hand.points) < 2:
        return None
    if not _is_in_open_water(status):
        return None
    if leg == 0 and state.mode is RobotMode.SWIMMING:
        return None
    north, east = state.position_ned[:2]
    off_m = _to_line_m(hand.points[:, 1:3], north, east)
    return max(0.0, off_m - _SIGMAS * _std_m(state))


def _to_line_m(points_ne: FloatArray, north_m: float, east_m: float) -> float:
    """Return the distance of a point from a line of points, shape ``(n, 2)``, m."""
    begins, ways = points_ne[:-1], np.diff(points_ne, axis=0)
    to_point = np.array((north_m, east_m)) - begins
    squared = np.maximum(np.sum(ways**2, axis=1), 1e-12)
    part = np.clip(np.sum(to_point * ways, axis=1) / squared, 0.0, 1.0)
    off = to_point - part[:, None] * ways
    return float(np.sqrt(np.min(np.sum(off**2, axis=1))))


def to_keep_out_m(status: RobotStatus) -> float | None:
    """Return how far a robot is from the nearest keep-out, negative inside of one."""
    state, areas = status.state, status.record.site.keep_outs
    if state is None or not areas or status.is_in_workshop:
        return None
    north, east = state.position_ned[:2]
    left_m = min(_to_area_m(np.array(area.corners_m), north, east) for area in areas)
    return left_m - _SIGMAS * _std_m(state)


def _to_area_m(corners: FloatArray, north_m: float, east_m: float) -> float:
    """Return the distance of a point to an outline, shape ``(n, 2)``, negative inside of it."""
    outline = np.vstack((corners, corners[:1]))
    to_edge_m = _to_line_m(outline, north_m, east_m)
    (x0, y0), (x1, y1) = outline[:-1].T, outline[1:].T
    crosses = (y0 <= east_m) != (y1 <= east_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = x0 + (east_m - y0) * (x1 - x0) / (y1 - y0)
    is_inside = int(np.sum(crosses & (north_m < at))) % 2 == 1
    return -to_edge_m if is_inside else to_edge_m


def nearest_robot_m(
    status: RobotStatus, fleet: Iterable[RobotStatus], now: datetime
) -> tuple[str, float] | None:
    """Return the nearest other robot in the same water and its distance in space, m."""
    state, site = status.state, status.record.site
    if state is None or not _is_near_now(status, now):
        return None
    found: list[tuple[str, float]] = []
    for other in fleet:
        if other is status or other.state is None or other.record.site.name != site.name:
            continue
        if _is_near_now(other, now):
            slack_m = _SIGMAS * (_std_m(state) + _std_m(other.state))
            apart_m = math.dist(state.position_ned, other.state.position_ned)
            found.append((other.record.id, max(0.0, apart_m - slack_m)))
    return min(found, key=lambda pair: pair[1], default=None)


def _is_near_now(status: RobotStatus, now: datetime) -> bool:
    state = status.state
    if state is None or not _is_in_open_water(status) or status.record.kind == "recorded":
        return False
    return now - state.received_at <= _HEARD_WITHIN
