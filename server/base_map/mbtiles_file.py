"""MBTiles: tiles in a SQLite database, which is only ever read, and not trusted.

Source:
    https://github.com/mapbox/mbtiles-spec/blob/master/1.3/spec.md
"""

import math
import sqlite3
import threading
import time
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from server.base.text import TITLE_LENGTH_MAX
from server.base_map.tile_file import (
    ATTRIBUTION_LENGTH_MAX,
    LATITUDE_MAX_DEG,
    ZOOM_MAX,
    TileFacts,
    checked_extent,
    checked_zooms,
    plain,
)
from server.base_map.tile_image import TILE_BYTES_MAX, TileFileError, picture

QUERY_MAX_S: Final = 2.0
"""A database of the right form answers in milliseconds; another may hold an endless view."""
_STEPS_BETWEEN_LOOKS: Final = 10_000
_TILE: Final = (
    "SELECT tile_data FROM tiles WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?"
)
_SETTINGS: Final = (
    "query_only = ON",
    "trusted_schema = OFF",
    "cell_size_check = ON",
    "mmap_size = 0",
    "cache_size = -2000",  # an index; the rest stays with the system
)
_ALLOWED: Final = frozenset(
    {sqlite3.SQLITE_SELECT, sqlite3.SQLITE_READ, sqlite3.SQLITE_FUNCTION, sqlite3.SQLITE_RECURSIVE}
)
_FUNCTIONS: Final = frozenset({"min", "max", "coalesce", "ifnull", "count", "substr"})


