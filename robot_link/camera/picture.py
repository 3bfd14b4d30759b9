"""What a camera sent becomes a grey picture, or is refused with a reason that can be counted.

The header is read before anything is decoded: nothing large is ever made of a few bytes. JPEG
(baseline and progressive, colour and grey) and PNG (8 and 16 bits) are taken.
"""

import struct
from typing import Any, Final, Literal, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from autonomy.vision.corner_kernel import Picture
from robot_link.camera.wire import BODY_MAX

SIDE_LEAST_PX, SIDE_MOST_PX = 64, 4096
Content: TypeAlias = bytes | npt.NDArray[Any]
"""A file, or an array ``(rows, columns)`` or ``(rows, columns, 3)`` of blue, green and red."""
LightState: TypeAlias = Literal["running", "dark", "glare"]

_JPEG, _JPEG_END, _PNG = b"\xff\xd8\xff", b"\xff\xd9", b"\x89PNG\r\n\x1a\n"
_FRAMES_TAKEN: Final = frozenset((0xC0, 0xC1, 0xC2))
_FRAMES: Final = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_WITHOUT_LENGTH: Final = frozenset((0x01, *range(0xD0, 0xD9)))
_SCAN: Final = 0xDA
_FILLED_AFTER: Final = 64
"""Zeros behind the end of a JPEG that some cameras send are no cut."""
_GREY: Final = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
_EVERY: Final = 8
_BRIGHT_SHARE, _BLACK_GREY = 0.98, 32
_GLARE_SHARE, _WHITE_GREY = 0.5, 250


class PictureError(ValueError):
    """A picture that is not looked at; the message is the reason under which it is counted."""


def grey_picture(content: Content) -> Picture:
    """Return the grey values of a picture, shape ``(rows, columns)``.

    Raises:
        PictureError: If it is none, or one that is not taken.
    """
    if not isinstance(content, bytes):
        return _grey_of_array(content)
    width, height = picture_size(content)
    try:
        grey = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), _GREY)
    except cv2.error:
        raise PictureError("broken") from None
    if grey is None or grey.shape != (height, width):  # pyright: ignore[reportUnnecessaryComparison] - the stub knows no better
        raise PictureError("broken")
    return np.asarray(grey, dtype=np.uint8)


def picture_size(content: bytes) -> tuple[int, int]:
    """Return width and height that a file's header tells.

    Raises:
        PictureError: If it is no JPEG or PNG, is cut, or its sides are not 64 to 4096 px.
    """
    if len(content) > BODY_MAX:
        raise PictureError("longer than 8 MiB")
    if content.startswith(_JPEG):
        size = _jpeg_size(content)
        if _JPEG_END not in content[-_FILLED_AFTER:]:
            raise PictureError("cut")
    elif content.startswith(_PNG):
        size = _png_size(content)
    else:
        raise PictureError("neither JPEG nor PNG")
    _check_size(*size)
    return size


def light_state(grey: Picture) -> LightState:
    """Tell whether anything can be seen: ``dark`` is a black picture, ``glare`` a white one."""
    few = grey[::_EVERY, ::_EVERY]
    if float(np.mean(few < _BLACK_GREY)) >= _BRIGHT_SHARE:
        return "dark"
    return "glare" if float(np.mean(few >= _WHITE_GREY)) > _GLARE_SHARE else "running"


def jpeg_of(content: Content, quality: int = 80) -> bytes:
    """Return a picture as a JPEG; one that is a JPEG stays as it is.

    Raises:
        PictureError: If it cannot be written as one.
    """
    if isinstance(content, bytes):
        if content.startswith(_JPEG):
            return content
        content = grey_picture(content)
    try:
        _, jpeg = cv2.imencode(".jpg", content, [cv2.IMWRITE_JPEG_QUALITY, quality])
    except cv2.error:
        raise PictureError("broken") from None
    return jpeg.tobytes()


def _grey_of_array(content: npt.NDArray[Any]) -> Picture:
    if content.ndim not in (2, 3) or content.size == 0:
        raise PictureError("broken")
    _check_size(content.shape[1], content.shape[0])
    if content.dtype == np.uint16:
        content = content >> 8
    array = np.ascontiguousarray(content, dtype=np.uint8)
    if array.ndim == 2:
        return array
    if array.shape[2] != 3:
        raise PictureError("broken")
    return np.asarray(cv2.cvtColor(array, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def _check_size(width: int, height: int) -> None:
    if not all(SIDE_LEAST_PX <= side <= SIDE_MOST_PX for side in (width, height)):
        raise PictureError(f"a side is not {SIDE_LEAST_PX} to {SIDE_MOST_PX} px")


def _jpeg_size(content: bytes) -> tuple[int, int]:
    """Return the size that the first frame header tells.

    Source:
        ITU-T T.81, annex B.
    """
    at = 2
    while at + 4 <= len(content):
        if content[at] != 0xFF:
            raise PictureError("broken")
        marker = content[at + 1]
        if marker == 0xFF or marker in _WITHOUT_LENGTH:
            at += 1 if marker == 0xFF else 2
            continue
        if marker in _FRAMES:
            if marker not in _FRAMES_TAKEN or at + 9 > len(content) or content[at + 4] != 8:
                raise PictureError("a kind of JPEG that is not read")
            height, width = struct.unpack_from(">HH", content, at + 5)
            return width, height
        if marker == _SCAN:
            break
        at += 2 + int.from_bytes(content[at + 2 : at + 4], "big")
    raise PictureError("broken")


def _png_size(content: bytes) -> tuple[int, int]:
    if len(content) < 24 or content[12:16] != b"IHDR":
        raise PictureError("broken")
    width, height = struct.unpack_from(">II", content, 16)
    return width, height
