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
from functools import partial
from typing import Final, Generic, TypeVar

from robot_link.clock import monotonic_s
from robot_link.transport.datagram import FAR_END, Garbled, Received, Stranger, TransportEvent

FAITHFUL_S: Final = 10.0
"""Silence of the far end after which another may take its place."""
_KEPT_BYTES = 1024

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
        self.has_left = False
        """Whether that one hung up."""
        self._faithful_s = faithful_s
        self._host_of = host_of
        self._clock = clock
        self._heard_s = 0.0

    def admits(self, caller: Caller) -> bool:
        """Tell whether a caller is to be heard, and not a stranger."""
        if self.caller is None or caller == self.caller or self.has_left:
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
        self.caller, self._heard_s, self.has_left = caller, self._clock(), False
        return True

    def left(self, caller: Caller) -> None:
        """Note that a caller hung up: its place may be taken at once."""
        if caller == self.caller:
            self.has_left = True

    def forget(self) -> None:
        """Begin anew: whoever is believed next is the far end."""
        self.caller = None


class OpenPort(Generic[Caller]):
    """Hands on what is heard at such a port: of the far end, or as a stranger's.

    Args:
        bring: Takes what was heard.
        host_of: Names the host of a caller.
        where_of: Names where a caller speaks from, for a person.
        faithful_s: Silence of the far end after which another may take its place, s.
    """

    def __init__(
        self,
        bring: Callable[[TransportEvent], None],
        host_of: Callable[[Caller], str],
        where_of: Callable[[Caller], str],
        faithful_s: float = FAITHFUL_S,
    ) -> None:
        self.far_end = FarEnd(faithful_s, host_of, monotonic_s)
        self._bring = bring
        self._where_of = where_of

    def hear(self, caller: Caller, data: bytes) -> bool:
        """Hand on what a caller said; tell whether it is no stranger's."""
        if not self.far_end.admits(caller):
            self._refuse(caller, data)
            return False
        accept = partial(self._accept, caller, data)
        self._bring(Received(FAR_END, data, None, self._where_of(caller), accept))
        return True

    def _accept(self, caller: Caller, data: bytes, may_move: bool) -> bool:
        before, had_left = self.far_end.caller, self.far_end.has_left
        if not self.far_end.accept(caller, may_move=may_move):
            self._refuse(caller, data)
            return False
        if before not in (None, caller) and not had_left:
            self._bring(Stranger(self._where_of(caller), data, took_over=True))
        return True

    def _refuse(self, caller: Caller, data: bytes) -> None:
        self._bring(Garbled(1, data[:_KEPT_BYTES]))
        self._bring(Stranger(self._where_of(caller), data, took_over=False))
