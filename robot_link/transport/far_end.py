"""Who is at the other end of a port at which anybody may speak.

Whoever listens for a robot, by UDP or TCP, cannot choose who speaks there. What may not happen is
that somebody else gets what is meant for the robot, so:

- Nobody is the far end before the session has believed what it said. Until then everyone is heard,
  so that a robot is not kept out by somebody who was there first.
- While the far end speaks, everyone else is a stranger: told of, and not heard.
- When it has been silent for long, another one is heard, and takes its place when it is believed.
  Where signatures prove who speaks it may call from anywhere; where nothing does, only from the
  same host, as a robot does that was started again.
- Pulling the plug of the link forgets who it was.
"""

from collections.abc import Callable
from typing import Generic, TypeVar

Caller = TypeVar("Caller")


class FarEnd(Generic[Caller]):
    """Belongs to one event loop.

    Args:
        faithful_s: Silence after which another may take the place, s.
        host_of: Names the host of a caller.
        clock: Seconds of the wall.
    """

    def __init__(
        self,
        faithful_s: float,
        host_of: Callable[[Caller], str],
        clock: Callable[[], float],
    ) -> None:
        self.caller: Caller | None = None
        """Who is believed to be the far end."""
        self._faithful_s = faithful_s
        self._host_of = host_of
        self._clock = clock
        self._heard_s = 0.0

    def admits(self, caller: Caller) -> bool:
        """Tell whether a caller is to be heard, and not a stranger."""
        if self.caller is None or caller == self.caller:
            return True
        return self._clock() - self._heard_s > self._faithful_s

    def accept(self, caller: Caller, *, may_move: bool) -> bool:
        """Take a caller as the far end, for what it said was believed; tell whether it is.

        Args:
            caller: Who was heard.
            may_move: Whether it may be another host than before.
        """
        if not self.admits(caller):
            return False
        before = self.caller
        if before is not None and not may_move and self._host_of(before) != self._host_of(caller):
            return False
        self.caller, self._heard_s = caller, self._clock()
        return True

    def left(self, caller: Caller) -> None:
        """Note that a caller hung up: its place may be taken at once."""
        if caller == self.caller:
            self._heard_s = float("-inf")

    def forget(self) -> None:
        """Begin anew: whoever is believed next is the far end."""
        self.caller = None
