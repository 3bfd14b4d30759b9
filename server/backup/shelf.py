"""The backups of one station in a folder. A file has its name only after it was read again."""

import os
import re
import secrets
import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from robot_link.whole_file import replace_file
from server.backup.failure import BackupError

_SEALED: Final = ".sealed"
_STAMP: Final = "%Y%m%dT%H%M%SZ"
_MARK: Final = "backup.mark"


@dataclass(frozen=True, slots=True)
class ShelvedBackup:
    """One whole backup."""

    name: str
    at: datetime
    """When it was begun: what the station acknowledged before is in it."""
    bytes: int
    is_encrypted: bool


@dataclass(frozen=True, slots=True)
class Room:
    """How much room there is where backups lie."""

    free_bytes: int
    is_same_disk: bool
    """Whether the data folder is on it, too: both are lost together."""


def station_mark(data_dir: Path) -> str:
    """Return what tells this station's backups from others' in a folder, made at first need.

    It lies in the data folder, and in no backup: a station that was restored is another one, and
    must remove none of the backups of a station that may still run. Blocks on the disk.

    Raises:
        OSError: If it cannot be read or kept.
    """
    file = data_dir / _MARK
    mark = file.read_text().strip() if file.exists() else ""
    if re.fullmatch(r"[0-9a-f]{6}", mark) is None:
        mark = secrets.token_hex(3)
        replace_file(file, mark.encode(), mode=0o600)
    return mark


class Shelf:
    """Blocks on the disk; call it in a thread.

    Args:
        folder: Where the backups lie; others may lie there, too.
        mark: What the names of this station's backups hold.
    """

    def __init__(self, folder: Path, mark: str) -> None:
        self.folder = folder
        self._mark = mark
        self._pattern = re.compile(
            rf"grace-{re.escape(mark)}-(\d{{8}}T\d{{6}}Z)\.tar\.gz({re.escape(_SEALED)})?"
        )

    @property
    def staging(self) -> str:
        """Beginning of the names of folders in which this station's backups are made."""
        return f".grace-{self._mark}-"

    def place(self, at: datetime, *, is_encrypted: bool) -> Path:
        """Return where a backup of a moment goes."""
        end = _SEALED if is_encrypted else ""
        stamp = at.astimezone(UTC).strftime(_STAMP)
        return self.folder / f"grace-{self._mark}-{stamp}.tar.gz{end}"

    def backups(self) -> list[ShelvedBackup]:
        """Return the backups, the newest first.

        Raises:
            BackupError: If the folder cannot be read.
        """
        try:
            found = [self._backup(entry) for entry in os.scandir(self.folder)]
        except OSError as error:
            raise self._refusal(error) from error
        return sorted((one for one in found if one), key=lambda one: one.at, reverse=True)

    def remove(self, names: Iterable[str]) -> None:
        """Remove backups."""
        for name in names:
            (self.folder / name).unlink(missing_ok=True)

    def room(self, data_dir: Path) -> Room:
        """Return how much room there is.

        Raises:
            BackupError: If the folder is not there.
        """
        try:
            free = shutil.disk_usage(self.folder).free
            return Room(free, self.folder.stat().st_dev == data_dir.stat().st_dev)
        except OSError as error:
            raise self._refusal(error) from error

    def check(self) -> None:
        """Hold that backups can be written.

        Raises:
            BackupError: If they cannot.
        """
        if not self.folder.is_dir():
            raise BackupError(f"There is no folder {self.folder} on the station's machine.")
        if os.statvfs(self.folder).f_flag & os.ST_RDONLY:
            raise BackupError(
                f"{self.folder} is read-only for the station. A service of systemd writes only "
                f"where its unit says: put ReadWritePaths={self.folder} into its [Service] by "
                "`systemctl edit grace`, and start it again."
            )
        if not os.access(self.folder, os.W_OK | os.X_OK):
            raise BackupError(f"The station may not write in {self.folder}.")

    def _backup(self, entry: "os.DirEntry[str]") -> ShelvedBackup | None:
        match = self._pattern.fullmatch(entry.name)
        if match is None or not entry.is_file(follow_symlinks=False):
            return None
        try:
            at = datetime.strptime(match[1], _STAMP).replace(tzinfo=UTC)
        except ValueError:
            return None
        return ShelvedBackup(entry.name, at, entry.stat().st_size, match[2] is not None)

    def _refusal(self, error: OSError) -> BackupError:
        return BackupError(f"{self.folder} cannot be read: {error.strerror or error}.")
