"""What the track of a robot tells of the current: its finished dives, and its stays afloat."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from autonomy.arrays import FloatArray, evenly_spread, spaced
from autonomy.current.model import Observation
from autonomy.estimation.config import EstimatorConfig
from autonomy.estimation.smoother import finished_dives
from autonomy.estimation.telling_stay import telling_stay_s
from db.query.measured.current_observations import ReportedFix
from db.query.measured.smoothing import TrackColumns
from robot_link.messages import RobotId, RobotMode

POINTS = 31
"""Points of a track that are kept of a dive."""
LEAST_STAY_S = 60.0
"""A shorter stay at the surface tells less of the current than its fixes hide."""
LONGEST_STAY_S = 1800.0
"""A longer one is told piece by piece."""
_CLOSEST_S = 0.25
"""Points of a track closer than this give no speed."""
_LONGEST_SILENCE_S = 120.0
_KEPT_THERE = frozenset((RobotMode.HOLDING, RobotMode.ABORTING))
"""A fix taken so did not end a dive that was left to the water."""
_AFLOAT = frozenset((RobotMode.IDLE, RobotMode.SURFACED))
"""So a robot is left to the water."""


@dataclass(frozen=True, slots=True)
class Seen:
    """What a piece of track told."""

    observations: tuple[Observation, ...]
    left_out: tuple[str, ...]
    """Why dives were not counted, in words."""


def dives_seen(
    robot: RobotId,
    track: TrackColumns,
    fixes: Sequence[ReportedFix],
    beliefs: FloatArray,
    *,
    drift_m_sqrt_s: float,
    subtracts_silently: bool,
) -> Seen:
    """Return what the finished dives of a track tell of the current.

    Args:
        robot: Whose.
        track: What it said of its position, up to a fix.
        fixes: Its reports of the same time.
        beliefs: What it believed of the current, see ``finished_dives``.
        drift_m_sqrt_s: Growth of its dead reckoning's error without any current.
        subtracts_silently: Whether a robot that never said what current it believes reckons with
            one all the same; its dives are left out then.
    """
    time_s = track.measured_at_us.astype(np.float64) * 1e-6
    line = spaced(time_s, _CLOSEST_S)
    time_s, position = time_s[line], track.position_ned[line]
    std_m = track.position_std_m[line]
    found: list[Observation] = []
    left_out: list[str] = []
    for dive in finished_dives(time_s, position, std_m, beliefs):
        if any(
            one.mode in _KEPT_THERE
            for one in fixes
            if dive.end_s <= one.measured_at.timestamp() <= dive.fix_time_s
        ):
            left_out.append("it ended aborted or held")
            continue
        if subtracts_silently and not dive.is_belief_told:
            left_out.append("it reckons with a current that it does not report")
            continue
        mine = np.flatnonzero((time_s >= dive.start_s) & (time_s <= dive.end_s))
        rows = mine[evenly_spread(len(mine), POINTS - 1)]
        times = np.append(time_s[rows], dive.fix_time_s)
        reckoned = np.array([*dive.reckoned_ne_m, position[rows[-1], 2]])
        raw = np.vstack([position[rows], reckoned])
        raw[:, :2] -= (times - dive.start_s)[:, None] * np.array(dive.believed_ne_m_s)
        first_std = float(std_m[mine[0]])
        found.append(
            Observation(
                robot=robot,
                time_s=times,
                position_ned=raw,
                displacement_ne_m=dive.drift_ne_m,
                walk_std_m=math.hypot(first_std, drift_m_sqrt_s * math.sqrt(dive.duration_s)),
                fix_std_m=dive.fix_std_m,
            )
        )
    return Seen(tuple(found), tuple(left_out))


@dataclass(frozen=True, slots=True)
class Stay:
    """A stay of one robot at the surface, as far as it was seen: its first and its last fix."""

    fixes: tuple[ReportedFix, ...] = ()

    def with_reports(
        self, robot: RobotId, reports: Sequence[ReportedFix], estimator: EstimatorConfig
    ) -> tuple["Stay", tuple[Observation, ...]]:
        """Return the stay after further reports, and what stays that ended tell of the current.

        Args:
            robot: Whose.
            reports: Further ones, in order of time; those that are known already change nothing.
            estimator: Says how eddies and fixes hide the current from a stay.
        """
        fixes, found = self.fixes, list[Observation]()
        for one in reports:
            if fixes and one.measured_at <= fixes[-1].measured_at:
                continue
            goes_on = one.has_fix and one.mode in _AFLOAT
            if fixes and (not goes_on or _is_over(fixes, one.measured_at)):
                found += _told(robot, fixes, estimator)
                fixes = ()
            if goes_on:
                fixes = (*fixes[:1], one)
        return Stay(fixes), tuple(found)


def _is_over(fixes: tuple[ReportedFix, ...], at: datetime) -> bool:
    first, last = fixes[0].measured_at, fixes[-1].measured_at
    silent_s = (at - last).total_seconds()
    return silent_s > _LONGEST_SILENCE_S or (at - first).total_seconds() > LONGEST_STAY_S


def _told(
    robot: RobotId, fixes: tuple[ReportedFix, ...], estimator: EstimatorConfig
) -> list[Observation]:
    first, last = fixes[0], fixes[-1]
    duration_s = (last.measured_at - first.measured_at).total_seconds()
    telling_s = telling_stay_s(estimator, estimator.steady_current_m_s)
    if duration_s < max(LEAST_STAY_S, telling_s):
        return []
    drift = (last.north_m - first.north_m, last.east_m - first.east_m)
    place = np.array([[first.north_m, first.east_m, 0.0]] * 2)
    times = np.array([first.measured_at.timestamp(), last.measured_at.timestamp()])
    walk_m = estimator.drift_m_sqrt_s * math.sqrt(duration_s)
    std_m = max(first.position_std_m, last.position_std_m)
    return [Observation(robot, times, place, drift, walk_m, std_m, is_surface=True)]
