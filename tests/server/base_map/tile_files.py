"""Small files of tiles, as other programs write them."""

import io
import sqlite3
import struct
import zlib
from pathlib import Path

from pmtiles.tile import Compression, TileType, zxy_to_tileid
from pmtiles.writer import Writer

Z, X, Y = 9, 136, 189
"""A tile over Michigan; rows from the north."""


def png(side: int = 256, grey: int = 128, note: bytes = b"") -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        crc = zlib.crc32(kind + data)
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", crc)

    rows = zlib.compress(bytes([0, *[grey] * side]) * min(side, 1024), 9)
    head = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    text = chunk(b"tEXt", note) if note else b""
    magic = b"\x89PNG\r\n\x1a\n"
    return magic + chunk(b"IHDR", head) + text + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def jpeg(width: int = 256, height: int = 256) -> bytes:
    frame = b"\xff\xc0" + struct.pack(">HBHHB", 11, 8, height, width, 1) + b"\x01\x11\x00"
    return b"\xff\xd8\xff\xe0" + struct.pack(">H", 16) + b"JFIF\0" + bytes(9) + frame + b"\xff\xd9"


def webp(width: int = 256, height: int = 256) -> bytes:
    sides = (width - 1).to_bytes(3, "little") + (height - 1).to_bytes(3, "little")
    body = b"WEBPVP8X" + struct.pack("<I", 10) + bytes(4) + sides
    return b"RIFF" + struct.pack("<I", len(body)) + body


HEADER = {
    "tile_type": TileType.PNG,
    "tile_compression": Compression.NONE,
    "min_zoom": 0,
    "max_zoom": Z,
    "min_lon_e7": -846000000,
    "min_lat_e7": 426000000,
    "max_lon_e7": -842000000,
    "max_lat_e7": 429000000,
}
METADATA = {"name": "Lakes of Michigan", "attribution": '<a href="x">Survey &amp; Sons</a>'}


def pmtiles(
    tiles: dict[tuple[int, int, int], bytes] | None = None,
    header: dict[str, object] | None = None,
    metadata: dict[str, object] | None = None,
) -> bytes:
    out = io.BytesIO()
    writer = Writer(out)
    placed = {(Z, X, Y): png()} if tiles is None else tiles
    for place, data in sorted(placed.items(), key=lambda one: zxy_to_tileid(*one[0])):
        writer.write_tile(zxy_to_tileid(*place), data)
    writer.finalize(HEADER | (header or {}), METADATA if metadata is None else metadata)
    return out.getvalue()


TABLES = (
    "CREATE TABLE metadata (name TEXT, value TEXT)",
    "CREATE TABLE tiles (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, "
    "tile_data BLOB)",
)
INDEX = "CREATE UNIQUE INDEX tile_index ON tiles (zoom_level, tile_column, tile_row)"


def mbtiles(
    path: Path,
    tiles: dict[tuple[int, int, int], bytes] | None = None,
    metadata: dict[str, str] | None = None,
    statements: tuple[str, ...] = (*TABLES, INDEX),
) -> Path:
    connection = sqlite3.connect(path)
    for statement in statements:
        connection.execute(statement)
    told = {"name": "Harbour", "format": "png", "bounds": "-84.6,42.6,-84.2,42.9"}
    rows = {**told, "minzoom": "8", "maxzoom": str(Z)} if metadata is None else metadata
    if "CREATE TABLE metadata (name TEXT, value TEXT)" in statements:
        connection.executemany("INSERT INTO metadata VALUES (?, ?)", rows.items())
    if TABLES[1] in statements:
        placed = {(Z, X, Y): png()} if tiles is None else tiles
        connection.executemany(
            "INSERT INTO tiles VALUES (?, ?, ?, ?)",
            [(z, x, (1 << z) - 1 - y, data) for (z, x, y), data in placed.items()],
        )
    connection.commit()
    connection.close()
    return path
