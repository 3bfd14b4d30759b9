"""Columns of imported files that are no channel, by REST: which there are, and their values."""

import csv
import io
from collections.abc import Generator
from dataclasses import dataclass
from datetime import datetime

from fastapi import APIRouter, Response
from fastapi.responses import StreamingResponse

from autonomy.arrays import FloatArray, IntArray
from db.column import moments
from db.query.measured.other_series import OtherSeriesRecord, list_other_series, other_values
from server.access.dependency import Viewer
from server.base.dependency import StoreDep
from server.base.view import View

router = APIRouter(prefix="/api/deployments", tags=["data"])
_ROWS_AT_ONCE = 10_000


@dataclass(frozen=True, slots=True)
class OtherSeriesView(View):
    """A column that is no channel."""

    id: str
    name: str
    """As in the file."""
    unit: str
    """As the person said who imported it, "" for none."""
    count: int
    first_at: datetime
    last_at: datetime
    least: float
    greatest: float


@dataclass(frozen=True, slots=True)
class OtherSeriesListView(View):
    """Columns of imported files that are no channel, by name."""

    series: list[OtherSeriesView]


@router.get("/{deployment}/series")
async def list_series(caller: Viewer, deployment: str, store: StoreDep) -> OtherSeriesListView:
    """Return which columns of imported files a deployment has beside its channels."""
    del caller
    found = await store.query(lambda session: list_other_series(session, deployment))
    return OtherSeriesListView([_view(one) for one in found])


@router.get(
    "/{deployment}/series/{series}",
    response_class=Response,
    responses={200: {"content": {"text/csv; charset=utf-8": {}}}},
)
async def export_series(caller: Viewer, deployment: str, series: str, store: StoreDep) -> Response:
    """Return such a column as CSV of time and value."""
    del caller
    record, at_us, values = await store.query(
        lambda session: other_values(session, deployment, series)
    )
    return StreamingResponse(
        _rows(record, at_us, values),
        media_type="text/csv; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="{deployment}_{series}.csv"'},
    )


def _rows(record: OtherSeriesRecord, at_us: IntArray, values: FloatArray) -> Generator[str]:
    unit = f" ({record.unit})" if record.unit else ""
    header = io.StringIO()
    csv.writer(header).writerow(("time", f"{record.name}{unit}"))
    yield header.getvalue()
    for begin in range(0, len(at_us), _ROWS_AT_ONCE):
        part = slice(begin, begin + _ROWS_AT_ONCE)
        pairs = zip(moments(at_us[part].tolist()), values[part].tolist(), strict=True)
        yield "".join(f"{at:%Y-%m-%dT%H:%M:%S.%fZ},{value!r}\n" for at, value in pairs)


def _view(one: OtherSeriesRecord) -> OtherSeriesView:
    return OtherSeriesView(
        one.id,
        one.name,
        one.unit,
        one.count,
        one.first_at,
        one.last_at,
        one.least,
        one.greatest,
    )
