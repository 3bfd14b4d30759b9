"""The log book by REST: read, written, changed by versions, struck out, and taken away."""

import asyncio
from collections.abc import Generator
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, File, Path, Query, Response, UploadFile
from fastapi.responses import StreamingResponse
from sqlalchemy.orm import Session

from db.fault import UnknownIdError
from db.query.log_book.entries import (
    LogEntry,
    authors,
    corrections_of,
    entry_versions,
    get_entry,
    known_tags,
    robots_of_attachment,
)
from db.query.log_book.told import GROUP_OF
from db.record import same
from server.access.access import Caller
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.access.role import Right
from server.base.dependency import StoreDep, service
from server.base.problem import FieldError, Problem, not_found, unprocessable
from server.logbook.export import csv_blocks, json_blocks
from server.logbook.log_book import LogBook, LogItem, LogPart, log_part
from server.logbook.picture import PictureError
from server.logbook.question import Question, QuestionDep, place_text
from server.logbook.view import (
    DIGEST,
    AttachmentView,
    EntryChanges,
    EntryHistoryView,
    EntryView,
    LogBookView,
    LogItemView,
    LogWordsView,
    NewEntry,
    entry_view,
    version_view,
)
from server.system.event_route import event_view

router = APIRouter(prefix="/api/logbook", tags=["log book"], route_class=IdempotentRoute)
picture_router = APIRouter(prefix="/api/logbook/attachments", tags=["log book"])

LogBookDep = Annotated[LogBook, Depends(service(LogBook))]
Digest = Annotated[str, Path(pattern=DIGEST)]
ASK_THEMSELVES = (
    ("POST", "/api/logbook/entries"),
    ("PATCH", "/api/logbook/entries/{entry}"),
    ("DELETE", "/api/logbook/entries/{entry}"),
    ("POST", "/api/logbook/attachments"),
)
"""Routes that ask for the right on the robot that an entry is about: for writing of a robot, nobody
needs the lease of its pilot in charge."""
_HARMLESS = {
    "Content-Security-Policy": "default-src 'none'; sandbox",
    "Content-Disposition": "inline",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "private, max-age=31536000, immutable",
}
"""A picture that is opened by itself is a picture, and nothing in it runs or loads."""


def _may_write(caller: Caller, robot: str | None) -> None:
    """Ask for the right to write about a robot, or about the station as a whole.

    Raises:
        UnknownIdError: If the caller may not see the robot.
        Problem: 403 if they may not write.
    """
    if caller.rights.may(Right.PILOT, robot):
        return
    if robot is not None and not caller.rights.sees(robot):
        raise UnknownIdError("robot", robot)
    about = robot or "the whole station"
    raise Problem(403, f"{caller.name} may not write about {about}.")


def _seen(caller: Caller, entry: LogEntry) -> LogEntry:
    """Return an entry that the caller may see.

    Raises:
        UnknownIdError: If they may not.
    """
    if not caller.rights.sees(entry.newest.robot):
        raise UnknownIdError("entry", entry.id)
    return entry


@router.get("")
async def read_log_book(
    caller: Viewer,
    store: StoreDep,
    question: QuestionDep,
    limit: Annotated[int, Query(ge=1, le=500)] = 100,
) -> LogBookView:
    """Return entries and what happened between them, the last moments first.

    What happened is read of the event log. Entries that were struck out are among the others.
    """
    del caller

    def read(session: Session) -> LogBookView:
        entries, told = question.of(session)
        period = told.period
        part = log_part(session, entries, told, limit)
        items = [_item(item, part) for item in part.items]
        if question.shift is None or period is None:
            return LogBookView(items, part.has_more, None, None)
        return LogBookView(items, part.has_more, period.first, period.last)

    return await store.query(read)


def _item(item: LogItem, part: LogPart) -> LogItemView:
    entry, event = item.entry, item.event
    return LogItemView(
        at=item.place.at,
        place=place_text(item.place),
        group="entries" if event is None else GROUP_OF[event.kind],
        entry=None if entry is None else entry_view(entry, part.corrected_by.get(entry.id, [])),
        event=None if event is None else event_view(event),
    )


@router.get("/words")
async def list_words(caller: Viewer, store: StoreDep) -> LogWordsView:
    """Return who wrote entries, and the tags of the newest."""
    robots = caller.rights.robots
    return await store.query(
        lambda session: LogWordsView(authors(session, robots), known_tags(session, robots))
    )


