"""Fields of a JSON document of others: of the type that they should have, or refused by path."""

import math
from collections.abc import Mapping
from typing import Any

from server.plan_file.proposal import LatitudeLongitude
from server.water.proposal import ReadingError

Document = Mapping[str, Any]


def object_at(document: Document, key: str, path: str = "") -> Document:
    """Return an object, empty if it is not there.

    Raises:
        ReadingError: If something else is there.
    """
    value = document.get(key)
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise ReadingError((f"{path}{key}", "is no object"))
    return value


def list_at(document: Document, key: str, path: str = "") -> list[Any]:
    """Return a list, empty if it is not there.

    Raises:
        ReadingError: If something else is there.
    """
    value = document.get(key)
    if value is None:
        return []
    if not isinstance(value, list):
        raise ReadingError((f"{path}{key}", "is no list"))
    return value


def number_of(value: object) -> float:
    """Return a number, NaN for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.nan


def whole_of(value: object) -> int | None:
    """Return a whole number, None for anything else."""
    number = number_of(value)
    return int(number) if math.isfinite(number) and number == int(number) else None


def pair_of(value: object) -> LatitudeLongitude | None:
    """Return the first two of a list of numbers, None for anything else."""
    if not isinstance(value, list) or len(value) < 2:
        return None
    pair = number_of(value[0]), number_of(value[1])
    return pair if math.isfinite(pair[0]) and math.isfinite(pair[1]) else None


def pairs_of(value: object) -> list[LatitudeLongitude] | None:
    """Return a list of pairs, None for anything else."""
    if not isinstance(value, list):
        return None
    pairs = [pair_of(each) for each in value]
    return None if None in pairs else [pair for pair in pairs if pair is not None]
