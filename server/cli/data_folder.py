"""The data folder of a station, which one process holds at a time."""

import contextlib
import errno
import fcntl
import os
import pwd
import stat
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

CLOCK_FILE = "clock.json"
"""Name of a demo's clock file."""
LOG_FOLDER = "log"
"""Where a demo's processes write what they say."""
_LOCK_FILE = "station.lock"
_OTHERS = 0o077


class DataFolderError(Exception):
    """The folder cannot be used; the sentence says why and what to do."""


class DataFolderTakenError(DataFolderError):
    """Another process runs a station on this folder."""


def make_data_folder(folder: Path) -> None:
    """Create the folder if need be, for its user alone; an earlier one is closed to others.

    Raises:
        DataFolderError: If it cannot be created or written, or this is root and another user's.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        _refuse_root_at_others(folder)
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        raise _unusable(folder, error) from error
    _close_to_others(folder)


def _refuse_root_at_others(folder: Path) -> None:
    """Keep root from making files that the station, which runs as the folder's user, cannot read.

    Raises:
        DataFolderError: If this is root, and the folder another user's.
    """
    owner = folder.stat().st_uid
    if os.geteuid() == 0 != owner:
        try:
            name = pwd.getpwuid(owner).pw_name
        except KeyError:
            name = f"{owner}"
        raise DataFolderError(
            f"The data folder {folder} belongs to the user {name}, who could not read what root "
            f"makes in it: do this as {name}, such as by `runuser -u {name} -- grace ...`."
        )


def _unusable(folder: Path, error: OSError) -> DataFolderError:
    return DataFolderError(
        f"The data folder {folder} cannot be written ({error.strerror}); give this user the right "
        "to, or choose another with --data."
    )


def _close_to_others(folder: Path) -> None:
    for path in (folder, *folder.iterdir(), *(folder / LOG_FOLDER).glob("*")):
        # Of another user, who decides; or a file of the database that is gone by now.
        with contextlib.suppress(PermissionError, FileNotFoundError):
            mode = path.lstat().st_mode
            if mode & _OTHERS and (stat.S_ISREG(mode) or path == folder):
                path.chmod(stat.S_IMODE(mode) & ~_OTHERS)


@contextmanager
def hold_data_folder(folder: Path, inherited: int | None = None) -> Generator[int]:
    """Create the folder if need be and hold it for this process; the end of either frees it.

    Args:
        folder: The folder.
        inherited: Descriptor of the lock, of a process that hands the folder over to this one.

    Yields:
        Descriptor of the lock; whoever has it holds the folder, too.

    Raises:
        DataFolderTakenError: If another process holds it.
        DataFolderError: If it cannot be created or written.
    """
    make_data_folder(folder)
    try:
        lock = inherited
        if lock is None:
            lock = os.open(folder / _LOCK_FILE, os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        raise _unusable(folder, error) from error
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise DataFolderTakenError(f"A station runs on {folder} already.") from error
        yield lock
    finally:
        os.close(lock)
