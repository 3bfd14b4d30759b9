"""An export of VUE comes in: read, placed, and kept whole or not at all."""

import asyncio
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import IO, Any

import numpy as np
from sqlalchemy.orm import Session
from typing_extensions import TypedDict

from autonomy.arrays import FloatArray
from autonomy.frames import ned_from_wgs84
from db.query.fleet.robots import get_robot
from db.query.measured.detections import add_detections
from db.query.measured.telemetry import track
from db.query.station.events import add_event
from db.store import Store
from robot_link.clock import Clock
from server.base.job import JobError, JobProgress, ThreadWork
from server.tag.vue import RowFault, VueError, VueRow, read_vue

_READ_SHARE = 0.4
_ROWS_AT_ONCE = 5_000
_FARTHEST_M = 200_000.0
"""No receiver of a robot's water is farther from its origin."""
_GAP_MAX_S = 600.0
"""Of a longer silence nobody knows where the robot was."""
_TRACK_POINTS = 20_000


class BrokenRow(TypedDict):
    """A row of a file that cannot be taken in."""

    line: int
    reason: str


class DetectionsImported(TypedDict):
    """What came of an import of detections."""

    robot: str
    detections: int
    """That are new."""
    known: int
    """That were here already, and changed nothing."""
    without_place: int
    """Of which nobody knows where they were heard."""


class DetectionsRefused(TypedDict):
    """Why a file of detections was refused."""

    errors: list[BrokenRow]


@dataclass(frozen=True, slots=True)
class DetectionsOrder:
    """What is to be imported."""

    file: IO[bytes]
    size: int
    title: str
    """Name of the file."""
    robot: str
    by: str


async def run_import(
    order: DetectionsOrder, store: Store, clock: Clock, progress: JobProgress
) -> DetectionsImported:
    """Import a file into a running station.

    Raises:
        JobError: If the file was refused; the result names each broken row.
    """
    thread = ThreadWork(progress)

    def read() -> list[VueRow]:
        try:
            return read_vue(
                order.file,
                order.size,
                lambda share: thread.report(share * _READ_SHARE, "Reading the file"),
            )
        except VueError as error:
            raise _refusal(str(error), error.faults) from error

    rows = await thread.result(asyncio.to_thread(read))
    at = clock.now()
    progress.report(_READ_SHARE, f"Keeping {len(rows):,} detections")
    return await thread.result(
        store.write(lambda session: keep(session, order, rows, at, thread.report))
    )


def keep(
    session: Session,
    order: DetectionsOrder,
    rows: Sequence[VueRow],
    at: datetime,
    tell: Callable[[float, str], None],
) -> DetectionsImported:
    """Keep all rows in the caller's transaction, those of unknown place where the robot was then.

    Raises:
        JobError: If a row lies far outside the robot's water.
        UnknownIdError: If there is no such robot.
    """
    places = _places(session, order.robot, rows)
    sensible = np.isfinite(places).all(axis=1)

    def blocks() -> Generator[list[dict[str, Any]]]:
        for first in range(0, len(rows), _ROWS_AT_ONCE):
            share = _READ_SHARE + (1.0 - _READ_SHARE) * first / len(rows)
            tell(share, f"Keeping {len(rows):,} detections")
            part = zip(
                rows[first : first + _ROWS_AT_ONCE],
                places[first : first + _ROWS_AT_ONCE].tolist(),
                strict=True,
            )
            yield _told_columns([_columns(row, place, at) for row, place in part])

    new = add_detections(session, order.robot, blocks())
    known = len(rows) - new
    add_event(
        session,
        at,
        "detections.imported",
        f"{order.by} imported {order.title}: {new:,} detections of tags into {order.robot}, "
        f"{known:,} were here already.",
        robot=order.robot,
    )
    return DetectionsImported(
        robot=order.robot,
        detections=new,
        known=known,
        without_place=int(len(rows) - sensible.sum()),
    )


def _columns(row: VueRow, place: list[float], at: datetime) -> dict[str, Any]:
    north, east = place if place[0] == place[0] else (None, None)  # NaN is not itself
    return {
        "receiver": row.receiver,
        "tag": row.tag,
        "measured_at": row.measured_at,
        "received_at": at,
        "sensor": row.sensor,
        "sensor_unit": row.sensor_unit,
        "north_m": north,
        "east_m": east,
        "tag_name": row.tag_name,
        "tag_serial": row.tag_serial,
        "station": row.station,
    }


def _told_columns(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return rows without the columns that none of them tells."""
    told = [name for name in rows[0] if any(row[name] is not None for row in rows)]
    return [{name: row[name] for name in told} for row in rows]


def _places(session: Session, robot: str, rows: Sequence[VueRow]) -> FloatArray:
    """Return where each was heard, north and east m; NaN where nobody knows.

    Raises:
        JobError: If one is far outside the water.
    """
    site = get_robot(session, robot).site
    told = np.array([row.place_deg or (np.nan, np.nan) for row in rows], dtype=np.float64)
    places = np.full((len(rows), 2), np.nan)
    has_told = np.isfinite(told).all(axis=1)
    if has_told.any():
        origin = site.origin_latitude_deg, site.origin_longitude_deg
        latitude, longitude = told[has_told].T
        places[has_told] = ned_from_wgs84(latitude, longitude, *origin)
    far = np.flatnonzero(has_told & (np.hypot(*places.T) > _FARTHEST_M))
    if len(far):
        faults = [
            RowFault(
                rows[index].line,
                f"the position is {np.hypot(*places[index]) / 1e3:,.0f} km from {site.name}; "
                f"at most {_FARTHEST_M / 1e3:.0f} km",
            )
            for index in far[:100].tolist()
        ]
        raise _refusal(
            f"{len(far):,} detections lie far outside {site.name}, the first in line "
            f"{faults[0].line}. Nothing was imported.",
            faults,
        )
    if not has_told.all():
        lacking = np.flatnonzero(~has_told)
        at = np.array([rows[index].measured_at.timestamp() for index in lacking.tolist()])
        places[lacking] = _on_track(session, robot, rows, at)
    return places


def _on_track(session: Session, robot: str, rows: Sequence[VueRow], at_s: FloatArray) -> FloatArray:
    """Return where the robot was at these times, by its own reports."""
    times = [row.measured_at for row in rows]
    known = track(session, robot, min(times), max(times), _TRACK_POINTS)
    found = np.full((len(at_s), 2), np.nan)
    time_s = np.array([one.timestamp() for one in known.measured_at], dtype=np.float64)
    if not len(time_s):
        return found
    behind = np.clip(np.searchsorted(time_s, at_s), 0, len(time_s) - 1)
    before = np.maximum(behind - 1, 0)
    gap = np.minimum(np.abs(time_s[behind] - at_s), np.abs(time_s[before] - at_s))
    for axis in (0, 1):
        found[:, axis] = np.interp(at_s, time_s, known.position_ned[:, axis])
    found[gap > _GAP_MAX_S] = np.nan
    return found


def _refusal(sentence: str, faults: Sequence[RowFault]) -> JobError:
    errors = [BrokenRow(line=fault.line, reason=fault.reason) for fault in faults]
    return JobError(sentence, DetectionsRefused(errors=errors))
