"""What tells a robot's velocity and position in its water, by the method of its settings."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.attitude import AttitudeFilter
from autonomy.estimation.config import (
    ESTIMATOR_PRESETS,
    MODEL_FILTER_PRESETS,
    EstimatorConfig,
    ModelFilterConfig,
)
from autonomy.estimation.known_current import TOLD_LEAST_M_S, TOLD_SHARE
from autonomy.estimation.model_filter import ModelFilter
from autonomy.estimation.position_filter import PositionFilter
from autonomy.estimation.tag_filter import TagFilter, TagFilterConfig
from autonomy.estimation.velocity_observer import VelocityObserver
from autonomy.vehicle.config import Vehicle
from onboard.flight.hardware import Readings, SetPoints


@dataclass(frozen=True, slots=True)
class CurrentBelief:
    """What the robot believes of the water's steady current, and how it fared with its fixes."""

    current_ne_m_s: tuple[float, float]
    """North and east; zero where none is learned."""
    std_m_s: float
    """Of it, larger axis, ``doubt`` counted."""
    doubt: float = 1.0
    """How many times larger the stated standard deviations are than the filter's own."""
    dives: int = 0
    """How many dives that was judged by."""
    fixes_refused: int = 0
    """Fixes that were not believed so far."""

    @property
    def sure_ne_m_s(self) -> tuple[float, float]:
        """What of the current is worth aiming off for, north and east.

        Its uncertainty alone lets a current in still water be believed with the mean square
        ``2 std^2``; the rest is the share of what is believed that is really there.
        """
        north, east = self.current_ne_m_s
        squared = north**2 + east**2
        by_chance = 2.0 * self.std_m_s**2
        share = 1.0 - by_chance / squared if squared > by_chance else 0.0
        return share * north, share * east


@dataclass(frozen=True, slots=True)
class WaterState:
    """Where the robot is and how it moves through the water."""

    position_ned: tuple[float, float, float]
    position_std_m: float
    """Of the horizontal position, larger axis."""
    velocity_body: tuple[float, float, float]
    """Through the water in body axes, m/s."""
    velocity_ned: tuple[float, float, float]
    """Through the water in NED, m/s."""
    current: CurrentBelief
    fix_shift_ne_m: tuple[float, float]
    """How far the newest call's fix moved the position, which is no way that the robot made."""
    heading_rad: float | None = None
    """None where the compass alone tells it."""
    took_pose: bool = False
    """Whether it comes of ``take_pose``, and the filter believed that pose."""


@dataclass(frozen=True, slots=True)
class PoseNow:
    """Where a robot is now by a late fix: what was measured, moved by the way made since."""

    position_ne_m: tuple[float, float]
    heading_rad: float | None
    variance_m2: float
    """Of north and east each, what was lost on the way included; what of it stays from one fix to
    the next does not average out, so nobody becomes surer of the place by it."""
    heading_variance_rad2: float


class WaterTrack(Protocol):
    """What tells position and velocity, from one step to the next."""

    def step(
        self,
        dt_s: float,
        command: SetPoints,
        time_s: float,
        attitude: AttitudeFilter,
        readings: Readings,
    ) -> WaterState:
        """Let ``dt_s`` pass under set points, then take in the readings at its end."""
        ...

    def take_pose(self, pose: PoseNow) -> WaterState:
        """Take in a late fix, after ``step``."""
        ...

    def believe_fixes_to(self, depth_m: float) -> None:
        """Believe fixes of the robot's own sensor where it is not deeper than this."""
        ...

    def expect_current(self, current_ne_m_s: tuple[float, float] | None) -> None:
        """Take what the plan counts on for this dive; None where it tells nothing."""
        ...

    def begin_with(self, current: CurrentBelief) -> None:
        """Begin with a current that was learned before; only before the first step."""
        ...


