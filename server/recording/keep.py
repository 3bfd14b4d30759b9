"""Puts a recording into the station's memory: its robot, its rows, its deployment."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import IO, Any, Final

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray
from autonomy.frames import ned_from_wgs84
from autonomy.site import Box, Site
from db.column import microseconds
from db.fault import StoreError, UnknownIdError
from db.query.fleet.deployments import DeploymentRecord, get_deployment
from db.query.fleet.recordings import (
    DeploymentExistsError,
    ImportedFile,
    add_recorded_deployment,
    extend_deployment,
    overlapping_deployment,
    refuse_closed,
    refuse_known,
)
from db.query.fleet.robots import RobotRecord, add_robot, change_robot, get_robot, robot_key
from db.query.station.events import add_event
from robot_link.messages import RobotId
from server.base.channels import catalogue_in
from server.recording.merge import Merge, keep, kept_mark, merge
from server.recording.table import Recording

ROBOT_ID: Final = r"^[a-z0-9][a-z0-9-]{0,39}$"
"""What a robot may be called: it stands in addresses, file names and commands."""
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MARGIN_M = 1.0
_BLOCK_BYTES = 1 << 20


def _go_on() -> None:
    return None


class ForeignMarkError(StoreError):
    """The files say that their robot does not exist, and the station has one that does."""


def hashed(file: IO[bytes], name: str) -> ImportedFile:
    """Return a file with the hash of its content, by which it is recognized again."""
    file.seek(0)
    digest = hashlib.sha256()
    while block := file.read(_BLOCK_BYTES):
        digest.update(block)
    file.seek(0)
    return ImportedFile(name, digest.hexdigest())


@dataclass(frozen=True, slots=True)
class Source:
    """Where a recording comes from."""

    title: str
    files: tuple[ImportedFile, ...]
    log: int
    """Names the files' content among the robot's sample logs."""
    is_simulated: bool = False
    into: str = ""
    """Id of the deployment that the rows belong to, "" to go by their time."""
    clock_offset_s: float | None = None
    """How far the recorder's clock was ahead, as a person said; the rows' times are right."""


@dataclass(frozen=True, slots=True)
class Kept:
    """What became of a recording."""

    deployment: DeploymentRecord
    new: int
    duplicate: int
    differs: int


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """A recording held against what was kept of its robot."""

    mark: tuple[float, ...]
    """Another one once something else is kept."""
    positions: FloatArray
    """Shape ``(n, 3)``, m, in the frame of the robot's site."""
    merged: Merge


def hold(session: Session, robot: str, recording: Recording) -> Held | None:
    """Hold a recording against what is kept of its robot; ``None`` if nobody knows that robot.

    It reads much and may take long; what it found is used by ``keep_recording`` if it still holds.
    """
    try:
        record = get_robot(session, robot)
    except UnknownIdError:
        return None
    return _hold(session, record, recording)


def _hold(session: Session, record: RobotRecord, recording: Recording) -> Held:
    positions = positions_ned(record.site, recording)
    merged = merge(session, robot_key(session, record.id), recording, positions)
    return Held(_mark(session, record, recording), positions, merged)


def _mark(session: Session, record: RobotRecord, recording: Recording) -> tuple[float, ...]:
    site = record.site
    origin = (site.origin_latitude_deg, site.origin_longitude_deg)
    return (*origin, *kept_mark(session, robot_key(session, record.id), recording))


def source_of(title: str, hashes: Sequence[ImportedFile], **more: Any) -> Source:  # noqa: ANN401 - fields of a source
    """Return the source of files that were hashed; one file is named as it always was."""
    digests = sorted(one.sha256 for one in hashes)
    joined = (
        digests[0] if len(digests) == 1 else hashlib.sha256("".join(digests).encode()).hexdigest()
    )
    return Source(title, tuple(hashes), int(joined[:16], 16) >> 1, **more)


