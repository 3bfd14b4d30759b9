"""Ten million bytes of garbage and bit-flipped messages through every parser of the product.

They are fed in a process started afresh, so that the memory that grows is theirs.
"""

import contextlib
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from typing import Any

from benchmarks.station.memory import peak_mb
from tests.parser.catalogue import catalogue
from tests.parser.garbage import garbage

TOTAL_BYTES = 10_000_000
MEMORY_BAR_MB = 50.0
SEED = 2026


def measure() -> list[dict[str, Any]]:
    """Return how many faults there were, and the memory that it took."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        return pool.submit(fed).result()


def fed() -> list[dict[str, Any]]:
    """Feed every parser its share, and count what it raised that it does not declare."""
    parsers = catalogue()
    before_mb = peak_mb()
    faults: list[str] = []
    total = 0
    for parser in parsers:
        feed = parser.make()
        for data in garbage(parser, SEED, -(-TOTAL_BYTES // len(parsers))):
            total += len(data)
            try:
                with contextlib.suppress(*parser.refusals):
                    feed(data)
            except Exception as error:  # noqa: BLE001 - whatever it is, it is a fault
                faults.append(f"{parser.name}: {type(error).__name__} {error}")
    grown_mb = peak_mb() - before_mb
    if faults:
        print("\n".join(sorted(set(faults))[:20]))
    return [
        {
            "area": "garbage",
            "name": f"faults of {len(parsers)} parsers in {total / 1e6:.1f} million bytes",
            "value": float(len(faults)),
            "unit": "",
            "bar": 0,
            "met": not faults,
        },
        {
            "area": "garbage",
            "name": "memory that grew meanwhile",
            "value": grown_mb,
            "unit": "MB",
            "bar": MEMORY_BAR_MB,
            "met": grown_mb <= MEMORY_BAR_MB,
        },
    ]
