"""Tags that robots heard: lists, plots, files in and out, and where a resting tag is."""

import asyncio
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Annotated, Literal

import numpy as np
from fastapi import APIRouter, Depends, File, Path, Query, Response, UploadFile
from fastapi.responses import StreamingResponse
from pydantic import AwareDatetime
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray
from autonomy.tag.config import TagConfig
from autonomy.tag.resting import CELLS
from db.query.fleet.robots import RobotRecord
from db.query.measured.detections import newest_receiver_report
from robot_link.report import ReceiverReport
from server.access.dependency import Pilot, Viewer
from server.access.role import Rights
from server.base.dependency import FoundationDep, service
from server.base.job import JobProgress, kept_upload
from server.base.problem import not_found
from server.base.text import shown
from server.base.view import encoded
from server.base.work.job_view import JobBegun, JobView, leaves
from server.fleet.dependency import FleetDep
from server.fleet.water import site_robots
from server.link.ingest import CLOCK_OFF_MAX_S
from server.map.field_maps import FieldMaps
from server.tag.export import csv_blocks
from server.tag.heard import Heard, Listening, heard, listening, rates_per_hour, where_resting
from server.tag.importing import DetectionsImported, DetectionsOrder, run_import
from server.tag.maps import mapped_variables
from server.tag.view import (
    DetectionsView,
    DetectionView,
    RatePointView,
    ReceiverView,
    RestingView,
    RowView,
    TagsView,
    TagTrackView,
    TagView,
)

router = APIRouter(prefix="/api/robots/{robot}", tags=["data"])

MapsDep = Annotated[FieldMaps, Depends(service(FieldMaps))]
_TAG_NAME = r"^[A-Z][0-9]{2,3}-[0-9]{4}-[0-9]{1,7}$"
_PLOTTED = 600
"""Detections of one tag in a plot, at most."""
TagName = Annotated[str, Path(pattern=_TAG_NAME)]
Tag = Annotated[str | None, Query(pattern=_TAG_NAME, description="Only this transmitter.")]
Of = Annotated[
    Literal["robot", "water"], Query(description="What this robot heard, or all of its water.")
]
Since = Annotated[AwareDatetime | None, Query(description="By default all; RFC 3339.")]
Until = Annotated[AwareDatetime | None, Query(description="By default now; RFC 3339.")]


async def _config(foundation: FoundationDep, robot: str) -> TagConfig:
    return (await foundation.configurations.current("tags", robot)).value_as(TagConfig)


@dataclass(frozen=True, slots=True)
class Question:
    """Whose detections are asked for, by whom, of which time, and how they are judged."""

    rights: Rights
    record: RobotRecord
    config: TagConfig
    since: datetime | None
    until: datetime | None
    of: str

    def robots(self, session: Session) -> Sequence[str]:
        """Return the robots that listened, as far as the caller may see them."""
        if self.of != "water":
            return (self.record.id,)
        return [one for one in site_robots(session, self.record.id) if self.rights.sees(one)]

    def heard(self, session: Session, tag: str | None = None) -> Heard:
        """Return what they heard, of one tag or of all."""
        return heard(session, self.robots(session), self.config, tag, self.since, self.until)


async def _question(
    caller: Viewer,
    robot: str,
    fleet: FleetDep,
    foundation: FoundationDep,
    since: Since = None,
    until: Until = None,
    of: Of = "robot",
) -> Question:
    record, config = fleet.status(robot).record, await _config(foundation, robot)
    return Question(caller.rights, record, config, since, until, of)


QuestionDep = Annotated[Question, Depends(_question)]


@router.get("/detections", response_model=DetectionsView)
async def list_detections(
    question: QuestionDep,
    foundation: FoundationDep,
    tag: Tag = None,
    doubtful: Annotated[
        bool | None, Query(description="Only doubtful ones, or only those beyond doubt.")
    ] = None,
    limit: Annotated[int, Query(ge=1, le=10_000)] = 200,
) -> Response:
    """Return detections of tags, the newest first."""

    def views(session: Session) -> DetectionsView:
        found = question.heard(session, tag)
        wanted = np.arange(len(found.records))
        if doubtful is not None:
            wanted = wanted[found.doubtful == doubtful]
        newest = wanted[::-1][:limit].tolist()
        return DetectionsView([_view(found, index) for index in newest], len(wanted))

    return encoded(await foundation.store.query(views))


