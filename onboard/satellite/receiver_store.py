"""Where the robot's end of the satellite keeps its memory."""

from pathlib import Path
from typing import Protocol

from robot_link.whole_file import replace_file


class ReceiverStore(Protocol):
    """Memory that survives a restart, replaced whole or not at all."""

    def load(self) -> bytes | None:
        """Return what was saved last, None at first."""
        ...

    def save(self, data: bytes) -> None:
        """Replace what is saved."""
        ...


class MemoryStore:
    """A store that lives as long as its process."""

    def __init__(self, data: bytes | None = None) -> None:
        self.data = data

    def load(self) -> bytes | None:
        """Return what was saved last."""
        return self.data

    def save(self, data: bytes) -> None:
        """Replace what is saved."""
        self.data = data


class FileStore:
    """A store in one file, which is on the disk, its name too, when ``save`` returns."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def load(self) -> bytes | None:
        """Return what was saved last."""
        try:
            return self._path.read_bytes()
        except FileNotFoundError:
            return None

    def save(self, data: bytes) -> None:
        """Replace the file.

        Raises:
            OSError: If the disk refuses; the file is then what it was, or the new one.
        """
        replace_file(self._path, data)
