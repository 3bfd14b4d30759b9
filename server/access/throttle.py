"""Slows down whoever guesses."""

from http import HTTPStatus

from robot_link.clock import monotonic_s
from server.base.problem import Problem

FREE_FAILURES = 5
PAUSE_S = 30.0
_NAMES_MAX = 10_000


class Throttle:
    """Counts failures by name and pauses after too many of them."""

    def __init__(self) -> None:
        self._failures: dict[str, tuple[int, float]] = {}

    def check(self, name: str) -> None:
        """Let the next try pass.

        Raises:
            Problem: 429 while the pause for this name lasts.
        """
        failures, last_s = self._failures.get(name, (0, 0.0))
        left_s = last_s + PAUSE_S - monotonic_s()
        if failures >= FREE_FAILURES and left_s > 0:
            raise Problem(
                HTTPStatus.TOO_MANY_REQUESTS,
                f"Too many failed tries; wait {left_s:.0f} s.",
                headers={"Retry-After": str(int(left_s) + 1)},
            )

    def failed(self, name: str) -> None:
        """Count a failure."""
        if len(self._failures) >= _NAMES_MAX:
            self._failures.clear()
        failures, _ = self._failures.get(name, (0, 0.0))
        self._failures[name] = (failures + 1, monotonic_s())

    def succeeded(self, name: str) -> None:
        """Forget the failures of a name."""
        self._failures.pop(name, None)
