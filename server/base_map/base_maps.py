"""The base maps of a station: the files of one folder, each opened once."""

import asyncio
import contextlib
import os
import re
import shutil
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

from server.base.text import TITLE_LENGTH_MAX, shown
from server.base_map.mbtiles_file import MbtilesFile
from server.base_map.pmtiles_file import PmtilesFile
from server.base_map.tile_file import TileFacts, TileFile
from server.base_map.tile_image import TileFileError, picture

FOLDER: Final = "base-maps"
"""Within the data folder."""
ID_PATTERN: Final = r"^[a-z0-9][a-z0-9-]{0,59}$"
_ENDINGS: Final = (".pmtiles", ".mbtiles")
_INCOMING: Final = ".incoming-"


class BaseMapExistsError(Exception):
    """A base map of this id is there already; the sentence names it."""


class UnknownBaseMapError(LookupError):
    """There is no base map of this id."""


@dataclass(frozen=True, slots=True)
class BaseMap:
    """One base map that can be drawn."""

    id: str
    file: str
    bytes: int
    revision: str
    """Changes with the file."""
    facts: TileFacts

    @property
    def title(self) -> str:
        """What it calls itself, else its id."""
        return self.facts.title or self.id


@dataclass(frozen=True, slots=True)
class RefusedFile:
    """A file of the folder that is no base map."""

    file: str
    reason: str


@dataclass(frozen=True, slots=True)
class _Open:
    map: BaseMap
    tiles: TileFile


class BaseMaps:
    """Finds, opens and keeps base maps. Blocks on the disk: call it beside the event loop.

    The folder is the only truth: a file that is put into it by hand is found with the next look.
    """

    def __init__(self, data_dir: Path) -> None:
        self._folder = data_dir / FOLDER
        self._lock = threading.Lock()
        """Held while maps are looked for, so never while a large file is copied."""
        self._adding = threading.Lock()
        self._open: dict[str, _Open] = {}

    def look(self) -> tuple[list[BaseMap], list[RefusedFile]]:
        """Return the base maps by their ids, and files of the folder that are none."""
        with self._lock:
            return self._look()

    def tile(self, base_map: str, z: int, x: int, y: int) -> tuple[str, bytes] | None:
        """Return media type and bytes of a tile, ``None`` where the map has none.

        Raises:
            UnknownBaseMapError: If there is no such map.
            TileFileError: If the tile is not to be served.
        """
        found = self._open.get(base_map)
        if found is None:
            self.look()
            found = self._open.get(base_map)
        if found is None:
            raise UnknownBaseMapError(base_map)
        data = found.tiles.tile(z, x, y)
        return None if data is None else picture(data)

    def add(self, source: IO[bytes], name: str) -> BaseMap:
        """Copy a file into the folder, under its own name made simple; whole or not at all.

        Raises:
            TileFileError: If it is no base map.
            BaseMapExistsError: If one of this id is there.
            OSError: If there is no room for it.
        """
        key = id_of(name)
        with self._adding:
            self._folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            self._check_free(key)
            path = self._folder / f"{_INCOMING}{os.getpid()}"
            try:
                self._copy(source, path)
                tiles = open_tile_file(path)
                ending = _ENDINGS[isinstance(tiles, MbtilesFile)]
                tiles.close()
                with self._lock:
                    self._check_free(key)
                    path.replace(self._folder / f"{key}{ending}")
                    found, _ = self._look()
            finally:
                path.unlink(missing_ok=True)
        return next(one for one in found if one.id == key)

    def remove(self, base_map: str) -> BaseMap:
        """Delete a base map and its file.

        Raises:
            UnknownBaseMapError: If there is no such map.
        """
        with self._lock:
            self._look()
            found = self._open.pop(base_map, None)
            if found is None:
                raise UnknownBaseMapError(base_map)
            found.tiles.close()
            (self._folder / found.map.file).unlink(missing_ok=True)
        return found.map

    async def stop(self) -> None:
        """Close every file."""
        await asyncio.to_thread(self._close)

    def _close(self) -> None:
        with self._lock:
            for one in self._open.values():
                one.tiles.close()
            self._open.clear()

    def _check_free(self, key: str) -> None:
        for ending in _ENDINGS:
            if (self._folder / f"{key}{ending}").exists():
                raise BaseMapExistsError(f"There is a base map {key} already; remove it first.")

    def _copy(self, source: IO[bytes], path: Path) -> None:
        """Copy a file beside the others; what a killed station left behind is cleared away."""
        for left in self._folder.glob(f"{_INCOMING}*"):
            left.unlink(missing_ok=True)
        with path.open("xb") as copy:
            shutil.copyfileobj(source, copy, 1 << 20)
            copy.flush()
            os.fsync(copy.fileno())

    def _look(self) -> tuple[list[BaseMap], list[RefusedFile]]:
        found: dict[str, BaseMap] = {}
        refused: list[RefusedFile] = []
        for path in self._files():
            name = shown(path.name)
            try:
                base_map = self._opened(path)
            except (TileFileError, OSError) as error:
                reason = error.strerror if isinstance(error, OSError) else str(error)
                refused.append(RefusedFile(name, reason or "it cannot be read"))
                continue
            if base_map.id in found:
                refused.append(RefusedFile(name, f"there is another base map {base_map.id}"))
            else:
                found[base_map.id] = base_map
        for gone in set(self._open) - set(found):
            self._open.pop(gone).tiles.close()
        return list(found.values()), refused

    def _files(self) -> list[Path]:
        with contextlib.suppress(FileNotFoundError):
            return sorted(
                path for path in self._folder.iterdir() if path.suffix.lower() in _ENDINGS
            )
        return []

    def _opened(self, path: Path) -> BaseMap:
        key, info = id_of(path.name), path.stat()
        revision = f"{info.st_mtime_ns:x}-{info.st_size:x}"
        known = self._open.get(key)
        if known is not None and known.map.file == path.name:
            if known.map.revision == revision:
                return known.map
            self._open.pop(key).tiles.close()
        elif known is not None:
            return known.map
        tiles = open_tile_file(path)
        base_map = BaseMap(key, path.name, info.st_size, revision, tiles.facts)
        self._open[key] = _Open(base_map, tiles)
        return base_map


def id_of(file: str) -> str:
    """Return the id of a file's base map: its name in small letters, digits and dashes.

    Raises:
        TileFileError: If nothing of the name is left.
    """
    stem = file.rsplit("/", 1)[-1].rsplit("\\", 1)[-1].rsplit(".", 1)[0]
    key = re.sub(r"[^a-z0-9]+", "-", stem.lower()).strip("-")[:TITLE_LENGTH_MAX][:60].strip("-")
    if not key:
        raise TileFileError("its name has no letter a to z and no digit: rename it")
    return key


def open_tile_file(path: Path) -> TileFile:
    """Open a PMTiles or MBTiles file by what it holds, not by its name.

    Raises:
        TileFileError: If it is no such file, or one that is not read here.
        OSError: If it cannot be read.
    """
    with path.open("rb") as file:
        head = file.read(16)
    if head.startswith(b"PMTiles"):
        return PmtilesFile(path)
    if head.startswith(b"SQLite format 3\0"):
        return MbtilesFile(path)
    if head.startswith(b"PM"):
        raise TileFileError("it is PMTiles of version 1 or 2; version 3 is read")
    raise TileFileError("it is neither PMTiles nor MBTiles")
