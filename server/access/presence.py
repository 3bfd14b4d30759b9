"""Who is there: whose pages and streams are open, and when somebody did something last.

Kept in memory and by a clock that nobody sets: ages are the station's own, whatever the clock of a
browser says, and begin anew with the station.
"""

from collections import Counter
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final, TypeAlias

from robot_link.clock import monotonic_s
from server.access.caller import Caller
from server.base.event_bus import EventBus

Who: TypeAlias = tuple[str, str]
"""``session`` of a person, ``link`` or ``token``, and the name: a link may be called as anybody."""
KNOWN_MAX: Final = 10_000
_BACK_S: Final = 30.0
"""Who was not seen for so long has come back when they are seen again."""


@dataclass(frozen=True, slots=True)
class PresenceChanged:
    """Somebody has come, come back, or closed their last page."""

    who: Who


def who(caller: Caller) -> Who:
    """Return as whom somebody is known here."""
    return "link" if caller.is_link else caller.proof.kind, caller.name


class Presence:
    """Belongs to one event loop; what it knows may be asked from any thread."""

    def __init__(self, bus: EventBus) -> None:
        self._bus = bus
        self._begun_s = monotonic_s()
        self._open: Counter[Who] = Counter()
        self._seen_s: dict[Who, float] = {}
        self._acted_s: dict[Who, float] = {}

    def note(self, caller: Caller, *, is_change: bool) -> None:
        """Take that somebody asked for something; ``is_change`` of what changes something."""
        one, now_s = who(caller), monotonic_s()
        is_back = self.silent_s(one) > _BACK_S
        _keep(self._seen_s, one, now_s)
        if is_change:
            _keep(self._acted_s, one, now_s)
        if is_back:
            self._bus.publish(PresenceChanged(one))

    @contextmanager
    def present(self, caller: Caller) -> Generator[None]:
        """Count somebody as there while a stream of theirs is open."""
        one = who(caller)
        self._open[one] += 1
        if self._open[one] == 1:
            self._bus.publish(PresenceChanged(one))
        try:
            yield
        finally:
            _keep(self._seen_s, one, monotonic_s())
            self._open[one] -= 1
            if not self._open[one]:
                del self._open[one]
                self._bus.publish(PresenceChanged(one))

    def is_open(self, one: Who) -> bool:
        """Tell whether a page or a stream of somebody's is open."""
        return one in self._open

    def silent_s(self, one: Who) -> float:
        """Return for how long nothing of somebody's was open or asked for, s; 0 while it is."""
        return 0.0 if one in self._open else self._since(self._seen_s, one)

    def idle_s(self, one: Who) -> float:
        """Return for how long somebody changed nothing, s, an open page or not."""
        return self._since(self._acted_s, one)

    def _since(self, times: dict[Who, float], one: Who) -> float:
        return max(0.0, monotonic_s() - times.get(one, self._begun_s))


def _keep(times: dict[Who, float], one: Who, at_s: float) -> None:
    """Note a moment; of too many, the one that was noted first is forgotten."""
    times.pop(one, None)
    if len(times) >= KNOWN_MAX:
        del times[next(iter(times))]
    times[one] = at_s