@router.get(
    "/detections.csv",
    response_class=Response,
    responses={200: {"content": {"text/csv; charset=utf-8": {}}}},
)
async def export_detections(
    robot: str, question: QuestionDep, foundation: FoundationDep, maps: MapsDep, tag: Tag = None
) -> StreamingResponse:
    """Return detections as CSV with the columns of VUE.

    Behind these stand for every mapped variable its mean and standard deviation at the place of the
    detection, from the map nearest in time.
    """
    record = question.record
    found = await foundation.store.query(lambda session: question.heard(session, tag))
    present = list(maps.views(robot).values())
    catalogue = foundation.channels.catalogue
    times = [one.measured_at for one in found.records]
    variables = await foundation.store.query(
        lambda session: mapped_variables(session, robot, times, present, catalogue)
    )
    is_simulation = foundation.settings.simulation or record.simulated
    mark = "SIMULATION_" if is_simulation else ""
    headers = {"Content-Disposition": f'attachment; filename="{mark}{robot}_detections.csv"'}
    blocks = csv_blocks(found, variables, record.site, is_simulation=is_simulation)
    return StreamingResponse(blocks, media_type="text/csv; charset=utf-8", headers=headers)


@router.post("/detections", status_code=202, openapi_extra=leaves(DetectionsImported))
async def import_detections(
    caller: Pilot,
    robot: str,
    file: Annotated[UploadFile, File(description="A CSV file, as VUE exports it.")],
    fleet: FleetDep,
    foundation: FoundationDep,
    begun: JobBegun,
) -> JobView:
    """Import an export of VUE: every row, or none with each broken row named in the job's result.

    Rows without a position are placed where the robot was at that time. What is here already
    changes nothing.
    """
    fleet.status(robot)
    kept = await asyncio.to_thread(kept_upload, file.file)
    title = shown(file.filename or "") or "detections.csv"
    order = DetectionsOrder(kept, os.fstat(kept.fileno()).st_size, title, robot, caller.name)

    async def work(progress: JobProgress) -> DetectionsImported:
        with kept:
            done = await run_import(order, foundation.store, foundation.clock, progress)
        foundation.feed.mark("tags", robot)
        return done

    job = await foundation.jobs.start("detections", work, by=caller.name, robot=robot)
    return await begun(job.id)


@router.get("/tags")
async def list_tags(robot: str, question: QuestionDep, foundation: FoundationDep) -> TagsView:
    """Return every tag that was heard, its detections in time, and the receiver's condition."""
    record = question.record

    def views(session: Session) -> TagsView:
        found = question.heard(session)
        report = newest_receiver_report(session, robot)
        return TagsView(
            robot=robot,
            tags=_tags(found),
            detections=len(found.records),
            doubtful=int(found.doubtful.sum()),
            receiver=None if report is None else _receiver(report),
            simulation=foundation.settings.simulation or record.simulated,
        )

    return await foundation.store.query(views)


@router.get("/tags/track")
async def get_tag_track(
    caller: Viewer,
    robot: str,
    fleet: FleetDep,
    foundation: FoundationDep,
    tag: Tag = None,
    since: Since = None,
    until: Until = None,
    max_points: Annotated[int, Query(ge=2, le=5000)] = 1000,
) -> TagTrackView:
    """Return the robot's track with the detections an hour about each place, but doubtful ones."""
    del caller
    fleet.status(robot)
    config = await _config(foundation, robot)

    def view(session: Session) -> TagTrackView:
        found = heard(session, (robot,), config, tag, since, until)
        known = listening(session, robot, since, until, max_points)
        return TagTrackView(robot, tag, _rate_points(found, known))

    return await foundation.store.query(view)


