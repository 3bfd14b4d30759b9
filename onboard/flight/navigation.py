"""What the robot believes of itself: attitude, velocity and position from its own readings."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from operator import attrgetter
from typing import Any, Protocol

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.attitude import AttitudeFilter
from autonomy.estimation.config import MODEL_FILTER_PRESETS, EstimatorConfig, ModelFilterConfig
from autonomy.estimation.known_current import TOLD_LEAST_M_S, TOLD_SHARE
from autonomy.estimation.model_filter import ModelFilter
from autonomy.estimation.position_filter import PositionFilter
from autonomy.estimation.velocity_observer import VelocityObserver
from autonomy.frames import TrueNorth
from autonomy.site import Site
from autonomy.vehicle.config import Vehicle
from onboard.flight.depth_zero import ABOVE_MAX_M
from onboard.flight.hardware import Readings, SetPoints

FIX_HOLDS_S = 2.0
_SENSED = tuple(field.name for field in fields(Readings) if field.name != "fix_ne_m")
_sensed: Callable[[Readings], tuple[Any, ...]] = attrgetter(*_SENSED)


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
class Estimate:
    """The robot's belief at one moment."""

    position_ned: tuple[float, float, float]
    position_std_m: float
    """Of the horizontal position, larger axis."""
    velocity_ned: tuple[float, float, float]
    """Through the water, which is all that a robot without a fix knows."""
    state: FloatArray
    """The 12 states of the vehicle model as the controllers take them, shape ``(12,)``."""
    readings: Readings
    course_heading_rad: float
    """Heading averaged over one beat of the tail, whose wiggle no controller should fight."""
    has_fix: bool
    """Whether a fix arrived within the last two seconds."""
    current: CurrentBelief
    """What is believed of the current."""

    @property
    def depth_m(self) -> float:
        """Depth below the surface, never negative."""
        return self.position_ned[2]

    @property
    def heading_rad(self) -> float:
        """Heading, in -pi..pi."""
        return float(self.state[5])

    @property
    def pitch_rad(self) -> float:
        """Pitch, nose up positive."""
        return float(self.state[4])


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
        self._surface_depth_m = config.surface_depth_m
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
        if readings.depth_m < self._surface_depth_m:
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
        velocity_ned = observer.velocity_ned
        position.step(dt_s, velocity_ned, readings.depth_m, readings.fix_ne_m)
        return WaterState(
            position.position_ned,
            position.position_std_m,
            observer.velocity_body,
            velocity_ned,
            CurrentBelief(
                (0.0, 0.0),
                position.doubt * self._steady_current_m_s,
                position.doubt,
                position.dives,
                position.refused_fixes,
            ),
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
            attitude_rad=_angles(readings),
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
        )


