r"""What the errors of planned positions do to the samples taken there: noise that a dive shares.

A sample taken where the robot is not differs from the field where it is believed to be. Along one
dive the error is a walk from the fix that began it, plus a current that nobody knows, so it is
alike for all samples of a dive; how much it matters to each follows from the field's slope, which
is alike for samples that are close. Hence the covariance

.. math:: \sqrt{D_i D_j} \, \rho_{ij} \, r_{ij}

of what errors add to samples i and j of one dive: :math:`D` is what each adds alone
(``FieldBelief.displacement_noise``), :math:`\rho` the correlation of the errors, :math:`r` that of
the field's differences across equal displacements. It is an entrywise product of covariances, and
so one itself.
"""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.model.kernel import covariance
from autonomy.planner.belief import FieldBelief, SampleNoise
from autonomy.planner.leg.edge import POINT_DOWN, POINT_NORTH, POINT_STD, POINT_TIME

SURFACE_M = 1e-6
"""A planned point above this depth is at the surface, where a dive ends."""
_STEP_SHARE = 0.05
"""Displacement across which the field is compared, in parts of its shorter horizontal length."""


def planned_noise(belief: FieldBelief, noise: SampleNoise, points: FloatArray) -> FloatArray:
    """Return the covariance of the noise of a trajectory's samples, shape ``(m, m)``.

    Args:
        belief: Kernel and noise of a measurement.
        noise: How the uncertainty of positions counts.
        points: Planned points, shape ``(m, 5)``.
    """
    alone = noise.of(belief, points[:, POINT_STD])  # (m,)
    if not noise.is_continuous:
        return np.diag(alone)
    added = np.sqrt(np.maximum(alone - belief.noise_variance, 0.0))  # (m,)
    places = points[:, POINT_NORTH : POINT_DOWN + 1]
    shared = np.multiply.outer(added, added) * error_correlation(
        points, noise.unknown_current_std_m_s
    )
    shared *= difference_correlation(belief, places)
    shared[np.diag_indices_from(shared)] = alone
    return shared


def error_correlation(points: FloatArray, unknown_current_std_m_s: float) -> FloatArray:
    """Return the correlation of the position errors of planned points, shape ``(m, m)``.

    Between moments t before t' of one dive the covariance on each axis is that of a walk, its
    variance at t, and ``b^2 t t'`` for a steady current of standard deviation b. Where a position
    is more certain than the current alone would leave it, the current explains all of its error.
    Dives share no error.

    Args:
        points: Planned points, shape ``(m, 5)``; where the depth is 0 a dive ends.
        unknown_current_std_m_s: Standard deviation per axis of the current that is not known, m/s.
    """
    ends = points[:, POINT_DOWN] <= SURFACE_M
    dive = np.cumsum(ends) - ends  # (m,)
    end_s = np.concatenate([[0.0], points[ends, POINT_TIME]])
    time_s = points[:, POINT_TIME] - end_s[dive]  # (m,), since its dive began
    std = points[:, POINT_STD]
    carried = np.minimum(unknown_current_std_m_s * np.maximum(time_s, 0.0), std)  # (m,)
    walked = np.square(std) - np.square(carried)
    shared = np.minimum.outer(walked, walked) + np.multiply.outer(carried, carried)
    whole = np.multiply.outer(std, std)
    correlation = np.divide(shared, whole, out=np.zeros_like(shared), where=whole > 0.0)
    correlation[np.not_equal.outer(dive, dive)] = 0.0
    return correlation


def difference_step_m(belief: FieldBelief) -> float:
    """Return the displacement across which differences of the field are compared, m."""
    return _STEP_SHARE * min(belief.length_scales_m[:2])


def difference_correlation(belief: FieldBelief, places: FloatArray) -> FloatArray:
    """Return how alike the field differs across equal displacements at places, ``(m, m)``.

    It is the correlation of ``f(x + e) - f(x)`` over short horizontal displacements e, the same at
    both places; for a field with slopes that of its slopes.

    Args:
        belief: The kernel.
        places: Where, shape ``(m, 3)``.
    """
    kernel = belief.kernel()
    here = covariance(places, places, kernel)
    shared, whole = np.zeros_like(here), 0.0
    for axis in range(2):
        step = np.zeros((1, 3))
        step[0, axis] = difference_step_m(belief)
        shared += 2.0 * here
        shared -= covariance(places, places + step, kernel)
        shared -= covariance(places, places - step, kernel)
        whole += 2.0 * (belief.signal_variance - covariance(np.zeros((1, 3)), step, kernel)[0, 0])
    return shared / whole
