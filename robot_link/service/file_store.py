"""Files that a robot lets the station read: its logs."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Protocol


@dataclass(frozen=True, slots=True)
class FileEntry:
    """One line of a folder's listing."""

    name: str
    size: int
    """Bytes; 0 for a folder."""
    is_folder: bool = False


class FileStore(Protocol):
    """What the file service needs; paths are ``/``-separated and begin at the store's root.

    Every method raises ``FileNotFoundError`` where there is nothing readable of that path.
    """

    def list(self, path: str) -> Sequence[FileEntry]:
        """Return the entries of a folder, in a fixed order."""
        ...

    def size(self, path: str) -> int:
        """Return the bytes of a file."""
        ...

    def read(self, path: str, offset: int, count: int) -> bytes:
        """Return up to ``count`` bytes from ``offset``; none at the end."""
        ...


class NoFiles:
    """A robot that keeps no files."""

    def list(self, path: str) -> Sequence[FileEntry]:
        """Return nothing of the root; there is no other folder."""
        if _parts(path):
            raise FileNotFoundError(path)
        return ()

    def size(self, path: str) -> int:
        """Refuse: there is no file."""
        raise FileNotFoundError(path)

    def read(self, path: str, offset: int, count: int) -> bytes:
        """Refuse: there is no file."""
        raise FileNotFoundError(path)


class FolderFiles:
    """The files below one folder, read only; nothing outside it can be named.

    Reads are short and from a local disk, so they happen on the event loop.
    """

    def __init__(self, root: Path) -> None:
        self._root = root.resolve()

    def list(self, path: str) -> Sequence[FileEntry]:
        """Return files and folders by name."""
        folder = self._inside(path)
        if not folder.is_dir():
            raise FileNotFoundError(path)
        return tuple(
            FileEntry(entry.name, 0 if entry.is_dir() else entry.stat().st_size, entry.is_dir())
            for entry in sorted(folder.iterdir())
            if entry.is_dir() or entry.is_file()
        )

    def size(self, path: str) -> int:
        """Return the bytes of a file."""
        return self._file(path).stat().st_size

    def read(self, path: str, offset: int, count: int) -> bytes:
        """Return up to ``count`` bytes from ``offset``."""
        with self._file(path).open("rb") as file:
            file.seek(offset)
            return file.read(count)

    def _file(self, path: str) -> Path:
        file = self._inside(path)
        if not file.is_file():
            raise FileNotFoundError(path)
        return file

    def _inside(self, path: str) -> Path:
        try:
            found = self._root.joinpath(*_parts(path)).resolve()
        except (OSError, ValueError) as error:
            raise FileNotFoundError(path) from error
        if not found.is_relative_to(self._root):
            raise FileNotFoundError(path)
        return found


def _parts(path: str) -> tuple[str, ...]:
    return tuple(part for part in PurePosixPath(path).parts if part not in ("/", "."))
