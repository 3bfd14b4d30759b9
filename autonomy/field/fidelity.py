"""Which fidelity level a measurement belongs to."""

from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray, IntArray


def fidelity_level(
    position_std_m: FloatArray | float, thresholds_m: Sequence[float] | FloatArray
) -> IntArray:
    """Assign measurements to fidelity levels by the uncertainty of their positions.

    Ascending thresholds make one level more than there are thresholds; the last level is the
    best located. On a threshold the better level wins.

    Args:
        position_std_m: Standard deviation of each horizontal position, shape ``(n,)``, m.
        thresholds_m: Level boundaries, strictly ascending, shape ``(M,)``, m.

    Returns:
        Level of each measurement, shape ``(n,)``, in ``0 .. M``.

    Raises:
        ValueError: If the thresholds do not ascend strictly.

    Source:
        Coleman, thesis, Algorithm 2, which lists the thresholds from the best level down.
    """
    boundaries = np.asarray(thresholds_m, dtype=np.float64)
    if np.any(np.diff(boundaries) <= 0):
        raise ValueError("fidelity thresholds must ascend strictly")
    above = np.searchsorted(boundaries, np.atleast_1d(position_std_m), side="left")
    return np.asarray(len(boundaries) - above, dtype=np.int64)