class ObserverTrack:
    """Velocity observer and position filter, which learn no current.

    Args:
        config: Noise and gains that both assume.
        vehicle: Model of the velocity observer.
        position_ned: First position, m.
        position_std_m: How well it is known.
        readings: First readings.
    """

    def __init__(
        self,
        config: EstimatorConfig,
        vehicle: Vehicle,
        position_ned: tuple[float, float, float],
        position_std_m: float,
        readings: Readings,
    ) -> None:
        usual = ESTIMATOR_PRESETS.get(vehicle.key, EstimatorConfig()).surface_depth_m
        self._dry_depth_m = min(config.surface_depth_m, usual)
        """Less deep, part of the robot may be out of the water."""
        self._steady_current_m_s = config.steady_current_m_s
        self._filter = PositionFilter(config, position_ned, position_std_m)
        self._observer = VelocityObserver(config, vehicle, readings.depth_m)

    def step(
        self,
        dt_s: float,
        command: SetPoints,
        time_s: float,
        attitude: AttitudeFilter,
        readings: Readings,
    ) -> WaterState:
        """Let ``dt_s`` pass under set points, then take in the readings at its end."""
        net_buoyancy = readings.net_buoyancy_kg
        if readings.depth_m < self._dry_depth_m:
            # the air carries no robot: what would lift it out of the water does not accelerate it
            net_buoyancy = max(net_buoyancy, 0.0)
        observer, position = self._observer, self._filter
        observer.step(
            dt_s,
            _packed(command, net_buoyancy),
            time_s,
            attitude_rad=attitude.attitude_rad,
            angular_velocity_rad_s=attitude.rates_rad_s,
            actuators=(net_buoyancy, readings.mass_position_m, readings.tail_rad),
            depth_m=readings.depth_m,
        )
        position.step(dt_s, observer.velocity_ned, readings.depth_m, readings.fix_ne_m)
        return self._state()

    def take_pose(self, pose: PoseNow) -> WaterState:
        """Take in a late fix, after ``step``."""
        took_pose = self._filter.take_late_fix(pose.position_ne_m, pose.variance_m2)
        return self._state(took_pose=took_pose)

    def believe_fixes_to(self, depth_m: float) -> None:
        """Believe fixes of the robot's own sensor where it is not deeper than this."""
        self._filter.surface_depth_m = depth_m

    def _state(self, *, took_pose: bool = False) -> WaterState:
        position, observer = self._filter, self._observer
        return WaterState(
            position.position_ned,
            position.position_std_m,
            observer.velocity_body,
            observer.velocity_ned,
            CurrentBelief(
                (0.0, 0.0),
                position.doubt * self._steady_current_m_s,
                position.doubt,
                position.dives,
                position.refused_fixes,
            ),
            position.fix_shift_ne_m,
            took_pose=took_pose,
        )

    def expect_current(self, current_ne_m_s: tuple[float, float] | None) -> None:
        """Leave it: this robot reckons with no current."""

    def begin_with(self, current: CurrentBelief) -> None:
        """Leave it likewise."""


class ModelTrack:
    """The filter on the vehicle's model, which learns current and ballast error.

    Args:
        config: Noise of depth and fixes, drift and steady current.
        vehicle: Its model.
        position_ned: First position, m.
        position_std_m: How well it is known.
        readings: First readings.
    """

    def __init__(
        self,
        config: EstimatorConfig,
        vehicle: Vehicle,
        position_ned: tuple[float, float, float],
        position_std_m: float,
        readings: Readings,
    ) -> None:
        model = MODEL_FILTER_PRESETS.get(vehicle.key, ModelFilterConfig())
        water = model.current.model_copy(
            update={
                "steady_std_m_s": config.steady_current_m_s,
                "steady_correlation_s": config.current_memory_s,
            }
        )
        self._filter = ModelFilter(
            config,
            model.model_copy(update={"current": water}),
            vehicle,
            position_ned,
            position_std_m,
            attitude_rad=angles_of(readings),
            angular_velocity_rad_s=readings.gyro_rad_s,
            actuators=_actuators(readings),
        )
        self._told_std_m_s = max(TOLD_SHARE * config.steady_current_m_s, TOLD_LEAST_M_S)
        self._expected: tuple[float, float] | None = None

    def expect_current(self, current_ne_m_s: tuple[float, float] | None) -> None:
        """Take what the plan counts on for this dive; None where it tells nothing.

        At the plan's beginning its word counts beside what the robot has learned itself; from dive
        to dive the robot's belief changes as the plan does.
        """
        before, self._expected = self._expected, current_ne_m_s
        if current_ne_m_s is None or current_ne_m_s == before:
            return
        if before is None:
            # a plan from the map of the robot's own dives is no news to one that knows as much
            if self._filter.steady_current_std_m_s > self._told_std_m_s:
                self._filter.hear_current(current_ne_m_s, self._told_std_m_s)
        else:
            north, east = current_ne_m_s
            self._filter.shift_current((north - before[0], east - before[1]))

    def begin_with(self, current: CurrentBelief) -> None:
        """Begin with a current that was learned before; only before the first step."""
        own_std_m_s = current.std_m_s / current.doubt
        self._filter.begin_with_current(current.current_ne_m_s, own_std_m_s, current.doubt)

    def step(
        self,
        dt_s: float,
        command: SetPoints,
        time_s: float,
        attitude: AttitudeFilter,
        readings: Readings,
    ) -> WaterState:
        """Let ``dt_s`` pass under set points, then take in the readings at its end."""
        belief = self._filter
        belief.step(
            dt_s,
            _packed(command, readings.net_buoyancy_kg),
            time_s,
            attitude_rad=attitude.attitude_rad,
            # the smoothed rates lag behind the swing between two glides
            angular_velocity_rad_s=readings.gyro_rad_s,
            actuators=_actuators(readings),
            depth_m=readings.depth_m,
            fix_ne=readings.fix_ne_m,
        )
        return self._state()

    def take_pose(self, pose: PoseNow) -> WaterState:
        """Take in a late fix, after ``step``."""
        took_pose = self._filter.take_late_fix(pose.position_ne_m, pose.variance_m2)
        return self._state(took_pose=took_pose)

    def believe_fixes_to(self, depth_m: float) -> None:
        """Believe fixes of the robot's own sensor where it is not deeper than this."""
        self._filter.surface_depth_m = depth_m

    def _state(self, *, took_pose: bool = False) -> WaterState:
        belief = self._filter
        return WaterState(
            belief.position_ned,
            belief.position_std_m,
            belief.velocity_body,
            belief.velocity_ned,
            CurrentBelief(
                belief.steady_current_ne_m_s,
                belief.steady_current_std_m_s,
                belief.doubt,
                belief.dives,
                belief.refused[0],
            ),
            belief.fix_shift_ne_m,
            took_pose=took_pose,
        )


