"""A file of tiles in Web Mercator, opened without reading it whole."""

import html
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from server.base.text import shown
from server.base_map.tile_image import TileFileError

ZOOM_MAX: Final = 24
LATITUDE_MAX_DEG: Final = 85.06
"""Where Web Mercator ends."""
ATTRIBUTION_LENGTH_MAX: Final = 300
_TAG = re.compile(r"<[^<>]*>")


@dataclass(frozen=True, slots=True)
class TileFacts:
    """What a file says of itself, held against what can be."""

    title: str
    attribution: str
    """Plain text: who is to be named where the map is shown."""
    media_type: str
    west_deg: float
    south_deg: float
    east_deg: float
    north_deg: float
    min_zoom: int
    max_zoom: int


class TileFile(Protocol):
    """An open file of tiles. May be used from several threads at once."""

    @property
    def facts(self) -> TileFacts:
        """What the file holds."""
        ...

    def tile(self, z: int, x: int, y: int) -> bytes | None:
        """Return a tile as it lies in the file, rows from the north; ``None`` if there is none.

        Raises:
            TileFileError: If the file is broken there, or closed.
        """
        ...

    def close(self) -> None:
        """Let go of the file."""
        ...


def checked_zooms(low: int, high: int) -> tuple[int, int]:
    """Return the zooms of a file.

    Raises:
        TileFileError: If they do not fit.
    """
    if not 0 <= low <= high <= ZOOM_MAX:
        raise TileFileError(f"its zooms are {low} to {high}; 0 to {ZOOM_MAX} can be")
    return low, high


def checked_extent(bounds: Sequence[float]) -> tuple[float, float, float, float]:
    """Return west, south, east and north of a file, deg.

    West may lie beyond east: such a map crosses the antimeridian.

    Raises:
        TileFileError: If they are no such edges.
    """
    west, south, east, north = bounds
    if not all(math.isfinite(one) for one in bounds) or not (
        -180.0 <= west <= 180.0 and -180.0 <= east <= 180.0 and -90.0 <= south < north <= 90.0
    ):
        told = ", ".join(f"{one:g}" for one in bounds)
        raise TileFileError(f"its extent is {told}; it should be west, south, east, north in deg")
    return west, max(south, -LATITUDE_MAX_DEG), east, min(north, LATITUDE_MAX_DEG)


def plain(text: object, length_max: int) -> str:
    """Return what can be read of a text that may be HTML; nothing for what is no text."""
    if not isinstance(text, str):
        return ""
    words = html.unescape(_TAG.sub(" ", text[: 16 * length_max]))
    return " ".join(shown(words, 16 * length_max).split())[:length_max]
