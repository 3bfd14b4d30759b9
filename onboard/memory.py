"""What a robot remembers while it is switched off: files that are replaced whole or not at all.

A disk that refuses must not bring a robot down that is flying: what cannot be kept is logged, and
holds until the robot is switched off. Only a plan is not taken then.
"""

import json
import logging
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from onboard.link.plan_store import WaitingPlan
from robot_link.messages import CommandNumber, LogId, PlanHash
from robot_link.mission import Mission
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.blob import Blob, mission_of
from robot_link.whole_file import replace_file

_KEY_BYTES = 32
_QUIET = "quiet"
_DIGITS_MAX = 10
"""Digits of a second since 1970."""

_log = logging.getLogger(__name__)


class KeyUnreadableError(Exception):
    """A robot's key file does not hold a key; the text names the file."""


class FilePlanStore:
    """The plan on board in one file, the one that waits behind it in another beside it.

    A file that holds no plan counts as none: the robot then flies nothing until it is told again.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._next_path = path.with_name(f"{path.name}-next")
        self._mission = _mission_in(path)
        self._next = self._read_next()

    def load(self) -> Mission | None:
        """Return the plan on board, None without one."""
        return self._mission

    def replace(self, mission: Mission) -> None:
        """Make a mission the plan on board, whole or not at all.

        Raises:
            OSError: If the disk refuses; the plan on board is then what it was.
        """
        replace_file(self._path, _octets(mission))
        self._mission = mission

    def load_next(self) -> WaitingPlan | None:
        """Return the plan that waits, None without one."""
        return self._next

    def replace_next(self, waiting: WaitingPlan | None) -> None:
        """Make a plan the one that waits, whole or not at all; None lets none wait.

        Raises:
            OSError: If the disk refuses; what waited before still does.
        """
        data = b"" if waiting is None else bytes((waiting.starts,)) + _octets(waiting.mission)
        replace_file(self._next_path, data)
        self._next = waiting

    @property
    def has_queued(self) -> bool:
        """Whether a plan ever waited."""
        return self._next_path.exists()

    def _read_next(self) -> WaitingPlan | None:
        mission = _mission_in(self._next_path, skip=1)
        if mission is None:
            return None
        return WaitingPlan(mission, starts=bool(self._next_path.read_bytes()[0]))


def _octets(mission: Mission) -> bytes:
    blob = Blob.of(mission)
    return bytes((blob.codec,)) + blob.packed


def _mission_in(path: Path, *, skip: int = 0) -> Mission | None:
    try:
        data = path.read_bytes()[skip:]
        return mission_of(data[1:], data[0]) if data else None
    except (FileNotFoundError, ValueError):
        return None


class FileCommandMemory:
    """What came of the newest commands, in one file; see ``onboard.link.command_desk``."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def load(self) -> Sequence[tuple[CommandNumber, int, CommandOutcome]]:
        """Return number, expiry and outcome, oldest first; nothing where the file is none."""
        try:
            rows = json.loads(self._path.read_text())
            return [(CommandNumber(n), int(at), CommandOutcome(what)) for n, at, what in rows]
        except (FileNotFoundError, ValueError, TypeError):
            return []

    def save(self, outcomes: Sequence[tuple[CommandNumber, int, CommandOutcome]]) -> None:
        """Replace what is kept."""
        _keep(self._path, json.dumps(list(outcomes)).encode())


class FileValues:
    """Values by name, such as of parameters, in one file."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def load(self) -> dict[str, float]:
        """Return what was saved; nothing where the file is none."""
        try:
            values = json.loads(self._path.read_text())
            return {str(name): float(value) for name, value in values.items()}
        except (FileNotFoundError, ValueError, TypeError, AttributeError):
            return {}

    def save(self, values: dict[str, float]) -> None:
        """Replace what is kept."""
        _keep(self._path, json.dumps(values, indent=1).encode())


class FlownPlan:
    """Which plan on board was started already, so that no late copy of it starts it again.

    Args:
        path: The file; None forgets.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._plan = "" if path is None else _text(path)

    def note(self, plan: PlanHash | None) -> None:
        """Note that a plan was started, or with None that the plan on board waits for START."""
        wanted = plan or ""
        if wanted == self._plan:
            return
        self._plan = wanted
        if self._path is not None:
            _keep(self._path, wanted.encode())

    def is_it(self, plan: PlanHash) -> bool:
        """Tell whether this plan was started."""
        return plan == self._plan


class QuietOrder:
    """Whether the robot was told not to ping; that holds until it is told otherwise.

    Divers and animals are still there when it is switched on again.

    Args:
        path: The file; None forgets.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self.is_quiet = path is not None and _text(path) == _QUIET
        """What was noted last."""

    def note(self, is_quiet: bool) -> None:
        """Note what it was told."""
        if is_quiet == self.is_quiet:
            return
        self.is_quiet = is_quiet
        if self._path is not None:
            _keep(self._path, _QUIET.encode() if is_quiet else b"")


def new_log(path: Path, started_at: datetime) -> LogId:
    """Return a number for a new log of samples, and remember that it is taken.

    It is the second at which the robot was switched on. A clock that shows a second again, after
    a quick restart or without a battery, must not give a number again: the station would take new
    samples for old ones.
    """
    last = _text(path)
    is_number = last.isdecimal() and len(last) <= _DIGITS_MAX
    number = max(int(started_at.timestamp()), int(last) + 1 if is_number else 0)
    _keep(path, str(number).encode())
    return LogId(number)


def _keep(path: Path, data: bytes) -> None:
    try:
        replace_file(path, data)
    except OSError as error:
        _log.warning("cannot keep %s: %s", path, error)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        return ""


def read_key(path: Path) -> bytes:
    """Return a robot's key.

    Raises:
        FileNotFoundError: If there is none.
        KeyUnreadableError: If the file holds anything but 64 hexadecimal digits.
    """
    try:
        key = bytes.fromhex(path.read_text(encoding="ascii").strip())
    except ValueError:
        key = b""
    if len(key) != _KEY_BYTES:
        raise KeyUnreadableError(f"{path} does not hold {_KEY_BYTES} bytes in hexadecimal")
    return key