class MbtilesFile:
    """One open file, by a connection of its own that reads and does nothing else."""

    def __init__(self, path: Path) -> None:
        """Open a file and look at its first tile.

        Raises:
            TileFileError: If it is broken, is not laid out as MBTiles, or holds no pictures.
        """
        self._lock = threading.Lock()
        self._ends_at = 0.0
        self._connection: sqlite3.Connection | None = _opened(path)
        try:
            self._connection.set_progress_handler(self._is_late, _STEPS_BETWEEN_LOOKS)
            self._check_layout()
            self.facts = self._facts()
        except BaseException:
            self.close()
            raise

    def tile(self, z: int, x: int, y: int) -> bytes | None:
        """Return a tile, ``None`` if the file has none there."""
        rows = self._rows(_TILE, (z, x, (1 << z) - 1 - y))
        if not rows or rows[0][0] is None:
            return None
        data = rows[0][0]
        if not isinstance(data, bytes):
            raise TileFileError("a tile is no binary data")
        return data

    def close(self) -> None:
        """Let go of the file."""
        with self._lock:
            if self._connection is not None:
                self._connection.close()
            self._connection = None

    def _is_late(self) -> bool:
        return time.monotonic() > self._ends_at

    def _rows(self, query: str, values: tuple[int, ...] = ()) -> list[tuple[Any, ...]]:
        with self._lock:
            if self._connection is None:
                raise TileFileError("it was closed")
            self._ends_at = time.monotonic() + QUERY_MAX_S
            try:
                return self._connection.execute(query, values).fetchall()
            except sqlite3.DataError as error:
                raise TileFileError(
                    f"a tile is longer than the {TILE_BYTES_MAX} bytes that are taken"
                ) from error
            except (sqlite3.Error, UnicodeDecodeError) as error:
                raise TileFileError(f"it cannot be read as MBTiles ({error})") from error

    def _check_layout(self) -> None:
        """Refuse what has no tiles, and what would be searched whole for each of them."""
        plan = self._rows(f"EXPLAIN QUERY PLAN {_TILE}", (0, 0, 0))
        if any(str(row[-1]).startswith("SCAN") for row in plan):
            raise TileFileError(
                "its tiles have no index: run CREATE UNIQUE INDEX tile_index ON "
                "tiles (zoom_level, tile_column, tile_row) on it first"
            )

    def _facts(self) -> TileFacts:
        told = {
            name: value
            for name, value in self._rows("SELECT name, value FROM metadata LIMIT 100")
            if isinstance(name, str) and isinstance(value, str)
        }
        if told.get("format") == "pbf":
            raise TileFileError(
                "its tiles are vectors, not pictures: make it anew with PNG, JPEG or WebP tiles"
            )
        first = self._rows("SELECT tile_data FROM tiles LIMIT 1")
        if not first or not isinstance(first[0][0], bytes):
            raise TileFileError("it holds no tiles")
        low, high = self._zooms(told)
        west, south, east, north = checked_extent(self._extent(told, low))
        return TileFacts(
            title=plain(told.get("name"), TITLE_LENGTH_MAX),
            attribution=plain(told.get("attribution"), ATTRIBUTION_LENGTH_MAX),
            media_type=picture(first[0][0])[0],
            west_deg=west,
            south_deg=south,
            east_deg=east,
            north_deg=north,
            min_zoom=low,
            max_zoom=high,
        )

    def _zooms(self, told: dict[str, str]) -> tuple[int, int]:
        try:
            return checked_zooms(int(told["minzoom"]), int(told["maxzoom"]))
        except (KeyError, ValueError):
            low = self._rows("SELECT min(zoom_level) FROM tiles")[0][0]
            high = self._rows("SELECT max(zoom_level) FROM tiles")[0][0]
        if not isinstance(low, int) or not isinstance(high, int):
            raise TileFileError("its zooms are no numbers")
        return checked_zooms(low, high)

    def _extent(self, told: dict[str, str], zoom: int) -> list[float]:
        """Return its bounds as it tells them, else those of its coarsest tiles."""
        parts = told.get("bounds", "").split(",")
        try:
            bounds = [float(part) for part in parts]
        except ValueError:
            bounds = []
        if len(bounds) == 4:
            return bounds
        row = self._rows(
            "SELECT min(tile_column), min(tile_row), max(tile_column), max(tile_row) "
            "FROM tiles WHERE zoom_level = ?",
            (zoom,),
        )[0]
        if not all(isinstance(one, int) for one in row):
            raise TileFileError("it tells no bounds")
        count = 1 << min(zoom, ZOOM_MAX)
        west, east = row[0] / count * 360.0 - 180.0, (row[2] + 1) / count * 360.0 - 180.0
        return [west, _latitude(row[1] / count), east, _latitude((row[3] + 1) / count)]


def _latitude(share: float) -> float:
    """Return the latitude of a height in Web Mercator, 0 .. 1 from the south, deg."""
    height = math.pi * (2.0 * min(max(share, 0.0), 1.0) - 1.0)
    latitude = math.degrees(math.atan(math.sinh(height)))
    return min(max(latitude, -LATITUDE_MAX_DEG), LATITUDE_MAX_DEG)


def _opened(path: Path) -> sqlite3.Connection:
    address = f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1"
    try:
        connection = sqlite3.connect(address, uri=True, check_same_thread=False)
    except sqlite3.Error as error:
        raise TileFileError(f"it cannot be opened ({error})") from error
    try:
        for setting in _SETTINGS:
            connection.execute(f"PRAGMA {setting}")
    except sqlite3.Error as error:
        connection.close()
        raise TileFileError(f"it cannot be read as MBTiles ({error})") from error
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, 2 * TILE_BYTES_MAX)
    connection.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
    connection.set_authorizer(_authorized)
    return connection


def _authorized(
    action: int, _first: str | None, second: str | None, _database: str | None, _by: str | None
) -> int:
    """Let a query read, by functions that only choose; a view of the file may name others."""
    if action not in _ALLOWED:
        return sqlite3.SQLITE_DENY
    if action == sqlite3.SQLITE_FUNCTION and (second or "").lower() not in _FUNCTIONS:
        return sqlite3.SQLITE_DENY
    return sqlite3.SQLITE_OK
