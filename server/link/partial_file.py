"""A file that comes in pieces, on disk as far as it has come."""

from pathlib import Path


class PartialFile:
    """Grows on disk with ``content``; whoever opens it again finds what was kept."""

    def __init__(self, path: Path) -> None:
        """Read what an earlier attempt left.

        Raises:
            OSError: If it cannot be read.
        """
        self._path = path
        self.content = bytearray(path.read_bytes() if path.exists() else b"")
        """The file as far as it is here; may grow or be cleared by whoever brings it."""
        self._kept = len(self.content)

    def keep(self) -> None:
        """Write what came since; a file that was begun anew is begun anew on disk.

        Raises:
            OSError: If it cannot be written.
        """
        is_longer = len(self.content) >= self._kept
        with self._path.open("ab" if is_longer else "wb") as file:
            file.write(self.content[self._kept :] if is_longer else self.content)
        self._kept = len(self.content)

    def complete(self, path: Path) -> None:
        """Give the whole file its place.

        Raises:
            OSError: If it cannot be written.
        """
        self._path.write_bytes(self.content)
        self._path.replace(path)
