"""Latitudes and longitudes as people and instruments write them."""

import re
from typing import Final

import numpy as np

from autonomy.arrays import FloatArray

_NUMBER: Final = r"\d+(?:[.,]\d+)?"
_WRITTEN: Final = re.compile(
    rf"(?P<sign>[+-])?\s*(?P<degrees>{_NUMBER})\s*[°d:\s]?\s*(?:(?P<minutes>{_NUMBER})\s*[\u2032'm:\s]?\s*)?"
    rf"(?:(?P<seconds>{_NUMBER})\s*[\u2033\"s]?\s*)?(?P<side>[NSEWnsew])?"
)


def from_ddmm(values: FloatArray) -> FloatArray:
    """Return degrees of numbers written as degrees and minutes, ``DDMM.mm``."""
    size = np.abs(values)
    degrees = np.trunc(size / 100.0)
    return np.sign(values) * (degrees + (size - 100.0 * degrees) / 60.0)


def degrees_of(text: str, *, is_ddmm: bool) -> float:
    """Return an angle in degrees, south and west negative.

    Raises:
        ValueError: If it is none.
    """
    found = _WRITTEN.fullmatch(text.strip())
    if found is None:
        raise ValueError(f"{text[:40]!r} is no angle")
    first, minutes, seconds = (
        float((found[name] or "0").replace(",", ".")) for name in ("degrees", "minutes", "seconds")
    )
    if minutes >= 60.0 or seconds >= 60.0:
        raise ValueError(f"{text[:40]!r} has 60 or more minutes or seconds")
    angle = float(from_ddmm(np.array([first]))[0]) if is_ddmm else first
    angle += minutes / 60.0 + seconds / 3600.0
    is_negative = (found["sign"] == "-") != ((found["side"] or "").upper() in ("S", "W"))
    return -angle if is_negative else angle
