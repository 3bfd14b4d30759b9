"""The one file that a backup is: a gzipped tar of plain files, with a manifest at its end."""

import gzip
import hashlib
import io
import json
import tarfile
import zlib
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final, Protocol

from server.backup.content import MANIFEST, is_member
from server.backup.failure import BackupError

FORMAT: Final = 1
BLOCK_BYTES: Final = 1 << 20
_GZIP_LEVEL: Final = 4
_MANIFEST_BYTES_MAX: Final = 64 << 20
_MODE: Final = 0o600


class ByteSource(Protocol):
    """What an archive is read from, from its beginning to its end."""

    def read(self, size: int = -1, /) -> bytes:
        """Return the next bytes, fewer than asked for at the end alone."""
        ...


class ByteSink(Protocol):
    """What an archive is written to."""

    def write(self, data: bytes, /) -> int:
        """Take all of the bytes."""
        ...


@dataclass(frozen=True, slots=True)
class Content:
    """Size and hash of one member."""

    bytes: int
    sha256: str


Contents = Mapping[str, Content]
"""By the names of members."""
OnBytes = Callable[[int], None]
"""Told how many bytes were just read; what it raises ends the work."""


class _Counted:
    """A file that is hashed while it is read."""

    def __init__(self, file: IO[bytes], on_bytes: OnBytes) -> None:
        self._file, self._on_bytes = file, on_bytes
        self._hash = hashlib.sha256()
        self._bytes = 0

    def read(self, size: int = -1, /) -> bytes:
        data = self._file.read(size)
        self._hash.update(data)
        self._bytes += len(data)
        self._on_bytes(len(data))
        return data

    @property
    def content(self) -> Content:
        return Content(self._bytes, self._hash.hexdigest())


def write_archive(
    sink: ByteSink,
    files: Iterable[tuple[str, Path]],
    about: Mapping[str, Any],
    on_bytes: OnBytes,
) -> Contents:
    """Write an archive; a file that is gone by now is left out.

    Args:
        sink: Where to.
        files: Names of members, and their files.
        about: What the manifest says beside sizes and hashes.
        on_bytes: Told of each block.

    Raises:
        OSError: If the disk refuses.
    """
    written: dict[str, Content] = {}
    with (
        gzip.GzipFile("", "wb", _GZIP_LEVEL, sink) as stream,  # type: ignore[arg-type]
        tarfile.open(fileobj=stream, mode="w|") as archive,
    ):
        for name, path in files:
            with suppress(FileNotFoundError), path.open("rb") as file:
                member = archive.gettarinfo(arcname=name, fileobj=file)
                counted = _Counted(file, on_bytes)
                archive.addfile(_plain(member), counted)  # type: ignore[arg-type]
                written[name] = counted.content
        said = {name: {"bytes": one.bytes, "sha256": one.sha256} for name, one in written.items()}
        document = json.dumps({"format": FORMAT, **about, "files": said}, indent=1).encode()
        member = tarfile.TarInfo(MANIFEST)
        member.size = len(document)
        archive.addfile(_plain(member), io.BytesIO(document))
    return written


def _plain(member: tarfile.TarInfo) -> tarfile.TarInfo:
    """Say nothing of this machine's people."""
    member.mode, member.uid, member.gid, member.uname, member.gname = _MODE, 0, 0, "", ""
    return member


def read_archive(
    source: ByteSource,
    shown: object,
    take: Callable[[str, ByteSource], None],
    on_bytes: OnBytes = lambda _: None,
) -> Contents:
    """Read an archive to its end, hold it against its manifest, and return what was in it.

    Args:
        source: Where from.
        shown: What the file is called in sentences.
        take: Given each member but the manifest; reads all of it.
        on_bytes: Told of each block.

    Raises:
        BackupError: If it is damaged, cut off, or no backup. What was taken may be wrong then.
    """
    read: dict[str, Content] = {}
    told: Contents | None = None
    with _refused(shown), gzip.GzipFile(fileobj=source) as stream:  # type: ignore[arg-type]
        with tarfile.open(fileobj=stream, mode="r|") as archive:
            for member, content in _members(archive, shown):
                if member.name == MANIFEST:
                    told = _manifest(content.read(_MANIFEST_BYTES_MAX), shown)
                    continue
                counted = _Counted(content, on_bytes)
                take(member.name, counted)
                read[member.name] = counted.content
        # The checksum stands at the end, behind what tar reads.
        while stream.read(BLOCK_BYTES):
            pass
    if told is not None and told != read:
        wrong = sorted(name for name in {*told, *read} if told.get(name) != read.get(name))
        raise BackupError(f"{shown} is damaged: {wrong[0]} is not what its manifest says.")
    return read


def drain(name: str, content: ByteSource) -> None:
    """Read a member and keep nothing of it."""
    del name
    while content.read(BLOCK_BYTES):
        pass


def _members(
    archive: tarfile.TarFile, shown: object
) -> Generator[tuple[tarfile.TarInfo, IO[bytes]]]:
    for member in archive:
        content = archive.extractfile(member) if member.isfile() else None
        if content is None or not is_member(member.name):
            raise BackupError(f"{shown} holds {member.name!r}; it is no backup of a station.")
        yield member, content


def _manifest(data: bytes, shown: object) -> Contents:
    try:
        document = json.loads(data)
        if document["format"] != FORMAT:
            raise BackupError(
                f"{shown} has format {document['format']}; restore it by the version of the "
                "station that made it, or a later one."
            )
        return {
            name: Content(one["bytes"], one["sha256"]) for name, one in document["files"].items()
        }
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise BackupError(f"{shown} is damaged: its manifest cannot be read.") from error


@contextmanager
def _refused(shown: object) -> Generator[None]:
    try:
        yield
    except (tarfile.TarError, EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise BackupError(f"{shown} is no backup, or a damaged one ({error}).") from error
    except OSError as error:
        raise BackupError(f"{shown} cannot be read: {error.strerror or error}.") from error
