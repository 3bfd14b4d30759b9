"""An append-only file of frames: each is on the disk when ``append`` returns, or is not in it.

Layout: 8 bytes of magic, 16 bytes that name the file, then for each frame its length and the CRC-32
of its payload (two 32-bit numbers, little-endian) before the payload.
"""

import errno
import logging
import os
import shutil
import struct
import zlib
from collections.abc import Iterator
from io import FileIO
from pathlib import Path
from typing import NamedTuple
from uuid import UUID, uuid4

from robot_link.whole_file import keep_names

log = logging.getLogger(__name__)

_MAGIC = b"GRACEFR1"
_HEAD = struct.Struct("<II")
START = len(_MAGIC) + 16
"""Offset of the first frame."""
FRAME_BYTES_MAX = 2**28
"""A longer length was never written, nor one of nothing; it is a damaged one."""
TORN = ".torn"
"""Ends the name of the file with what is no whole frame."""
_BLOCK_BYTES = 1 << 20


class Frame(NamedTuple):
    """One frame, and where the next one begins."""

    payload: bytes
    end: int


class _Found(NamedTuple):
    """What stands at an offset."""

    payload: bytes | None
    """``None`` where it is damaged."""
    end: int


class FrameFile:
    """One such file; it exists only while there is a frame in it. Belongs to one thread.

    A frame that the disk has damaged is passed over, and kept beside the file (``.torn``). So is
    what a process that was killed left half written at the end, which is cut off when the file is
    opened: nobody was told that it is kept.

    Args:
        path: The file.
        reserve_bytes: What must stay free on its disk; a frame that would take of it is refused.
    """

    def __init__(self, path: Path, reserve_bytes: int = 0) -> None:
        self._path = path
        self._reserve_bytes = reserve_bytes
        self._file: FileIO | None = None
        self.name = uuid4()
        """Names this file; another one at the same path has another name."""
        self.end = START
        """Offset behind the last whole frame."""
        self._passed_over: set[int] = set()
        """Where damaged frames begin that are beside the file already."""
        if path.exists():
            self._open()

    @property
    def is_empty(self) -> bool:
        """Whether there is no frame in it."""
        return self.end == START

    def append(self, payload: bytes) -> int:
        """Add a frame; return its end, once it has reached the disk.

        Raises:
            OSError: It has not, and is not in the file.
        """
        if shutil.disk_usage(self._path.parent).free < self._reserve_bytes + len(payload):
            raise OSError(errno.ENOSPC, "too little room is left on the disk", str(self._path))
        file = self._file or self._create()
        try:
            file.seek(self.end)
            _write_whole(file, _HEAD.pack(len(payload), zlib.crc32(payload)) + payload)
            os.fsync(file.fileno())
        except OSError:
            file.truncate(self.end)
            raise
        self.end += _HEAD.size + len(payload)
        return self.end

    def frames(self, offset: int = START) -> Iterator[Frame]:
        """Yield the whole frames from the one at an offset on.

        Raises:
            OSError: If it cannot be read.
        """
        while self._file is not None and offset < self.end:
            found = _read(self._file, offset, self.end)
            end = self.end if found is None else found.end
            if found is not None and found.payload is not None:
                yield Frame(found.payload, end)
            elif offset not in self._passed_over:
                self._keep_beside(self._file, offset, end)
                self._passed_over.add(offset)
            offset = end

    def clear(self) -> None:
        """Remove every frame; its name stays.

        Raises:
            OSError: If the file cannot be removed. Its frames may be read when it is opened again;
                here it is empty, and the next frame takes their place.
        """
        self.close()
        self.end = START
        self._passed_over.clear()
        self._path.unlink(missing_ok=True)
        keep_names(self._path.parent)

    def close(self) -> None:
        """Let go of the file."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _create(self) -> FileIO:
        file = FileIO(self._path, "w+")
        try:
            _write_whole(file, _MAGIC + self.name.bytes)
            keep_names(self._path.parent)
        except OSError:
            file.close()
            raise
        self._file = file
        return file

    def _open(self) -> None:
        file = FileIO(self._path, "r+")
        head = file.read(START)
        if len(head) == START and head.startswith(_MAGIC):
            self.name = UUID(bytes=head[len(_MAGIC) :])
            self._file = file
        size = os.fstat(file.fileno()).st_size
        offset = START
        while self._file is not None and (found := _read(file, offset, size)) is not None:
            offset = found.end
            if found.payload is not None:
                self.end = offset
        whole = 0 if self._file is None else self.end
        if size > whole:
            self._keep_beside(file, whole, size)
            file.truncate(whole)
        if self._file is None or self.is_empty:
            self._file = file
            self.clear()

    def _keep_beside(self, file: FileIO, begin: int, end: int) -> None:
        """Keep bytes that are no whole frame for a person."""
        beside = self._path.with_suffix(TORN)
        log.error(
            "%s: %d bytes are torn or damaged; they are in %s", self._path, end - begin, beside
        )
        file.seek(begin)
        with beside.open("ab") as kept:
            while begin < end and (block := file.read(min(end - begin, _BLOCK_BYTES))):
                kept.write(block)
                begin += len(block)
            kept.flush()
            os.fsync(kept.fileno())


def _write_whole(file: FileIO, data: bytes) -> None:
    if file.write(data) < len(data):
        raise OSError(errno.ENOSPC, "only a part was written")


def _read(file: FileIO, offset: int, limit: int) -> _Found | None:
    """Return what stands at an offset, ``None`` where no frame can end by a limit."""
    file.seek(offset)
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    length, crc = _HEAD.unpack(head)
    end = offset + _HEAD.size + length
    if not 1 <= length <= FRAME_BYTES_MAX or end > limit:
        return None
    payload = file.read(length)
    return _Found(payload if zlib.crc32(payload) == crc else None, end)
