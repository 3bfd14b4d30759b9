"""Array types that the numerics share, and how a few of many rows are chosen."""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.int64]
BoolArray: TypeAlias = npt.NDArray[np.bool_]


def evenly_spread(count: int, most: int) -> IntArray:
    """Return indices of at most ``most`` of ``count`` rows, ascending.

    The first is among them and, of two or more, the last; fewer rows than asked for are all
    returned.
    """
    return np.unique(np.linspace(0, max(count - 1, 0), min(count, most)).round().astype(np.int64))
