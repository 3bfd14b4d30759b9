"""The one place where the project meets numba's untyped decorator."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a numeric hot loop at its first call and keep the machine code on disk.

    The plain function stays reachable as ``py_func``. ``cache=True`` is keyed by the file of the
    function alone, so ``autonomy.warm_up`` clears every cache when any source has changed.
    """
    return cast("Callable[P, R]", numba.njit(cache=True, nogil=True)(function))


def inlined_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel that other kernels call so often that the call itself would show."""
    return cast("Callable[P, R]", numba.njit(cache=True, nogil=True, forceinline=True)(function))


def summing_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel whose long sums may be added up in any order, and so by vector instructions.

    The result differs by rounding from that of another processor.
    """
    fast = {"reassoc", "contract", "nsz"}
    return cast("Callable[P, R]", numba.njit(cache=True, nogil=True, fastmath=fast)(function))
