"""Flags of quality, and how those of several tests become one."""

from collections.abc import Iterable
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

FlagArray: TypeAlias = npt.NDArray[np.int8]

GOOD: Final = 1
UNKNOWN: Final = 2
"""Not evaluated: the test says nothing of this value."""
SUSPECT: Final = 3
FAIL: Final = 4
MISSING: Final = 9
"""There is no value."""
_RANK: Final = (MISSING, UNKNOWN, GOOD, SUSPECT, FAIL)
"""Of two flags of one value the later one counts, as in ``qartod_compare`` of ioos_qc."""

OG1_FILL: Final = -127
"""In a file: there is no value, and so no flag."""
PROBABLY_GOOD: Final = 2
"""In a file: set by a person alone; no test gives it."""


def worst(flags: Iterable[FlagArray], size: int) -> FlagArray:
    """Return for each value the gravest of the flags of several tests; ``MISSING`` without any."""
    found = np.full(size, MISSING, dtype=np.int8)
    given = list(flags)
    for rank in _RANK:
        for one in given:
            found[one == rank] = rank
    return found


def og1_flags(flags: FlagArray) -> FlagArray:
    """Return flags of QARTOD as files of OG1.0 have them.

    1, 3 and 4 stay; what no test evaluated is 0, "no QC applied"; what is missing has no flag.
    """
    table = np.zeros(10, dtype=np.int8)
    table[[GOOD, SUSPECT, FAIL]] = (GOOD, SUSPECT, FAIL)
    table[MISSING] = OG1_FILL
    return table[flags]
