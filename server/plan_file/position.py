"""Latitudes and longitudes as text, in the three notations that pilots use."""

import math
import re

_MARKS = re.compile(
    "[:'\"\N{DEGREE SIGN}\N{MASCULINE ORDINAL INDICATOR}\N{PRIME}\N{DOUBLE PRIME}"
    "\N{RIGHT SINGLE QUOTATION MARK}\N{RIGHT DOUBLE QUOTATION MARK}]"
)
_ONE = re.compile(
    r"^([NSEW]?)\s*([+-]?\d+(?:\.\d*)?)(?:\s+(\d+(?:\.\d*)?))?(?:\s+(\d+(?:\.\d*)?))?\s*([NSEW]?)$"
)
_HALVES = re.compile(r"^(.*?[NS])\s*(.*[EW])$")
_SIXTY = 60.0


def angle_of(text: str, letters: str) -> float | None:
    """Return an angle in degrees: ``42.76``, ``42 45.6 N``, ``42° 45′ 36″ N``; None for no angle.

    Args:
        text: What was written.
        letters: ``NS`` of a latitude, ``EW`` of a longitude; the second is negative.
    """
    found = _ONE.match(_plain(text))
    if found is None:
        return None
    before, *parts, behind = found.groups()
    side = before or behind
    if (before and behind) or (side and side not in letters):
        return None
    given = [part for part in parts if part is not None]
    numbers = [float(part) for part in given]
    is_negative = given[0].startswith("-")
    if any(value != int(value) for value in numbers[:-1]) or (side and is_negative):
        return None
    whole, minutes, seconds = (*numbers, 0.0, 0.0)[:3]
    size = abs(whole) + minutes / _SIXTY + seconds / _SIXTY**2
    most = 90.0 if letters == "NS" else 180.0
    if minutes >= _SIXTY or seconds >= _SIXTY or not math.isfinite(size) or size > most:
        return None
    return -size if is_negative or side == letters[1] else size


def position_of(text: str) -> tuple[float, float] | None:
    """Return latitude and longitude of a position in one text, latitude first; None for none."""
    plain = _plain(text)
    halves = plain.split(",") if "," in plain else []
    if not halves:
        found = _HALVES.match(plain)
        halves = list(found.groups()) if found else plain.split(" ")
    if len(halves) != 2:
        return None
    latitude, longitude = angle_of(halves[0], "NS"), angle_of(halves[1], "EW")
    return None if latitude is None or longitude is None else (latitude, longitude)


def _plain(text: str) -> str:
    marked = _MARKS.sub(" ", text.upper().replace("\N{MINUS SIGN}", "-"))
    return " ".join(marked.split())
