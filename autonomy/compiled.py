"""The one place where the project meets numba's untyped decorator."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a numeric hot loop at its first call and keep the machine code on disk.

    The function must stay valid plain Python: tests call it through ``kernel_source`` too.
    ``cache=True`` is keyed by the file of the function alone, so ``autonomy.warm_up`` clears
    every cache when any kernel's file has changed.
    """
    return cast("Callable[P, R]", numba.njit(cache=True, nogil=True)(function))
