"""Files of rows that left the database: gzip of JSON lines, readable for as long as there is gzip.

The first line says what the file holds: format, kind, robot, day, the names of the columns, and
what numbers in them stand for. Each further line is a row, an array of its columns; moments are
microseconds from the epoch (UTC), bytes are base64, numbers beyond all are ``Infinity``.
"""

import base64
import gzip
import hashlib
import json
import os
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from db.query.storage.taking import Row
from robot_link.whole_file import keep_names, replace_file

FOLDER: Final = "archive"
MANIFEST: Final = "manifest.jsonl"
FORMAT: Final = "grace archive 1"
_DAMAGE: Final = (OSError, EOFError, ValueError, zlib.error)
"""What reading a file that is not whole may raise."""
_STAY: Final = "its rows stay in the database"
_FOLDERS: Final = 4
"""A file may be the first in a robot's folder, a kind's, the archive's and the data folder."""
_BLOCK: Final = 1 << 20


class ArchiveError(Exception):
    """A file cannot be written, or is not what was written; the sentence says which and why."""


@dataclass(frozen=True, slots=True)
class Header:
    """What a file says of itself."""

    kind: str
    robot: str
    """Id of the robot; "" where rows of all lie together."""
    day: str
    """Such as ``2026-11-21``, UTC."""
    columns: tuple[str, ...]
    names: Mapping[str, Any]
    """What numbers stand for: ``robots``, ``channels`` and ``logs`` by their keys."""


@dataclass(frozen=True, slots=True)
class Written:
    """A file as it lies on the disk."""

    rows: int
    bytes: int
    sha256: str
    first_us: int
    last_us: int


def write_archive(file: Path, header: Header, rows: Iterable[Row], at: str) -> Written | None:
    """Write a file, durable and read back once it returns; ``None`` where there are no rows.

    Raises:
        ArchiveError: If the disk refuses, or what is read back is something else.
    """
    fresh = file.with_name(f".{file.name}.new")
    try:
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        count, digest, first_us, last_us = _write(fresh, header, rows, at)
        if count == 0:
            fresh.unlink()
            return None
        if _contents(fresh) != (count, digest):
            raise ArchiveError(f"{file} does not hold what was written to it; {_STAY}.")
        size, sha256 = fresh.stat().st_size, sha256_of(fresh)
        fresh.replace(file)
        for folder in file.parents[:_FOLDERS]:
            keep_names(folder)
    except OSError as error:
        with suppress(OSError):
            fresh.unlink(missing_ok=True)
        raise ArchiveError(
            f"{file} cannot be written: {error.strerror or error}; {_STAY}."
        ) from error
    return Written(count, size, sha256, first_us, last_us)


def _write(file: Path, header: Header, rows: Iterable[Row], at: str) -> tuple[int, str, int, int]:
    count, digest, moments = 0, hashlib.sha256(), (2**63, -(2**63))
    with file.open("wb") as raw:
        os.fchmod(raw.fileno(), 0o600)
        # Without a moment of its own: the same rows make the same file.
        with gzip.GzipFile("", "wb", compresslevel=6, fileobj=raw, mtime=0) as packed:
            first = {
                "format": FORMAT,
                "kind": header.kind,
                "robot": header.robot,
                "day": header.day,
                "columns": header.columns,
                **header.names,
            }
            packed.write(_line(first))
            for row in rows:
                line = _line([_plain(row[name]) for name in header.columns])
                packed.write(line)
                digest.update(line)
                count += 1
                moments = min(moments[0], row[at]), max(moments[1], row[at])
        raw.flush()
        os.fsync(raw.fileno())
        # Read again, it comes from the disk and not from memory.
        os.posix_fadvise(raw.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    return count, digest.hexdigest(), *moments


def _contents(file: Path) -> tuple[int, str]:
    count, digest = 0, hashlib.sha256()
    try:
        with gzip.open(file) as packed:
            packed.readline()
            for line in packed:
                digest.update(line)
                count += 1
    except _DAMAGE:
        return 0, ""
    return count, digest.hexdigest()


def write_manifest(folder: Path, files: Iterable[Mapping[str, Any]]) -> None:
    """Write beside the files what each of them holds, a line of JSON each, for other programs.

    Raises:
        ArchiveError: If the disk refuses.
    """
    lines = b"".join(_line(one) for one in files)
    try:
        replace_file(folder / MANIFEST, lines, mode=0o600)
    except OSError as error:
        raise ArchiveError(
            f"{folder / MANIFEST} cannot be written: {error.strerror or error}."
        ) from error


def read_header(file: Path) -> Header:
    """Return what a file says of itself.

    Raises:
        ArchiveError: If it is none of a station.
    """
    try:
        with gzip.open(file) as packed:
            told = json.loads(packed.readline())
        if told["format"] != FORMAT:
            raise ArchiveError(f"{file} is of a format that this station does not know.")
        names = {key: told[key] for key in ("robots", "channels", "logs") if key in told}
        return Header(told["kind"], told["robot"], told["day"], tuple(told["columns"]), names)
    except (*_DAMAGE, KeyError, TypeError) as error:
        raise ArchiveError(f"{file} holds no rows of a station, or is damaged.") from error


def read_rows(file: Path, header: Header) -> Iterator[Row]:
    """Yield the rows of a file.

    Raises:
        ArchiveError: If it is damaged.
    """
    try:
        with gzip.open(file) as packed:
            packed.readline()
            for line in packed:
                row = dict(zip(header.columns, json.loads(line), strict=True))
                if "data" in row:
                    row["data"] = base64.b64decode(row["data"])
                yield row
    except _DAMAGE as error:
        raise ArchiveError(f"{file} is damaged.") from error


def sha256_of(file: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal.

    Raises:
        OSError: If it cannot be read.
    """
    digest = hashlib.sha256()
    with file.open("rb") as source:
        while block := source.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def check_archive(file: Path, sha256: str) -> None:
    """Hold a file against what was noted of it.

    Raises:
        ArchiveError: If it is missing or something else.
    """
    try:
        found = sha256_of(file)
    except OSError as error:
        raise ArchiveError(f"{file} cannot be read: {error.strerror or error}.") from error
    if found != sha256:
        raise ArchiveError(f"{file} is not what was written: its SHA-256 is another.")


def _line(value: object) -> bytes:
    return json.dumps(value, separators=(",", ":")).encode() + b"\n"


def _plain(value: object) -> object:
    return base64.b64encode(value).decode() if isinstance(value, bytes) else value
