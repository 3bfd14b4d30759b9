"""Pursuit of a target that is known by its range alone: the tracker steers, the tail swims."""

from dataclasses import replace

import numpy as np

from autonomy.tracking.beacon import BeaconFix, BeaconNavigator
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.control.inner_loop import BeatAverage, InnerLoop, Swimming, TailBeat
from autonomy.tracking.control.inner_loop_config import INNER_LOOP_PRESETS
from autonomy.tracking.control.wall import Helm
from autonomy.tracking.phase import TargetPhase
from autonomy.tracking.reading import (
    RangeHeard,
    TrackerReading,
    TrackerStart,
    TrackerStep,
)
from autonomy.tracking.tracker import Tracker
from onboard.flight.hardware import SetPoints
from onboard.flight.level import LevelKeeper
from onboard.flight.maneuver import Flight
from onboard.flight.navigation import Estimate
from onboard.target.ranging import Hearing
from robot_link.messages import RobotMode

_DOUBT_STDS, _DOUBT_M = 2.0, 0.05
"""A robot may be so far outside by its own account before it is: walls hold it back."""
_FLOOR_MARGINS = 1.5
"""It swims so many times as far above the floor as is too near."""
_LEFT_THE_WATER = "the robot left the water in which it may swim"
_NEAR_THE_FLOOR = "the floor is near"


_SEED = 5
"""Of the navigator's random numbers: the same dive is always located alike."""


class GroundMotion:
    """Adds to the velocity through the water what fixes show of the current.

    A target and its ranges know nothing of the water, and an eddy of a tank is as fast as a fifth
    of the robot. Without fixes the last current is kept.

    Args:
        current_time_s: Time over which the current is averaged; as short as the fixes are good.
        period_s: Time between two steps.
    """

    def __init__(self, current_time_s: float, period_s: float) -> None:
        self._share = min(period_s / current_time_s, 1.0)
        self._period_s = period_s
        self._before_ne_m: tuple[float, float] | None = None
        self._current_ne_m_s = (0.0, 0.0)

    def step(self, estimate: Estimate) -> tuple[float, float]:
        """Return the velocity over ground, north and east, m/s."""
        position, through_water = estimate.position_ned[:2], estimate.velocity_ned[:2]
        before = self._before_ne_m
        # what the first fix after a dive corrects is no motion
        self._before_ne_m = position if estimate.has_fix else None
        if before is not None and estimate.has_fix:
            north, east = (
                current + self._share * ((now - then) / self._period_s - water - current)
                for current, now, then, water in zip(
                    self._current_ne_m_s, position, before, through_water, strict=True
                )
            )
            self._current_ne_m_s = (north, east)
        return (
            through_water[0] + self._current_ne_m_s[0],
            through_water[1] + self._current_ne_m_s[1],
        )


class BeaconPosition:
    """Begins with the last fix of each dive, and is given up for the next fix.

    Args:
        config: The mission; its target is the beacon.
    """

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self._navigator: BeaconNavigator | None = None
        self._newest: BeaconFix | None = None
        self._reckoned: Estimate | None = None

    def step(self, ranges: tuple[RangeHeard, ...], dt_s: float) -> None:
        """Let time pass since the estimate that was located, and take in horizontal ranges."""
        reckoned = self._reckoned
        if reckoned is None or reckoned.has_fix:
            self._navigator = self._newest = None
            return
        own, std_m = reckoned.position_ned[:2], reckoned.position_std_m
        if self._navigator is None:
            chance = np.random.default_rng(_SEED)
            self._navigator = BeaconNavigator(self._config, own, std_m, chance)
        self._newest = self._navigator.step(own, std_m, dt_s, ranges)

    def located(self, reckoned: Estimate) -> Estimate:
        """Return an estimate at the beacon's position, if that is the better one.

        Args:
            reckoned: By dead reckoning alone.
        """
        self._reckoned, fix = reckoned, self._newest
        if fix is None or reckoned.has_fix or fix.position_std_m >= reckoned.position_std_m:
            return reckoned
        north, east = fix.position_ne_m
        return replace(
            reckoned,
            position_ned=(north, east, reckoned.depth_m),
            position_std_m=fix.position_std_m,
        )