def keep_recording(
    session: Session,
    robot: str,
    recording: Recording,
    source: Source,
    *,
    at: datetime,
    by: str,
    held: Held | None = None,
    go_on: Callable[[], None] = _go_on,
) -> Kept:
    """Keep a recording, all of it or nothing, in the caller's transaction.

    A robot that is not known is created as ``recorded``, or as ``simulated`` where the files are
    marked so, with a site around the track whose origin is the track's centre; the site of a robot
    of recordings grows around further ones. Rows that are kept already are not kept again. What is
    new joins the deployment that it is said to belong to, or that has a part of its time; else it
    becomes one of its own. What ``hold`` found is used if nothing was kept since, and else found
    anew, so that this transaction, during which nothing else is written, need not read all.

    Raises:
        DeploymentExistsError: If these very files are there already.
        DeploymentClosedError: If the deployment takes no more rows.
        ForeignMarkError: If the files are marked SIMULATION, and the robot is not.
        WorkStoppedError: If ``go_on``, which is called between two blocks, says so.
    """
    variables = tuple(recording.values)
    known = catalogue_in(session)
    mapped = next(key for key in (*variables, *known) if known[key].can_map)
    record = _robot(session, robot, recording, mapped, at, is_simulated=source.is_simulated)
    if source.is_simulated and not record.simulated:
        raise ForeignMarkError(
            f"{source.title} is marked SIMULATION, and {robot} is a robot that exists; "
            "choose another name."
        )
    refuse_known(session, robot, source.log, source.files)
    if held is None or held.mark != _mark(session, record, recording):
        held = _hold(session, record, recording)
    merged = held.merged
    if record.system_id is None and not record.links and record.water is None:
        water = _union(record.site.water, _box_around(held.positions))
        site = record.site.model_copy(update={"water": water, "domain": water})
        change_robot(session, robot, site=site.model_dump())
    target = _target(session, robot, recording, source)
    if target is None and not merged.changes:
        raise DeploymentExistsError(
            f"Every row of {source.title} is kept already, in another deployment of {robot}."
        )
    kept = Kept(_joined(session, robot, target, recording, source, merged, at, by), **merged.counts)
    if merged.changes or merged.counts["differs"]:
        log = source.log if kept.deployment.log is None else kept.deployment.log
        keep(session, robot_key(session, robot), log, merged, microseconds(at), go_on)
    add_event(
        session,
        at,
        "deployment.imported",
        f"{by} imported {source.title}: {kept.new} new rows of {robot}, {kept.duplicate} known, "
        f"{kept.differs} different, {len(recording.skipped)} left out.",
        robot=robot,
        data={"deployment": kept.deployment.id},
    )
    return kept


def _target(
    session: Session, robot: str, recording: Recording, source: Source
) -> DeploymentRecord | None:
    if source.into:
        target = get_deployment(session, source.into)
        if target.robot != robot or target.void_reason or target.started_at is None:
            raise UnknownIdError("deployment", f"{source.into} of {robot} that has begun")
    else:
        first, last = (_moment(recording.time_s[place]) for place in (0, -1))
        target = overlapping_deployment(session, robot, first, last)
    return target


def _joined(
    session: Session,
    robot: str,
    target: DeploymentRecord | None,
    recording: Recording,
    source: Source,
    merged: Merge,
    at: datetime,
    by: str,
) -> DeploymentRecord:
    """Return the deployment that the rows belong to, which knows of the import."""
    first, last = (_moment(recording.time_s[place]) for place in (0, -1))
    variables = tuple(key for key, values in recording.values.items() if np.isfinite(values).any())
    imported = {
        "files": [{"name": one.name, "sha256": one.sha256} for one in source.files],
        "at": at.isoformat(),
        "by": by,
        **merged.counts,
        "faults": len(recording.skipped),
        "clock_offset_s": source.clock_offset_s,
    }
    if target is not None:
        if merged.changes:
            refuse_closed(session, target)
        return extend_deployment(
            session,
            target.id,
            variables=variables,
            imported=imported,
            rows=merged.counts["new"],
            first=first,
            last=last,
        )
    return add_recorded_deployment(
        session,
        robot,
        title=source.title,
        log=source.log,
        variables=variables,
        document={
            "source": source.title,
            "skipped": [{"line": f.line, "reason": f.reason} for f in recording.skipped[:1000]],
            "skipped_rows": len(recording.skipped),
            "imports": [imported],
        },
        rows=merged.counts["new"],
        first=first,
        last=last,
    )


def _moment(time_s: float) -> datetime:
    return _EPOCH + timedelta(seconds=float(time_s))


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
    session: Session,
    robot: str,
    recording: Recording,
    variable: str,
    at: datetime,
    *,
    is_simulated: bool,
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
        kind="simulated" if is_simulated else "recorded",
        system_id=None,
        links=(),
        site=site,
        created_at=at,
    )
    add_robot(session, record)
    return record


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
