"""Draws a film in a worker process: all of it is kept, or nothing."""

import hashlib
import shutil
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Final, Protocol

from sqlalchemy.orm import Session

from db.engine import reading
from db.query.measured.telemetry import track
from server.base.worker import IsCancelled, Report, WorkCancelledError
from server.replay.film.order import PART, FilmOrder, KeptFilm
from server.replay.film.picture import Pictures
from server.replay.film.scene import SceneFilm
from server.scene.replay_source import (
    Moment,
    Recorded,
    ReplaySource,
    map_reader,
    moment_of,
    recorded_around,
)
from webui.scene.source import MapView

TASK: Final = f"{__name__}:run"
_TRACK_POINTS: Final = 4000
_MAPS_MAX: Final = 40
"""A map of each model is drawn so often at most: each weighs as much as a thousand moments."""
_DRAWN: Final = 0.9
"""Part of the work that is done when all moments are drawn."""


class Film(Protocol):
    """Takes moments one after another."""

    def take(self, moment: Moment) -> None:
        """Draw the next moment."""
        ...

    def finish(self) -> None:
        """Write what is not written yet."""
        ...


def run(order: FilmOrder, report: Report, is_cancelled: IsCancelled) -> KeptFilm:
    """Draw a film.

    Raises:
        WorkCancelledError: If the work is not wanted any more.
        ValueError: If the disk does not take it.
    """
    part = order.folder / f".{order.id}{PART}"
    target = part / order.name
    try:
        part.mkdir(parents=True, mode=0o700)
        with reading(order.database_url) as session:
            _draw(session, order, target, report, is_cancelled)
        sha256, size = _hashed(target)
        part.replace(order.folder / order.id)
    except OSError as error:
        raise ValueError(
            f"the disk did not take the film ({error}); make room and make it again"
        ) from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return KeptFilm(order.id, order.name, sha256, size)


def _draw(
    session: Session, order: FilmOrder, target: Path, report: Report, is_cancelled: IsCancelled
) -> None:
    report((0.01, "Reading the stretch"))
    recorded = _stretch(session, order)
    source = ReplaySource(recorded, order.hull, order.thresholds_m)
    maps: dict[int, MapView] = {}
    known_map = map_reader(session, order.robot.id, order.channels, maps)
    with _begun(order, source, target) as film:
        for number, at in enumerate(order.moments(), 1):
            if is_cancelled():
                raise WorkCancelledError
            moment = moment_of(session, recorded, at, order.clock, known_map)
            maps.update((one.version, one) for one in moment.maps)
            for key in maps.keys() - {one.version for one in moment.maps}:
                del maps[key]
            source.show(moment)
            film.take(moment)
            done = _DRAWN * number / order.frames
            report((done, f"Drawing moment {number} of {order.frames}"))
        report((_DRAWN, "Writing the film"))
        film.finish()


@contextmanager
def _begun(order: FilmOrder, source: ReplaySource, target: Path) -> Generator[Film]:
    if order.kind == "pictures":
        with Pictures(order, source, target) as pictures:
            yield pictures
    else:
        with SceneFilm(order, source, target) as film:
            yield film


def _stretch(session: Session, order: FilmOrder) -> Recorded:
    """Read the stretch: its own track, and no more maps than a film can hold."""
    found = recorded_around(session, order.robot, order.first, order.made_at)
    way = track(session, order.robot.id, order.first, order.last, _TRACK_POINTS)
    return replace(found, track=way, maps=thinned(found.maps, order.first, order.last))


def thinned(
    maps: tuple[tuple[int, str, str, datetime], ...], first: datetime, last: datetime
) -> tuple[tuple[int, str, str, datetime], ...]:
    """Return the maps that stand at even steps of a stretch, the oldest first.

    Args:
        maps: Key, variable, model and moment of each, the oldest first.
        first: Where the stretch begins.
        last: Where it ends.
    """
    series: dict[tuple[str, str], list[tuple[int, str, str, datetime]]] = defaultdict(list)
    for one in maps:
        series[one[1:3]].append(one)
    step = (last - first) / (_MAPS_MAX - 1)
    kept: set[int] = set()
    for of_model in series.values():
        for number in range(_MAPS_MAX):
            count = bisect_right(of_model, first + number * step, key=lambda one: one[3])
            if count:
                kept.add(of_model[count - 1][0])
    return tuple(one for one in maps if one[0] in kept)


def _hashed(path: Path) -> tuple[str, int]:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest(), path.stat().st_size
