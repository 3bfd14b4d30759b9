"""Which samples are stored, as far as the station was told, and what the robots must still hear."""

from bisect import bisect_right
from collections.abc import Container, Iterable

from robot_link.messages import LogId, RobotId, Sample
from robot_link.report import Detection


class SequenceSet:
    """A set of numbers that mostly come in order, kept as runs: its size is that of its gaps."""

    def __init__(self) -> None:
        self._starts: list[int] = []
        self._ends: list[int] = []
        """Behind the last number of each run; runs ascend and never touch."""

    def __contains__(self, number: int) -> bool:
        run = bisect_right(self._starts, number) - 1
        return run >= 0 and number < self._ends[run]

    def __len__(self) -> int:
        """Return how many runs there are."""
        return len(self._starts)

    def add(self, number: int) -> None:
        """Put a number in."""
        behind = bisect_right(self._starts, number)
        run = behind - 1
        if run >= 0 and number < self._ends[run]:
            return
        joins_left = run >= 0 and self._ends[run] == number
        joins_right = behind < len(self._starts) and self._starts[behind] == number + 1
        if joins_left and joins_right:
            self._ends[run] = self._ends.pop(behind)
            del self._starts[behind]
        elif joins_left:
            self._ends[run] = number + 1
        elif joins_right:
            self._starts[behind] = number
        else:
            self._starts.insert(behind, number)
            self._ends.insert(behind, number + 1)


class SampleGate:
    """Lets samples and detections through until they are stored; gathers what to acknowledge."""

    def __init__(self) -> None:
        self._stored: dict[tuple[RobotId, LogId], SequenceSet] = {}
        self._owed: dict[tuple[RobotId, LogId], set[int]] = {}

    def admit(self, sample: Sample | Detection) -> bool:
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

    def take_owed(
        self, busy: Container[RobotId] = ()
    ) -> dict[RobotId, list[tuple[LogId, set[int]]]]:
        """Return what the robots must hear, and forget that they must.

        Args:
            busy: Robots whose share waits for another time.
        """
        taken: dict[RobotId, list[tuple[LogId, set[int]]]] = {}
        for robot, log in [key for key in self._owed if key[0] not in busy]:
            taken.setdefault(robot, []).append((log, self._owed.pop((robot, log))))
        return taken
