"""What a job read of a file, kept until an operator confirms it or a week has passed."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, Final

KEPT_S: Final = 7 * 24 * 3600.0


def keep_proposal(folder: Path, name: str, write: Callable[[IO[bytes]], object]) -> None:
    """Write a proposal, whole or not at all; forget what nobody confirmed in time."""
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    _forget_old(folder)
    part = folder / f".{name}.{os.getpid()}.part"
    with part.open("wb") as file:
        write(file)
    part.replace(folder / name)


def proposal_place(folder: Path, token: str, suffix: str) -> Path:
    """Return where a proposal is kept.

    Raises:
        FileNotFoundError: If no proposal can have this name.
    """
    if not token.isalnum():
        raise FileNotFoundError(token)
    return folder / f"{token}{suffix}"


def _forget_old(folder: Path) -> None:
    for old in folder.iterdir():
        try:
            if time.time() - old.stat().st_mtime > KEPT_S:
                old.unlink()
        except FileNotFoundError:
            continue  # another process renamed or forgot it meanwhile
