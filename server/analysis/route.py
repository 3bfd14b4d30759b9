"""Dives and rows of deployments by REST, for figures and for tables."""

from collections.abc import Generator
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.responses import StreamingResponse

from autonomy.arrays import FloatArray
from autonomy.quality.flag import OG1_FILL
from db.column import moment
from db.query.fleet.robots import get_robot
from db.record import same
from server.access.dependency import Viewer
from server.analysis.analyses import Analyses, OnShare
from server.analysis.answer import DivesFound, RowsFound
from server.analysis.export import csv_blocks
from server.analysis.progress import LINES, answer_with
from server.analysis.question import Question, Series
from server.base.dependency import StoreDep, service
from server.base.problem import FieldError, unprocessable
from server.base.view import View, encoded, one_of

router = APIRouter(prefix="/api/deployments", tags=["data"])
_AS_LINES: Final[dict[int | str, dict[str, Any]]] = {200: {"content": {LINES: {}}}}
AnalysesDep = Annotated[Analyses, Depends(service(Analyses))]
ChannelsQuery = Annotated[
    str,
    Query(
        max_length=300, description="Keys of series with commas between, at most 6; see `dives`."
    ),
]
DivesQuery = Annotated[
    str, Query(max_length=300, description="Numbers of dives such as `1-5,9`; all by default.")
]
FlagMaxQuery = Annotated[
    int,
    Query(ge=2, le=4, description="Values with a greater flag of OG1.0 are left out: 3 no bad one"),
]


@dataclass(frozen=True, slots=True)
class DiveFactsView(View):
    """One dive, found from depths."""

    number: int
    begin_at: datetime
    end_at: datetime
    duration_s: float
    depth_m: float
    """The greatest."""
    distance_m: float | None
    """Over ground in a straight line, to the fix after the dive where one came soon."""
    energy_j: float | None
    """By the charge that the robot told; null where it tells none, or fell by less than told."""
    legs: int
    """Halves, down and up; more than two in a yo-yo."""
    samples: int
    """Measurements of the channel that has most."""


@dataclass(frozen=True, slots=True)
class SeriesView(View):
    """Something that can be asked for."""

    key: str
    title: str
    unit: str
    kind: Annotated[str, one_of("sampled", "derived", "state", "computed")]
    variable: str
    """Its name in the NetCDF file; empty where that lacks it."""
    decimals: int


@dataclass(frozen=True, slots=True)
class DivesView(View):
    """Dives of a deployment."""

    dives: list[DiveFactsView]
    series: list[SeriesView]
    """What `rows` can be asked for."""
    rows: int
    is_checked: bool
    """Whether rules of quality were run."""
    energy_step_j: float | None
    """Steps in which the robot tells its charge."""


@dataclass(frozen=True, slots=True)
class StatisticsView(View):
    """Of all chosen values, not only of those that are told."""

    count: int
    mean: float | None
    std: float | None
    median: float | None
    low_5: float | None
    """One in twenty is less."""
    high_95: float | None
    """One in twenty is greater."""
    least: float | None
    greatest: float | None


@dataclass(frozen=True, slots=True)
class BinsView(View):
    """Values counted in bins of one width."""

    edges: list[float]
    """One more than there are counts."""
    counts: list[int]


@dataclass(frozen=True, slots=True)
class SeriesRowsView(View):
    """A series at the moments of the answer."""

    series: SeriesView
    value: list[float | None]
    flag: list[int | None]
    """Of OG1.0; null without a value."""
    interpolated: int
    """How many values lie between two that were measured."""
    statistics: StatisticsView
    bins: BinsView


@dataclass(frozen=True, slots=True)
class DensityView(View):
    """Potential density anomaly on a grid of salinity and temperature."""

    salinity: list[float]
    """g/kg."""
    temperature: list[float]
    """Conservative, degC."""
    sigma0: list[list[float]]
    """kg/m3 less 1000, by temperature, then salinity."""


@dataclass(frozen=True, slots=True)
class RowsView(View):
    """Rows of some series at the same moments."""

    total: int
    """Rows that were chosen; the statistics are of all."""
    decimated: bool
    """Whether rows were left out; the least and greatest values are there."""
    is_checked: bool
    time_s: list[float]
    """Since 1970, UTC."""
    dive: list[int]
    """From 1; 0 at the surface."""
    leg: list[int]
    """From 1 through the deployment; 0 at the surface."""
    direction: list[int]
    """1 down, -1 up, 0 at the surface."""
    depth_m: list[float | None]
    series: list[SeriesRowsView]
    density: DensityView | None
    """Where absolute salinity and conservative temperature were asked for."""


