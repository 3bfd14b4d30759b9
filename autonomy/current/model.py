r"""The current of a water as a Gaussian process of what the fixes of its robots reveal.

A dive goes from a fix to the next. Its robot believed the track :math:`q(t)` without a current, so
the fix tells the integral of the current along the true track,

.. math:: d = \int u(r(t))\,dt + w, \qquad \mathrm{Cov}(w) = (\kappa^2 s_q^2 + s_f^2) I,

which is linear in the current. The integral is a sum over midpoints of equal times.

Source:
    Lee, Zhang and others 2019; Russo and others 2022 (occupation kernels) have this map's mean.
"""

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
from scipy.linalg import cho_solve, solve_triangular

from autonomy.arrays import FloatArray
from autonomy.current.belief import Belief
from autonomy.current.config import CurrentMapConfig
from autonomy.current.kernel import (
    BASIN_STD,
    CHANGING_STD,
    EDDY_STD,
    SHEAR_STD,
    Functionals,
    at_points,
    cross_gram,
    factor_of,
    gram_of,
    joined,
    packed,
    prior_blocks,
)
from autonomy.current.table import TABLE_SHAPE, FlowRecord
from autonomy.current.told import ToldCurrent
from autonomy.estimation.config import FASTEST_CURRENT_M_S
from autonomy.site import Box

