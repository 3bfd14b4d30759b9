"""Files that were sent and wait for their mapping to be confirmed, for a week at most."""

import json
import secrets
import shutil
import time
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Final

KEPT_S: Final = 7 * 24 * 3600.0
_NAMES: Final = "names.json"


def keep_upload(folder: Path, files: Sequence[tuple[str, IO[bytes]]]) -> str:
    """Copy files into a folder of their own; return its name. Old ones are forgotten."""
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    _forget_old(folder)
    token = secrets.token_hex(12)
    place = folder / token
    place.mkdir(mode=0o700)
    try:
        for number, (_, source) in enumerate(files):
            source.seek(0)
            with (place / str(number)).open("wb") as kept:
                shutil.copyfileobj(source, kept)
        (place / _NAMES).write_text(json.dumps([name for name, _ in files]))
    except BaseException:
        forget_upload(place)
        raise
    return token


def upload_place(folder: Path, token: str) -> tuple[Path, tuple[str, ...]]:
    """Return where an upload lies, and the names of its files.

    Raises:
        FileNotFoundError: If there is none of this name.
    """
    if not token.isalnum():
        raise FileNotFoundError(token)
    place = folder / token
    return place, tuple(json.loads((place / _NAMES).read_text()))


def forget_upload(place: Path) -> None:
    """Delete an upload."""
    shutil.rmtree(place, ignore_errors=True)


def _forget_old(folder: Path) -> None:
    for old in folder.iterdir():
        if time.time() - old.stat().st_mtime > KEPT_S:
            forget_upload(old)
