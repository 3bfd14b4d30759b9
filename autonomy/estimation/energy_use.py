"""What a robot draws from its battery in each of its primitives, learned from what it drew.

Units: powers in W, energies in Wh, times in h. An interval of a flight is a row ``x``, the hours
spent in each use, and the energy ``y`` that the battery lost over it:

    y = x . w + e,    e ~ N(0, s^2 (x . w_0)^2 + r^2)

``w`` are the powers of the uses, ``w_0`` those of the model that was believed beforehand, ``s`` the
relative scatter from flight to flight, ``r`` what reading the battery's charge twice adds. ``w`` is
Gaussian with a prior about ``w_0``: what the electronics draw is common to all uses, and each has a
part of its own. It is learned row by row (recursive Bayesian linear regression, Bishop 2006,
section 3.3); ``s`` is inverse gamma, fed with the expected share of the scatter in each error. An
error beyond 2.5 standard deviations counts less the larger it is (Huber 1964), and four of them in
a row on one side are believed: the robot changed.
"""

import math
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any, Self

import numpy as np

from autonomy.arrays import FloatArray

_OUTLIER = 2.5
_PATIENCE = 4
_HOTEL_SHARE = 0.4
"""Standard deviation of what is believed of the electronics' power beforehand, as a share of it."""
_OWN_SHARE = 0.6
"""The same of what a use draws on top."""
_SCATTER = 0.10
"""``s`` as believed beforehand."""
_SCATTER_ROWS = 4.0
"""Rows that this belief counts for."""
_RENEWED = 0.3
"""Standard deviation that comes back when the robot has changed, as a share of its electronics'."""


class Use(IntEnum):
    """What a robot does with its battery's energy."""

    AFLOAT = 0
    """Nothing but its electronics: at the surface or waiting."""
    GLIDE = 1
    SPIRAL = 2
    DIVE = 3
    SWIM = 4
    """With a beating tail: swimming, turning, following a target."""


@dataclass(frozen=True, slots=True)
class EnergyEstimate:
    """An energy with the interval that holds it in 90 of 100 cases."""

    mean_wh: float
    low_wh: float
    high_wh: float


