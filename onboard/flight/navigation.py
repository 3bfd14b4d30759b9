"""What the robot believes of itself: attitude, velocity and position from its own readings."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from operator import attrgetter
from typing import Any, Final

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.attitude import AttitudeFilter
from autonomy.estimation.config import MODEL_FILTER_PRESETS, EstimatorConfig, ModelFilterConfig
from autonomy.frames import TrueNorth
from autonomy.site import Site
from autonomy.vehicle.config import Vehicle
from onboard.flight.depth_zero import ABOVE_MAX_M
from onboard.flight.hardware import Readings, SetPoints
from onboard.flight.outside_fix import FixSource, LateFix
from onboard.flight.water_track import (
    TRACKS,
    CurrentBelief,
    PoseNow,
    WaterState,
    WaterTrack,
    angles_of,
)

FIX_HOLDS_S = 2.0
WAY_KEPT_S: Final = 3.0
"""So far back the robot knows where it was; no fix is taken that is older than half of it."""
_SENSED = tuple(field.name for field in fields(Readings) if field.name != "fix_ne_m")
_sensed: Callable[[Readings], tuple[Any, ...]] = attrgetter(*_SENSED)


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
    """Whether a fix counted within the last two seconds."""
    fixed_by: FixSource | None
    """Who told the newest of those that counted; None without one."""
    current: CurrentBelief
    """What is believed of the current."""

    @property
    def is_by_cameras(self) -> bool:
        """Whether somebody who sees the robot, or its own camera, told that fix."""
        return self.fixed_by in (FixSource.CAMERAS, FixSource.OWN_CAMERA)

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


class OwnWay:
    """The way that a robot made of late, by its own reckoning; corrections by fixes are no way.

    Args:
        period_s: Time between two steps.
    """

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._corrected = np.zeros(2)
        self._steps: deque[FloatArray] = deque(maxlen=round(WAY_KEPT_S / period_s) + 1)
        """North, east, depth and heading at the end of each step, the newest last."""

    def add(self, ne_m: tuple[float, float], depth_m: float, heading_rad: float) -> None:
        """Note where the robot believes to be, as its depth sensor and its compass say it."""
        north, east = np.subtract(ne_m, self._corrected).tolist()
        self._steps.append(np.array([north, east, depth_m, heading_rad]))

    def correct(self, shift_ne_m: tuple[float, float]) -> None:
        """Note that a fix moves the position of the step that is added next."""
        self._corrected += shift_ne_m

    def since(self, age_s: float) -> FloatArray:
        """Return how far the robot went since a moment of the last seconds.

        Args:
            age_s: How long ago it was; before the first step it stood still.

        Returns:
            North, east, down and the turn, shape ``(4,)``, m and rad.
        """
        newest = len(self._steps) - 1
        place = max(0.0, newest - age_s / self._period_s)
        before = min(math.floor(place), max(newest - 1, 0))
        after = min(before + 1, newest)
        share = place - before
        went = share * (self._steps[newest] - self._steps[after])
        went += (1.0 - share) * (self._steps[newest] - self._steps[before])
        # a heading that passed from pi to -pi has turned by little
        turns = [self._steps[newest][3] - self._steps[k][3] for k in (after, before)]
        went[3] = share * math.remainder(turns[0], math.tau)
        went[3] += (1.0 - share) * math.remainder(turns[1], math.tau)
        return went


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
        self._track: WaterTrack = TRACKS[config.method](
            config,
            vehicle,
            (*(fix or centre), max(readings.depth_m, 0.0)),
            config.fix_std_m if fix else unknown_m,
            readings,
        )
        if current is not None:
            self._track.begin_with(current)
        self._attitude = AttitudeFilter(angles_of(readings), readings.gyro_rad_s)
        self._headings: deque[float] = deque(
            maxlen=round(1.0 / (vehicle.swim.frequency_hz * period_s))
        )
        self._period_s = period_s
        self._way = OwnWay(period_s)
        self._drift_m2_s = config.drift_m_sqrt_s**2
        water = MODEL_FILTER_PRESETS.get(vehicle.key, ModelFilterConfig()).current
        self._eddy_s = water.eddy_correlation_s
        self._fixed_by = FixSource.SENSOR
        self._since_fix_s = 0.0 if fix else math.inf
        self._good = readings
        self._newest_fix: tuple[float, float] | None = None

    def step(
        self,
        readings: Readings,
        command: SetPoints,
        time_s: float,
        late: LateFix | None = None,
    ) -> Estimate:
        """Take in one set of readings.

        Args:
            readings: Sensors at the end of the step.
            command: Set points that were in force during the step.
            time_s: Time at the beginning of the step, on the clock of the tail's beat.
            late: A fix that came during the step, measured some time ago.
        """
        dt_s = self._period_s
        readings = self._in_frame(self._usable(readings))
        if readings.depth_m < -ABOVE_MAX_M:
            # nobody swims there: the sensor's zero is wrong, and filters would chase it
            readings = replace(readings, depth_m=0.0)
        self._attitude.step(dt_s, angles_of(readings), readings.gyro_rad_s)
        now = self._track.step(dt_s, command, time_s, self._attitude, readings)
        self._since_fix_s = 0.0 if readings.fix_ne_m else self._since_fix_s + dt_s
        if readings.fix_ne_m:
            self._fixed_by = FixSource.SENSOR
        now = self._taken_late(now, readings, late)
        north, east, down = now.position_ned
        self._place = (north, east)
        position = (north, east, max(down, 0.0))
        attitude, rates = self._attitude.attitude_rad.copy(), self._attitude.rates_rad_s
        if now.heading_rad is not None:
            attitude[2] = now.heading_rad
        return Estimate(
            position_ned=position,
            position_std_m=now.position_std_m,
            velocity_ned=now.velocity_ned,
            state=np.concatenate([position, attitude, now.velocity_body, rates]),
            readings=readings,
            course_heading_rad=self._mean_heading(float(attitude[2])),
            has_fix=(has_fix := self._since_fix_s < FIX_HOLDS_S),
            fixed_by=self._fixed_by if has_fix else None,
            current=now.current,
        )

    def _taken_late(self, now: WaterState, readings: Readings, late: LateFix | None) -> WaterState:
        """Note the step's way, and take in a late fix moved by the way made since it was measured.

        ``z' = fix + p(now) - p(then)``, ``R = P_fix + drift^2 age min(1, age / tau)``: the drift is
        what eddies add up to; within their memory ``tau`` they carry the robot steadily, and less
        far. Fixes that follow each other have most of that way, and of what cameras do not know of
        themselves, in common: no filter becomes surer by a fix than ``R``.
        """
        north, east, _ = now.position_ned
        heading_rad = float(self._attitude.attitude_rad[2])
        self._way.correct(now.fix_shift_ne_m)
        self._way.add((north, east), readings.depth_m, heading_rad)
        if late is None:
            return now
        fix, age_s, went = late.fix, late.age_s, self._way.since(late.age_s)
        lost_m2 = self._drift_m2_s * age_s * min(1.0, age_s / self._eddy_s)
        north, east = np.add(fix.ned_m[:2], went[:2]).tolist()
        heading = None if fix.heading_rad is None else fix.heading_rad + float(went[3])
        now = self._track.take_pose(
            PoseNow(
                position_ne_m=(north, east),
                heading_rad=heading,
                variance_m2=fix.variance_m2 + lost_m2,
                heading_variance_rad2=fix.heading_std_rad**2,
            )
        )
        self._way.correct(now.fix_shift_ne_m)
        if now.took_pose:
            self._since_fix_s, self._fixed_by = 0.0, late.by
        return now

    def believe_fixes_to(self, depth_m: float) -> None:
        """Believe fixes of the robot's own sensor where it is not deeper than this."""
        self._track.believe_fixes_to(depth_m)

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

    def _mean_heading(self, newest: float) -> float:
        self._headings.append(newest)
        wiggle = sum(math.remainder(angle - newest, math.tau) for angle in self._headings)
        return math.remainder(newest + wiggle / len(self._headings), math.tau)


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
