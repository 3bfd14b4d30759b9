"""PMTiles, version 3: a header, directories packed by gzip, and tiles one after the other.

Source:
    https://github.com/protomaps/PMTiles/blob/main/spec/v3/spec.md
"""

import bisect
import json
import os
import threading
from array import array
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pmtiles.tile import Compression, TileType, deserialize_header, zxy_to_tileid

from server.base.text import TITLE_LENGTH_MAX
from server.base_map.tile_file import (
    ATTRIBUTION_LENGTH_MAX,
    TileFacts,
    checked_extent,
    checked_zooms,
    plain,
)
from server.base_map.tile_image import TILE_BYTES_MAX, TileFileError, inflated, picture

HEADER_BYTES: Final = 127
VERSION: Final = 3
PACKED_BYTES_MAX: Final = 2**20
UNPACKED_BYTES_MAX: Final = 2**22
ENTRIES_MAX: Final = 2**16
"""Of one directory."""
DIRECTORIES_KEPT: Final = 8
LEVELS_MAX: Final = 4
_PICTURES: Final = frozenset({TileType.UNKNOWN, TileType.PNG, TileType.JPEG, TileType.WEBP})


@dataclass(frozen=True, slots=True)
class _Directory:
    """Where tiles lie, in the order of their ids; an entry with no run points to another."""

    ids: "array[int]"
    runs: "array[int]"
    lengths: "array[int]"
    offsets: "array[int]"

    def find(self, tile: int) -> tuple[int, int, int] | None:
        """Return run, offset and length of the entry that holds a tile."""
        at = bisect.bisect_right(self.ids, tile) - 1
        if at < 0:
            return None
        run = self.runs[at]
        if run and tile - self.ids[at] >= run:
            return None
        return run, self.offsets[at], self.lengths[at]


