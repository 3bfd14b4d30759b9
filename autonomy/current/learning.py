"""What the dives of a water teach of its current: strength and size of its parts."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve

from autonomy.arrays import FloatArray
from autonomy.current.config import CurrentMapConfig
from autonomy.current.kernel import (
    BASIN_STD,
    CHANGING_STD,
    EDDY_LENGTH,
    EDDY_STD,
    SHEAR_STD,
    TIDES,
    Functionals,
    factor_of,
    gram_of,
    joined,
    packed,
)
from autonomy.current.model import Observation

_PRIOR_STD = 1.0
"""Standard deviation of the logarithm of each number about its configured value."""
_FARTHEST = 3.0
_ITERATIONS = 12
_STEP = 1e-4
_WALK = -1
"""Stands for the walk factor among the places of packed settings."""


@dataclass(frozen=True, slots=True, eq=False)
class _Evidence:
    """The observations as learning needs them."""

    functionals: Functionals
    told: FloatArray
    walk: FloatArray
    """Variance by the walk of dead reckoning of each told number, at a walk factor of 1."""
    fixed: FloatArray
    """Variance by the fixes of each told number."""
    start: FloatArray
    """Packed settings as configured."""
    walk_factor: float
    places: tuple[int, ...]
    """What is learned: places of packed settings, or ``_WALK``."""


def learn(
    config: CurrentMapConfig, observations: Sequence[Observation], latitude_deg: float = 0.0
) -> CurrentMapConfig:
    """Return the settings under which the observations are most probable, near the given ones.

    Learned are the standard deviations that are not 0, the size of eddies and the walk factor; the
    shear only where a drift at the surface tells of it.

    Args:
        config: The settings as configured, about which the logarithms have a normal prior of
            standard deviation 1.
        observations: What was observed.
        latitude_deg: Of the water.
    """
    evidence = _evidence_of(config, observations, latitude_deg)
    if not evidence.places or not observations:
        return config
    components = _Components(evidence)
    from scipy.optimize import minimize  # here: a station that starts need not wait for it

    found = minimize(
        components.cost,
        np.zeros(len(evidence.places)),
        jac=True,
        method="L-BFGS-B",
        bounds=[(-_FARTHEST, _FARTHEST)] * len(evidence.places),
        options={"maxiter": _ITERATIONS},
    )
    return _settings(config, evidence, np.exp(found.x))


def _evidence_of(
    config: CurrentMapConfig, observations: Sequence[Observation], latitude_deg: float
) -> _Evidence:
    start = packed(config, latitude_deg)
    has_surface = any(one.is_surface for one in observations)
    amplitudes = [BASIN_STD, EDDY_STD, CHANGING_STD, *range(TIDES, len(start), 2)]
    if has_surface:
        amplitudes.append(SHEAR_STD)
    places = [place for place in amplitudes if start[place] > 0.0]
    if start[EDDY_STD] > 0.0:
        places.append(EDDY_LENGTH)
    walk = [one.walk_std_m**2 for one in observations]
    fixed = [(2.0 if one.is_surface else 1.0) * one.fix_std_m**2 for one in observations]
    functionals = joined([one.functional() for one in observations])
    functionals.points[..., 3] -= functionals.points[..., 3].min()
    return _Evidence(
        functionals=functionals,
        told=np.array([one.displacement_ne_m for one in observations]).ravel(),
        walk=np.repeat(walk, 2),
        fixed=np.repeat(fixed, 2),
        start=start,
        walk_factor=config.walk_factor,
        places=(*places, _WALK),
    )


class _Components:
    """Covariance of the observations by parts, each at its configured strength."""

    def __init__(self, evidence: _Evidence) -> None:
        self._evidence = evidence
        self._parts = {
            place: self._alone(place) for place in evidence.places if self._is_linear(place)
        }
        fixed = evidence.start.copy()
        for place in (*self._parts, EDDY_STD):
            fixed[place] = 0.0
        self._rest = gram_of(evidence.functionals, fixed) + np.diag(evidence.fixed)
        self._walk = np.diag(evidence.walk_factor**2 * evidence.walk)

    @staticmethod
    def _is_linear(place: int) -> bool:
        return place not in {EDDY_STD, EDDY_LENGTH, _WALK}

    def _alone(self, place: int, length_factor: float = 1.0) -> FloatArray:
        """Return the covariance by one part only."""
        alone = self._evidence.start.copy()
        for other in (BASIN_STD, EDDY_STD, CHANGING_STD, SHEAR_STD, *range(TIDES, len(alone), 2)):
            if other != place:
                alone[other] = 0.0
        alone[EDDY_LENGTH] *= length_factor
        return gram_of(self._evidence.functionals, alone)

    def cost(self, theta: FloatArray) -> tuple[float, FloatArray]:
        r"""Return the negative log posterior of the logarithms of factors, and its gradient.

        .. math:: \tfrac12 y^T G^{-1} y + \tfrac12 \ln |G| + \tfrac12 \theta^T\theta / s^2
        """
        evidence = self._evidence
        at = dict(zip(evidence.places, theta.tolist(), strict=True))
        slopes: dict[int, FloatArray] = {}
        covariance = self._rest.copy()
        for place, part in self._parts.items():
            grown = math.exp(2.0 * at[place]) * part
            covariance += grown
            slopes[place] = 2.0 * grown
        if EDDY_STD in at:
            scale, length = math.exp(2.0 * at[EDDY_STD]), at[EDDY_LENGTH]
            grown = scale * self._alone(EDDY_STD, math.exp(length))
            longer = scale * self._alone(EDDY_STD, math.exp(length + _STEP))
            covariance += grown
            slopes[EDDY_STD] = 2.0 * grown
            slopes[EDDY_LENGTH] = (longer - grown) / _STEP
        walked = math.exp(2.0 * at[_WALK]) * self._walk
        covariance += walked
        slopes[_WALK] = 2.0 * walked
        factor = factor_of(covariance)
        if factor is None:
            return math.inf, np.zeros(len(theta))
        alpha = cho_solve((factor, True), evidence.told, check_finite=False)
        inverse = cho_solve((factor, True), np.eye(len(factor)), check_finite=False)
        weight = inverse - np.outer(alpha, alpha)
        slope = np.array([0.5 * np.sum(weight * slopes[place]) for place in evidence.places])
        value = 0.5 * float(evidence.told @ alpha) + float(np.log(np.diag(factor)).sum())
        value += 0.5 * float(theta @ theta) / _PRIOR_STD**2
        return value, slope + theta / _PRIOR_STD**2


def _settings(
    config: CurrentMapConfig, evidence: _Evidence, factors: FloatArray
) -> CurrentMapConfig:
    """Return the settings with what was learned."""
    by_place = dict(zip(evidence.places, factors.tolist(), strict=True))
    grown = {
        place: float(evidence.start[place]) * by_place.get(place, 1.0)
        for place in (BASIN_STD, EDDY_STD, EDDY_LENGTH, CHANGING_STD, SHEAR_STD)
    }
    tides = tuple(
        min(std * by_place.get(TIDES + 2 * k, 1.0), 3.0)
        for k, std in enumerate(config.tide_std_m_s)
    )
    return config.model_copy(
        update={
            "basin_std_m_s": min(grown[BASIN_STD], 3.0),
            "eddy_std_m_s": min(grown[EDDY_STD], 3.0),
            "eddy_length_m": min(max(grown[EDDY_LENGTH], 0.5), 1e6),
            "changing_std_m_s": min(grown[CHANGING_STD], 3.0),
            "shear_std_m_s": min(grown[SHEAR_STD], 3.0),
            "tide_std_m_s": tides,
            "walk_factor": min(max(config.walk_factor * by_place[_WALK], 0.1), 10.0),
        }
    )
