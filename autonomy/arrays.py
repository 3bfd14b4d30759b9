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


def spaced(ascending: FloatArray, least: float) -> BoolArray:
    """Choose of ascending values those that lie at least ``least`` behind the one chosen before."""
    chosen = np.zeros(len(ascending), dtype=np.bool_)
    last = -np.inf
    for i, value in enumerate(ascending.tolist()):
        if value - last >= least:
            chosen[i], last = True, value
    return chosen
