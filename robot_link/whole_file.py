"""Files that are replaced whole or not at all."""

import os
from pathlib import Path


def replace_file(path: Path, data: bytes, *, mode: int = 0o666) -> None:
    """Replace a file; once this returns, the new one outlives a power cut, its name too.

    Args:
        path: The file; its folder is made where it is missing.
        data: What it is to hold.
        mode: Who may do what with it, before the process's mask; 0o600 for secrets.

    Raises:
        OSError: If the disk refuses; the file is then what it was, or the new one.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(f".{path.name}.new")
    fresh.unlink(missing_ok=True)
    descriptor = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    try:
        with open(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(path)
    except OSError:
        fresh.unlink(missing_ok=True)  # on a full disk it would take the last that is free
        raise
    keep_names(path.parent)


def keep_names(folder: Path) -> None:
    """Let the names of a folder's files outlive a power cut.

    Raises:
        OSError: If the disk refuses.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
