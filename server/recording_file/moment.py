"""Times of foreign files in seconds from the epoch. What may be meant twofold is never guessed."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Final, Literal

import numpy as np

from autonomy.arrays import FloatArray

TimeFormat = Literal["", "unix_s", "unix_ms", "iso", "day_first", "month_first"]
"""How times are written; "" where nobody has said it."""
_SLASHED: Final = re.compile(
    r"(?P<one>\d{1,2})[/.\-](?P<two>\d{1,2})[/.\-](?P<year>\d{4})"
    r"(?:[ T]+(?P<hour>\d{1,2}):(?P<minute>\d{2})(?::(?P<second>\d{2}(?:\.\d+)?))?)?"
    r"\s*(?P<zone>Z|UTC)?"
)
_MILLISECONDS_FROM: Final = 1e11
"""A number of this size counts milliseconds: as seconds it would lie in the year 5138."""


def is_in_milliseconds(values: FloatArray) -> bool:
    """Tell whether numbers of a time count milliseconds since the epoch."""
    known = values[np.isfinite(values)]
    return bool(len(known)) and float(np.median(known)) >= _MILLISECONDS_FROM


def kind_of(texts: Sequence[str]) -> TimeFormat:
    """Return how times in words are written; "" if day and month may be either way round."""
    told = [text for text in texts if text][:200]
    if told and all(_SLASHED.fullmatch(text) for text in told):
        return ""
    return "iso"


def has_zone(texts: Sequence[str]) -> bool:
    """Tell whether every time says its zone."""
    return all(
        text.endswith(("Z", "UTC")) or re.search(r"[+-]\d{2}:?\d{2}$", text[10:])
        for text in texts
        if text
    )


def seconds_of(text: str, written: TimeFormat) -> float:
    """Return a time in words as seconds from the epoch; UTC where it says no zone.

    Raises:
        ValueError: If it is no time of this form.
    """
    if written in ("day_first", "month_first"):
        return _slashed(text, is_day_first=written == "day_first")
    try:
        at = datetime.fromisoformat(text.removesuffix("UTC").strip())
    except ValueError:
        raise ValueError(f"the time {text[:40]!r} is not written as in ISO 8601") from None
    return (at if at.tzinfo else at.replace(tzinfo=UTC)).timestamp()


def _slashed(text: str, *, is_day_first: bool) -> float:
    found = _SLASHED.fullmatch(text.strip())
    order = "DD/MM/YYYY" if is_day_first else "MM/DD/YYYY"
    if found is None:
        raise ValueError(f"the time {text[:40]!r} is not written as {order}")
    one, two = int(found["one"]), int(found["two"])
    day, month = (one, two) if is_day_first else (two, one)
    second = float(found["second"] or 0.0)
    try:
        at = datetime(
            int(found["year"]),
            month,
            day,
            int(found["hour"] or 0),
            int(found["minute"] or 0),
            tzinfo=UTC,
        )
    except ValueError:
        raise ValueError(f"the time {text[:40]!r} is no day if read as {order}") from None
    return at.timestamp() + second
