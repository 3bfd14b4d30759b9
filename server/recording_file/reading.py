"""Files of one upload: what each is, by its content, and all of them as one recording."""

import shutil
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Final, Literal

import numpy as np

from server.recording_file import netcdf, og1_reader, seaglider
from server.recording_file.card import Card, is_card, read_card
from server.recording_file.csv_file import read_csv
from server.recording_file.raw import (
    ROWS_MAX,
    Column,
    Fixes,
    FlagArray,
    RawRecording,
    Tell,
    UnreadableError,
)
from server.recording_file.slocum import LABEL, is_cache, is_packed_slocum
from server.recording_file.slocum_recording import read_pair, side_of

FILE_BYTES_MAX: Final = 2 << 30
ZIP_MEMBERS_MAX: Final = 10_000
ZIP_EXPANSION_MAX: Final = 50
_ZIP_FREE_BYTES: Final = 1 << 20
"""So much may come of any archive: a small text packs better than the limit."""
_BLOCK_BYTES: Final = 1 << 20
Kind = Literal["netcdf", "slocum", "cache", "zip", "card", "text"]
NamedFile = tuple[str, Path]
"""A file as the operator knows it, and where it lies."""


def kind_of(name: str, path: Path) -> Kind:
    """Return what a file is by its first octets; the name tells only empty Slocum files apart."""
    with path.open("rb") as file:
        head = file.read(16)
    if head.startswith((b"CDF\x01", b"CDF\x02", b"CDF\x05", b"\x89HDF")):
        return "netcdf"
    if head.startswith(LABEL) or is_packed_slocum(head):
        return "slocum"
    if head.startswith(b"PK\x03\x04"):
        return "zip"
    if is_cache(head):
        return "cache"
    if not head and Path(name).suffix.lower().endswith(("bd", "cd")) and side_of(name):
        return "slocum"
    return "card" if is_card(path) else "text"


def read_files(files: Sequence[NamedFile], folder: Path, tell: Tell) -> RawRecording | Card:
    """Read the files of one upload as one recording, or as the card of a robot of ours.

    Args:
        files: What was sent: one table, dives of a Seaglider, files of OG1, a Slocum's files with
            their caches, or a robot's memory of samples; each may lie in an archive.
        folder: An empty folder for what archives hold.
        tell: Told how much is read.

    Raises:
        UnreadableError: If a file cannot be read, or they do not belong together.
    """
    found = _unpacked(files, folder)
    by_kind: dict[Kind, list[NamedFile]] = {}
    for name, path in found:
        if path.stat().st_size > FILE_BYTES_MAX:
            raise UnreadableError(f"{name} has more than {FILE_BYTES_MAX >> 30} GiB.")
        by_kind.setdefault(kind_of(name, path), []).append((name, path))
    caches = {Path(name).stem.lower(): path for name, path in by_kind.pop("cache", [])}
    if "card" in by_kind and by_kind.keys() <= {"card", "text"}:
        left_out = [name for name, _ in by_kind.get("text", [])]
        return read_card(sorted(by_kind["card"]), tell, left_out)
    if len(by_kind) > 1:
        kinds = ", ".join(f"{group[0][0]} ({kind})" for kind, group in sorted(by_kind.items()))
        raise UnreadableError(f"Files of several kinds are several imports: {kinds}.")
    if not by_kind:
        raise UnreadableError("There is no recording among the files, only cache files.")
    ((kind, group),) = by_kind.items()
    if kind == "slocum":
        return read_pair(sorted(group), caches, tell)
    if kind == "netcdf":
        return _read_netcdf(sorted(group), tell)
    if len(group) > 1:
        raise UnreadableError(f"{len(group)} tables are {len(group)} imports; send one at a time.")
    name, path = group[0]
    return read_csv(path, name, tell)


def _unpacked(files: Sequence[NamedFile], folder: Path) -> list[NamedFile]:
    found: list[NamedFile] = []
    for name, path in files:
        if kind_of(name, path) == "zip":
            found += _members(name, path, folder)
        else:
            found.append((name, path))
    return found


