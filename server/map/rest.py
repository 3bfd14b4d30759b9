"""Which maps keep the factors that samples are taken in with, and when the others are made anew.

The factors of a map that holds all the samples it may are some 60 MB, what it shows is 100 kB. So a
map that nobody looks at rests once it is large, and so does one for which there is no room: its
samples wait in the database, and it is made of them when somebody looks, or now and then. What all
maps keep is bounded so, however many robots there are.
"""

import time
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from prometheus_client.core import Metric

from server.base.metric.metrics import counted, gauge
from server.map.group import MapGroup

LOOKED_AT_S: Final = 60.0
"""A map counts as looked at this long after somebody asked for it, by the wall."""
LOOKED_AT_BYTES: Final = 128_000_000
"""Most that maps keep which are looked at; the first of them has room whatever its settings."""
UNSEEN_BYTES: Final = 16_000_000
"""Most that maps keep which nobody looks at: small ones take samples in as they come."""
REST_FACTOR: Final = 10.0
"""A map that took t to be made anew rests for this many t, so that several dives come together."""
UNSEEN_FACTOR: Final = 30.0
"""After one that nobody looks at took t, no other such map is made for this many t."""


class MapRest:
    """Lets maps rest, and wakes them. Belongs to one event loop."""

    def __init__(self) -> None:
        self._unseen_due_s = 0.0

    def look(self, group: MapGroup) -> None:
        """Note that somebody asks for a map: if it is behind, it is made anew at once."""
        now_s = time.monotonic()
        if not _is_looked_at(group, now_s):
            group.due_s = 0.0
        group.looked_s = now_s

    def let(self, groups: Iterable[MapGroup]) -> None:
        """Let maps rest that nobody looks at or that have no room; none may be worked on."""
        now_s = time.monotonic()
        seen_bytes = unseen_bytes = 0
        for group in groups:
            if group.live is None or group.live.is_at_rest:
                continue
            size = group.live.memory_bytes
            if _is_looked_at(group, now_s) and (
                not seen_bytes or seen_bytes + size <= LOOKED_AT_BYTES
            ):
                seen_bytes += size
            elif not _is_looked_at(group, now_s) and unseen_bytes + size <= UNSEEN_BYTES:
                unseen_bytes += size
            else:
                group.live.rest()

    def due(self, groups: Sequence[MapGroup]) -> list[MapGroup]:
        """Return the maps that are to be made anew now: all that are looked at, one other."""
        now_s = time.monotonic()
        stale = [one for one in groups if one.is_stale and now_s >= one.due_s]
        seen = [one for one in stale if _is_looked_at(one, now_s)]
        if now_s < self._unseen_due_s:
            return seen
        unseen = [one for one in stale if not _is_looked_at(one, now_s)]
        return [*seen, *sorted(unseen, key=lambda one: one.due_s)[:1]]

    def made(self, group: MapGroup, began_s: float) -> None:
        """Note that a map was made anew."""
        now_s = time.monotonic()
        took_s = now_s - began_s
        group.due_s = now_s + REST_FACTOR * took_s
        if not _is_looked_at(group, now_s):
            self._unseen_due_s = now_s + UNSEEN_FACTOR * took_s


def figures_of(groups: Sequence[MapGroup]) -> Iterator[Metric]:
    """Yield what maps keep, and how many of them rest."""
    made = [one.live for one in groups if one.live is not None]
    states = {
        "awake": float(sum(not live.is_at_rest for live in made)),
        "resting": float(sum(live.is_at_rest for live in made)),
    }
    yield counted(
        "maps", "Live maps, by whether they take samples in as they come.", "state", states
    )
    kept = float(sum(live.memory_bytes for live in made))
    yield gauge("map_memory_bytes", "What live maps keep to take samples in with.", kept)


def _is_looked_at(group: MapGroup, now_s: float) -> bool:
    return now_s - group.looked_s < LOOKED_AT_S