@router.get(
    "/export",
    response_class=Response,
    responses={200: {"content": {"application/json": {}, "text/csv": {}}}},
)
async def export_log_book(
    caller: Viewer,
    store: StoreDep,
    question: QuestionDep,
    format: Annotated[Literal["json", "csv"], Query()] = "json",
) -> StreamingResponse:
    """Return the log book as a file, the last moments first: JSON, or CSV with a line for each."""
    del caller
    await store.query(question.period)
    write, media_type = (
        (json_blocks, "application/json") if format == "json" else (csv_blocks, "text/csv")
    )

    def blocks(asked: Question) -> Generator[str]:
        with store.read() as session:
            yield from write(session, *asked.of(session))

    headers = {"Content-Disposition": f'attachment; filename="log-book.{format}"'}
    return StreamingResponse(blocks(question), media_type=media_type, headers=headers)


@router.post("/entries", status_code=201)
async def write_entry(
    caller: Pilot, body: NewEntry, log_book: LogBookDep, store: StoreDep
) -> EntryView:
    """Write an entry. It is kept once this answers."""
    _may_write(caller, body.robot)
    corrects = body.corrects
    if corrects is not None:
        await store.query(lambda session: _seen(caller, get_entry(session, corrects)))
    return entry_view(await log_book.write(body, by=caller.name, corrects=body.corrects), [])


@router.get("/entries/{entry}")
async def read_entry(caller: Viewer, entry: str, store: StoreDep) -> EntryHistoryView:
    """Return an entry with everything that it ever said of robots that the caller may see."""

    def read(session: Session) -> EntryHistoryView:
        found, versions = _seen(caller, get_entry(session, entry)), entry_versions(session, entry)
        corrected_by = corrections_of(session, [entry]).get(entry, [])
        return EntryHistoryView(
            entry_view(found, corrected_by),
            [version_view(one) for one in versions if caller.rights.sees(one.robot)],
        )

    return await store.query(read)


@router.patch("/entries/{entry}")
async def change_entry(
    caller: Pilot, entry: str, body: EntryChanges, log_book: LogBookDep, store: StoreDep
) -> EntryView:
    """Let an entry say something else from now on; what it said before is kept.

    409 if it is on a signed page, was struck out, or is not of ``version`` any more.
    """
    known = await store.query(lambda session: _seen(caller, get_entry(session, entry)))
    for robot in {known.newest.robot, body.robot}:
        _may_write(caller, robot)
    changed = await log_book.change(entry, body, body.version, by=caller.name)
    corrected_by = await store.query(lambda session: corrections_of(session, [entry]))
    return entry_view(changed, corrected_by.get(entry, []))


@router.delete("/entries/{entry}")
async def strike_entry(
    caller: Pilot,
    entry: str,
    log_book: LogBookDep,
    store: StoreDep,
    version: Annotated[
        int, Query(ge=1, le=2**31, description="The newest version that the caller has seen.")
    ],
) -> EntryView:
    """Strike an entry out: it stays to be read, with who did it and when.

    409 as for a change.
    """
    known = await store.query(lambda session: _seen(caller, get_entry(session, entry)))
    _may_write(caller, known.newest.robot)
    return entry_view(await log_book.strike(entry, version, by=caller.name), [])


@picture_router.post("", status_code=201)
async def keep_picture(
    caller: Pilot,
    file: Annotated[UploadFile, File(description="A PNG, JPEG or WebP picture.")],
    log_book: LogBookDep,
) -> AttachmentView:
    """Keep a picture for an entry: PNG, JPEG or WebP by its bytes, of at most 10 MB.

    422 says why one is not taken.
    """
    if not caller.rights.may_any(Right.PILOT):
        raise Problem(403, f"{caller.name} may write about no robot and sends no picture.")
    data = await file.read()
    try:
        kept = await asyncio.to_thread(log_book.pictures.keep, data, file.filename or "")
    except PictureError as error:
        detail = f"This picture is not taken: {error}."
        raise unprocessable(detail, [FieldError(loc=["file"], msg=str(error))]) from error
    return same(AttachmentView, kept)


@picture_router.get(
    "/{sha256}",
    response_class=Response,
    responses={200: {"content": {"image/png": {}, "image/jpeg": {}, "image/webp": {}}}},
)
async def get_picture(
    caller: Viewer, sha256: Digest, log_book: LogBookDep, store: StoreDep
) -> Response:
    """Return a picture, as the kind that it is by its bytes.

    404 if every entry that has it is about a robot that the caller may not see.
    """
    robots = await store.query(lambda session: robots_of_attachment(session, sha256))
    if robots and not any(caller.rights.sees(robot) for robot in robots):
        raise not_found("There is no picture of this hash.")
    found = await asyncio.to_thread(log_book.pictures.find, sha256)
    if found is None:
        raise not_found("There is no picture of this hash.")
    media_type, data = found
    return Response(data, media_type=media_type, headers=_HARMLESS)
