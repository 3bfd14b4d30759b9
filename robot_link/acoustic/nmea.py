"""NMEA 0183 sentences, as the Micro-Modem speaks them: ``$CAMPR,2,1,0.0101*7C`` and CR LF.

The two digits behind the asterisk are the exclusive or of all bytes between it and the dollar.
A sentence without them, or with wrong ones, is none.
"""

from collections.abc import Sequence

_LONGEST = 4096
"""More than any sentence; the modem's hexadecimal data makes some longer than NMEA's 82."""
_HEX = frozenset(b"0123456789abcdefABCDEF")


def checksum(body: bytes) -> int:
    """Return the exclusive or of all bytes."""
    total = 0
    for byte in body:
        total ^= byte
    return total


def encode(fields: Sequence[object]) -> bytes:
    """Return the sentence of these fields, with its end of line.

    Raises:
        ValueError: If a field holds what would end or split the sentence.
    """
    texts = [str(field) for field in fields]
    for text in texts:
        if not text.isascii() or not text.isprintable() or set(text) & set("$*,"):
            raise ValueError(f"{text!r} is no field of a sentence")
    body = ",".join(texts).encode("ascii")
    return b"$%s*%02X\r\n" % (body, checksum(body))


def decode(line: bytes) -> tuple[str, ...]:
    """Return the fields of one sentence, without what may stand before its dollar.

    Raises:
        ValueError: If it is none; the text says why.
    """
    start = line.rfind(b"$")
    if start < 0:
        raise ValueError("there is no dollar")
    body, star, digits = line[start + 1 :].rstrip(b"\r\n").partition(b"*")
    if not star or len(digits) != 2 or not set(digits) <= _HEX:
        raise ValueError("there is no checksum")
    if int(digits, 16) != checksum(body):
        raise ValueError("the checksum is wrong")
    if not body.isascii():
        raise ValueError("a byte is no character")
    return tuple(body.decode("ascii").split(","))


class SentenceReader:
    """Finds sentences in a stream that may begin anywhere, be cut anywhere and hold garbage."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> tuple[list[tuple[str, ...]], list[bytes]]:
        """Take bytes; return the sentences that they complete, and the lines that are none."""
        *lines, self._rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        sentences: list[tuple[str, ...]] = []
        bad: list[bytes] = []
        for line in lines:
            if not line.strip():
                continue
            try:
                sentences.append(decode(line))
            except ValueError:
                bad.append(line[-_LONGEST:])
        if len(self._rest) > _LONGEST:
            bad.append(self._rest[:_LONGEST])
            self._rest = b""
        return sentences, bad
