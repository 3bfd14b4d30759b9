"""One filter on the vehicle's model: position, velocity, current and ballast error together.

Where dead reckoning only knows that the water moves, this filter learns how: the fix that ends a
dive, or a stay at the surface that is long enough to tell (``telling_stay_s``), says how far the
water carried the robot, and the depth says how much lighter or heavier it is than the pump's
feedback does. The attitude is an input, as the thesis's observer takes it, so that no Euler angle
is ever averaged.
"""

import math
from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation import model_kernel as kernel
from autonomy.estimation.config import EstimatorConfig, ModelFilterConfig
from autonomy.estimation.fix_watch import SHORTEST_DIVE_S, FixGate, FixWatch, Verdict
from autonomy.estimation.known_current import UNTOLD
from autonomy.estimation.telling_stay import telling_stay_s
from autonomy.frames import rotation_ned_from_body
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.surroundings import Surroundings

LONGEST_STEP_S = 0.1
"""Longest Runge-Kutta step of the filter's model."""
LONGEST_SILENCE_S = 5.0
"""After a longer time without readings nothing but a widened covariance is claimed."""
_FIRST_SPEED_STD_M_S = 0.05
FASTEST_CURRENT_STDS = 4.0
"""The robot may move over ground by its own speed and a current of so many standard deviations."""
_HORIZONTAL = [kernel.NORTH, kernel.EAST]