class Navigator:
    """Attitude filter and what tells velocity and position, stepped together at 10 Hz.

    A number that is not finite is replaced by the sensor's last good one, a depth above the surface
    by the surface, and a fix that repeats the last one to the last digit is left out: one bad
    message must not end a flight.

    Args:
        config: Method, noise and gains that the filters assume.
        vehicle: Model of the velocity observer or the model filter.
        site: Bounds the first position when there is no fix yet.
        readings: First readings.
        period_s: Time between two steps.
        current: What was learned of the current before; None as when a robot is switched on.

    Raises:
        ValueError: If the first readings are not finite.
    """

    def __init__(
        self,
        config: EstimatorConfig,
        vehicle: Vehicle,
        site: Site,
        readings: Readings,
        period_s: float,
        current: CurrentBelief | None = None,
    ) -> None:
        water = site.water
        unknown_m = math.hypot(water.x_max_m - water.x_min_m, water.y_max_m - water.y_min_m) / 2.0
        centre = (0.5 * (water.x_min_m + water.x_max_m), 0.5 * (water.y_min_m + water.y_max_m))
        fix = readings.fix_ne_m
        if not all(map(math.isfinite, (*_numbers(readings), *(fix or ())))):
            raise ValueError("navigation must begin with finite readings")
        self._north = TrueNorth(site.origin_latitude_deg)
        self._place = fix or centre
        readings = self._in_frame(readings)
        make = ModelTrack if config.method == "model" else ObserverTrack
        self._track: WaterTrack = make(
            config,
            vehicle,
            (*(fix or centre), max(readings.depth_m, 0.0)),
            config.fix_std_m if fix else unknown_m,
            readings,
        )
        if current is not None:
            self._track.begin_with(current)
        self._attitude = AttitudeFilter(_angles(readings), readings.gyro_rad_s)
        self._headings: deque[float] = deque(
            maxlen=round(1.0 / (vehicle.swim.frequency_hz * period_s))
        )
        self._period_s = period_s
        self._since_fix_s = 0.0 if fix else math.inf
        self._good = readings
        self._newest_fix: tuple[float, float] | None = None

    def step(self, readings: Readings, command: SetPoints, time_s: float) -> Estimate:
        """Take in one set of readings.

        Args:
            readings: Sensors at the end of the step.
            command: Set points that were in force during the step.
            time_s: Time at the beginning of the step, on the clock of the tail's beat.
        """
        dt_s = self._period_s
        readings = self._in_frame(self._usable(readings))
        if readings.depth_m < -ABOVE_MAX_M:
            # nobody swims there: the sensor's zero is wrong, and filters would chase it
            readings = replace(readings, depth_m=0.0)
        self._attitude.step(dt_s, _angles(readings), readings.gyro_rad_s)
        now = self._track.step(dt_s, command, time_s, self._attitude, readings)
        self._since_fix_s = 0.0 if readings.fix_ne_m else self._since_fix_s + dt_s
        north, east, down = now.position_ned
        self._place = (north, east)
        position = (north, east, max(down, 0.0))
        attitude, rates = self._attitude.attitude_rad, self._attitude.rates_rad_s
        return Estimate(
            position_ned=position,
            position_std_m=now.position_std_m,
            velocity_ned=now.velocity_ned,
            state=np.concatenate([position, attitude, now.velocity_body, rates]),
            readings=readings,
            course_heading_rad=self._mean_heading(),
            has_fix=self._since_fix_s < FIX_HOLDS_S,
            current=now.current,
        )

    def expect_current(self, current_ne_m_s: tuple[float, float] | None) -> None:
        """Take the current, north and east, that the plan counts on; None without one."""
        self._track.expect_current(current_ne_m_s)

    def _usable(self, readings: Readings) -> Readings:
        """Return the readings without repeated fixes and without numbers that are none."""
        fix = readings.fix_ne_m
        if fix is not None and (fix == self._newest_fix or not np.isfinite(fix).all()):
            fix = None
        self._newest_fix = fix or self._newest_fix
        if fix is not readings.fix_ne_m:
            readings = replace(readings, fix_ne_m=fix)
        if not all(map(math.isfinite, _numbers(readings))):
            readings = _mended(readings, self._good)
        self._good = readings
        return readings

    def _in_frame(self, readings: Readings) -> Readings:
        """Return readings whose heading counts from the frame's north, not from true north."""
        lead_rad = self._north.convergence_rad(*self._place)
        return replace(readings, heading_rad=readings.heading_rad - lead_rad)

    def _mean_heading(self) -> float:
        newest = float(self._attitude.attitude_rad[2])
        self._headings.append(newest)
        wiggle = sum(math.remainder(angle - newest, math.tau) for angle in self._headings)
        return math.remainder(newest + wiggle / len(self._headings), math.tau)


def _angles(readings: Readings) -> tuple[float, float, float]:
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


def _numbers(readings: Readings) -> list[float]:
    """Return every number but the fix."""
    numbers: list[float] = []
    for sensed in _sensed(readings):
        if isinstance(sensed, tuple):
            numbers.extend(sensed)
        else:
            numbers.append(sensed)
    return numbers


def _mended(readings: Readings, good: Readings) -> Readings:
    """Replace each number that is not finite by the one in ``good``."""

    def sound(new: Any, old: Any) -> Any:  # noqa: ANN401 - a number or some of them
        if isinstance(new, tuple):
            return tuple(map(sound, new, old))
        return new if math.isfinite(new) else old

    return replace(
        readings,
        **{name: sound(getattr(readings, name), getattr(good, name)) for name in _SENSED},
    )