class Pursuit:
    """Follows a target until the mission's time is over or the track has to be given up.

    Args:
        flight: The robot.
        config: The mission.
        hearing: Its ranges, and its time.
        estimate: Where the robot is.
        period_s: Time between two steps.
    """

    def __init__(
        self,
        flight: Flight,
        config: TrackingConfig,
        hearing: Hearing,
        estimate: Estimate,
        period_s: float,
    ) -> None:
        loops = INNER_LOOP_PRESETS[flight.vehicle.key]
        self._flight = flight
        self._config = config
        self._hearing = hearing
        self._half_step_s = 0.5 * period_s
        self._ground = GroundMotion(loops.current_time_s, period_s)
        self._average = BeatAverage(loops, period_s)
        self._loop = InnerLoop(loops, period_s)
        now = self._swimming(estimate)
        start = TrackerStart(
            estimate.position_ned[:2],
            now.course_rad,
            now.speed_m_s,
            hearing.known_velocity_ne_m_s,
        )
        helm = Helm(loops.hard_turn_rad_s, loops.hard_lag_s, loops.hard_speed_m_s)
        self._tracker = Tracker(config, start, helm)
        self.newest: TrackerStep | None = None
        """What the tracker said last; None before the first step."""
        self.failure = ""
        """Why the mission fails, or ""."""
        self._level = self._new_level(estimate)
        self._beacon = BeaconPosition(config) if config.target.kind == "beacon" else None

    @property
    def mode(self) -> RobotMode:
        """Tracking, or searching for a target that was lost; who teaches does not search."""
        is_lost = self.newest is not None and self.newest.phase is TargetPhase.LOST
        is_searching = is_lost and not self._config.barrier.is_teaching
        return RobotMode.SEARCHING if is_searching else RobotMode.TRACKING

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Take in the ranges that came, and swim on."""
        now = self._swimming(estimate)
        # the tail does not do what is asked of it at once: what it did is measured
        self._tracker.applied((now.turn_rate_rad_s, now.acceleration_m_s2))
        reading = self._reading(estimate, now, self._heard(estimate))
        if self._beacon is not None:
            self._beacon.step(reading.ranges, dt_s)
        wanted = self._tracker.step(reading, dt_s)
        step = self._tracker.keep_inside(wanted, estimate.position_ned[:2], self._flight.site)
        self.newest = step
        self.failure = step.reason or self._trouble(estimate)
        if step.phase is TargetPhase.WAITING:
            return self._flight.pilot.rest()
        turn_rate, acceleration = step.command
        is_turning_away = step is not wanted
        beat = (
            self._loop.turn_hard(turn_rate)
            if is_turning_away
            else self._loop.step(turn_rate, acceleration, now)
        )
        return self._swim(estimate, beat)

    def wait(self, estimate: Estimate, dt_s: float) -> None:
        """Let time pass while the robot does something else: nothing is heard, doubt grows."""
        now = self._swimming(estimate)
        self._tracker.applied((now.turn_rate_rad_s, now.acceleration_m_s2))
        self._tracker.step(self._reading(estimate, now, ()), dt_s)

    def resume(self, estimate: Estimate) -> None:
        """Swim on from where the robot is, and listen again."""
        self._tracker.listen_again()
        self.failure = ""
        self._level = self._new_level(estimate)

    def located(self, estimate: Estimate) -> Estimate:
        """Return the estimate with the position that a beacon's ranges give, if that is better."""
        return estimate if self._beacon is None else self._beacon.located(estimate)

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether the time is over or the track has to be given up."""
        left_s = self._config.motion.duration_s - self._hearing.time_s
        return bool(self.failure) or left_s < self._half_step_s

    def _heard(self, estimate: Estimate) -> tuple[RangeHeard, ...]:
        heard = self._hearing.take(estimate.position_ned[:2], estimate.depth_m)
        return tuple(RangeHeard(one.range_m, one.age_s) for one in heard)

    def _reading(
        self, estimate: Estimate, now: Swimming, ranges: tuple[RangeHeard, ...]
    ) -> TrackerReading:
        return TrackerReading(
            own_ne_m=estimate.position_ned[:2],
            heading_rad=now.course_rad,
            speed_m_s=now.speed_m_s,
            ranges=ranges,
            is_quiet=self._hearing.is_quiet,
            target_velocity_ne_m_s=self._hearing.known_velocity_ne_m_s,
        )

    def _swimming(self, estimate: Estimate) -> Swimming:
        return self._average.step(
            self._ground.step(estimate), estimate.heading_rad, float(estimate.state[11])
        )

    def _trouble(self, estimate: Estimate) -> str:
        """Return why the robot cannot stay here, or ""."""
        site, profile = self._flight.site, self._flight.profile
        north, east, depth = estimate.position_ned
        doubt_m = _DOUBT_STDS * estimate.position_std_m + _DOUBT_M
        if site.clearance_m(north, east) < -doubt_m:
            return _LEFT_THE_WATER
        if self._flight.is_surfaced(estimate):
            return ""
        if depth > float(site.floor_m(north, east)) - profile.floor_margin_m:
            return _NEAR_THE_FLOOR
        return ""

    def _new_level(self, estimate: Estimate) -> LevelKeeper:
        flight = self._flight
        leash_m = flight.profile.depth_leash_m
        return LevelKeeper(flight.vehicle, leash_m, estimate, 2.0 * self._half_step_s)

    def _deepest_m(self, estimate: Estimate) -> float:
        """Return how deep the robot may swim here without coming near the floor."""
        north, east, _ = estimate.position_ned
        floor_m = float(self._flight.site.floor_m(north, east))
        return floor_m - _FLOOR_MARGINS * self._flight.profile.floor_margin_m

    def _swim(self, estimate: Estimate, beat: TailBeat) -> SetPoints:
        wanted_m = min(self._config.motion.depth_m, self._deepest_m(estimate))
        if wanted_m <= 0.0:
            return self._flight.pilot.beat(estimate, beat)
        return self._flight.pilot.beat(estimate, beat, self._level.step(estimate, wanted_m))
