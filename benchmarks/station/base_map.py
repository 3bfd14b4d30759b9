"""A base map of 200 MB under a real station: its first tiles over HTTP, and what it costs there.

The file is made at run time, of pictures of noise that nothing packs; the station is asked for the
list and for the tiles of one screen, as a browser does.
"""

import math
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing
from io import BytesIO
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from PIL import Image

from benchmarks.station.station_process import StationProcess, station_process

ZOOM, SIDE_PX = 14, 256
COLUMNS, ROWS, WEST, NORTH = 40, 26, 4350, 6020
SCREEN = (6, 4)
"""Columns and rows of tiles of one screen."""
FIRST_BAR_S, MEMORY_BAR_MB = 0.5, 20.0


def measure() -> list[dict[str, Any]]:
    """Open the map in a station that has just started; takes half a minute."""
    with station_process() as station:
        before_mb = _warm(station)
        folder = station.data / "base-maps"
        folder.mkdir()
        size_mb = _write(folder / "chart.mbtiles")
        began = time.perf_counter()
        [found] = station.get("/api/base-maps").json()["base_maps"]
        listed_s = time.perf_counter() - began
        took_s = [_asked(station, found, column, row) for column, row in _screen()]
        first_s = time.perf_counter() - began
        rest = [(column, row) for column in range(COLUMNS) for row in range(ROWS)]
        every_s = [_asked(station, found, column, row) for column, row in rest]
        more_mb = station.memory_mb() - before_mb
    what = f"of {size_mb:.0f} MB"
    return [
        _row(f"base map {what} is found and listed", listed_s, "s", None),
        _row(f"until all {len(took_s)} tiles of a screen are there", first_s, "s", FIRST_BAR_S),
        _row("one tile, median", float(np.median(every_s)), "s", None),
        _row(
            f"memory of the station after {len(rest)} tiles, more than before",
            more_mb,
            "MB",
            MEMORY_BAR_MB,
        ),
    ]


def _warm(station: StationProcess) -> float:
    """Let the station answer what has no map yet; return its memory, MB."""
    for _ in range(20):
        station.get("/api/base-maps")
    return station.memory_mb()


def _screen() -> Iterator[tuple[int, int]]:
    columns, rows = SCREEN
    for number in range(columns * rows):
        yield COLUMNS // 2 + number % columns, ROWS // 2 + number // columns


def _asked(station: StationProcess, found: dict[str, Any], column: int, row: int) -> float:
    began = time.perf_counter()
    path = f"/api/base-maps/{found['id']}/tiles/{ZOOM}/{WEST + column}/{NORTH + row}"
    answer: httpx.Response = station.get(f"{path}?revision={found['revision']}")
    if answer.headers["content-type"] != "image/png":
        raise AssertionError(f"{path}: {answer.status_code}")
    return time.perf_counter() - began


def _write(path: Path) -> float:
    """Write an MBTiles file; return its size, MB."""
    generator = np.random.default_rng(0)
    left, right = (_longitude(WEST + add) for add in (0, COLUMNS))
    top, bottom = (_latitude(NORTH + add) for add in (0, ROWS))
    facts = {
        "name": "Chart of noise",
        "format": "png",
        "bounds": f"{left},{bottom},{right},{top}",
        "minzoom": str(ZOOM),
        "maxzoom": str(ZOOM),
    }
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("CREATE TABLE metadata (name TEXT, value TEXT)")
        database.executemany("INSERT INTO metadata VALUES (?, ?)", facts.items())
        database.execute(
            "CREATE TABLE tiles (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER,"
            " tile_data BLOB, PRIMARY KEY (zoom_level, tile_column, tile_row))"
        )
        for column in range(COLUMNS):
            for row in range(ROWS):
                from_south = 2**ZOOM - 1 - (NORTH + row)
                at = (ZOOM, WEST + column, from_south, _tile(generator))
                database.execute("INSERT INTO tiles VALUES (?, ?, ?, ?)", at)
    return path.stat().st_size / 1e6


def _tile(generator: np.random.Generator) -> bytes:
    pixels = generator.integers(0, 256, (SIDE_PX, SIDE_PX, 3), dtype=np.uint8)
    kept = BytesIO()
    Image.fromarray(pixels).save(kept, "PNG", compress_level=0)
    return kept.getvalue()


def _longitude(column: int) -> float:
    return 360.0 * column / 2**ZOOM - 180.0


def _latitude(row: int) -> float:
    return math.degrees(math.atan(math.sinh(math.pi * (1.0 - 2.0 * row / 2**ZOOM))))


def _row(name: str, value: float, unit: str, bar: float | None) -> dict[str, Any]:
    return {
        "area": "base_map",
        "name": name,
        "value": round(value, 4),
        "unit": unit,
        "bar": bar,
        "met": None if bar is None else value <= bar,
    }