class ModelFilter:
    """Square-root unscented filter on the equations of motion with a current and a ballast error.

    The model's coefficients may be wrong by what ``config.model_error`` says; the filter learns how
    far as it learns the ballast error.

    What it states of position and current is ``doubt`` times larger than its covariance, by what
    the fixes of the last dives said of that (``FixWatch``). A fix that lies too far off is refused;
    when ``fix_patience`` in a row agree they are believed, and the current is doubted as far as it
    would have to have been another to explain them.

    Args:
        estimator: Noise of depth and fixes, the eddies' drift, and how deep a fix is believed.
        config: Noise of everything else.
        vehicle: Its model.
        position_ned: Position at the beginning, m.
        position_std_m: How well the horizontal position is known, per axis.
        attitude_rad: Roll, pitch and heading at the beginning, shape ``(3,)``.
        angular_velocity_rad_s: In body axes at the beginning, shape ``(3,)``.
        actuators: Net mass kg, sliding mass m and tail rad at the beginning, shape ``(3,)``.

    Raises:
        ValueError: If a number is not finite.
    """

    def __init__(
        self,
        estimator: EstimatorConfig,
        config: ModelFilterConfig,
        vehicle: Vehicle,
        position_ned: Sequence[float],
        position_std_m: float,
        *,
        attitude_rad: Sequence[float] | FloatArray,
        actuators: Sequence[float] | FloatArray,
        angular_velocity_rad_s: Sequence[float] | FloatArray = (0.0, 0.0, 0.0),
    ) -> None:
        self._estimator = estimator
        self._config = config
        self._packed = vehicle.packed()
        self._pump_rate_kg_s = vehicle.limits.m0_rate_kg_s
        self._still_water = Surroundings().packed()
        self._noise = process_noise(estimator, config)
        self._x, self._S = first_belief(estimator, config, position_ned, position_std_m)
        self._S[kernel.STEADY_NORTH : kernel.EDDY_NORTH] *= UNTOLD
        self._attitude = np.array(attitude_rad, dtype=np.float64)
        self._rates = np.array(angular_velocity_rad_s, dtype=np.float64)
        self._actuators = np.array(actuators, dtype=np.float64)
        measured = (*self._attitude, *self._rates, *self._actuators)
        if not np.isfinite([*self._x, *self._S.ravel(), *measured]).all():
            raise ValueError("the model filter must begin with finite numbers")
        self._refused_depths = np.zeros(2)
        self._newest_fix: tuple[float, float] | None = None
        self._watch = FixWatch(estimator.doubt)
        self._gate = FixGate(
            config.outlier.limit,
            config.outlier.fix_patience,
            config.greatest_speed_m_s + FASTEST_CURRENT_STDS * config.current.steady_std_m_s,
            estimator.fix_std_m,
        )
        self._believed_fix: tuple[float, float] | None = None
        self._since_fix_s = 0.0
        self._stay_s = 0.0
        """How long fixes have come one after the other."""
        self._telling_stay_s = telling_stay_s(estimator, config.current.steady_std_m_s)
        self._doubt = self._watch.doubt
        self._fix_shift_m = (0.0, 0.0)
        self.surface_depth_m = estimator.surface_depth_m
        """Deeper than this, a fix of ``step`` is not believed."""

    @property
    def position_ned(self) -> tuple[float, float, float]:
        """Estimated position, m."""
        x = self._x.tolist()
        return (x[kernel.NORTH], x[kernel.EAST], x[kernel.DEPTH])

    @property
    def fix_shift_ne_m(self) -> tuple[float, float]:
        """How far the last fix of ``step`` or ``take_late_fix`` moved the position; 0 without."""
        return self._fix_shift_m

    @property
    def velocity_body(self) -> tuple[float, float, float]:
        """Velocity through the water in body axes, m/s."""
        forward, starboard, down = self._x[kernel.FORWARD : kernel.BIAS].tolist()
        return (forward, starboard, down)

    @property
    def velocity_ned(self) -> tuple[float, float, float]:
        """Velocity through the water in NED, m/s."""
        rotation = rotation_ned_from_body(*self._attitude.tolist())
        north, east, down = (rotation @ self._x[kernel.FORWARD : kernel.BIAS]).tolist()
        return (north, east, down)

    @property
    def steady_current_ne_m_s(self) -> tuple[float, float]:
        """The part of the current that stays, north and east."""
        north, east = self._x[kernel.STEADY_NORTH : kernel.EDDY_NORTH].tolist()
        return (north, east)

    @property
    def steady_current_std_m_s(self) -> float:
        """Standard deviation of that part along its worst direction."""
        across = self._S[kernel.STEADY_NORTH : kernel.EDDY_NORTH]
        return self._doubt * math.sqrt(float(np.linalg.eigvalsh(across @ across.T)[-1]))

    @property
    def doubt(self) -> float:
        """How many times larger than its covariance the filter states its deviations to be."""
        return self._doubt

    @property
    def dives(self) -> int:
        """How many dives that is judged by."""
        return self._watch.dives

    @property
    def buoyancy_bias_kg(self) -> float:
        """What the feedback of the net buoyancy says too much."""
        return float(self._x[kernel.BIAS])

    @property
    def covariance(self) -> FloatArray:
        """Covariance in the order of ``model_kernel``'s indices, shape ``(14, 14)``."""
        return self._S @ self._S.T

    @property
    def position_covariance(self) -> FloatArray:
        """Covariance of northing and easting with its doubt, shape ``(2, 2)``, m2."""
        across = self._doubt * self._S[kernel.NORTH : kernel.EAST + 1]
        return across @ across.T

    @property
    def position_std_m(self) -> float:
        """Standard deviation of the horizontal position along its worst direction, m."""
        return math.sqrt(float(np.linalg.eigvalsh(self.position_covariance)[-1]))

    @property
    def refused(self) -> tuple[int, int]:
        """How many fixes and depths were refused as outliers so far."""
        return self._gate.refused, int(self._refused_depths[1])

    def step(
        self,
        dt_s: float,
        command: FloatArray,
        time_s: float,
        *,
        attitude_rad: Sequence[float] | FloatArray,
        angular_velocity_rad_s: Sequence[float] | FloatArray,
        actuators: Sequence[float] | FloatArray,
        depth_m: float,
        fix_ne: tuple[float, float] | None = None,
    ) -> None:
        """Let ``dt_s`` pass under a command, then take in what is measured at its end.

        A fix that repeats the last one to the last digit brings nothing new; a fix deeper than
        ``surface_depth_m`` is not believed.

        Args:
            dt_s: Time since the last step, s; positive.
            command: In force during that time, shape ``(5,)``; only the tail's part matters.
            time_s: Time at its beginning, on the clock of the tail's flap.
            attitude_rad: Roll, pitch and heading.
            angular_velocity_rad_s: In body axes.
            actuators: Net mass kg, sliding mass m, tail angle rad.
            depth_m: From the pressure sensor.
            fix_ne: Northing and easting from outside, or ``None``.

        Raises:
            ValueError: If ``dt_s`` is not positive or a measurement is not finite; nothing has
                changed then.
        """
        attitude, rates, inside = (
            np.array(measured, dtype=np.float64)
            for measured in (attitude_rad, angular_velocity_rad_s, actuators)
        )
        numbers = (dt_s, time_s, *attitude, *rates, *inside, depth_m, *command, *(fix_ne or ()))
        if not (dt_s > 0.0 and np.isfinite(numbers).all()):
            raise ValueError("the model filter needs dt > 0 and finite measurements")
        if dt_s > LONGEST_SILENCE_S:
            self._lose_sight(dt_s)
        else:
            self._predict(dt_s, command, time_s, inside)
        self._since_fix_s += dt_s
        self._stay_s += dt_s
        self._notice_trim(dt_s, inside)
        self._attitude, self._rates, self._actuators = attitude, rates, inside
        self._take_depth(depth_m)
        self._fix_shift_m = (0.0, 0.0)
        if fix_ne is None or fix_ne == self._newest_fix:
            return
        self._newest_fix = fix_ne
        if depth_m <= self.surface_depth_m:
            self._take_fix(fix_ne, self._estimator.fix_std_m)

    def take_late_fix(self, fix_ne: tuple[float, float], variance_m2: float) -> bool:
        """Take in a fix that says of itself how sure it is, after ``step``.

        Args:
            fix_ne: Northing and easting now: what was measured, moved by the way made since.
            variance_m2: Of that per axis, what was lost on that way included. Fixes that follow
                each other have most of their error in common, so that it does not average out: no
                axis becomes surer by a fix than the fix is.

        Returns:
            Whether it was believed.
        """
        self._fix_shift_m = (0.0, 0.0)
        least = np.minimum((self._S[_HORIZONTAL] ** 2).sum(axis=1), variance_m2)  # (2,)
        if not self._take_fix(fix_ne, math.sqrt(variance_m2)):
            return False
        known = (self._S[_HORIZONTAL] ** 2).sum(axis=1)  # (2,)
        if (known < least).any():
            std = np.zeros(kernel.STATES)
            std[_HORIZONTAL] = np.sqrt(np.maximum(least - known, 0.0))
            kernel.widen(self._S, std)
        return True

    def begin_with_current(
        self, current_ne_m_s: tuple[float, float], std_m_s: float, doubt: float
    ) -> None:
        """Begin with a steady current that was learned before; only before the first step.

        Args:
            current_ne_m_s: North and east.
            std_m_s: Of it per axis, the doubt not counted.
            doubt: How many times larger all deviations are to be stated, 1 or more.
        """
        steady = slice(kernel.STEADY_NORTH, kernel.EDDY_NORTH)
        self._x[steady] = current_ne_m_s
        self._S[steady] = 0.0
        self._S[steady, steady] = std_m_s * np.eye(2)
        self._watch.begin_with(doubt)
        self._doubt = self._watch.doubt

    def hear_current(self, current_ne_m_s: tuple[float, float], std_m_s: float) -> None:
        """Take somebody's word of the steady current, north and east, for what it is worth."""
        for axis, told in enumerate(current_ne_m_s):
            state = kernel.STEADY_NORTH + axis
            kernel.measure(self._x, self._S, state, told - self._x[state], std_m_s**2)

    def shift_current(self, change_ne_m_s: tuple[float, float]) -> None:
        """Let the steady current be another by a change, half of which is doubted."""
        steady = slice(kernel.STEADY_NORTH, kernel.EDDY_NORTH)
        self._x[steady] += change_ne_m_s
        std = np.zeros(kernel.STATES)
        std[steady] = 0.5 * np.abs(change_ne_m_s)
        kernel.widen(self._S, std)

    def _predict(
        self, dt_s: float, command: FloatArray, time_s: float, actuators: FloatArray
    ) -> None:
        during = self._actuators.copy()
        during[0] = 0.5 * (self._actuators[0] + actuators[0])
        kernel.predict(
            self._x,
            self._S,
            dt_s,
            command,
            time_s,
            self._attitude,
            self._rates,
            during,
            self._packed,
            self._still_water,
            self._noise,
            math.ceil(dt_s / LONGEST_STEP_S),
        )

    def _take_depth(self, depth_m: float) -> None:
        outlier = self._config.outlier
        kernel.measure_depth(
            self._x,
            self._S,
            depth_m,
            self._estimator.depth_std_m**2,
            outlier.limit,
            outlier.patience,
            self._refused_depths,
        )

    def _take_fix(self, fix_ne: tuple[float, float], std_m: float) -> bool:
        """Judge a fix, and take it in if it is believed; return whether it was."""
        before = self._x[_HORIZONTAL].copy()
        innovation = np.array(fix_ne) - before
        variance = std_m**2
        across = self._S[_HORIZONTAL]
        covariance = across @ across.T + variance * np.eye(2)
        squared = float(innovation @ np.linalg.solve(covariance, innovation))
        since_s = self._since_fix_s
        away_m = 0.0 if self._believed_fix is None else math.dist(fix_ne, self._believed_fix)
        verdict = self._gate.judge(fix_ne, squared / self._doubt**2, away_m, since_s, std_m)
        if verdict is Verdict.REFUSED:
            return False
        if since_s >= SHORTEST_DIVE_S and self._believed_fix is not None:
            self._watch.take(squared, 1.0 - self._share_of_current(covariance))
            self._doubt = self._watch.doubt
        if verdict is Verdict.REOPENED:
            self._doubt_itself(float(np.hypot(*innovation)), since_s)
        if since_s >= SHORTEST_DIVE_S:
            self._stay_s = 0.0
        tells_current = since_s >= SHORTEST_DIVE_S or self._stay_s >= self._telling_stay_s
        kernel.take_fix(
            self._x, self._S, np.array(fix_ne, dtype=np.float64), variance, tells_current
        )
        self._believed_fix, self._since_fix_s = fix_ne, 0.0
        north, east = (self._x[_HORIZONTAL] - before).tolist()
        self._fix_shift_m = (north, east)
        return True

    def _share_of_current(self, covariance: FloatArray) -> float:
        """Return which part of a fix's expected distance comes from not knowing the current."""
        steady = self._S[kernel.STEADY_NORTH : kernel.EDDY_NORTH]
        own = (steady**2).sum(axis=1)  # (2,)
        both = (self._S[_HORIZONTAL] * steady).sum(axis=1)  # (2,)
        explained = np.divide(both**2, own, out=np.zeros(2), where=own > 0.0)
        return float(np.mean(explained / np.diag(covariance)))

    def _doubt_itself(self, off_m: float, since_s: float) -> None:
        """Doubt position and current, each so far that it alone explains where the fixes lie."""
        rows = np.zeros((kernel.STATES + 4, kernel.STATES))
        rows[: kernel.STATES] = self._S.T
        for i in range(2):
            rows[kernel.STATES + i, kernel.NORTH + i] = off_m
            if since_s >= SHORTEST_DIVE_S:
                rows[kernel.STATES + 2 + i, kernel.NORTH + i] = off_m
                rows[kernel.STATES + 2 + i, kernel.STEADY_NORTH + i] = off_m / since_s
        self._S[:] = kernel.triangular(rows)

    def _notice_trim(self, dt_s: float, actuators: FloatArray) -> None:
        """Doubt the ballast error when the feedback jumps farther than the pump can go.

        That is a new trim, or a sensor set anew: what was learned of its error holds no longer.
        """
        jump = abs(actuators[0] - self._actuators[0]) - self._pump_rate_kg_s * dt_s
        if jump > 2.0 * self._config.buoyancy_bias_kg:
            std = np.zeros(kernel.STATES)
            std[kernel.BIAS] = jump
            kernel.widen(self._S, std)

    def _lose_sight(self, dt_s: float) -> None:
        """Let a silence pass: the robot may be anywhere that its speed and the water allow."""
        first, S = first_belief(self._estimator, self._config, self.position_ned, 0.0)
        current = self._config.current
        first[kernel.BIAS : kernel.NORTH] = self._x[kernel.BIAS : kernel.NORTH]
        first[kernel.STEADY_NORTH : kernel.EDDY_NORTH] = self.steady_current_ne_m_s
        way = dt_s * np.array(self.steady_current_ne_m_s)
        first[kernel.NORTH : kernel.EAST + 1] += way
        reach = dt_s * math.hypot(self._config.greatest_speed_m_s, current.steady_std_m_s)
        lost = [kernel.DEPTH, kernel.FORWARD, kernel.STARBOARD, kernel.DOWN]
        lost += [kernel.EDDY_NORTH, kernel.EDDY_EAST]
        std = np.zeros(kernel.STATES)
        std[lost] = np.diag(S)[lost]
        std[[kernel.DEPTH, kernel.NORTH, kernel.EAST]] = reach
        known = self._S.T.copy()
        known[:, lost] = 0.0
        self._x[:] = first
        self._S[:] = kernel.triangular(known)
        kernel.widen(self._S, std)


