"""The log book as one HTML file."""

from collections.abc import Generator
from datetime import datetime, timedelta
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Response
from fastapi.responses import StreamingResponse
from sqlalchemy.orm import Session

from db.deployment_span import Period
from db.query.fleet.robots import RobotRecord, get_robot, list_robots
from server.access.dependency import Viewer
from server.base.dependency import FoundationDep, StoreDep, service
from server.logbook.log_book import LogBook
from server.logbook.question import QuestionDep
from server.logbook.report import HEADERS, ReportOrder, report_blocks

router = APIRouter(prefix="/api/logbook", tags=["log book"])

LogBookDep = Annotated[LogBook, Depends(service(LogBook))]
_SPANS = {"day": timedelta(days=1), "week": timedelta(days=7)}


@router.get("/report", response_class=Response, responses={200: {"content": {"text/html": {}}}})
async def report(
    caller: Viewer,
    foundation: FoundationDep,
    store: StoreDep,
    question: QuestionDep,
    log_book: LogBookDep,
    span: Annotated[
        Literal["day", "week"], Query(description="Until now, where no time is given.")
    ] = "day",
) -> StreamingResponse:
    """Return the log book of a shift, a day, a week or any time as one HTML file.

    It loads nothing, has its figures and pictures inside, and prints well. Of a `robot`, or of
    every robot that the caller may see. It comes piece by piece, as fast as it is made.
    """
    now = foundation.clock.now()

    def ask(session: Session) -> tuple[Period | None, list[RobotRecord]]:
        robot = question.told.robot
        robots = list_robots(session) if robot is None else [get_robot(session, robot)]
        shown = [one for one in robots if caller.rights.sees(one.id) and one.retired_at is None]
        return question.period(session), shown

    asked, robots = await store.query(ask)
    period = asked or Period(now - _SPANS[span], now)
    order = ReportOrder(
        period=period,
        until=min(period.last or now, now),
        robots=robots,
        has_watches=caller.rights.sees(None),
        made_at=now,
        made_by=caller.name,
        is_simulation=foundation.settings.simulation,
    )

    def blocks() -> Generator[str]:
        with store.read() as session:
            entries, told = question.within(period)
            yield from report_blocks(session, order, entries, told, log_book.pictures)

    name = f"log-book-{_stamp(period.first)}-{_stamp(order.until)}.html"
    headers = HEADERS | {"Content-Disposition": f'inline; filename="{name}"'}
    return StreamingResponse(blocks(), media_type="text/html; charset=utf-8", headers=headers)


def _stamp(at: datetime) -> str:
    return f"{at:%Y%m%dT%H%MZ}"
