"""What the track of a robot tells of the current: its finished dives, and its stays afloat."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np

from autonomy.arrays import evenly_spread, spaced
from autonomy.current.model import Observation
from autonomy.estimation.smoother import Dive, finished_dives
from db.query.current_observations import ReportedFix
from db.query.smoothing import TrackColumns
from robot_link.messages import CurrentReport, RobotId, RobotMode

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
    reports: Sequence[CurrentReport],
    *,
    drift_m_sqrt_s: float,
    subtracts_silently: bool,
) -> Seen:
    """Return what the finished dives of a track tell of the current.

    Args:
        robot: Whose.
        track: What it said of its position, up to a fix.
        fixes: Its reports of the same time.
        reports: What it believed of the current, in order of time.
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
    for dive in finished_dives(time_s, position, std_m):
        if any(
            one.mode in _KEPT_THERE
            for one in fixes
            if dive.end_s <= one.measured_at.timestamp() <= dive.fix_time_s
        ):
            left_out.append("it ended aborted or held")
            continue
        believed = _believed(reports, dive)
        if believed is None:
            if subtracts_silently:
                left_out.append("it reckons with a current that it does not report")
                continue
            believed = (0.0, 0.0)
        mine = np.flatnonzero((time_s >= dive.start_s) & (time_s <= dive.end_s))
        rows = mine[evenly_spread(len(mine), POINTS - 1)]
        times = np.append(time_s[rows], dive.fix_time_s)
        reckoned = np.array([*dive.reckoned_ne_m, position[rows[-1], 2]])
        raw = np.vstack([position[rows], reckoned])
        raw[:, :2] -= (times - dive.start_s)[:, None] * np.array(believed)
        drift = np.array(dive.fix_ne_m) - raw[-1, :2]
        first_std = float(std_m[mine[0]])
        duration_s = dive.fix_time_s - dive.start_s
        found.append(
            Observation(
                robot=robot,
                time_s=times,
                position_ned=raw,
                displacement_ne_m=(float(drift[0]), float(drift[1])),
                walk_std_m=float(np.hypot(first_std, drift_m_sqrt_s * np.sqrt(duration_s))),
                fix_std_m=dive.fix_std_m,
            )
        )
    return Seen(tuple(found), tuple(left_out))


def _believed(reports: Sequence[CurrentReport], dive: Dive) -> tuple[float, float] | None:
    """Return the current with which a robot reckoned a dive, ``None`` if it never said."""
    before = [one for one in reports if one.measured_at.timestamp() <= dive.end_s]
    return before[-1].current_ne_m_s if before else None


@dataclass(slots=True)
class Stay:
    """A stay of one robot at the surface, as far as it was seen."""

    fixes: list[ReportedFix] = field(default_factory=list[ReportedFix])

    def take(self, robot: RobotId, reports: Sequence[ReportedFix]) -> list[Observation]:
        """Take further reports in; return what stays that ended tell of the current."""
        found: list[Observation] = []
        for one in reports:
            if self.fixes and one.measured_at <= self.fixes[-1].measured_at:
                continue
            goes_on = one.has_fix and one.mode in _AFLOAT
            if self.fixes and (not goes_on or self._is_over(one.measured_at)):
                found += self._told(robot)
                self.fixes.clear()
            if goes_on:
                self.fixes = [*self.fixes[:1], one]
        return found

    def _is_over(self, at: datetime) -> bool:
        first, last = self.fixes[0].measured_at, self.fixes[-1].measured_at
        silent_s = (at - last).total_seconds()
        return silent_s > _LONGEST_SILENCE_S or (at - first).total_seconds() > LONGEST_STAY_S

    def _told(self, robot: RobotId) -> list[Observation]:
        first, last = self.fixes[0], self.fixes[-1]
        if (last.measured_at - first.measured_at).total_seconds() < LEAST_STAY_S:
            return []
        drift = (last.north_m - first.north_m, last.east_m - first.east_m)
        place = np.array([[first.north_m, first.east_m, 0.0]] * 2)
        times = np.array([first.measured_at.timestamp(), last.measured_at.timestamp()])
        std_m = max(first.position_std_m, last.position_std_m)
        return [Observation(robot, times, place, drift, 0.0, std_m, is_surface=True)]
