"""The order in which a robot sends its samples, first and again."""

import heapq
from collections.abc import Iterable

from robot_link.sample_log import SampleKey

_AT_ONCE = 0.0


class SampleQueue:
    """When which sample is due: new ones in order, unconfirmed ones again after a growing wait.

    Times are seconds of any clock that begins at or after 0.
    """

    def __init__(
        self, keys: Iterable[SampleKey], first_wait_s: float, longest_wait_s: float
    ) -> None:
        self._first_wait_s = first_wait_s
        self._longest_wait_s = longest_wait_s
        self._due_s: dict[SampleKey, float] = {}
        self._waits_s: dict[SampleKey, float] = {}
        self._heap: list[tuple[float, SampleKey]] = []
        for key in keys:
            self.add(key)

    def __len__(self) -> int:
        return len(self._due_s)

    def add(self, key: SampleKey) -> None:
        """Put a new sample in; it is due at once."""
        self._schedule(key, _AT_ONCE)

    def discard(self, key: SampleKey) -> None:
        """Take a sample out for good."""
        self._due_s.pop(key, None)
        self._waits_s.pop(key, None)

    def take(self, count: int, now_s: float) -> list[SampleKey]:
        """Return up to ``count`` due samples as sent now; each is due again after its wait."""
        taken: list[SampleKey] = []
        while len(taken) < count and self._peek() is not None and self._heap[0][0] <= now_s:
            taken.append(heapq.heappop(self._heap)[1])
        self.send(taken, now_s)
        return taken

    def holds(self, key: SampleKey) -> bool:
        """Tell whether a sample is neither sent for good nor unknown."""
        return key in self._due_s

    def send(self, keys: Iterable[SampleKey], now_s: float) -> None:
        """Count samples as sent now, due or not; each is due again after its wait."""
        for key in keys:
            wait_s = self._waits_s.get(key, self._first_wait_s)
            self._waits_s[key] = min(2 * wait_s, self._longest_wait_s)
            self._schedule(key, now_s + wait_s)

    def hurry(self, keys: Iterable[SampleKey]) -> None:
        """Make samples due at once that did not leave, as if they had not been sent."""
        for key in keys:
            if key in self._due_s:
                self._waits_s.pop(key, None)
                self._schedule(key, _AT_ONCE)

    def next_due_s(self) -> float | None:
        """Return when the next sample is due, None without one."""
        return self._peek()

    def _schedule(self, key: SampleKey, due_s: float) -> None:
        self._due_s[key] = due_s
        heapq.heappush(self._heap, (due_s, key))

    def _peek(self) -> float | None:
        """Drop what is no longer valid from the heap's top; return the time of what is."""
        while self._heap and self._due_s.get(self._heap[0][1]) != self._heap[0][0]:
            heapq.heappop(self._heap)
        return self._heap[0][0] if self._heap else None