@router.get("/{deployment}/analysis/dives", response_model=DivesView, responses=_AS_LINES)
async def list_dives(
    caller: Viewer, request: Request, deployment: str, analyses: AnalysesDep
) -> Response:
    """Return the dives, found from depths alone, and the series that there are.

    Whoever accepts `application/x-ndjson` is told line by line how far the reading is, as
    `{"progress": 0.4}`; the last line is `{"answer": ...}`, or `{"problem": "why there is none"}`.
    """
    del caller
    question = await analyses.question(deployment, [], "", flag_max=4)

    async def work(on_share: OnShare) -> Response:
        return encoded(_dives(await analyses.dives(request, question, on_share)))

    return await answer_with(request, work)


def _dives(found: DivesFound) -> DivesView:
    return DivesView(
        dives=[
            same(
                DiveFactsView,
                one,
                begin_at=moment(one.begin_us),
                end_at=moment(one.end_us),
                duration_s=(one.end_us - one.begin_us) / 1e6,
            )
            for one in found.dives
        ],
        series=[_series(one) for one in found.series],
        rows=found.rows,
        is_checked=found.is_checked,
        energy_step_j=found.energy_step_j,
    )


@router.get("/{deployment}/analysis/rows", response_model=RowsView, responses=_AS_LINES)
async def list_rows(
    caller: Viewer,
    request: Request,
    deployment: str,
    analyses: AnalysesDep,
    channels: ChannelsQuery,
    dives: DivesQuery = "",
    flag_max: FlagMaxQuery = 4,
    limit: Annotated[int, Query(ge=10, le=20_000)] = 3000,
) -> Response:
    """Return series at the moments of the one with fewest values, thinned above a limit.

    Others are interpolated between two values that are at most 10 s apart. Statistics and counts
    are of all chosen rows. Lines that tell how far the reading is can be had as of `dives`.
    """
    del caller
    question = await analyses.question(
        deployment, _keys(channels), dives, flag_max=flag_max, limit=limit
    )

    async def work(on_share: OnShare) -> Response:
        return encoded(_rows(question, await analyses.rows(request, question, on_share)))

    return await answer_with(request, work)


@router.get(
    "/{deployment}/analysis/rows.csv",
    response_class=Response,
    responses={200: {"content": {"text/csv": {}}}},
)
async def rows_csv(
    caller: Viewer,
    deployment: str,
    analyses: AnalysesDep,
    store: StoreDep,
    channels: ChannelsQuery,
    dives: DivesQuery = "",
    flag_max: FlagMaxQuery = 4,
) -> Response:
    """Return all rows that `rows` is thinned of, with units; simulated data say so."""
    del caller
    question = await analyses.question(deployment, _keys(channels), dives, flag_max=flag_max)
    record = question.wanted.deployment
    robot = await store.query(lambda session: get_robot(session, record.robot))

    def blocks() -> Generator[str]:
        with store.read() as session:
            yield from csv_blocks(session, question, is_simulated=robot.simulated)

    mark = "SIMULATION_" if robot.simulated else ""
    name = "_".join((robot.id, record.id, *(one.key for one in question.series)))
    headers = {"Content-Disposition": f'attachment; filename="{mark}{name}.csv"'}
    return StreamingResponse(blocks(), media_type="text/csv; charset=utf-8", headers=headers)


def _keys(channels: str) -> list[str]:
    """Return what is named with commas between.

    Raises:
        Problem: 422 if nothing is.
    """
    keys = [key for one in channels.split(",") if (key := one.strip())]
    if not keys:
        message = "must name a series, such as temperature; see `analysis/dives`"
        raise unprocessable("1 field is wrong.", [FieldError(loc=["channels"], msg=message)])
    return keys


def _series(one: Series) -> SeriesView:
    return same(SeriesView, one)


def _rows(question: Question, found: RowsFound) -> RowsView:
    table = found.table
    density = None if found.density is None else DensityView(*found.density)
    return RowsView(
        total=found.total,
        decimated=len(table) < found.total,
        is_checked=found.is_checked,
        time_s=(table.at_us / 1e6).tolist(),
        dive=table.dive.tolist(),
        leg=table.leg.tolist(),
        direction=table.direction.tolist(),
        depth_m=_told(table.depth_m),
        series=[
            SeriesRowsView(
                series=_series(one),
                value=_told(table.values[one.key]),
                flag=[None if flag == OG1_FILL else flag for flag in table.flags[one.key].tolist()],
                interpolated=table.interpolated[one.key],
                statistics=same(StatisticsView, found.statistics[one.key]),
                bins=BinsView(*found.bins[one.key]),
            )
            for one in question.series
        ],
        density=density,
    )


def _told(values: FloatArray) -> list[float | None]:
    # a number that is not one differs from itself
    return [one if one == one else None for one in values.tolist()]
