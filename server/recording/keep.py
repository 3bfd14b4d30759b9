"""Puts a recording into the station's memory: its robot, its rows, its deployment."""

import hashlib
import math
from collections.abc import Callable, Generator, Mapping
from datetime import UTC, datetime, timedelta
from typing import IO

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray
from autonomy.frames import ned_from_wgs84
from autonomy.site import Box, Site
from db.fault import UnknownIdError
from db.query.fleet.deployments import DeploymentRecord
from db.query.fleet.recordings import RecordedRow, add_recording
from db.query.fleet.robots import RobotRecord, add_robot, change_robot, get_robot
from db.query.station.events import add_event
from robot_link.messages import RobotId
from server.base.channels import catalogue_in
from server.recording.table import Recording

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MARGIN_M = 1.0
_BLOCK_BYTES = 1 << 20


def _go_on() -> None:
    return None


def recording_log(file: IO[bytes]) -> int:
    """Return the number that names a file's content among a robot's sample logs.

    It comes from the content, so that the same file imported twice is recognized.
    """
    file.seek(0)
    digest = hashlib.sha256()
    while block := file.read(_BLOCK_BYTES):
        digest.update(block)
    file.seek(0)
    return int.from_bytes(digest.digest()[:8]) >> 1


def keep_recording(
    session: Session,
    robot: str,
    recording: Recording,
    *,
    title: str,
    log: int,
    at: datetime,
    by: str,
    go_on: Callable[[], None] = _go_on,
) -> DeploymentRecord:
    """Keep a recording, all of it or nothing, in the caller's transaction.

    A robot that is not known is created as ``recorded``, with a site around the track whose origin
    is the track's centre; the site of a recorded robot grows around further recordings.

    Raises:
        DeploymentExistsError: If this very file is there already.
        WorkStoppedError: If ``go_on``, which is called before every row, says so.
    """
    variables = tuple(recording.values)
    known = catalogue_in(session)
    mapped = next(key for key in (*variables, *known) if known[key].can_map)
    record = _robot(session, robot, recording, mapped, at)
    positions = positions_ned(record.site, recording)
    if record.kind == "recorded":
        water = _union(record.site.water, _box_around(positions))
        site = record.site.model_copy(update={"water": water, "domain": water})
        change_robot(session, robot, site=site.model_dump())
    deployment = add_recording(
        session,
        robot,
        _rows(recording, positions, go_on),
        title=title,
        log=log,
        variables=variables,
        document={
            "source": title,
            "skipped": [{"line": f.line, "reason": f.reason} for f in recording.skipped[:1000]],
            "skipped_rows": len(recording.skipped),
        },
        at=at,
    )
    add_event(
        session,
        at,
        "deployment.imported",
        f"{by} imported {title}: {deployment.rows} rows of {robot}, "
        f"{len(recording.skipped)} left out.",
        robot=robot,
        data={"deployment": deployment.id},
    )
    return deployment


def positions_ned(site: Site, recording: Recording) -> FloatArray:
    """Return where the rows were taken in a site's frame, shape ``(n, 3)``, m."""
    north_east = ned_from_wgs84(
        recording.latitude_deg,
        recording.longitude_deg,
        site.origin_latitude_deg,
        site.origin_longitude_deg,
    )
    return np.column_stack([north_east, recording.depth_m])


def _robot(
    session: Session, robot: str, recording: Recording, variable: str, at: datetime
) -> RobotRecord:
    try:
        return get_robot(session, robot)
    except UnknownIdError:
        latitude_deg = _centre(recording.latitude_deg)
        longitude_deg = _centre(recording.longitude_deg)
    site = Site(
        name=f"Waters of {robot}",
        kind="sea",
        water=Box(x_min_m=-1.0, x_max_m=1.0, y_min_m=-1.0, y_max_m=1.0, depth_max_m=1.0),
        domain=Box(x_min_m=-1.0, x_max_m=1.0, y_min_m=-1.0, y_max_m=1.0, depth_max_m=1.0),
        origin_latitude_deg=latitude_deg,
        origin_longitude_deg=longitude_deg,
        radio_under_water=False,
        variable=variable,
    )
    record = RobotRecord(
        id=RobotId(robot),
        name=robot,
        model="",
        kind="recorded",
        system_id=None,
        links=(),
        site=site,
        created_at=at,
    )
    add_robot(session, record)
    return record


def _rows(
    recording: Recording, positions: FloatArray, go_on: Callable[[], None]
) -> Generator[RecordedRow]:
    values = _rows_of(recording.values, len(positions))
    flight = _rows_of(recording.flight, len(positions))
    for time_s, position, row, flown in zip(
        recording.time_s.tolist(), positions.tolist(), values, flight, strict=True
    ):
        go_on()
        north_m, east_m, depth_m = position
        told = zip(recording.flight, flown, strict=True)
        yield RecordedRow(
            _EPOCH + timedelta(seconds=time_s),
            (north_m, east_m, depth_m),
            row,
            {name: value for name, value in told if math.isfinite(value)},
        )


def _rows_of(columns: Mapping[str, FloatArray], count: int) -> list[list[float]]:
    return np.array(list(columns.values()), dtype=np.float64).reshape(-1, count).T.tolist()


def _centre(values: FloatArray) -> float:
    return float(values.min() + values.max()) / 2.0


def _box_around(positions: FloatArray) -> Box:
    low = positions.min(axis=0) - _MARGIN_M
    high = positions.max(axis=0) + _MARGIN_M
    return Box(
        x_min_m=float(low[0]),
        x_max_m=float(high[0]),
        y_min_m=float(low[1]),
        y_max_m=float(high[1]),
        depth_max_m=float(high[2]),
    )


def _union(first: Box, second: Box) -> Box:
    return Box(
        x_min_m=min(first.x_min_m, second.x_min_m),
        x_max_m=max(first.x_max_m, second.x_max_m),
        y_min_m=min(first.y_min_m, second.y_min_m),
        y_max_m=max(first.y_max_m, second.y_max_m),
        depth_max_m=max(first.depth_max_m, second.depth_max_m),
    )
