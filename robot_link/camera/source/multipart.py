"""Pictures out of a stream of parts (``multipart/x-mixed-replace``), however it is cut.

Source:
    RFC 2046, section 5.1; cameras differ from it in dashes and line ends, which is taken as it is.
"""

import re
from typing import Final

from robot_link.camera.source.frame import SourceError
from robot_link.camera.wire import BODY_MAX

_HEADER_MAX: Final = 16384
_LENGTH: Final = re.compile(rb"(?im)^content-length[ \t]*:[ \t]*([0-9]{1,9})[ \t]*\r?$")
_HEADER_END: Final = re.compile(rb"\r?\n\r?\n")
_BOUNDARY: Final = re.compile(r'boundary\s*=\s*("([^"]{1,200})"|[^\s;"]{1,200})', re.IGNORECASE)


def boundary_of(content_type: str) -> bytes:
    """Return what stands between the parts.

    Raises:
        SourceError: If the content type does not tell it.
    """
    found = _BOUNDARY.search(content_type)
    # Some cameras count the two leading dashes to the boundary, some do not.
    boundary = (found[2] or found[1]).strip("-") if found else ""
    if not boundary or not boundary.isascii():
        raise SourceError("the camera's stream does not say what stands between its pictures")
    return b"--" + boundary.encode()


class MultipartReader:
    """Takes parts out of a stream of bytes.

    A part that tells its length is complete as soon as its last byte is there, others when the
    next part begins.
    """

    def __init__(self, boundary: bytes) -> None:
        self._boundary = boundary
        self._rest = bytearray()
        self._searched = 0
        """So many bytes hold no begin of a boundary."""
        self._is_open = False
        """A boundary and the part's header are behind us."""
        self._length: int | None = None

    def take(self, data: bytes) -> list[bytes]:
        """Return the parts that are complete with these bytes.

        Raises:
            SourceError: If a header or a part is too long.
        """
        self._rest += data
        parts: list[bytes] = []
        while self._header() if not self._is_open else self._body(parts):
            pass
        return parts

    def _header(self) -> bool:
        """Go behind the next part's header, if it is there."""
        at = self._rest.find(self._boundary)
        if at < 0:
            # What stands before the first boundary, and behind a part, is nothing.
            del self._rest[: -len(self._boundary)]
            return False
        end = _HEADER_END.search(self._rest, at, at + _HEADER_MAX)
        if end is None:
            if len(self._rest) - at > _HEADER_MAX:
                raise SourceError(f"the header of a picture is longer than {_HEADER_MAX} bytes")
            del self._rest[:at]
            return False
        length = _LENGTH.search(self._rest, at, end.end())
        self._length = int(length[1]) if length else None
        if self._length is not None and self._length > BODY_MAX:
            raise SourceError(f"a picture of {self._length} bytes is longer than {BODY_MAX}")
        del self._rest[: end.end()]
        self._is_open, self._searched = True, 0
        return True

    def _body(self, parts: list[bytes]) -> bool:
        """Take the part's body, if it is complete."""
        if self._length is not None:
            if len(self._rest) < self._length:
                return False
            end = self._length
            body = bytes(self._rest[:end])
        else:
            end = self._rest.find(self._boundary, self._searched)
            if end < 0:
                if len(self._rest) > BODY_MAX + len(self._boundary):
                    raise SourceError(f"a picture is longer than {BODY_MAX} bytes")
                self._searched = max(0, len(self._rest) - len(self._boundary))
                return False
            body = bytes(self._rest[:end]).rstrip(b"-").rstrip(b"\r\n")
        del self._rest[:end]
        self._is_open = False
        parts.append(body)
        return True
