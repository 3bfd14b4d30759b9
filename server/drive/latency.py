"""How long robots take to answer a stick, of late."""

from collections import deque
from dataclasses import dataclass
from typing import Final

from robot_link.clock import monotonic_s

WINDOW_S: Final = 10.0
_ANSWERS_MAX: Final = 500


@dataclass(frozen=True, slots=True)
class RoundTrips:
    """Times from a stick to its answer, ms; ``None`` without an answer of late."""

    answers: int
    p50_ms: float | None
    p95_ms: float | None


class LatencyWatch:
    """Keeps the round trips of the last ``WINDOW_S`` seconds of the wall."""

    def __init__(self) -> None:
        self._answers: deque[tuple[float, float]] = deque(maxlen=_ANSWERS_MAX)

    def note(self, round_trip_s: float) -> None:
        """Take the time between a stick and its answer, which came now."""
        self._answers.append((monotonic_s(), round_trip_s))

    def of_late(self) -> RoundTrips:
        """Return what the answers of late say."""
        since_s = monotonic_s() - WINDOW_S
        times = sorted(trip_s for at_s, trip_s in self._answers if at_s >= since_s)
        if not times:
            return RoundTrips(0, None, None)
        return RoundTrips(
            len(times),
            1e3 * _share(times, 0.50),
            1e3 * _share(times, 0.95),
        )


def _share(ascending: list[float], share: float) -> float:
    """Return the smallest value that is not exceeded by this share of all."""
    return ascending[min(int(share * len(ascending)), len(ascending) - 1)]
