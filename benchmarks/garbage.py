"""Ten million bytes of garbage and bit-flipped messages through every parser of the product."""

import contextlib
import resource
from typing import Any

from tests.parser.catalogue import catalogue
from tests.parser.garbage import garbage

TOTAL_BYTES = 10_000_000
MEMORY_BAR_MB = 50.0
SEED = 2026


def measure() -> list[dict[str, Any]]:
    """Feed every parser its share, and count what it raised that it does not declare."""
    parsers = catalogue()
    before_mb = _peak_mb()
    faults: list[str] = []
    fed = 0
    for parser in parsers:
        feed = parser.make()
        for data in garbage(parser, SEED, -(-TOTAL_BYTES // len(parsers))):
            fed += len(data)
            try:
                with contextlib.suppress(*parser.refusals):
                    feed(data)
            except Exception as error:  # noqa: BLE001 - whatever it is, it is a fault
                faults.append(f"{parser.name}: {type(error).__name__} {error}")
    grown_mb = _peak_mb() - before_mb
    if faults:
        print("\n".join(sorted(set(faults))[:20]))
    return [
        {
            "area": "garbage",
            "name": f"faults of {len(parsers)} parsers in {fed / 1e6:.1f} million bytes",
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


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