@router.get("/tags/{tag}/resting")
async def get_resting_place(
    robot: str, tag: TagName, question: QuestionDep, foundation: FoundationDep
) -> RestingView:
    """Return the regions that hold a tag with 50 and 90 %, if it stays where it is."""
    since, until = question.since, question.until

    def read(session: Session) -> tuple[Heard, dict[str, Listening]]:
        tracks = {one: listening(session, one, since, until) for one in question.robots(session)}
        return question.heard(session, tag), tracks

    found, tracks = await foundation.store.query(read)
    try:
        place = await asyncio.to_thread(
            where_resting, found, tracks, question.config, question.record.site
        )
    except ValueError as error:
        raise not_found(f"Where {tag} is cannot be said. {error}") from error
    extent = place.extent
    cell = (
        (extent.north_max_m - extent.north_min_m) / CELLS,
        (extent.east_max_m - extent.east_min_m) / CELLS,
    )
    half, most = place.region(0.5), place.region(0.9)
    hectare = cell[0] * cell[1] / 1e4
    north, east = place.mean_ne_m
    return RestingView(
        robot=robot,
        tag=tag,
        detections=int((~found.doubtful).sum()),
        mean_ne_m=place.mean_ne_m,
        south_west_m=(extent.north_min_m, extent.east_min_m),
        cell_m=cell,
        half=_runs(half),
        most=_runs(most),
        half_ha=float(half.sum()) * hectare,
        most_ha=float(most.sum()) * hectare,
        text=(
            f"If it stays where it is, {tag} is about {north:.0f} m north, {east:.0f} m east: with "
            f"50 % within {_area(float(half.sum()) * hectare)}, with 90 % within "
            f"{_area(float(most.sum()) * hectare)}."
        ),
    )


def _area(hectares: float) -> str:
    return f"{1e4 * hectares:,.0f} m²" if hectares < 1.0 else f"{hectares:,.1f} ha"


def _runs(cells: BoolArray) -> list[RowView]:
    """Return the cells of a region as parts of rows."""
    runs: list[RowView] = []
    for row in np.flatnonzero(cells.any(axis=1)).tolist():
        edges = np.flatnonzero(np.diff(np.concatenate(([0], cells[row].astype(np.int8), [0]))))
        pairs = edges.reshape(-1, 2).tolist()
        runs += [RowView(row, first, behind - first) for first, behind in pairs]
    return runs


def _view(found: Heard, index: int) -> DetectionView:
    told = asdict(found.records[index])
    del told["tag_serial"]
    return DetectionView(**told, doubtful=bool(found.doubtful[index]))


def _tags(found: Heard) -> list[TagView]:
    by_tag: dict[str, list[int]] = {}
    for index, record in enumerate(found.records):
        by_tag.setdefault(record.tag, []).append(index)
    views: list[TagView] = []
    for tag, indices in sorted(by_tag.items()):
        records = [found.records[index] for index in indices]
        first = records[0].measured_at
        step = -(-len(indices) // _PLOTTED)
        views.append(
            TagView(
                tag=tag,
                name=next((one.tag_name for one in records if one.tag_name), None),
                detections=len(indices),
                doubtful=int(found.doubtful[indices].sum()),
                first_at=first,
                last_at=records[-1].measured_at,
                hours=[
                    (one.measured_at - first).total_seconds() / 3600.0 for one in records[::step]
                ],
                doubts=[bool(found.doubtful[index]) for index in indices[::step]],
            )
        )
    return views


def _receiver(report: ReceiverReport) -> ReceiverView:
    offset = report.clock_offset_s
    return ReceiverView(
        receiver=report.receiver,
        at=report.measured_at,
        heard=report.heard,
        refused_sum=report.refused_sum,
        refused_date=report.refused_date,
        refused_code=report.refused_code,
        clock_offset_s=offset,
        is_clock_off=offset is not None and abs(offset) > CLOCK_OFF_MAX_S,
    )


def _rate_points(found: Heard, known: Listening) -> list[RatePointView]:
    sure = [
        record.measured_at.timestamp()
        for record, is_doubtful in zip(found.records, found.doubtful.tolist(), strict=True)
        if not is_doubtful
    ]
    times_s = np.array([at.timestamp() for at in known.measured_at], dtype=np.float64)
    rates = rates_per_hour(times_s, np.array(sure, dtype=np.float64))
    return [
        RatePointView(at, north, east, rate)
        for at, (north, east), rate in zip(
            known.measured_at, known.north_east_m.tolist(), rates.tolist(), strict=True
        )
    ]
