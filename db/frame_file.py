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
"""A longer length was never written; it is a damaged one."""


class Frame(NamedTuple):
    """One frame, and where the next one begins."""

    payload: bytes
    end: int


class FrameFile:
    """One such file; it exists only while there is a frame in it. Belongs to one thread.

    What a process that was killed left half written at the end is cut off when the file is opened,
    and kept beside it (``.torn``): nobody was told that it is kept.

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
            frame = _read(self._file, offset)
            if frame is None:
                raise OSError(
                    errno.EIO, "a frame that was whole cannot be read any more", str(self._path)
                )
            yield frame
            offset = frame.end

    def clear(self) -> None:
        """Remove every frame; its name stays.

        Raises:
            OSError: If the file cannot be removed. Its frames may be read when it is opened again;
                here it is empty, and the next frame takes their place.
        """
        self.close()
        self.end = START
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
            while (frame := _read(file, self.end)) is not None:
                self.end = frame.end
        size = os.fstat(file.fileno()).st_size
        if size > self.end or self._file is None:
            torn = self._path.with_suffix(".torn")
            log.warning("%s ends in %d torn bytes; they are in %s", self._path, size, torn)
            file.seek(self.end if self._file else 0)
            with torn.open("ab") as kept:
                shutil.copyfileobj(file, kept)
            file.truncate(self.end if self._file else 0)
        if self._file is None or self.is_empty:
            self._file = file
            self.clear()


def _write_whole(file: FileIO, data: bytes) -> None:
    if file.write(data) < len(data):
        raise OSError(errno.ENOSPC, "only a part was written")


def _read(file: FileIO, offset: int) -> Frame | None:
    """Return the frame at an offset, ``None`` where none is whole."""
    file.seek(offset)
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    length, crc = _HEAD.unpack(head)
    if length > FRAME_BYTES_MAX:
        return None
    payload = file.read(length)
    if len(payload) < length or zlib.crc32(payload) != crc:
        return None
    return Frame(payload, offset + _HEAD.size + length)
