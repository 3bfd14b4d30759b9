"""Garbage and bit-flipped captures, the same for the same seed."""

import random
from collections.abc import Generator

from tests.parser.catalogue import Parser

_MOST_FLIPS = 6


def garbage(parser: Parser, seed: int, total_bytes: int) -> Generator[bytes]:
    """Yield messages for a parser until they hold so many bytes.

    A third is noise; the rest are captures with flipped bits, cut, doubled, or run together.
    """
    rng = random.Random(f"{parser.name} {seed}")
    made = 0
    while made < total_bytes:
        data = _message(parser, rng)[: parser.longest] or b"\0"
        made += len(data)
        yield data


def _message(parser: Parser, rng: random.Random) -> bytes:
    kind = rng.randrange(6)
    if kind < 2:
        return rng.randbytes(rng.randrange(1, min(parser.longest, 700)))
    data = bytearray(rng.choice(parser.captures))
    if kind == 2:
        del data[rng.randrange(len(data)) :]
    elif kind == 3:
        data += rng.choice(parser.captures) * rng.randrange(1, 3)
    for _ in range(rng.randrange(1, _MOST_FLIPS)):
        if data:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return bytes(data)
