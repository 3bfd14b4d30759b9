"""Records of numbers that compiled code reads and writes by the names of their fields."""

from typing import Annotated, Any, get_args, get_origin, get_type_hints

import numpy as np
import numpy.typing as npt

_SCALARS: dict[Any, str] = {float: "f8", int: "i8", bool: "?"}


def record_type(declared: type) -> np.dtype[np.void]:
    """Return the numpy type of a class of annotated numbers.

    Args:
        declared: Its fields are ``float``, ``int``, ``bool``, or ``Annotated[FloatArray, shape]``.

    Raises:
        TypeError: If a field is something else.
    """
    fields: list[tuple[Any, ...]] = []
    for name, kind in get_type_hints(declared, include_extras=True).items():
        if kind in _SCALARS:
            fields.append((name, _SCALARS[kind]))
        elif get_origin(kind) is Annotated:
            fields.append((name, "f8", get_args(kind)[1]))
        else:
            raise TypeError(f"{name} of {declared.__name__} is no number and no array")
    return np.dtype(fields, align=True)


def empty_record(declared: type) -> npt.NDArray[np.void]:
    """Return one record of zeros, shape ``(1,)``: compiled code takes the first of an array."""
    return np.zeros(1, dtype=record_type(declared))
