"""Where a robot samples if it flies legs: a few flights ahead by the compiled program on board.

Legs are a promise that no robot keeps to the metre; beside water that is known well, a metre is
what a plan gains or loses.
"""

import importlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.edge import POINT_DOWN, POINT_STD
from autonomy.planner.plan import Candidate, Leg
from autonomy.vehicle.trim import TrimConfig
from robot_link.dry_run import DRY_RUN, DryRun, DryRunProblem, DryRunTrack
from robot_link.mission import Mission, MissionSettings

FLIGHTS = 8
"""Of each plan; both meet the same water and the same noise."""
_SURE = 1e-6


def flown(
    pattern: DryRunProblem,
    config: PlannerConfig,
    candidate: Candidate,
    is_cancelled: Callable[[], bool],
) -> list[FloatArray]:
    """Return where flights of a trajectory sample, as the robot itself believes.

    Args:
        pattern: Robot and water that they are flown in; its mission gives the trim.
        config: What the trajectory was planned with.
        candidate: What is flown.
        is_cancelled: Asked between two flights.

    Returns:
        Of each flight that came to anything, points of shape ``(m, 5)`` like planned ones.
    """
    module, _, name = DRY_RUN.partition(":")
    fly: Callable[..., DryRun] = getattr(importlib.import_module(module), name)
    problem = replace(
        pattern,
        mission=_mission(pattern, config, candidate.legs, candidate.duration_s),
        planned_points=candidate.points,
        runs=1,
    )
    found: list[FloatArray] = []
    for number in range(FLIGHTS):
        if is_cancelled():
            break
        one = replace(problem, seed=pattern.seed + number)
        track = fly(one, _tell_nobody, is_cancelled).track
        if len(track.time_s) > 1:
            found.append(points_of(track, config.primitives.point_interval_s))
    return found


def points_of(track: DryRunTrack, interval_s: float) -> FloatArray:
    """Return the samples of a flight as planned points are written: a dive ends at depth 0."""
    moments = np.arange(track.time_s[0], track.time_s[-1], interval_s)
    taken = np.unique(np.searchsorted(track.time_s, moments))
    points = np.column_stack([track.time_s, track.believed_ned, track.stated_std_m])[taken]
    points[:, POINT_DOWN] = np.maximum(points[:, POINT_DOWN], 0.0)
    ends = np.flatnonzero(np.diff(points[:, POINT_STD]) < -_SURE)
    points[ends, POINT_DOWN] = 0.0
    return points


def _mission(
    pattern: DryRunProblem, config: PlannerConfig, legs: tuple[Leg, ...], duration_s: float
) -> Mission:
    settings = pattern.mission.settings
    trim = TrimConfig(
        net_buoyancy_offset_kg=settings.net_buoyancy_offset_kg,
        mass_position_offset_m=settings.mass_position_offset_m,
    )
    return Mission.from_legs(
        MissionSettings.of(config, trim, legs[0].start_ned, duration_s),
        legs,
        onboard=pattern.mission.onboard,
    )


def _tell_nobody(share: float) -> None:
    """Leave out how far a single flight is."""
    del share
