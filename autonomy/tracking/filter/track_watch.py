"""Tells how a track stands: its phase, what is wrong, and when and why it is given up."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.phase import TargetPhase

STANDING_REACH_M = 0.05
"""A robot that stays within this distance of one place for ``lost_after_s`` stands."""
LEAST_RANGES = 8
"""So many ranges at least tell how fast the distance grows."""
CONVINCING = 3
"""Ranges in a row after which a lost track is believed to be found."""
SCATTER = 3.0
"""Ranges that stray by more than so many times their variance lie on no line."""
LOOK_S = 1.0
"""How often the growth of the distance is looked at."""
SURE = 3.0
"""Standard deviations by which a distance must grow too fast for the target to be left alone."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """What one step tells of the track."""

    own_ne_m: tuple[float, float]
    is_own_measured: bool
    """Whether heading and speed were measured."""
    is_quiet: bool
    """Whether the robot was told not to ping."""
    newest_range: tuple[float, float] | None
    """When the newest good range held, s since the beginning, and the range, m."""
    silence_s: float
    """Time since a range was believed."""
    streak: int
    """Ranges believed since one was rejected or they failed."""
    is_searching: bool
    """Whether the ranges contradicted the estimate, and none has taken its place."""


class TrackWatch:
    """Phase of one track. Time is what the steps add up to.

    Args:
        config: After which silence a track coasts, is lost and is given up.
    """

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self._now_s = 0.0
        self._phase = TargetPhase.WAITING
        self._lost_for_s = 0.0
        self._unmeasured_s = 0.0
        self._anchor: tuple[float, float] | None = None
        self._stood_s = 0.0
        self._ranges: deque[tuple[float, float, float, float]] = deque()
        self._next_look_s = 0.0
        self._reason = ""
        self._note = ""

    @property
    def phase(self) -> TargetPhase:
        """Where the robot stands with its target."""
        return self._phase

    @property
    def reason(self) -> str:
        """Why the track ended; empty before."""
        return self._reason

    @property
    def note(self) -> str:
        """What is wrong; empty while nothing is."""
        return self._note

    def step(self, dt_s: float, evidence: Evidence) -> None:
        """Let time pass and judge."""
        self._now_s += dt_s
        if self._phase is TargetPhase.ENDED:
            return
        self._watch_own(dt_s, evidence)
        self._note_range(evidence)
        self._note = self._wrong(evidence)
        self._lost_for_s = self._lost_for_s + dt_s if self._phase is TargetPhase.LOST else 0.0
        self._give_up()

    def _wrong(self, evidence: Evidence) -> str:
        """Set the phase and return what is wrong."""
        ranging = self._config.ranging
        if evidence.newest_range is None:
            self._phase = TargetPhase.WAITING
            quiet = "the robot was told not to ping; " if evidence.is_quiet else ""
            return f"{quiet}no range of the target was heard yet"
        was_lost = self._phase is TargetPhase.LOST
        self._phase = TargetPhase.LOST
        if evidence.silence_s > ranging.lost_after_s:
            return _silent(evidence)
        if evidence.is_searching:
            return "the ranges contradict what was believed of the target"
        if self._stood_s > ranging.lost_after_s:
            return "the robot stands, and from one place a range tells no direction"
        if self._unmeasured_s > ranging.lost_after_s:
            return f"heading and speed were not measured for {self._unmeasured_s:.0f} s"
        if was_lost and evidence.streak < CONVINCING:
            return "ranges came back, too few of them to be sure"
        self._phase = TargetPhase.COASTING
        if evidence.silence_s > ranging.coast_after_s:
            return _silent(evidence)
        if self._unmeasured_s > ranging.coast_after_s:
            return f"heading and speed were not measured for {self._unmeasured_s:.0f} s"
        self._phase = TargetPhase.TRACKING
        return ""

    def _watch_own(self, dt_s: float, evidence: Evidence) -> None:
        self._unmeasured_s = 0.0 if evidence.is_own_measured else self._unmeasured_s + dt_s
        anchor = self._anchor
        is_held = anchor is not None and math.dist(anchor, evidence.own_ne_m) < STANDING_REACH_M
        if self._phase is TargetPhase.WAITING or not is_held:
            self._anchor, self._stood_s = evidence.own_ne_m, 0.0
        else:
            self._stood_s += dt_s

    def _note_range(self, evidence: Evidence) -> None:
        newest = evidence.newest_range
        if newest is None or (self._ranges and newest[0] <= self._ranges[-1][0]):
            return
        self._ranges.append((*newest, *evidence.own_ne_m))
        while newest[0] - self._ranges[0][0] > self._config.ranging.lost_after_s:
            self._ranges.popleft()

    def _growth_m_s(self) -> tuple[float, float]:
        """Return how fast the distance grows, and how fast the robot went away meanwhile.

        The growth is what it is at least, by ``SURE`` standard deviations. A distance that jumps or
        scatters does not grow. The robot's own way counts, not its estimated speed, which a filter
        that diverges bends to its ranges.
        """
        heard = np.array(self._ranges)
        if len(heard) < LEAST_RANGES:
            return 0.0, 0.0
        span = float(heard[-1, 0] - heard[0, 0])
        if span < 0.5 * self._config.ranging.lost_after_s:
            return 0.0, 0.0
        since = heard[:, 0] - heard[:, 0].mean()
        total = float(since @ since)
        slope = float(since @ heard[:, 1]) / total
        residual = heard[:, 1] - heard[:, 1].mean() - slope * since
        noise = float(residual @ residual) / len(heard)
        if noise > SCATTER * self._config.ranging.variance_m2:
            return 0.0, 0.0
        noise = max(noise, self._config.ranging.variance_m2)
        away = float(np.hypot(*(heard[:, 2:] - heard[0, 2:]).T).max())
        return slope - SURE * math.sqrt(noise / total), away / span

    def _outrun_by_m_s(self) -> float:
        """Return the speed of a target that is faster than the robot, 0 where it is not for sure.

        The distance grows by no more than robot and target move together. What the filter estimates
        does not count: a robot that chases a misplaced estimate hears nothing against it.
        """
        if self._now_s < self._next_look_s:
            return 0.0
        self._next_look_s = self._now_s + LOOK_S
        most = self._config.motion.speed_max_m_s
        growth, own = self._growth_m_s()
        return growth - own if growth - own > most else 0.0

    def _give_up(self) -> None:
        ranging, most = self._config.ranging, self._config.motion.speed_max_m_s
        given_up = ranging.give_up_after_s
        speed = self._outrun_by_m_s()
        if speed > 0.0:
            self._reason = (
                f"the target is faster than the robot: {speed:.2f} m/s against {most:.2f} m/s"
            )
        elif self._phase is TargetPhase.WAITING and self._now_s > given_up:
            self._reason = f"no range of the target was heard in {given_up:.0f} s"
        elif self._lost_for_s > given_up:
            self._reason = f"track lost for {given_up:.0f} s: {self._note}"
        if self._reason:
            self._phase, self._note = TargetPhase.ENDED, ""


def _silent(evidence: Evidence) -> str:
    quiet = "the robot was told not to ping; " if evidence.is_quiet else ""
    return f"{quiet}no range was believed for {evidence.silence_s:.0f} s"
