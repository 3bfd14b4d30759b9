"""Which numbered things came already, in little memory."""


class Seen:
    """Sequence numbers of several logs; numbers without a gap from 0 on cost nothing."""

    def __init__(self) -> None:
        self._next: dict[int, int] = {}
        """All numbers below this were seen, by log."""
        self._beyond: dict[int, set[int]] = {}

    def add(self, log: int, sequence: int) -> bool:
        """Note a number; tell whether it is new."""
        begin = self._next.get(log, 0)
        beyond = self._beyond.setdefault(log, set())
        if sequence < begin or sequence in beyond:
            return False
        beyond.add(sequence)
        while begin in beyond:
            beyond.remove(begin)
            begin += 1
        self._next[log] = begin
        return True