MIDPOINTS = 6
"""Points of the sum that stands for the integral along a dive."""
FEWEST = 3
"""Observations from which a map tells more than its prior."""
_LIVES = 5.0
"""What is older than so many memories tells nothing."""
_TRACK_ROUNDS = 2
_CARRIAGE_ROUNDS = 3
_CARRIAGE_POINTS = 24


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """What a dive, or a stay at the surface, told of the current."""

    robot: str
    time_s: FloatArray
    """Ascending times, shape ``(n,)``, s; the first and the last are those of the two fixes."""
    position_ned: FloatArray
    """Where the robot believed to be then without any current, shape ``(n, 3)``, m."""
    displacement_ne_m: tuple[float, float]
    """Last fix less where the robot believed to be, north and east."""
    walk_std_m: float
    """Standard deviation, per axis, of what dead reckoning was wrong by without any current; of a
    stay, of what eddies displaced it by."""
    fix_std_m: float
    """Standard deviation of the last fix, per axis."""
    is_surface: bool = False
    """Whether it is a stay at the surface, which tells of the current there."""

    @property
    def duration_s(self) -> float:
        """Time between the two fixes, s."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def current_ne_m_s(self) -> tuple[float, float]:
        """Mean current along the track, north and east."""
        north, east = self.displacement_ne_m
        return north / self.duration_s, east / self.duration_s

    @property
    def key(self) -> tuple[str, float, float]:
        """What tells it from all others."""
        return self.robot, float(self.time_s[0]), float(self.time_s[-1])

    def fault(self) -> str | None:
        """Return why it cannot be, in words; None if it can."""
        numbers = (*self.displacement_ne_m, self.walk_std_m, self.fix_std_m)
        if not (np.isfinite(numbers).all() and np.isfinite(self.position_ned).all()):
            return "its numbers are not finite"
        if len(self.time_s) < 2 or not np.all(np.diff(self.time_s) > 0.0):
            return "its times do not ascend"
        if math.hypot(*self.displacement_ne_m) > FASTEST_CURRENT_M_S * self.duration_s:
            return f"no current is faster than {FASTEST_CURRENT_M_S:g} m/s"
        return None

    def functional(self) -> Functionals:
        """Return the integral that was observed, along the track as the fixes bend it."""
        share = (self.time_s - self.time_s[0]) / self.duration_s
        track = self.position_ned.copy()
        track[:, :2] += share[:, None] * np.array(self.displacement_ne_m)
        return integral_along(self.time_s, track)


class Taking(Enum):
    """What became of an observation."""

    TAKEN = "taken"
    REPEATED = "repeated"
    DOUBTED = "doubted"
    """Taken with the error that the map finds in it."""
    REFUSED = "refused"


@dataclass(frozen=True, slots=True)
class Appended:
    """What became of an observation, and why."""

    taking: Taking
    text: str = ""
    """A sentence for a person where it was doubted or refused."""


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """The current at points."""

    mean_ne_m_s: FloatArray
    """Shape ``(n, 2)``."""
    cov_m2_s2: FloatArray
    """Shape ``(n, 2, 2)``."""


@dataclass(frozen=True, slots=True, eq=False)
class Displacement:
    """How far the water carries something along a track."""

    mean_ne_m: FloatArray
    """Shape ``(2,)``."""
    cov_m2: FloatArray
    """Shape ``(2, 2)``."""

    @property
    def std_m(self) -> float:
        """Standard deviation along the axis where it is greatest."""
        return math.sqrt(max(float(np.linalg.eigvalsh(self.cov_m2)[-1]), 0.0))


def integral_along(
    time_s: FloatArray, position_ned: FloatArray, points: int = MIDPOINTS
) -> Functionals:
    """Return the integral of the current along a track, as a sum over midpoints of equal times."""
    duration_s = float(time_s[-1] - time_s[0])
    at_s = time_s[0] + (np.arange(points) + 0.5) * (duration_s / points)
    row = np.empty((1, points, 4))
    for axis in range(3):
        row[0, :, axis] = np.interp(at_s, time_s, position_ned[:, axis])
    row[0, :, 3] = at_s
    return Functionals(row, np.full((1, points), duration_s / points))


class CurrentMap:
    """What is known of the current of one water. Not for several threads at once.

    Args:
        config: What the current is like before anything was seen.
        latitude_deg: Of the water, for a current that turns with the earth.
        learned: What the dives taught of ``config``, if they did (``learning.learn``).
    """

    def __init__(
        self,
        config: CurrentMapConfig,
        latitude_deg: float = 0.0,
        learned: CurrentMapConfig | None = None,
    ) -> None:
        self.config = config
        self.latitude_deg = latitude_deg
        self._origin_s: float | None = None
        self._observations: list[Observation] = []
        self._functionals: list[Functionals] = []
        self._prior = np.zeros((0, 0))
        self._factor = np.zeros((0, 0))
        self._alpha = np.zeros(0)
        self._fitted: list[Functionals] = []
        """What the last good factor is of."""
        self._belief: Belief | None = None
        self._set(learned)

    def _set(self, learned: CurrentMapConfig | None) -> None:
        self.learned = learned
        self._parameters = packed(learned or self.config, self.latitude_deg)
        self._walk_factor = (learned or self.config).walk_factor

    @property
    def observations(self) -> tuple[Observation, ...]:
        """What the map is made of, in the order of their ends."""
        return tuple(self._observations)

    @property
    def told(self) -> ToldCurrent | None:
        """What somebody tells of the current besides."""
        return None if self._belief is None else self._belief.told

    @property
    def belief(self) -> float:
        """How far the dives let one believe what is told, 0 to 1; 0 where nothing is."""
        return 0.0 if self._belief is None else self._belief.share

    def tell(self, told: ToldCurrent | None) -> None:
        """Take what somebody tells of the current: the mean where dives do not tell otherwise."""
        self._belief = None if told is None else Belief(told)
        self._fit()

    def is_told(self, time_s: float) -> bool:
        """Tell whether somebody tells of the current at a moment, s since the epoch."""
        told = self.told
        return told is not None and told.field.from_s <= time_s <= told.field.until_s

    @property
    def oldest_s(self) -> float:
        """Time of the oldest observation's end; inf without any."""
        return min((float(one.time_s[-1]) for one in self._observations), default=math.inf)

    @property
    def newest_s(self) -> float:
        """Time of the newest observation's end; -inf without any."""
        return max((float(one.time_s[-1]) for one in self._observations), default=-math.inf)

    def append(self, observation: Observation) -> Appended:
        """Take an observation in; one that the map finds hard to believe with its own error."""
        fault = observation.fault()
        if fault is not None:
            return Appended(Taking.REFUSED, f"The dive tells nothing of the current: {fault}.")
        if any(one.key == observation.key for one in self._observations):
            return Appended(Taking.REPEATED)
        appended = Appended(Taking.TAKEN)
        error_m = self._strangeness(observation)
        if error_m is not None:
            observation = replace(observation, fix_std_m=error_m)
            appended = Appended(
                Taking.DOUBTED,
                f"The dive drifted {error_m:.1f} m from what the map of the current expected;"
                " it counts little.",
            )
        before = self.copy()
        self._insert(observation)
        self._forget()
        if not self._fit():
            self.__dict__.update(before.__dict__)
            text = "The dive cannot be told from others that the map is made of."
            return Appended(Taking.REFUSED, text)
        return appended

    @classmethod
    def of(
        cls,
        observations: Sequence[Observation],
        config: CurrentMapConfig,
        latitude_deg: float = 0.0,
        learned: CurrentMapConfig | None = None,
    ) -> "CurrentMap":
        """Return the map of observations that were taken before, in the order of their ends."""
        made = cls(config, latitude_deg, learned)
        if observations:
            made._origin_s = float(observations[0].time_s[0])
            made._observations = list(observations)
            made._functionals = [made._shifted(one.functional()) for one in observations]
            made.relearned(learned)
            made._forget()
            made._fit()
        return made

    def copy(self) -> "CurrentMap":
        """Return a map of the same observations, which later ones of this map do not change."""
        copy = CurrentMap(self.config, self.latitude_deg, self.learned)
        copy._origin_s = self._origin_s
        copy._observations = list(self._observations)
        copy._functionals = list(self._functionals)
        copy._prior, copy._factor, copy._alpha = self._prior, self._factor, self._alpha
        copy._fitted = list(self._fitted)
        copy._belief = self._belief
        return copy

    def relearned(self, learned: CurrentMapConfig | None) -> None:
        """Take what the dives taught, and make the map anew."""
        self._set(learned)
        if self._functionals:
            self._prior = gram_of(joined(self._functionals), self._parameters)
        self._fit()

    def flow(self, points: FloatArray) -> Flow:
        """Return the current at points, shape ``(n, 4)``: north, east, depth, m, and time, s."""
        functionals = self._shifted(at_points(np.asarray(points, dtype=np.float64)))
        mean, cov = self._condition(functionals)
        return Flow(mean, cov)

    def flow_over_depth(self, north_east_m: FloatArray, depth_m: FloatArray, time_s: float) -> Flow:
        """Return the mean current over depths at places, shape ``(n, 2)``, at a moment."""
        points = np.empty((len(north_east_m), len(depth_m), 4))
        points[..., :2] = north_east_m[:, None, :]
        points[..., 2] = depth_m
        points[..., 3] = time_s
        weights = np.full(points.shape[:2], 1.0 / len(depth_m))
        return Flow(*self._condition(self._shifted(Functionals(points, weights))))

    def mean_flow(self, points: FloatArray) -> FloatArray:
        """Return the mean current at points, shape ``(n, 2)``; quicker than ``flow``."""
        return self._joint_mean(self._shifted(at_points(points)))

    def tide(self, points: FloatArray) -> FloatArray:
        """Return the mean of the tidal part of the current at points, shape ``(n, 2)``."""
        parameters = self._parameters.copy()
        parameters[[BASIN_STD, EDDY_STD, CHANGING_STD, SHEAR_STD]] = 0.0
        return self._mean(self._shifted(at_points(points)), parameters)

    def prior_std_m_s(self) -> float:
        """Return the standard deviation of the current, per axis, where nothing was seen."""
        prior = prior_blocks(at_points(np.zeros((1, 4))), self._parameters)[0]
        return math.sqrt(float(np.trace(prior)) / 2.0)

    def displacement(
        self, time_s: FloatArray, position_ned: FloatArray, noise_variance_m2: float = 0.0
    ) -> Displacement:
        """Return how far the water carries a robot that believes to fly a track without a current.

        Args:
            time_s: Ascending times of the believed track, shape ``(n,)``, s.
            position_ned: The believed track, shape ``(n, 3)``, m.
            noise_variance_m2: Variance per axis, m², of what no current explains: the walk of dead
                reckoning (times the walk factor squared) and the fixes.
        """
        share = ((time_s - time_s[0]) / (time_s[-1] - time_s[0]))[:, None]
        track = position_ned.copy()
        for _ in range(_TRACK_ROUNDS):
            mean = self._joint_mean(self._shifted(integral_along(time_s, track)))
            track[:, :2] = position_ned[:, :2] + share * mean
        found, cov = self._condition(self._shifted(integral_along(time_s, track)))
        return Displacement(found[0], cov[0] + noise_variance_m2 * np.eye(2))

    def carriage(
        self, place_ned: tuple[float, float, float], from_s: float, to_s: float
    ) -> Displacement:
        """Return how far the water at a place is carried until another moment, earlier or later.

        The way is the mean one, at the depth of the place; the covariance is that of the current's
        integral along it. Nothing to carry, no way and no doubt.
        """
        if from_s == to_s:
            return Displacement(np.zeros(2), np.zeros((2, 2)))
        count = _CARRIAGE_POINTS
        step_s = (to_s - from_s) / count
        points = np.empty((count, 4))
        points[:, :3] = place_ned
        points[:, 3] = from_s + (np.arange(count) + 0.5) * step_s
        for _ in range(_CARRIAGE_ROUNDS):
            way = self.mean_flow(points) * step_s  # (count, 2)
            points[:, :2] = np.array(place_ned[:2]) + np.cumsum(way, axis=0) - 0.5 * way
        functional = Functionals(points[None], np.full((1, count), step_s))
        mean, cov = self._condition(self._shifted(functional))
        return Displacement(mean[0], cov[0])

    def walk_variance_m2(self, drift_m_sqrt_s: float, duration_s: float) -> float:
        """Return what dead reckoning walks in a dive without any current, per axis."""
        return (self._walk_factor * drift_m_sqrt_s) ** 2 * duration_s

    def _strangeness(self, observation: Observation) -> float | None:
        """Return the error of a dive that the map cannot believe, m; None if it can."""
        if len(self._observations) < FEWEST:
            return None
        mean, cov = self._condition(self._shifted(observation.functional()))
        error = np.array(observation.displacement_ne_m) - mean[0]
        cov = cov[0] + self._noise(observation) * np.eye(2)
        surprise = float(error @ np.linalg.solve(cov, error))
        return float(np.hypot(*error)) if surprise > self.config.gate else None

    def _noise(self, one: Observation) -> float:
        """Return the variance per axis of what was observed, m²."""
        walked = (self._walk_factor * one.walk_std_m) ** 2
        return walked + (2.0 if one.is_surface else 1.0) * one.fix_std_m**2

    def _insert(self, observation: Observation) -> None:
        """Put an observation in its place in time, with its row of the prior covariance."""
        if self._origin_s is None:
            self._origin_s = float(observation.time_s[0])
        own = self._shifted(observation.functional())
        ends = [float(one.time_s[-1]) for one in self._observations]
        at = int(np.searchsorted(ends, float(observation.time_s[-1]), side="right"))
        self._observations.insert(at, observation)
        self._functionals.insert(at, own)
        cross = cross_gram(own, joined(self._functionals), self._parameters)  # (2, 2n)
        size = 2 * len(self._observations)
        others = np.r_[0 : 2 * at, 2 * at + 2 : size]
        prior = np.empty((size, size))
        prior[np.ix_(others, others)] = self._prior
        prior[2 * at : 2 * at + 2] = cross
        prior[:, 2 * at : 2 * at + 2] = cross.T
        self._prior = prior

    def _forget(self) -> None:
        """Drop what is too old to tell anything, and what is more than the map may hold."""
        used = self.learned or self.config
        oldest_s = self.newest_s - _LIVES * max(used.basin_memory_s, used.eddy_memory_s)
        drop = sum(float(one.time_s[-1]) < oldest_s for one in self._observations)
        drop = max(drop, len(self._observations) - self.config.dives_max)
        if drop > 0:
            del self._observations[:drop], self._functionals[:drop]
            self._prior = self._prior[2 * drop :, 2 * drop :]

    def _fit(self) -> bool:
        """Factor the covariance of what was observed; False, and no change, if it has no factor."""
        noise = np.repeat(np.array([self._noise(one) for one in self._observations]), 2)
        factor = factor_of(self._prior + np.diag(noise))
        if factor is None:
            return False
        told = np.array([one.displacement_ne_m for one in self._observations]).ravel()
        self._factor = factor
        self._alpha = cho_solve((factor, True), told, check_finite=False)
        self._fitted = list(self._functionals)
        if self._belief is not None:
            self._belief = self._belief.fitted(
                self._fitted, told, self._prior, noise, self.prior_std_m_s(), self._origin_s or 0.0
            )
        return True

    def _shifted(self, functionals: Functionals) -> Functionals:
        """Count times from the first observation, so that no digits are lost."""
        points = functionals.points.copy()
        points[..., 3] -= self._origin_s or 0.0
        return Functionals(points, functionals.weights)

    def _mean(self, wanted: Functionals, parameters: FloatArray) -> FloatArray:
        if not self._fitted:
            return np.zeros((len(wanted), 2))
        cross = cross_gram(wanted, joined(self._fitted), parameters)  # (2p, 2n)
        return (cross @ self._alpha).reshape(-1, 2)

    def _joint_mean(self, wanted: Functionals) -> FloatArray:
        if self._belief is None:
            return self._mean(wanted, self._parameters)
        return self._condition(wanted)[0]

    def _condition(self, wanted: Functionals) -> tuple[FloatArray, FloatArray]:
        """Return mean ``(p, 2)`` and covariance ``(p, 2, 2)`` of functionals."""
        mean, cov = self._own(wanted)
        if self._belief is None:
            return mean, cov
        return self._belief.joint(wanted, mean, cov, self._parameters, self._origin_s or 0.0)

    def _own(self, wanted: Functionals) -> tuple[FloatArray, FloatArray]:
        """Return what the dives alone tell of functionals."""
        prior = prior_blocks(wanted, self._parameters)
        if not self._fitted:
            return np.zeros((len(wanted), 2)), prior
        cross = cross_gram(joined(self._fitted), wanted, self._parameters)  # (2n, 2p)
        mean = (cross.T @ self._alpha).reshape(-1, 2)
        known = solve_triangular(self._factor, cross, lower=True, check_finite=False)
        known = known.reshape(len(known), -1, 2)  # (2n, p, 2)
        return mean, prior - np.einsum("npi,npj->pij", known, known)


def tabulate(
    known: CurrentMap,
    domain: Box,
    from_s: float,
    until_s: float,
    shape: tuple[int, int, int, int] = TABLE_SHAPE,
) -> FlowRecord:
    """Return the mean current of a map over a domain and a time.

    Args:
        known: The map.
        domain: Where.
        from_s: From when, s; the table's own time 0.
        until_s: Until when, s.
        shape: Points north, east, down and in time, at least two each.
    """
    low = (domain.x_min_m, domain.y_min_m, 0.0)
    high = (domain.x_max_m, domain.y_max_m, domain.depth_max_m)
    until_s = max(until_s, from_s + 1.0)
    ends = zip((*low, from_s), (*high, until_s), shape, strict=True)
    axes = [np.linspace(a, b, count) for a, b, count in ends]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 4)
    values: Any = known.mean_flow(grid).astype("<f4")
    return FlowRecord(
        shape=shape,
        low=low,
        high=high,
        from_s=from_s,
        duration_s=until_s - from_s,
        dives=sum(not one.is_surface for one in known.observations),
        values=base64.b64encode(values.tobytes()).decode(),
    )
