"""The data folder of a station, which one process holds at a time."""

import fcntl
import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

CLOCK_FILE = "clock.json"
"""Name of a demo's clock file."""
_LOCK_FILE = "station.lock"


class DataFolderTakenError(Exception):
    """Another process runs a station on this folder."""


@contextmanager
def hold_data_folder(folder: Path) -> Generator[None]:
    """Create the folder if need be and hold it for this process; the end of either frees it.

    Raises:
        DataFolderTakenError: If another process holds it.
        OSError: If it cannot be created or written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    lock = os.open(folder / _LOCK_FILE, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise DataFolderTakenError(f"A station runs on {folder} already.") from error
        yield
    finally:
        os.close(lock)
