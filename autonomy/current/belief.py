"""What dives make of a current that somebody told: how far it is believed, and what then holds.

Two hypotheses explain the dives: the map's own prior of mean 0, and the told current with an error
of the prior's form but of the stated standard deviation. The told one is believed nine to one
before any dive, then as the evidence of the dives that it tells of has it. At each place the two
are mixed by belief over variance, so what own dives have told counts where they know more. Where
they know and the two are farther apart than both allow, the told current is believed less.

Source:
    Hoeting and others 1999 (Bayesian model averaging).
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_solve, solve_triangular

from autonomy.arrays import FloatArray
from autonomy.current.kernel import Functionals, cross_gram, factor_of, joined, prior_blocks
from autonomy.current.told import ToldCurrent

_PRIOR_LOG_ODDS = math.log(9.0)
_MOST_LOG_ODDS = 14.0
"""However many dives agree, one in a million is left for the other."""
_LEAST_VARIANCE = 1e-12
_USUAL_SURPRISE = 2.0
"""Squared distance of two axes, in its own covariance, that is no sign of an error."""


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """A told current beside what the dives made of it; ``fitted`` returns another one."""

    told: ToldCurrent
    log_odds: float = _PRIOR_LOG_ODDS
    """Of the told current being right within its error, against the map's own prior."""
    _dives: Functionals | None = None
    """Dives that the told current tells of."""
    _factor: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    _alpha: FloatArray = field(default_factory=lambda: np.zeros(0))
    _scale: float = 1.0
    """Standard deviation of the told current's error over that of the map's own prior."""

    @property
    def share(self) -> float:
        """Return how far the told current is believed, 0 to 1."""
        return 1.0 / (1.0 + math.exp(-min(max(self.log_odds, -_MOST_LOG_ODDS), _MOST_LOG_ODDS)))

    def fitted(
        self,
        functionals: list[Functionals],
        observed: FloatArray,
        prior: FloatArray,
        noise: FloatArray,
        prior_std_m_s: float,
        origin_s: float,
    ) -> "Belief":
        """Return the belief that dives leave.

        Args:
            functionals: One of each dive.
            observed: North and east of the first, of the second, ..., shape ``(2n,)``.
            prior: Their covariance by the map's own prior, shape ``(2n, 2n)``.
            noise: Variance of what was observed, shape ``(2n,)``.
            prior_std_m_s: Standard deviation of the map's own prior.
            origin_s: Moment from which the functionals count their times.
        """
        scale = self.told.std_m_s / prior_std_m_s if prior_std_m_s > 0.0 else 1.0
        without = Belief(self.told, _scale=scale)
        if not functionals:
            return without
        mean, is_told = self._said(joined(functionals), origin_s)
        if not is_told.any():
            return without
        rows = np.flatnonzero(np.repeat(is_told, 2))
        known = prior[np.ix_(rows, rows)]
        own = factor_of(known + np.diag(noise[rows]))
        factor = factor_of(scale**2 * known + np.diag(noise[rows]))
        if own is None or factor is None:
            return without
        error = observed[rows] - mean.ravel()[rows]
        odds = _evidence(factor, error) - _evidence(own, observed[rows])
        return replace(
            without,
            log_odds=_PRIOR_LOG_ODDS + odds,
            _dives=joined([functionals[i] for i in np.flatnonzero(is_told)]),
            _factor=factor,
            _alpha=cho_solve((factor, True), error, check_finite=False),
        )

    def joint(
        self,
        wanted: Functionals,
        mean: FloatArray,
        cov: FloatArray,
        parameters: FloatArray,
        origin_s: float,
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean and covariance of functionals with what was told.

        Args:
            wanted: The functionals.
            mean: What the map says of them without it, shape ``(n, 2)``.
            cov: And how surely, shape ``(n, 2, 2)``.
            parameters: Settings as ``kernel.packed`` returns them.
            origin_s: Moment from which the functionals count their times.
        """
        told, is_told = self._said(wanted, origin_s)
        if not is_told.any():
            return mean, cov
        prior = prior_blocks(wanted, parameters)
        told_cov = self._scale**2 * prior
        if self._dives is not None:  # what they tell of the told current's error
            cross = self._scale**2 * cross_gram(self._dives, wanted, parameters)
            told = told + (cross.T @ self._alpha).reshape(-1, 2)
            known = solve_triangular(self._factor, cross, lower=True, check_finite=False)
            known = known.reshape(len(known), -1, 2)
            told_cov = told_cov - np.einsum("npi,npj->pij", known, known)
        apart = told - mean
        variances = [
            np.maximum(np.trace(one, axis1=1, axis2=2), _LEAST_VARIANCE)
            for one in (told_cov, cov, prior)
        ]
        surprise = 2.0 * (apart**2).sum(axis=1) / (variances[0] + variances[1])
        known_share = np.clip(1.0 - variances[1] / variances[2], 0.0, 1.0)
        strange = np.maximum(known_share * surprise - _USUAL_SURPRISE, 0.0)
        weight = self.share * np.exp(-0.5 * strange) / variances[0]
        part = np.where(is_told, weight / (weight + (1.0 - self.share) / variances[1]), 0.0)
        part = part[:, None]
        spread = (part * (1.0 - part))[..., None] * np.einsum("pi,pj->pij", apart, apart)
        both = part[..., None] * told_cov + (1.0 - part[..., None]) * cov + spread
        return mean + part * apart, both

    def _said(
        self, functionals: Functionals, origin_s: float
    ) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Return what the told current makes of functionals, 0 where it does not tell of all."""
        points = functionals.points.reshape(-1, 4).copy()
        points[:, 3] += origin_s
        velocity = self.told.velocity_ne_m_s(points).reshape(*functionals.weights.shape, 2)
        found = np.einsum("nk,nkc->nc", functionals.weights, velocity)
        is_told = np.isfinite(found).all(axis=1)
        return np.where(is_told[:, None], found, 0.0), is_told


def _evidence(factor: FloatArray, error: FloatArray) -> float:
    """Return the logarithm of the density of errors, but for a constant."""
    scaled = solve_triangular(factor, error, lower=True, check_finite=False)
    return float(-0.5 * scaled @ scaled - np.log(np.diag(factor)).sum())