def first_belief(
    estimator: EstimatorConfig,
    config: ModelFilterConfig,
    position_ned: Sequence[float],
    position_std_m: float,
) -> tuple[FloatArray, FloatArray]:
    """Return estimate ``(14,)`` and factor ``(14, 14)`` of a robot about which little is known."""
    x = np.zeros(kernel.STATES)
    x[[kernel.NORTH, kernel.EAST, kernel.DEPTH]] = position_ned
    current = config.current
    std = np.zeros(kernel.STATES)
    std[kernel.DEPTH] = estimator.depth_std_m
    std[kernel.FORWARD : kernel.BIAS] = _FIRST_SPEED_STD_M_S
    std[kernel.BIAS] = config.buoyancy_bias_kg
    std[kernel.DRAG : kernel.NORTH] = config.model_error
    std[[kernel.NORTH, kernel.EAST]] = position_std_m
    std[kernel.STEADY_NORTH : kernel.EDDY_NORTH] = current.steady_std_m_s
    std[kernel.EDDY_NORTH :] = current.eddy_std_m_s(estimator.drift_m_sqrt_s)
    return x, np.diag(std)


def process_noise(estimator: EstimatorConfig, config: ModelFilterConfig) -> FloatArray:
    """Return the process noise as ``model_kernel`` indexes it, shape ``(13,)``."""
    current = config.current
    return np.array(
        [
            config.acceleration_density,
            config.rate_noise_rad_sqrt_s,
            config.heading_std_rad,
            config.tilt_std_rad,
            config.attitude_correlation_s,
            current.steady_std_m_s,
            current.steady_correlation_s,
            current.eddy_std_m_s(estimator.drift_m_sqrt_s),
            current.eddy_correlation_s,
            config.buoyancy_bias_kg,
            config.buoyancy_correlation_s,
            config.model_error,
            config.model_error_correlation_s,
        ]
    )