class PmtilesFile:
    """One open file; it is read by place, and of its directories only those last used are kept."""

    def __init__(self, path: Path) -> None:
        """Open a file and look at its first tile.

        Raises:
            TileFileError: If it is broken, of another version, or holds no pictures.
        """
        self._lock = threading.Lock()
        self._directories: OrderedDict[int, _Directory] = OrderedDict()
        self._file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        try:
            self._size = os.fstat(self._file).st_size
            self._header = self._read_header()
            self.facts = self._facts()
        except BaseException:
            self.close()
            raise

    def tile(self, z: int, x: int, y: int) -> bytes | None:
        """Return a tile, ``None`` if the file has none there."""
        with self._lock:
            return self._tile(zxy_to_tileid(z, x, y))

    def close(self) -> None:
        """Let go of the file."""
        with self._lock:
            if self._file >= 0:
                os.close(self._file)
            self._file = -1

    def _tile(self, tile: int | None) -> bytes | None:
        """Return the tile of an id, or for ``None`` the first that there is."""
        header = self._header
        offset, length = header["root_offset"], header["root_length"]
        for _ in range(LEVELS_MAX):
            directory = self._directory(offset, length)
            if not directory.ids:
                return None
            found = directory.find(directory.ids[0] if tile is None else tile)
            if found is None:
                return None
            run, offset, length = found
            if run:
                if length > TILE_BYTES_MAX:
                    raise TileFileError(
                        f"a tile has {length} bytes; at most {TILE_BYTES_MAX} are taken"
                    )
                return self._read(header["tile_data_offset"] + offset, length)
            offset += header["leaf_directory_offset"]
        raise TileFileError("its directories lead in a circle")

    def _read(self, offset: int, length: int) -> bytes:
        if self._file < 0:
            raise TileFileError("it was closed")
        if offset + length > self._size:
            raise TileFileError("it is cut short")
        return os.pread(self._file, length, offset)

    def _read_header(self) -> Any:  # noqa: ANN401 - the package's own dictionary
        raw = self._read(0, HEADER_BYTES)
        if raw[7] != VERSION:
            raise TileFileError(f"it is PMTiles of version {raw[7]}; version {VERSION} is read")
        try:
            header = deserialize_header(raw)
        except ValueError as error:
            raise TileFileError(f"its header cannot be read ({error})") from error
        if header["internal_compression"] not in {Compression.NONE, Compression.GZIP}:
            raise TileFileError("its directories are packed by something else than gzip")
        if header["tile_compression"] in {Compression.BROTLI, Compression.ZSTD}:
            raise TileFileError("its tiles are packed by something else than gzip")
        if header["tile_type"] not in _PICTURES:
            raise TileFileError(
                f"its tiles are {header['tile_type'].name}, not pictures: make it anew with PNG, "
                "JPEG or WebP tiles"
            )
        if header["tile_data_offset"] + header["tile_data_length"] > self._size:
            raise TileFileError("it is cut short")
        return header

    def _facts(self) -> TileFacts:
        header, told = self._header, self._metadata()
        first = self._tile(None)
        if first is None:
            raise TileFileError("it holds no tiles")
        names = ("min_lon_e7", "min_lat_e7", "max_lon_e7", "max_lat_e7")
        west, south, east, north = checked_extent([header[name] * 1e-7 for name in names])
        low, high = checked_zooms(header["min_zoom"], header["max_zoom"])
        return TileFacts(
            title=plain(told.get("name"), TITLE_LENGTH_MAX),
            attribution=plain(told.get("attribution"), ATTRIBUTION_LENGTH_MAX),
            media_type=picture(first)[0],
            west_deg=west,
            south_deg=south,
            east_deg=east,
            north_deg=north,
            min_zoom=low,
            max_zoom=high,
        )

    def _metadata(self) -> dict[str, Any]:
        offset, length = self._header["metadata_offset"], self._header["metadata_length"]
        if not length:
            return {}
        try:
            found = json.loads(self._unpacked(offset, length, "its metadata"))
        except (ValueError, RecursionError) as error:
            raise TileFileError("its metadata are not JSON") from error
        return found if isinstance(found, dict) else {}

    def _directory(self, offset: int, length: int) -> _Directory:
        if offset in self._directories:
            self._directories.move_to_end(offset)
            return self._directories[offset]
        directory = _parsed(self._unpacked(offset, length, "a directory"))
        self._directories[offset] = directory
        if len(self._directories) > DIRECTORIES_KEPT:
            self._directories.popitem(last=False)
        return directory

    def _unpacked(self, offset: int, length: int, name: str) -> bytes:
        if length > PACKED_BYTES_MAX:
            raise TileFileError(f"{name} has {length} bytes; at most {PACKED_BYTES_MAX} are taken")
        raw = self._read(offset, length)
        if self._header["internal_compression"] is Compression.NONE:
            return raw
        return inflated(raw, UNPACKED_BYTES_MAX, name)


def _parsed(data: bytes) -> _Directory:
    """Read a directory: how many entries, then ids, runs, lengths and offsets of all of them."""
    try:
        count, at = _varint(data, 0)
        if count > ENTRIES_MAX:
            raise TileFileError(f"a directory has {count} entries; {ENTRIES_MAX} can be")
        columns: list[array[int]] = []
        for _ in range(4):
            column = array("Q")
            for _ in range(count):
                value, at = _varint(data, at)
                column.append(value)
            columns.append(column)
        ids, runs, lengths, offsets = columns
        for i in range(1, count):
            ids[i] += ids[i - 1]
        for i in range(count):
            # 0 says: right behind the one before.
            offsets[i] = offsets[i] - 1 if offsets[i] else offsets[i - 1] + lengths[i - 1]
    except (IndexError, OverflowError) as error:
        raise TileFileError("a directory is broken") from error
    return _Directory(ids, runs, lengths, offsets)


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """Return a number of 7 bits a byte, the lowest first, and where the next one begins."""
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at += 1
        if byte < 0x80:
            return value, at
        shift += 7