class TagTrack:
    """Velocity observer, and the filter of poses by cameras, which learns no current.

    Args:
        config: Noise of depth and fixes, and gains of the observer.
        vehicle: Model of the velocity observer.
        position_ned: First position, m.
        position_std_m: How well it is known.
        readings: First readings.
    """

    def __init__(
        self,
        config: EstimatorConfig,
        vehicle: Vehicle,
        position_ned: tuple[float, float, float],
        position_std_m: float,
        readings: Readings,
    ) -> None:
        self._steady_current_m_s = config.steady_current_m_s
        self._surface_depth_m = config.surface_depth_m
        self._fix_variance_m2 = config.fix_std_m**2
        tags = TagFilterConfig(depth_std_m=config.depth_std_m)
        self._filter = TagFilter(tags, position_ned, position_std_m, readings.heading_rad)
        self._observer = VelocityObserver(config, vehicle, readings.depth_m)

    def step(
        self,
        dt_s: float,
        command: SetPoints,
        time_s: float,
        attitude: AttitudeFilter,
        readings: Readings,
    ) -> WaterState:
        """Let ``dt_s`` pass under set points, then take in the readings at its end."""
        self._observer.step(
            dt_s,
            _packed(command, readings.net_buoyancy_kg),
            time_s,
            attitude_rad=attitude.attitude_rad,
            angular_velocity_rad_s=attitude.rates_rad_s,
            actuators=_actuators(readings),
            depth_m=readings.depth_m,
        )
        angles, rates = np.array(angles_of(readings)), np.array(readings.gyro_rad_s)
        self._filter.step(dt_s, readings.depth_m, angles, rates)
        fix = readings.fix_ne_m
        if fix is None or readings.depth_m > self._surface_depth_m:
            return self._state((0.0, 0.0))
        variance = self._fix_variance_m2
        shift = self._filter.take_pose(fix, None, (variance, 0.0), least_m2=0.0)
        return self._state(shift or (0.0, 0.0))

    def take_pose(self, pose: PoseNow) -> WaterState:
        """Take in a late fix, after ``step``."""
        variances = (pose.variance_m2, pose.heading_variance_rad2)
        told = pose.position_ne_m, pose.heading_rad
        shift = self._filter.take_pose(*told, variances, least_m2=pose.variance_m2)
        return self._state(shift or (0.0, 0.0), took_pose=shift is not None)

    def believe_fixes_to(self, depth_m: float) -> None:
        """Believe fixes of the robot's own sensor where it is not deeper than this."""
        self._surface_depth_m = depth_m

    def _state(self, shift_ne_m: tuple[float, float], *, took_pose: bool = False) -> WaterState:
        position, observer = self._filter, self._observer
        return WaterState(
            position.position_ned,
            position.position_std_m,
            observer.velocity_body,
            observer.velocity_ned,
            CurrentBelief((0.0, 0.0), self._steady_current_m_s, fixes_refused=position.refused),
            shift_ne_m,
            position.heading_rad,
            took_pose,
        )

    def expect_current(self, current_ne_m_s: tuple[float, float] | None) -> None:
        """Leave it: this robot reckons with no current."""

    def begin_with(self, current: CurrentBelief) -> None:
        """Leave it likewise."""


TRACKS = {"model": ModelTrack, "position": ObserverTrack, "tags": TagTrack}
"""By the method of ``EstimatorConfig``."""


def angles_of(readings: Readings) -> tuple[float, float, float]:
    """Return roll, pitch and heading."""
    return readings.roll_rad, readings.pitch_rad, readings.heading_rad


def _actuators(readings: Readings) -> tuple[float, float, float]:
    return readings.net_buoyancy_kg, readings.mass_position_m, readings.tail_rad


def _packed(command: SetPoints, net_buoyancy_kg: float) -> FloatArray:
    """Return set points as ``extended_kernel.advance`` takes them, shape ``(5,)``."""
    return np.array(
        [
            net_buoyancy_kg,
            command.mass_position_m,
            command.tail_rad,
            command.tail_amplitude_rad,
            command.tail_frequency_hz,
        ]
    )
