"""The little of CBOR (RFC 8949) that a blob is made of: lists of integers, and byte strings.

A general decoder understands much more (tags, maps, indefinite lengths, nesting without end) that
bytes from outside could make it build; this one reads nothing it was not asked for.
"""

from robot_link.satellite.frame import WireError

_UNSIGNED, _NEGATIVE, _BYTES, _ARRAY = 0, 1, 2, 4
_ONE_BYTE = 24
_LENGTHS = {24: 1, 25: 2, 26: 4, 27: 8}
"""Bytes of an argument by the low five bits of the first byte."""


class CborReader:
    """Reads one item after another; every failure is a ``WireError``."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._next = 0

    def array(self) -> int:
        """Return how many items of a list follow."""
        count = self._argument(_ARRAY)
        if count > len(self._data) - self._next:
            raise WireError("a list is longer than the bytes that hold it")
        return count

    def integers(self) -> list[int]:
        """Return a list of integers."""
        return [self.integer() for _ in range(self.array())]

    def integer(self) -> int:
        """Return one integer."""
        major = self._first() >> 5
        if major == _NEGATIVE:
            return -1 - self._argument(_NEGATIVE)
        return self._argument(_UNSIGNED)

    def octets(self) -> bytes:
        """Return one byte string."""
        return self._take(self._argument(_BYTES))

    def end(self) -> None:
        """Note that nothing should follow."""
        if self._next != len(self._data):
            raise WireError("something follows the end")

    def _first(self) -> int:
        if self._next >= len(self._data):
            raise WireError("the bytes end too early")
        return self._data[self._next]

    def _argument(self, major: int) -> int:
        first = self._first()
        kind, low = first >> 5, first & 31
        if kind != major or low >= _ONE_BYTE + len(_LENGTHS):
            raise WireError(f"byte {self._next} is not what belongs there")
        self._next += 1
        return low if low < _ONE_BYTE else int.from_bytes(self._take(_LENGTHS[low]), "big")

    def _take(self, count: int) -> bytes:
        end = self._next + count
        if end > len(self._data):
            raise WireError("the bytes end too early")
        taken = self._data[self._next : end]
        self._next = end
        return taken
