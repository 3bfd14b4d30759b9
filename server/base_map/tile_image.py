"""What a tile is, told by its own bytes: a picture that a browser may draw, or nothing."""

import struct
import zlib
from typing import Final

TILE_BYTES_MAX: Final = 2**20
SIDE_PX_MAX: Final = 1024
_GZIP: Final = b"\x1f\x8b"
_PNG: Final = b"\x89PNG\r\n\x1a\n"
_JPEG: Final = b"\xff\xd8\xff"
_JPEG_ALONE: Final = frozenset({0x01, *range(0xD0, 0xD9)})
"""Markers that nothing follows."""
_JPEG_NO_FRAME: Final = frozenset({0xC4, 0xC8, 0xCC})
"""Markers within those of frames that begin none."""


class TileFileError(Exception):
    """A file, or a tile of it, is not what a base map is made of; the sentence says why."""


def picture(data: bytes) -> tuple[str, bytes]:
    """Return media type and bytes of a tile that is a PNG, JPEG or WebP picture of sound size.

    A tile that was packed by gzip is unpacked. The answer depends on the bytes alone, whatever
    the file says of itself.

    Raises:
        TileFileError: If it is anything else, such as SVG, HTML or a vector tile.
    """
    if len(data) > TILE_BYTES_MAX:
        raise TileFileError(f"a tile has {len(data)} bytes; at most {TILE_BYTES_MAX} are taken")
    if data.startswith(_GZIP):
        data = inflated(data, TILE_BYTES_MAX, "a tile")
    try:
        kind, width, height = _measured(data)
    except (struct.error, IndexError):
        raise TileFileError("a tile is a picture that is cut short") from None
    if not (0 < width <= SIDE_PX_MAX and 0 < height <= SIDE_PX_MAX):
        raise TileFileError(
            f"a tile is {width} x {height} pixels; at most {SIDE_PX_MAX} a side are taken"
        )
    return kind, data


def inflated(data: bytes, size_max: int, name: str) -> bytes:
    """Return what was packed by gzip, unpacked to no more than a size.

    Raises:
        TileFileError: If it is broken, or would be longer.
    """
    unpacker = zlib.decompressobj(wbits=16 + zlib.MAX_WBITS)
    try:
        result = unpacker.decompress(data, size_max + 1)
    except zlib.error as error:
        raise TileFileError(f"{name} cannot be unpacked ({error})") from error
    if len(result) > size_max:
        raise TileFileError(f"{name} unpacks to more than {size_max} bytes")
    if not unpacker.eof:
        raise TileFileError(f"{name} is cut short")
    return result


def _measured(data: bytes) -> tuple[str, int, int]:
    """Return media type, width and height of a picture."""
    if data.startswith(_PNG):
        width, height = struct.unpack_from(">II", data, 16)
        return "image/png", width, height
    if data.startswith(_JPEG):
        return "image/jpeg", *_jpeg_size(data)
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return "image/webp", *_webp_size(data)
    head = data[:200].lstrip().lower()
    if head.startswith((b"<", b"\xef\xbb\xbf<")):
        raise TileFileError("a tile is SVG or HTML, which may hold script; none is served")
    raise TileFileError("a tile is no PNG, JPEG or WebP picture")


def _jpeg_size(data: bytes) -> tuple[int, int]:
    at = 2
    while data[at] == 0xFF:
        marker = data[at + 1]
        if 0xC0 <= marker <= 0xCF and marker not in _JPEG_NO_FRAME:
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        at += 2
        if marker not in _JPEG_ALONE:
            at += struct.unpack_from(">H", data, at)[0]
    raise TileFileError("a tile is a JPEG picture without a size")


def _webp_size(data: bytes) -> tuple[int, int]:
    match data[12:16]:
        case b"VP8X":
            return (
                1 + int.from_bytes(data[24:27], "little"),
                1 + int.from_bytes(data[27:30], "little"),
            )
        case b"VP8L":
            bits = struct.unpack_from("<I", data, 21)[0]
            return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
        case b"VP8 ":
            width, height = struct.unpack_from("<HH", data, 26)
            return width & 0x3FFF, height & 0x3FFF
        case _:
            raise TileFileError("a tile is a WebP picture of an unknown kind")
