"""Shifts and signed pages by REST."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query
from sqlalchemy.orm import Session

from db.query.log_book.pages import get_page, list_pages
from db.query.log_book.shifts import newest_shifts
from server.access.access import Caller
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import ClockDep, StoreDep, service
from server.base.problem import Problem
from server.logbook.page import (
    HandoverView,
    PageBriefView,
    PageToSign,
    PageToTake,
    PageView,
    page_brief,
    page_view,
)
from server.logbook.view import ShiftView, shift_view
from server.logbook.watch import Watch

router = APIRouter(prefix="/api/logbook", tags=["log book"], route_class=IdempotentRoute)

WatchDep = Annotated[Watch, Depends(service(Watch))]


def _person(caller: Caller, deed: str) -> str:
    """Return the name of somebody who signed in by themselves.

    Raises:
        Problem: 403 for a script.
    """
    if caller.proof.kind != "session":
        raise Problem(403, f"{caller.name} is a script; {deed} is for a person who signed in.")
    return caller.name


def _of_the_station(caller: Caller) -> None:
    """Ask for the right to see all of the station, as a watch does.

    Raises:
        Problem: 403 for who may see chosen robots alone.
    """
    if not caller.rights.sees(None):
        raise Problem(403, f"{caller.name} may look at chosen robots, not at a whole watch.")


@router.get("/shifts")
async def list_shifts(
    caller: Viewer,
    store: StoreDep,
    clock: ClockDep,
    limit: Annotated[int, Query(ge=1, le=500)] = 50,
) -> list[ShiftView]:
    """Return the shifts of everybody with their hours, the newest first."""
    _of_the_station(caller)
    now = clock.now()
    shifts = await store.query(lambda session: newest_shifts(session, limit))
    return [shift_view(one, now) for one in shifts]


@router.post("/shifts", status_code=201)
async def begin_shift(caller: Pilot, watch: WatchDep, clock: ClockDep) -> ShiftView:
    """Be on watch from now on; 409 if one is already."""
    shift = await watch.begin(_person(caller, "a watch"))
    return shift_view(shift, clock.now())


@router.post("/shifts/end")
async def end_shift(caller: Pilot, watch: WatchDep, clock: ClockDep) -> ShiftView:
    """Be on watch no more, without signing a page; 409 if one is not."""
    shift = await watch.end(_person(caller, "a watch"))
    return shift_view(shift, clock.now())


@router.get("/handover")
async def show_handover(caller: Viewer, watch: WatchDep) -> HandoverView:
    """Return what whoever leaves would sign now."""
    _of_the_station(caller)
    return await watch.handover()


@router.get("/pages")
async def get_pages(
    caller: Viewer,
    store: StoreDep,
    before: Annotated[str | None, Query(description="Id of the last page of the list.")] = None,
    limit: Annotated[int, Query(ge=1, le=500)] = 50,
) -> list[PageBriefView]:
    """Return the signed pages, the newest first."""
    _of_the_station(caller)

    def read(session: Session) -> list[PageBriefView]:
        return [page_brief(one) for one in list_pages(session, before=before, limit=limit)]

    return await store.query(read)


@router.post("/pages", status_code=201)
async def sign_page(caller: Pilot, body: PageToSign, watch: WatchDep) -> PageView:
    """Sign the hand-over as the one who leaves; the caller's shift ends.

    Its entries cannot be changed from now on, and its hash is in the chain of events. 409 if it is
    not what was shown any more; a script signs nothing.
    """
    return page_view(await watch.sign(body, by=_person(caller, "a signature")))


@router.get("/pages/{page}")
async def read_page(caller: Viewer, page: str, store: StoreDep) -> PageView:
    """Return a page as it was signed."""
    _of_the_station(caller)
    return page_view(await store.query(lambda session: get_page(session, page)))


@router.post("/pages/{page}/take")
async def take_page(caller: Pilot, page: str, body: PageToTake, watch: WatchDep) -> PageView:
    """Sign a page as the one who takes over; the caller's shift begins.

    409 if somebody took it already, it is one's own, or it is not what was shown.
    """
    taken = await watch.take(page, body.sha256, by=_person(caller, "a signature"))
    return page_view(taken)
