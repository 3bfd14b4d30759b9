r"""How much of a fidelity level's field is in the levels above it.

Level ``i`` is :math:`\rho_i` times the level below and something of its own, so the share of
component ``t`` in level ``i`` is the product of the factors of the steps from ``t`` to ``i``.
"""

from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray


def scale_factors(rho: Sequence[float], levels: int) -> FloatArray:
    """Return the factor of each step between levels, shape ``(levels - 1,)``.

    Args:
        rho: One factor for each step, lowest first; none for factors of 1.
        levels: Number of levels.

    Raises:
        ValueError: If there are some factors, but not one for each step.
    """
    steps = max(levels - 1, 0)
    if not len(rho):
        return np.ones(steps)
    if len(rho) != steps:
        raise ValueError(f"rho has {len(rho)} factors, but {levels} levels have {steps} steps")
    return np.asarray(rho, dtype=np.float64)


def shares(factors: FloatArray) -> FloatArray:
    """Return the share of component ``t`` in level ``i``, element ``[t, i]``; 0 below ``t``.

    Args:
        factors: Of each step between levels, shape ``(levels - 1,)``.

    Returns:
        Shape ``(levels, levels)``.
    """
    levels = len(factors) + 1
    result = np.zeros((levels, levels))
    for t in range(levels):
        result[t, t] = 1.0
        result[t, t + 1 :] = np.cumprod(factors[t:])
    return result


def share_slopes(factors: FloatArray) -> FloatArray:
    """Return the derivative of ``shares`` by each factor.

    Args:
        factors: Of each step between levels, shape ``(levels - 1,)``.

    Returns:
        By the factor of step ``s`` at ``[s, t, i]``, shape ``(levels - 1, levels, levels)``.
    """
    levels = len(factors) + 1
    result = np.zeros((levels - 1, levels, levels))
    for step in range(levels - 1):
        without = factors.copy()
        without[step] = 1.0
        passing = shares(without)[: step + 1, step + 1 :]
        result[step, : step + 1, step + 1 :] = passing
    return result
