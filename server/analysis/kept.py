"""Keeps the columns that were read of a deployment, so that the next figure need not read them.

They are kept by a stamp of all that they were read of: another measurement, state, import or
definition makes another stamp, and what was kept is found no more. Flags are no part of it; they
are read anew for each figure. The folder may be emptied at any time.
"""

import hashlib
import logging
import os
import secrets
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final
from zipfile import BadZipFile

import numpy as np
from sqlalchemy.orm import Session

from db.query.measured.samples import sampled_variables
from db.query.measured.telemetry import states_kept
from db.query.station.events import EventFilter, newest_events
from server.analysis.question import Question

log = logging.getLogger(__name__)

FOLDER: Final = "analysis"
"""Of the data folder."""
BYTES_MAX: Final = 512_000_000
"""Of all that is kept; what was asked for longest ago goes first."""
_ENDING: Final = ".npz"
_IMPORTS: Final = ("deployment.imported", "deployment.mapped")
"""Events of what may put other values in the place of those that are there."""
Arrays = Mapping[str, np.ndarray]


def place_of(session: Session, question: Question) -> Path | None:
    """Return where the columns of a question are kept, as they stand now.

    ``None`` while the deployment lasts: its next measurement would make them worthless.
    """
    deployment, wanted = question.wanted.deployment, question.wanted
    if question.kept_in is None or deployment.last_at is None:
        return None
    first, last = deployment.begun_at, deployment.last_at
    imports = newest_events(session, EventFilter(robot=deployment.robot, kinds=_IMPORTS), 1)
    counts = sampled_variables(session, deployment.robot, start=first, end=last, log=deployment.log)
    told: tuple[Any, ...] = (
        version("grace-ground-station"),
        (deployment.id, deployment.kind, deployment.log, first, last),
        deployment.site.model_dump_json(),
        (sorted(wanted.believable.items()), wanted.derived, wanted.smoothed),
        [(one.key, one.kind) for one in question.series],
        question.pace,
        sorted(counts.items()),
        states_kept(session, deployment.robot, first, last),
        [one.cursor for one in imports],
    )
    return question.kept_in / f"{hashlib.sha256(repr(told).encode()).hexdigest()}{_ENDING}"


def load(place: Path | None) -> dict[str, np.ndarray] | None:
    """Return what is kept in a place, ``None`` where nothing is."""
    if place is None:
        return None
    try:
        with np.load(place) as found:
            arrays = dict(found)
        os.utime(place)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, BadZipFile) as error:
        log.warning("columns that were kept cannot be read: %s", error)
        place.unlink(missing_ok=True)
        return None
    return arrays


def keep(place: Path | None, arrays: Arrays) -> None:
    """Keep columns, unless there are too many, or the disk has no room."""
    if place is None or sum(one.nbytes for one in arrays.values()) > BYTES_MAX // 2:
        return
    part = place.with_name(f".{secrets.token_hex(8)}{_ENDING}")
    try:
        place.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with part.open("xb") as file:
            np.savez(file, allow_pickle=False, **arrays)
        part.replace(place)
        _make_room(place.parent)
    except OSError as error:
        log.warning("columns are not kept for the next figure: %s", error)
    finally:
        part.unlink(missing_ok=True)


def _make_room(folder: Path) -> None:
    """Remove what was asked for longest ago, until the rest fits."""
    left = BYTES_MAX
    kept = [(one.stat(), one) for one in folder.glob(f"[0-9a-f]*{_ENDING}")]
    for told, one in sorted(kept, key=lambda each: each[0].st_mtime_ns, reverse=True):
        left -= told.st_size
        if left < 0:
            one.unlink(missing_ok=True)
