"""Which samples are stored, as far as the station was told, and what the robots must still hear."""

from collections.abc import Iterable

from robot_link.messages import LogId, RobotId, Sample


class SequenceSet:
    """A set of numbers that mostly come in order: what lies below a mark, and what is beyond it."""

    def __init__(self) -> None:
        self._below = 0
        self._beyond: set[int] = set()

    def __contains__(self, number: int) -> bool:
        return number < self._below or number in self._beyond

    def add(self, number: int) -> None:
        """Put a number in."""
        if number in self:
            return
        self._beyond.add(number)
        while self._below in self._beyond:
            self._beyond.remove(self._below)
            self._below += 1


class SampleGate:
    """Lets each sample through until it is stored, and gathers what is to be acknowledged."""

    def __init__(self) -> None:
        self._stored: dict[tuple[RobotId, LogId], SequenceSet] = {}
        self._owed: dict[tuple[RobotId, LogId], set[int]] = {}

    def admit(self, sample: Sample) -> bool:
        """Tell whether a sample is not known to be stored; if it is, the robot is told again."""
        stored = self._stored.get((sample.robot, sample.log))
        if stored is None or sample.sequence not in stored:
            return True
        self._owed.setdefault((sample.robot, sample.log), set()).add(sample.sequence)
        return False

    def store(self, robot: RobotId, log: LogId, sequences: Iterable[int]) -> None:
        """Note that samples are stored."""
        numbers = set(sequences)
        stored = self._stored.setdefault((robot, log), SequenceSet())
        for number in numbers:
            stored.add(number)
        self._owed.setdefault((robot, log), set()).update(numbers)

    def take_owed(self) -> dict[tuple[RobotId, LogId], set[int]]:
        """Return what the robots must hear, and forget that they must."""
        owed, self._owed = self._owed, {}
        return owed
