"""Slows down whoever comes too often."""

from robot_link.clock import monotonic_s


class RateLimit:
    """Lets so many come at once, and then so many a second.

    Args:
        burst: How many may come at once.
        per_s: How many may come in each second after that.
    """

    def __init__(self, burst: int, per_s: float) -> None:
        self._burst = float(burst)
        self._per_s = per_s
        self._left = float(burst)
        self._counted_s = monotonic_s()

    def admits(self) -> bool:
        """Tell whether one more may come now, and count it if so."""
        now_s = monotonic_s()
        self._left = min(self._burst, self._left + (now_s - self._counted_s) * self._per_s)
        self._counted_s = now_s
        if self._left < 1:
            return False
        self._left -= 1
        return True
