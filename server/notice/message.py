"""What a notice says: vehicle, value, limit, since when, where, and what to open."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final
from urllib.parse import quote

from db.query.station.notices import ItemRecord

TITLE_LENGTH_MAX: Final = 120
_SIXTY: Final = 60
_MINUTES, _SECONDS = "\N{PRIME}", "\N{DOUBLE PRIME}"
_TOPICS: Final = {"surfaced": "Surfaced", "plan": "Plan", "assigned": "Assigned", "test": "Test"}


@dataclass(frozen=True, slots=True)
class Place:
    """Where a robot was when it last said so."""

    latitude_deg: float
    longitude_deg: float
    measured_at: datetime
    has_fix: bool
    std_m: float | None


@dataclass(frozen=True, slots=True)
class Words:
    """Title and text of a message, without links."""

    title: str
    text: str


def compose(
    topic: str,
    items: Sequence[ItemRecord],
    counts: Sequence[tuple[str, int]],
    places: Mapping[str, Place],
    notation: str,
    now: datetime,
) -> Words:
    """Write a message.

    Args:
        topic: What all of it is about.
        items: What is named one by one, the gravest first.
        counts: How many there are in all, by level.
        places: Where robots were last.
        notation: How positions are written.
        now: The station's time.
    """
    total = sum(count for _, count in counts)
    first = items[0]
    word = _TOPICS.get(topic, first.level.capitalize())
    if total == 1:
        title = f"{word}: {first.text}"
    else:
        listed = ", ".join(f"{count} {level}" for level, count in counts)
        title = f"{word}: {total} notices ({listed})"
    lines = [_line(item) for item in items]
    if total > len(items):
        lines.append(f"... and {total - len(items)} more on the page.")
    if any(item.step > 0 for item in items):
        lines.insert(0, "Nobody has acknowledged this yet.")
    robots = dict.fromkeys(item.robot for item in items if item.robot is not None)
    lines += [
        f"{robot}: {place_text(places[robot], notation, now)}"
        for robot in robots
        if robot in places
    ]
    return Words(_shortened(title), "\n".join(lines))


def page_of(origin: str, items: Sequence[ItemRecord]) -> str:
    """Return the address of the page that shows what a message tells of."""
    robots = {item.robot for item in items}
    robot = robots.pop() if len(robots) == 1 else None
    return f"{origin}/robot/{quote(robot, safe='')}" if robot else f"{origin}/log"


def place_text(place: Place, notation: str, now: datetime) -> str:
    """Say where a robot was, how well that was known, and how long ago."""
    latitude = angle_text(place.latitude_deg, 2, notation, "NS")
    longitude = angle_text(place.longitude_deg, 3, notation, "EW")
    how = "by a fix" if place.has_fix else "by dead reckoning"
    spread = "" if place.std_m is None else f" ± {place.std_m:.0f} m"
    minutes = max(0, round((now - place.measured_at).total_seconds() / _SIXTY))
    return f"last at {latitude}, {longitude}{spread} {how}, {minutes} min before this message."


def angle_text(degrees: float, width: int, notation: str, letters: str) -> str:
    """Write one angle in a pilot's notation; 60 minutes or seconds are never written."""
    size, side = abs(degrees), letters[1] if degrees < 0 else letters[0]
    if notation == "degrees":
        return f"{size:0{width + 6}.5f}° {side}"
    if notation == "minutes":
        whole, thousandths = divmod(round(size * 60_000), 60_000)
        return f"{whole:0{width}}° {thousandths / 1000:06.3f}{_MINUTES} {side}"
    whole, tenths = divmod(round(size * 36_000), 36_000)
    minutes, rest = divmod(tenths, 600)
    return f"{whole:0{width}}° {minutes:02}{_MINUTES} {rest / 10:04.1f}{_SECONDS} {side}"


def _line(item: ItemRecord) -> str:
    return f"{item.level.capitalize()}, since {item.raised_at:%Y-%m-%d %H:%MZ}: {item.text}"


def _shortened(title: str) -> str:
    plain = " ".join(title.split())
    return plain if len(plain) <= TITLE_LENGTH_MAX else plain[: TITLE_LENGTH_MAX - 1] + "…"
