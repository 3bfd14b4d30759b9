"""Where a robot is of which nothing was heard for a while, and how surely: mean and covariance.

Frames: north, east (and down) of the water's own frame, m; times in seconds. Nothing here is what a
robot said; all of it is predicted from its last word.

Model. A robot afloat without a mission goes with the water: a current that stays, ``u``, an
Ornstein-Uhlenbeck process of stationary deviation ``S`` and memory ``T`` as the robot's own filter
takes it to be (Uhlenbeck and Ornstein 1930), and a random walk of ``q`` m/s^0.5. A robot that flies
a plan keeps to the plan's expected track by its own reckoning; the truth leaves that by the error
of dead reckoning since its last fix, by what it flies beside its track, and along the track by how
well the time is known at which it passes each point.
"""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray

CHI_SQUARED_90 = -2.0 * math.log(0.1)
"""Of two degrees of freedom: squared distance, in standard deviations, that holds 90 of 100."""
_NODES, _MASSES = np.polynomial.hermite_e.hermegauss(7)
_WEIGHTS = _MASSES / _MASSES.sum()
_WRONG_SHARE = 0.05
"""How often what is believed of a current is not within its stated error at all: it turned, or was
told of another place. Then it is as unknown as before any fix."""
_CALIBRATION_PRIOR = 8.0
"""Predictions that the stated model counts for, beside those that fixes have judged."""
_WORST_CALIBRATION, _BEST_CALIBRATION = 4.0, 0.5
_MOST_SQUARED = 25.0
"""One prediction that was farther off, in standard deviations squared, counts no more."""


@dataclass(frozen=True, slots=True)
class WaterBelief:
    """What is believed of the current that carries a robot."""

    current_ne_m_s: tuple[float, float]
    std_m_s: float
    """Standard deviation per axis of the believed current, when it was told."""
    unknown_std_m_s: float
    """``S``: standard deviation per axis of a current of which nobody has told."""
    memory_s: float
    """``T``: what is told is believed for so long."""
    walk_m_sqrt_s: float
    """``q``: growth of the error of dead reckoning, and of a float in eddies, per axis."""

    def carried_ne_m(self, age_s: float) -> tuple[float, float]:
        """Return how far the believed current carries in a time, m: ``u T (1 - exp(-t/T))``."""
        reach_s = -self.memory_s * math.expm1(-age_s / self.memory_s)
        return self.current_ne_m_s[0] * reach_s, self.current_ne_m_s[1] * reach_s

    def variance_m2(self, age_s: float) -> float:
        r"""Return the variance per axis of how far the water carries in a time, m^2.

        With :math:`a = t / T`, the integral of an Ornstein-Uhlenbeck process known to ``s`` at
        first has :math:`s^2 T^2 (1 - e^{-a})^2 + S^2 T^2 (2a - 3 + 4 e^{-a} - e^{-2a})`; the walk
        adds :math:`q^2 t`.
        """
        T, a = self.memory_s, age_s / self.memory_s
        said = (T * math.expm1(-a)) ** 2
        # the bracket loses all digits where the age is short: 2/3 a^3 there
        fresh = 2.0 * a - 3.0 + 4.0 * math.exp(-a) - math.exp(-2.0 * a)
        fresh = fresh if a > 1e-3 else 2.0 / 3.0 * a**3
        unknown = self.unknown_std_m_s**2
        mean_squared = 0.5 * (self.current_ne_m_s[0] ** 2 + self.current_ne_m_s[1] ** 2)
        wrong = _WRONG_SHARE * (unknown + mean_squared)
        known = (1.0 - _WRONG_SHARE) * self.std_m_s**2 + wrong
        return known * said + unknown * T**2 * max(fresh, 0.0) + self.walk_m_sqrt_s**2 * age_s


