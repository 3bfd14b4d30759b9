"""Pictures of log entries: told by their bytes, kept under their hash, and nothing but pictures.

A PNG or WebP file that goes on behind its own end is refused, for it may be another file as well;
what follows the end of a JPEG file, as some cameras write it, is cut off.
"""

import os
import re
import struct
from collections.abc import Collection, Iterator
from hashlib import sha256
from pathlib import Path
from threading import Lock
from typing import Final

from db.query.log_book.entries import Attachment
from robot_link.whole_file import replace_file
from server.base.text import shown

FOLDER: Final = "log_pictures"
"""In the data folder; a copy of the data needs it beside the database."""
BYTES_MAX: Final = 10 * 2**20
SIDE_MAX: Final = 16_384
PIXELS_MAX: Final = 64_000_000
ENDINGS: Final = {"image/png": "png", "image/jpeg": "jpg", "image/webp": "webp"}
_DIGEST: Final = "[0-9a-f]{64}"
_PNG: Final = b"\x89PNG\r\n\x1a\n"
_FRAMES: Final = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Markers of JPEG that tell the size of the picture."""
_ALONE: Final = frozenset({0x01, *range(0xD0, 0xD8)})
"""Markers of JPEG without a length."""


class PictureError(ValueError):
    """This is no picture that is taken; the sentence says why."""


class Pictures:
    """The pictures of one station's log book. Its calls read and write files: use a thread.

    The time of a file is when it was sent, or taken into an entry, last. Taking and throwing away
    exclude each other, so that nobody writes down a picture that is about to go.
    """

    def __init__(self, data_dir: Path) -> None:
        self._folder = data_dir / FOLDER
        self._lock = Lock()

    def keep(self, data: bytes, name: str) -> Attachment:
        """Keep a picture; once this returns it outlives a power cut.

        Raises:
            PictureError: If it is none that is taken.
            OSError: If the disk refuses.
        """
        media_type, data = checked(data)
        digest = sha256(data).hexdigest()
        path = self._path(digest)
        with self._lock:
            if path.exists():
                os.utime(path)
            else:
                replace_file(path, data, mode=0o600)
        called = shown(name) or f"picture.{ENDINGS[media_type]}"
        return Attachment(digest, called, media_type, len(data))

    def find(self, digest: str) -> tuple[str, bytes] | None:
        """Return media type and bytes of a picture; ``None`` where there is none of this hash."""
        try:
            data = self._path(digest).read_bytes()
        except FileNotFoundError:
            return None
        return media_type_of(data), data

    def take(self, digest: str, name: str) -> Attachment | None:
        """Return a picture that was kept before, to be written down now under a name.

        ``None`` if there is none; else it is not thrown away for as long as if it came now.
        """
        with self._lock:
            found = self.find(digest)
            if found is None:
                return None
            os.utime(self._path(digest))
        return Attachment(digest, name, found[0], len(found[1]))

    def older_than(self, before_s: float) -> set[str]:
        """Return the hashes of pictures that were sent, or taken, before a time of the wall."""
        files = self._folder.iterdir() if self._folder.is_dir() else ()
        return {
            one.name
            for one in files
            if re.fullmatch(_DIGEST, one.name) and one.stat().st_mtime < before_s
        }

    def remove(self, digests: Collection[str], before_s: float) -> int:
        """Throw away those that nobody took meanwhile; return how many went."""
        gone = 0
        for digest in digests:
            path = self._path(digest)
            with self._lock:
                if path.exists() and path.stat().st_mtime < before_s:
                    path.unlink()
                    gone += 1
        return gone

    def _path(self, digest: str) -> Path:
        return self._folder / digest


def complaints(data_dir: Path, attachments: Iterator[Attachment]) -> Iterator[str]:
    """Tell which pictures are missing, or are not what was written down."""
    folder = data_dir / FOLDER
    for one in attachments:
        path = folder / one.sha256
        if not path.is_file():
            yield f"the picture {one.name} ({one.sha256[:12]}) is missing"
        elif sha256(path.read_bytes()).hexdigest() != one.sha256:
            yield f"the picture {one.name} ({one.sha256[:12]}) is not what was kept"


def checked(data: bytes) -> tuple[str, bytes]:
    """Return the media type of a picture, and the part of its bytes that is the picture.

    Raises:
        PictureError: If it is none that is taken.
    """
    if len(data) > BYTES_MAX:
        raise PictureError(f"it has more than {BYTES_MAX // 2**20} MB")
    media_type = media_type_of(data)
    try:
        match media_type:
            case "image/png":
                size = _png(data)
            case "image/jpeg":
                size, end = _jpeg(data)
                data = data[:end]
            case _:
                size = _webp(data)
    except (struct.error, IndexError) as error:
        raise PictureError("it breaks off, or its parts do not fit together") from error
    width, height = size
    if not (0 < width <= SIDE_MAX and 0 < height <= SIDE_MAX and width * height <= PIXELS_MAX):
        raise PictureError(f"{width} x {height} pixels; {PIXELS_MAX // 10**6} million at most")
    return media_type, data


def media_type_of(data: bytes) -> str:
    """Return the media type of a picture by its first bytes.

    Raises:
        PictureError: If it is of none of the kinds that are taken.
    """
    if data.startswith(_PNG):
        return "image/png"
    if data.startswith(b"\xff\xd8\xff"):
        return "image/jpeg"
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return "image/webp"
    if b"<svg" in data[:4096].lower():
        raise PictureError("SVG can carry programs; save it as PNG")
    raise PictureError("it is neither PNG, JPEG nor WebP by its bytes")


def _png(data: bytes) -> tuple[int, int]:
    """Return width and height of a PNG file that ends where its last chunk does."""
    at, size = len(_PNG), (0, 0)
    while True:
        length, kind = struct.unpack_from(">I4s", data, at)
        if not kind.isalpha() or at + 12 + length > len(data):
            raise PictureError("it breaks off, or its parts do not fit together")
        if at == len(_PNG):
            if kind != b"IHDR":
                raise PictureError("it does not begin as PNG does")
            size = struct.unpack_from(">II", data, at + 8)
        at += 12 + length
        if kind == b"IEND":
            break
    if at != len(data):
        raise PictureError("something follows behind the end of the picture")
    return size


def _jpeg(data: bytes) -> tuple[tuple[int, int], int]:
    """Return width and height of a JPEG file, and where it ends."""
    at, size = 2, (0, 0)
    while True:
        if data[at] != 0xFF:
            raise PictureError("its parts do not fit together")
        marker = data[at + 1]
        if marker == 0xFF:
            at += 1
            continue
        if marker == 0xD9:
            if size == (0, 0):
                raise PictureError("it holds no picture")
            return size, at + 2
        if marker in _ALONE:
            at += 2
            continue
        (length,) = struct.unpack_from(">H", data, at + 2)
        if length < 2:
            raise PictureError("its parts do not fit together")
        if marker in _FRAMES:
            height, width = struct.unpack_from(">HH", data, at + 5)
            size = (width, height)
        at += 2 + length
        if marker == 0xDA:
            at = _end_of_scan(data, at)


def _end_of_scan(data: bytes, at: int) -> int:
    """Return where the next marker stands behind the coded picture."""
    while True:
        at = data.find(b"\xff", at)
        if at < 0 or at + 1 >= len(data):
            raise PictureError("it breaks off")
        if data[at + 1] != 0 and data[at + 1] not in _ALONE:
            return at
        at += 2


def _webp(data: bytes) -> tuple[int, int]:
    """Return width and height of a WebP file that is as long as it says."""
    (length,) = struct.unpack_from("<I", data, 4)
    if length + 8 + length % 2 != len(data):
        raise PictureError("it is not as long as it says")
    kind = data[12:16]
    if kind == b"VP8X":
        return _three(data, 24) + 1, _three(data, 27) + 1
    if kind == b"VP8L":
        (bits,) = struct.unpack_from("<I", data, 21)
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b"VP8 " and data[23:26] == b"\x9d\x01\x2a":
        width, height = struct.unpack_from("<HH", data, 26)
        return width & 0x3FFF, height & 0x3FFF
    raise PictureError("it does not begin as WebP does")


def _three(data: bytes, at: int) -> int:
    return data[at] | data[at + 1] << 8 | data[at + 2] << 16
