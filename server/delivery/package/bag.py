"""Packs files as a bag of BagIt 1.0 in a ZIP, streamed from disk.

The same files packed with the same information and moment give the same bytes: entries stand in
the order given, all of one time, and nothing tells of the machine. Source: RFC 8493.
"""

import hashlib
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final

_BAGIT: Final = "BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n"
_BLOCK_BYTES: Final = 1 << 20
_MODE: Final = 0o644 << 16
_UNIX: Final = 3


@dataclass(frozen=True, slots=True)
class Payload:
    """One file of a bag."""

    name: str
    """Where it lies below ``data``, such as ``csv/samples.csv``."""
    path: Path
    is_packed: bool = False
    """Whether it is compressed already."""


def write_bag(
    target: Path,
    top: str,
    payloads: Sequence[Payload],
    information: Mapping[str, str],
    at: datetime,
    on_block: Callable[[int], None] = lambda _: None,
) -> None:
    """Write a bag with one top folder.

    Args:
        target: The ZIP, which must not exist.
        top: Name of the folder that holds everything.
        payloads: What lies below ``data``, in this order.
        information: What ``bag-info.txt`` says of the bag, beside its size; one line each.
        at: Time of every entry, UTC.
        on_block: Told how many bytes were read after each block; what it raises ends the work.

    Raises:
        OSError: If the disk has no room.
    """
    with zipfile.ZipFile(target, "x", allowZip64=True) as archive:
        pack = _Packer(archive, top, at, on_block)
        sums = {f"data/{one.name}": pack.file(one) for one in payloads}
        size = sum(one.path.stat().st_size for one in payloads)
        said = {**information, "Payload-Oxum": f"{size}.{len(payloads)}"}
        tags = {
            "bagit.txt": _BAGIT,
            "bag-info.txt": "".join(f"{key}: {' '.join(v.split())}\n" for key, v in said.items()),
            "manifest-sha256.txt": _manifest(sums.items()),
        }
        tag_sums = {name: pack.text(name, content) for name, content in tags.items()}
        pack.text("tagmanifest-sha256.txt", _manifest(tag_sums.items()))


def _manifest(sums: Iterable[tuple[str, str]]) -> str:
    return "".join(f"{digest}  {name}\n" for name, digest in sums)


class _Packer:
    """Adds entries to an archive; each tells its SHA-256."""

    def __init__(
        self, archive: zipfile.ZipFile, top: str, at: datetime, on_block: Callable[[int], None]
    ) -> None:
        self._archive, self._top, self._on_block = archive, top, on_block
        self._time = (at.year, at.month, at.day, at.hour, at.minute, at.second)

    def file(self, payload: Payload) -> str:
        """Add a file, block by block."""
        digest = hashlib.sha256()
        entry = self._entry(f"data/{payload.name}", is_packed=payload.is_packed)
        with (
            payload.path.open("rb") as source,
            self._archive.open(entry, "w", force_zip64=True) as packed,
        ):
            while block := source.read(_BLOCK_BYTES):
                self._on_block(len(block))
                digest.update(block)
                packed.write(block)
        return digest.hexdigest()

    def text(self, name: str, content: str) -> str:
        """Add a short text."""
        data = content.encode()
        self._archive.writestr(self._entry(name, is_packed=False), data)
        return hashlib.sha256(data).hexdigest()

    def _entry(self, name: str, *, is_packed: bool) -> zipfile.ZipInfo:
        entry = zipfile.ZipInfo(f"{self._top}/{name}", self._time)
        entry.compress_type = zipfile.ZIP_STORED if is_packed else zipfile.ZIP_DEFLATED
        entry.external_attr, entry.create_system = _MODE, _UNIX
        return entry