@dataclass(frozen=True, slots=True, eq=False)
class FlownTrack:
    """The track that a robot keeps to, as its plan expects it."""

    time_s: FloatArray
    """Since the plan's start, ascending, shape ``(n,)``."""
    position_ned: FloatArray
    """Shape ``(n, 3)``, m."""
    leg_end_s: FloatArray
    """When each leg ends, ascending, shape ``(l,)``: by then the robot is back on its track."""
    stays_s: FloatArray
    """When the robot comes up, and when it sets out again, ascending, shape ``(k, 2)``; each stay
    follows a leg, and brings fixes until its end."""
    now_s: float
    """Where along the track the robot was at its last word."""
    following_std_m: float
    """Standard deviation per axis of what it flies beside the track by its own reckoning."""
    pace_std: float
    """Standard deviation of its pace, as a share of the plan's."""
    wait_std_s: float
    """Standard deviation of how long one stay at the surface takes."""


@dataclass(frozen=True, slots=True)
class LastWord:
    """Where a robot said it was."""

    position_ned: tuple[float, float, float]
    std_m: float
    """Standard deviation per axis of its horizontal position, as it stated it."""
    blind_s: float
    """How long before it had taken its last fix; 0 with a fix. What it believes of the current has
    been at work for so long, and counts in ``std_m`` already."""
    fix_std_m: float
    """Noise of a fix, per axis."""


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Where a robot should be at several ages of its last word."""

    age_s: FloatArray
    """Shape ``(m,)``."""
    position_ned: FloatArray
    """Shape ``(m, 3)``, m."""
    covariance_m2: FloatArray
    """Of north and east, shape ``(m, 2, 2)``."""


def predict_afloat(word: LastWord, water: WaterBelief, age_s: FloatArray) -> Prediction:
    """Predict a robot that floats: it goes where the water goes.

    Args:
        word: Its last.
        water: What is believed of the current.
        age_s: How long ago that was, shape ``(m,)``.
    """
    age = np.maximum(age_s, 0.0)
    carried = np.array([water.carried_ne_m(t) for t in age.tolist()]).reshape(-1, 2)
    variance = np.array([word.std_m**2 + water.variance_m2(t) for t in age.tolist()])
    place = np.tile(np.array([*word.position_ned[:2], 0.0]), (len(age), 1))
    place[:, :2] += carried
    return Prediction(age, place, variance[:, None, None] * np.eye(2))


def predict_flown(
    word: LastWord, track: FlownTrack, water: WaterBelief, age_s: FloatArray
) -> Prediction:
    """Predict a robot that flies a plan; after the plan's end it floats where that left it.

    When the robot passes a point is known with an error that grows, so that each prediction is the
    mean of seven times weighted as a normal error (Gauss-Hermite), which bends with the track.

    Args:
        word: Its last.
        track: What it flies.
        water: What is believed of the current.
        age_s: How long ago the word was, shape ``(m,)``.
    """
    age = np.maximum(age_s, 0.0)
    place = np.empty((len(age), 3))
    covariance = np.empty((len(age), 2, 2))
    for row, t in enumerate(age.tolist()):
        stays = np.count_nonzero(
            (track.stays_s[:, 0] > track.now_s) & (track.stays_s[:, 0] <= track.now_s + t)
        )
        late_s = math.hypot(track.pace_std * t, track.wait_std_s * math.sqrt(stays))
        means, variances = np.empty((len(_NODES), 3)), np.empty(len(_NODES))
        for node, share in enumerate(_NODES.tolist()):
            passed_s = max(0.0, t + share * late_s)
            means[node], variances[node] = _flown_for(word, track, water, passed_s)
        mean = _WEIGHTS @ means
        apart = means[:, :2] - mean[:2]
        place[row] = mean
        covariance[row] = (_WEIGHTS[:, None] * apart).T @ apart + (_WEIGHTS @ variances) * np.eye(2)
    return Prediction(age, place, covariance)


def _flown_for(
    word: LastWord, track: FlownTrack, water: WaterBelief, passed_s: float
) -> tuple[FloatArray, float]:
    """Return where a robot is that has flown on for so long, and its variance per axis, m^2."""
    end_s = float(track.time_s[-1])
    along_s = min(track.now_s + passed_s, end_s)
    share = _left_of_leg(track, track.now_s, along_s)
    beside = np.array(word.position_ned) - _on_track(track, track.now_s)
    mean = _on_track(track, along_s) + share * beside
    variance = (1.0 - share**2) * track.following_std_m**2
    variance += _reckoning_variance(word, track, water, along_s)
    afloat_s = track.now_s + passed_s - end_s
    if afloat_s > 0.0:
        mean[:2] += water.carried_ne_m(afloat_s)
        mean[2] = 0.0
        variance += water.variance_m2(afloat_s)
    return mean, variance


def _reckoning_variance(
    word: LastWord, track: FlownTrack, water: WaterBelief, along_s: float
) -> float:
    """Return the variance per axis of what dead reckoning did not know there, m^2.

    It grows from one fix to the next. How far off a dive came up is known to the robot from then
    on, and made good by the end of its next leg; while it stays there the water carries it on.
    """
    blind_s, start_s = word.blind_s, track.now_s
    # the current's error of the time before the word is in what the word stated
    before = word.std_m**2 - water.variance_m2(blind_s)
    off = 0.0
    for up_s, down_s in track.stays_s.tolist():
        if up_s <= track.now_s or up_s >= along_s:
            continue
        stay_s = min(along_s, down_s) - up_s
        off = before + water.variance_m2(blind_s + up_s - start_s) + water.variance_m2(stay_s)
        if along_s <= down_s:
            return off
        blind_s, start_s, before = 0.0, down_s, word.fix_std_m**2
    share = _left_of_leg(track, start_s, along_s)
    return before + water.variance_m2(blind_s + along_s - start_s) + share**2 * off


def _left_of_leg(track: FlownTrack, start_s: float, along_s: float) -> float:
    """Return what is left of the way from a moment to the end of its leg, 1 to 0."""
    ends_s = track.leg_end_s[track.leg_end_s > start_s]
    left_s = float(ends_s[0]) - start_s if len(ends_s) else 0.0
    return max(0.0, 1.0 - (along_s - start_s) / left_s) if left_s > 0.0 else 0.0


def _on_track(track: FlownTrack, at_s: float) -> FloatArray:
    return np.array(
        [np.interp(at_s, track.time_s, track.position_ned[:, axis]) for axis in range(3)]
    )


def ellipse_90(covariance_m2: FloatArray) -> tuple[tuple[float, float], float]:
    """Return the ellipse that holds 90 of 100 draws about the mean.

    Args:
        covariance_m2: Of north and east, shape ``(2, 2)``.

    Returns:
        Half axes, the longer one first, m, and its direction from north towards east, rad.
    """
    values, vectors = np.linalg.eigh(covariance_m2)
    minor, major = np.sqrt(CHI_SQUARED_90 * np.maximum(values, 0.0)).tolist()
    return (major, minor), math.atan2(float(vectors[1, 1]), float(vectors[0, 1]))


def miss(
    mean_ne_m: FloatArray, covariance_m2: FloatArray, fix_ne_m: FloatArray, fix_std_m: float
) -> tuple[float, float]:
    """Hold a prediction against the fix that followed.

    Args:
        mean_ne_m: Predicted place, shape ``(2,)``.
        covariance_m2: Its covariance, shape ``(2, 2)``.
        fix_ne_m: Where the robot was, shape ``(2,)``.
        fix_std_m: Noise of that, per axis.

    Returns:
        Distance in m, and in units of the 90 % ellipse: inside of it where not above 1.
    """
    apart = fix_ne_m - mean_ne_m
    known = covariance_m2 + fix_std_m**2 * np.eye(2)
    squared = float(apart @ np.linalg.solve(known, apart))
    return float(np.hypot(*apart)), math.sqrt(squared / CHI_SQUARED_90)


def calibration(ellipse_units: FloatArray) -> float:
    """Return by what factor to widen standard deviations so that predictions so far held.

    The mean squared distance of predictions that hold is 2 deviations (chi-squared of two degrees
    of freedom); the model counts for eight of them, so that a few verdicts say little.

    Args:
        ellipse_units: Of predictions that fixes have judged, as ``miss`` returns them, with the
            factor 1, shape ``(n,)``.
    """
    squared = np.minimum(CHI_SQUARED_90 * np.asarray(ellipse_units) ** 2, _MOST_SQUARED)
    prior = _CALIBRATION_PRIOR
    factor = math.sqrt((2.0 * prior + float(squared.sum())) / (2.0 * (prior + len(squared))))
    return min(max(factor, _BEST_CALIBRATION), _WORST_CALIBRATION)