@dataclass(frozen=True, slots=True, eq=False)
class EnergyUse:
    """Powers of the uses as far as they are known; ``taken`` returns another one."""

    prior_w: FloatArray
    """``w_0``, shape ``(5,)``."""
    power_w: FloatArray
    """Mean of ``w``, shape ``(5,)``."""
    covariance_w2: FloatArray
    """Shape ``(5, 5)``."""
    scatter_a: float = 0.5 * _SCATTER_ROWS
    """Shape of the inverse gamma of ``s^2``."""
    scatter_b: float = 0.5 * _SCATTER_ROWS * _SCATTER**2
    """Its scale."""
    learned_h: FloatArray = field(default_factory=lambda: np.zeros(len(Use)))
    """Hours of each use that were learned from, shape ``(5,)``."""
    rows: int = 0
    outliers: int = 0
    """Rows that counted less."""
    surprises: int = 0
    """Rows in a row that were too much (positive) or too little (negative)."""

    @classmethod
    def of_model(cls, prior_w: FloatArray) -> Self:
        """Return what is known before any flight.

        Args:
            prior_w: Power of each use by the vehicle's model, shape ``(5,)``, positive.
        """
        return cls(prior_w, prior_w.copy(), _prior_covariance(prior_w))

    @property
    def scatter(self) -> float:
        """Return ``s``: how a flight's energy scatters, as a share of it."""
        return math.sqrt(self.scatter_b / self.scatter_a)

    def taken(self, hours: FloatArray, energy_wh: float, reading_std_wh: float) -> "EnergyUse":
        """Return what is known after one more interval.

        Args:
            hours: Spent in each use, shape ``(5,)``.
            energy_wh: What the battery lost.
            reading_std_wh: ``r``.
        """
        x, known_w2 = hours, self.covariance_w2
        scatter = (self.scatter * float(x @ self.prior_w)) ** 2
        noise = scatter + reading_std_wh**2
        known = float(x @ known_w2 @ x)
        error = energy_wh - float(x @ self.power_w)
        z = error / math.sqrt(known + noise)
        is_odd = abs(z) > _OUTLIER
        surprises = _counted(self.surprises, z) if is_odd else 0
        if abs(surprises) >= _PATIENCE:
            doubt = _RENEWED**2 * _prior_covariance(self.prior_w) / _HOTEL_SHARE**2
            renewed = replace(self, covariance_w2=known_w2 + doubt, surprises=0)
            return renewed.taken(hours, energy_wh, reading_std_wh)
        weight = (_OUTLIER / z) ** 2 if is_odd else 1.0
        total = known + noise / weight
        gain = known_w2 @ x / total
        covariance = known_w2 - np.outer(gain, x @ known_w2)
        # the scatter's expected square, given the error of the whole (expectation step)
        sum_of_all = known + noise
        share = scatter / sum_of_all
        squared = share**2 * error**2 + scatter * (1.0 - share)
        relative = squared / max(float(x @ self.prior_w), 1e-12) ** 2
        # rows that reading noise hides say nothing of the scatter, and far ones hardly anything
        told = weight**2 * share
        return replace(
            self,
            power_w=self.power_w + gain * error,
            covariance_w2=0.5 * (covariance + covariance.T),
            scatter_a=self.scatter_a + 0.5 * told,
            scatter_b=self.scatter_b + 0.5 * told * relative,
            learned_h=self.learned_h + x,
            rows=self.rows + 1,
            outliers=self.outliers + int(is_odd),
            surprises=surprises,
        )

    def energy(self, hours: FloatArray, pieces: float = 1.0) -> EnergyEstimate:
        """Return what a time takes, with the interval that holds it in 90 of 100 cases.

        Args:
            hours: In each use, shape ``(5,)``.
            pieces: In how many flights that scatter by themselves it is parted.
        """
        from scipy.special import stdtrit  # here: a station that starts need not wait for it

        mean = max(0.0, float(hours @ self.power_w))
        scatter = (self.scatter * float(hours @ self.prior_w)) ** 2 / max(pieces, 1.0)
        total = max(float(hours @ self.covariance_w2 @ hours), 0.0) + scatter
        # of the two variances only the scatter's is itself unsure (Satterthwaite 1946)
        freedom = 2.0 * self.scatter_a * (total / scatter) ** 2 if scatter > 0.0 else math.inf
        off = float(stdtrit(min(freedom, 1e6), 0.95)) * math.sqrt(total)
        return EnergyEstimate(mean, max(0.0, mean - off), mean + off)

    def power(self, use: Use) -> EnergyEstimate:
        """Return the mean power of a use, W: what an hour of it takes, Wh, in the long run."""
        one = np.zeros(len(Use))
        one[use] = 1.0
        return self.energy(one, pieces=1e9)

    def is_learned(self, hours: FloatArray) -> bool:
        """Tell whether most of a time is in uses that were learned from flights."""
        known = self.learned_h >= 0.1 * hours
        return self.rows > 0 and float(hours @ known) >= 0.5 * float(hours.sum())

    def document(self) -> dict[str, Any]:
        """Return what ``of_document`` reads."""
        return {
            "prior_w": self.prior_w.tolist(),
            "power_w": self.power_w.tolist(),
            "covariance_w2": self.covariance_w2.tolist(),
            "scatter_a": self.scatter_a,
            "scatter_b": self.scatter_b,
            "learned_h": self.learned_h.tolist(),
            "rows": self.rows,
            "outliers": self.outliers,
            "surprises": self.surprises,
        }

    @classmethod
    def of_document(cls, document: dict[str, Any]) -> Self:
        """Return what ``document`` returned."""
        arrays = ("prior_w", "power_w", "covariance_w2", "learned_h")
        fields: dict[str, Any] = {name: np.array(document[name]) for name in arrays}
        return cls(**(document | fields))


def lasts_h(left_wh: float, rate: EnergyEstimate) -> tuple[float, float, float]:
    """Return how long a charge lasts at a rate, h: expected, at least, at most.

    Args:
        left_wh: What may be used.
        rate: Mean power, W, as energy of an hour.
    """
    left = max(0.0, left_wh)
    return (
        left / max(rate.mean_wh, 1e-9),
        left / max(rate.high_wh, 1e-9),
        left / max(rate.low_wh, 1e-9),
    )


def _prior_covariance(prior_w: FloatArray) -> FloatArray:
    hotel = prior_w[Use.AFLOAT]
    own = np.maximum(prior_w - hotel, 0.05 * prior_w)
    own[Use.AFLOAT] = 0.02 * hotel
    return np.full((len(prior_w),) * 2, (_HOTEL_SHARE * hotel) ** 2) + np.diag(
        (_OWN_SHARE * own) ** 2
    )


def _counted(before: int, z: float) -> int:
    sign = 1 if z > 0.0 else -1
    return before + sign if before * sign >= 0 else sign