def _members(name: str, path: Path, folder: Path) -> list[NamedFile]:
    """Unpack an archive; what it says of its sizes is not believed."""
    left = max(_ZIP_FREE_BYTES, ZIP_EXPANSION_MAX * path.stat().st_size)
    found: list[NamedFile] = []
    try:
        with zipfile.ZipFile(path) as archive:
            members = [one for one in archive.infolist() if not one.is_dir()]
            if len(members) > ZIP_MEMBERS_MAX:
                raise UnreadableError(
                    f"{name} has {len(members):,} members; at most {ZIP_MEMBERS_MAX:,} are read."
                )
            for number, member in enumerate(members):
                place = PurePosixPath(member.filename.replace("\\", "/"))
                if place.is_absolute() or ".." in place.parts:
                    raise UnreadableError(f"{name}: the member {member.filename!r} leads outside.")
                target = folder / f"member-{number}"
                with archive.open(member) as source, target.open("wb") as kept:
                    while block := source.read(_BLOCK_BYTES):
                        left -= len(block)
                        if left < 0:
                            raise UnreadableError(
                                f"{name} would grow to more than {ZIP_EXPANSION_MAX} times its "
                                "size; it is not unpacked."
                            )
                        kept.write(block)
                if kind_of(place.name, target) == "zip":
                    raise UnreadableError(f"{name}: {place.name} is an archive in an archive.")
                found.append((place.name, target))
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise UnreadableError(f"{name} is no whole ZIP archive: {error}.") from error
    if not found:
        raise UnreadableError(f"{name} is an empty archive.")
    return found


def _read_netcdf(files: Sequence[NamedFile], tell: Tell) -> RawRecording:
    parts: list[RawRecording] = []
    for number, (name, path) in enumerate(files):
        with netcdf.opened(path, name) as file:
            if seaglider.is_seaglider(file):
                reader = seaglider.read_dive
            elif og1_reader.is_og1(file):
                reader = og1_reader.read_og1
            else:
                raise UnreadableError(f"{name} is NetCDF, but neither OG1 nor of a Seaglider.")
        parts.append(reader(path, name))
        tell((number + 1) / len(files))
    if len({part.format for part in parts}) > 1:
        raise UnreadableError("Files of a Seaglider and of OG1 are several imports.")
    parts.sort(key=_number_of_dive)
    return parts[0] if len(parts) == 1 else _joined(parts)


def _number_of_dive(part: RawRecording) -> tuple[float, str]:
    told = part.scalars.get("dive_number", "")
    return (float(told) if told.isdigit() else 0.0, part.files[0])


def _joined(parts: Sequence[RawRecording]) -> RawRecording:
    """Put recordings one after another, with the columns of all of them."""
    if sum(map(len, parts)) > ROWS_MAX:
        raise UnreadableError(f"The files have more than {ROWS_MAX:,} rows together.")
    columns: dict[str, Column] = {}
    for part in parts:
        for key, column in part.columns.items():
            columns.setdefault(key, column)
    fixes = [part.fixes for part in parts if part.fixes is not None]
    return replace(
        parts[0],
        files=tuple(part.files[0] for part in parts),
        columns={
            key: replace(
                column,
                values=np.concatenate([_numbers(part, key) for part in parts]),
                flags=_flags(parts, key),
            )
            for key, column in columns.items()
        },
        row=np.concatenate([part.row for part in parts]),
        file=np.concatenate([np.full(len(part), index) for index, part in enumerate(parts)]),
        fixes=Fixes(
            np.concatenate([one.time_s for one in fixes]),
            np.concatenate([one.latitude_deg for one in fixes]),
            np.concatenate([one.longitude_deg for one in fixes]),
        )
        if fixes
        else None,
        notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
        is_simulated=any(part.is_simulated for part in parts),
    )


def _numbers(part: RawRecording, key: str) -> np.ndarray:
    column = part.columns.get(key)
    return np.full(len(part), np.nan) if column is None else column.values


def _flags(parts: Sequence[RawRecording], key: str) -> FlagArray | None:
    if all(key not in part.columns or part.columns[key].flags is None for part in parts):
        return None
    silent = [part.columns[key].flags if key in part.columns else None for part in parts]
    return np.concatenate(
        [
            np.full(len(part), -127, dtype=np.int8) if flags is None else flags
            for part, flags in zip(parts, silent, strict=True)
        ]
    )


def forget(folder: Path) -> None:
    """Delete what was unpacked."""
    shutil.rmtree(folder, ignore_errors=True)
