"""The page behind a notice's link: it shows what is acknowledged, and acknowledges once.

It needs no sign-in, so that a phone at night is enough, and shows nothing that the message did not
hold. Opening it does nothing: mail filters and previews open links. The button does.
"""

from dataclasses import dataclass
from datetime import datetime
from html import escape
from http import HTTPStatus
from typing import Annotated, Final

from fastapi import APIRouter, Depends, Response
from sqlalchemy.orm import Session

from db.actor import Actor, acting
from db.fault import UnknownIdError
from db.query.station import notices as query
from db.query.station.alarms import AlarmRecord
from db.query.station.events import add_event
from db.query.station.notices import ItemRecord, NoticeRecord
from robot_link.clock import SystemClock
from server.access.role import Right, Rights, Role
from server.base.dependency import FoundationDep, service
from server.base.foundation import Foundation
from server.base.problem import Problem
from server.notice.escalation import is_to_be_seen, rights_of
from server.notice.link import read_word
from server.notice.outbox import Notices
from server.notice.wish import rank

router = APIRouter(prefix="/ack", include_in_schema=False)
NoticesDep = Annotated[Notices, Depends(service(Notices))]
_FORGED: Final = "This link is not one that this station wrote, or not whole. Nothing was done."
_EXPIRED: Final = "This link has expired. Nothing was done; sign in to see and acknowledge alarms."
_USED: Final = "This link was used already, and works once. Nothing was done now."
_NOBODY: Final = "This link was written for somebody who may not acknowledge alarms any more."
_HEADERS: Final = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": (
        "default-src 'none'; style-src 'self'; form-action 'self'; base-uri 'none'; "
        "frame-ancestors 'none'"
    ),
    "Referrer-Policy": "no-referrer",
    "X-Robots-Tag": "noindex, nofollow",
}
_STYLE: Final = """
:root { color-scheme: dark; }
body { margin: 0 auto; max-width: 34rem; padding: 1.25rem; background: #0f151b; color: #e6edf3;
  font: 1rem/1.5 system-ui, sans-serif; overflow-wrap: anywhere; }
h1 { font-size: 1.25rem; }
li { margin: 0.75rem 0; }
.muted { color: #9fb0c0; }
button { width: 100%; min-height: 3.5rem; border: 0; border-radius: 6px; background: #4aa3ff;
  color: #0f151b; font: inherit; font-weight: 650; }
a { color: #4aa3ff; }
"""


@dataclass(frozen=True, slots=True)
class _Told:
    """What stands behind a link that is sound."""

    notice: NoticeRecord
    items: list[ItemRecord]
    """As far as its person may see them."""
    rights: Rights

    @property
    def may_acknowledge(self) -> bool:
        """Tell whether its person may acknowledge any of it, as a pilot of its robot."""
        return any(self.rights.may(Right.PILOT, item.robot) for item in self.items)


@router.get("/style.css")
async def get_style() -> Response:
    """Return how the page looks; the policy of the page takes no style within it."""
    return Response(_STYLE, media_type="text/css", headers={"Cache-Control": "no-cache"})


@router.get("/{word}")
async def show(word: str, foundation: FoundationDep) -> Response:
    """Show what a link would acknowledge; this changes nothing, however often it is opened."""
    told, refusal = await _read(foundation, word)
    if told is None or refusal:
        return _page("Nothing to acknowledge here", f"<p>{refusal}</p>", status=HTTPStatus.GONE)
    waiting = [
        item
        for item in told.items
        if told.rights.may(Right.PILOT, item.robot) and _standing(foundation, item) is not None
    ]
    if not waiting:
        return _page("Nothing waits any more", _list(foundation, told))
    count = "this alarm" if len(waiting) == 1 else f"these {len(waiting)} alarms"
    button = (
        f'<form method="post" action="/ack/{escape(word)}"><button>Acknowledge {count} as '
        f"{escape(told.notice.person)}</button></form>"
        '<p class="muted">That says that you have seen it, and ends its escalation. It changes '
        "nothing about the robot. This link works once.</p>"
    )
    return _page("Acknowledge", _list(foundation, told) + button)


@router.post("/{word}")
async def acknowledge(word: str, foundation: FoundationDep, notices: NoticesDep) -> Response:
    """Acknowledge what the link's message told of, as far as that is what stands now."""
    told, refusal = await _read(foundation, word)
    if told is None or refusal:
        return _page("Nothing was done", f"<p>{refusal}</p>", status=HTTPStatus.GONE)
    person, notice = told.notice.person, told.notice.id
    acting.set(Actor(person, "person"))
    done = 0
    for item in told.items:
        alarm = _standing(foundation, item)
        if alarm is None or not told.rights.may(Right.PILOT, item.robot):
            continue
        try:
            await foundation.alarms.acknowledge(
                alarm.id, person, raised_at=item.raised_at, level=alarm.level
            )
        except Problem:
            continue  # it changed just now; the page below says how it stands
        done += 1
    at = foundation.clock.now()

    def write(session: Session) -> None:
        row = query.notice_row(session, notice)
        row.link_used_at = row.link_used_at or at
        text = f"{person} acknowledged by the link of {notice}: {done} of {len(told.items)}."
        add_event(session, at, "notice.link_used", text, data={"notice": notice})

    await foundation.store.write(write)
    foundation.feed.mark("notices")
    title = "Acknowledged" if done else "Nothing was left to acknowledge"
    return _page(title, _list(foundation, told))


async def _read(foundation: Foundation, word: str) -> tuple[_Told | None, str]:
    """Return what stands behind a link, and why it does not count; the station's clock decides."""
    found = read_word(foundation.secrets.notice_key(), word)
    if found is None:
        return None, _FORGED
    notice, expires_at = found

    def read(session: Session) -> _Told:
        record = query.get_notice(session, notice)
        people = {person.name: rights_of(person) for person in query.everybody(session)}
        rights = people.get(record.person, Rights(Role.NONE))
        items = [
            item
            for item in query.items_of(session, notice)
            if item.alarm is not None and rights.sees(item.robot)
        ]
        return _Told(record, items, rights)

    try:
        told = await foundation.store.query(read)
    except UnknownIdError:
        return None, _FORGED
    if SystemClock().now() >= expires_at:
        return told, _EXPIRED
    if told.notice.link_used_at is not None:
        return told, _USED
    return told, "" if told.may_acknowledge else _NOBODY


def _standing(foundation: Foundation, item: ItemRecord) -> AlarmRecord | None:
    """Return the alarm of an item if it is the one that was told and nobody has seen it."""
    alarm = _alarm(foundation, item)
    if alarm is None or not is_to_be_seen(alarm):
        return None
    is_same = alarm.raised_at == item.raised_at and rank(alarm.level) <= rank(item.level)
    return alarm if is_same else None


def _alarm(foundation: Foundation, item: ItemRecord) -> AlarmRecord | None:
    return next((one for one in foundation.alarms.open if one.id == item.alarm), None)


def _list(foundation: Foundation, told: _Told) -> str:
    lines = [
        f"<li>{escape(item.level.capitalize())}, since {_moment(item.raised_at)}: "
        f'{escape(item.text)}<br><span class="muted">{_how(foundation, item)}</span></li>'
        for item in told.items
    ]
    left = told.notice.items - len(told.items)
    more = f"<p>{left} more are on the station's page, and not in this link.</p>" if left else ""
    return f"<ul>{''.join(lines)}</ul>{more}"


def _how(foundation: Foundation, item: ItemRecord) -> str:
    alarm = _alarm(foundation, item)
    if alarm is None:
        return "It is closed: normal again and seen."
    if alarm.acknowledged_at is not None:
        by = escape(alarm.acknowledged_by or "somebody")
        return f"Acknowledged by {by} at {_moment(alarm.acknowledged_at)}."
    if not is_to_be_seen(alarm):
        return "It was set aside."
    if _standing(foundation, item) is None:
        return "It has changed since this message; a newer message or the page shows it."
    return "It is normal again; nobody has seen it." if alarm.cleared_at else "It stands."


def _moment(at: datetime) -> str:
    return f"{at:%Y-%m-%d %H:%MZ}"


def _page(title: str, body: str, status: int = HTTPStatus.OK) -> Response:
    html = (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="robots" content="noindex, nofollow">'
        '<meta name="referrer" content="no-referrer">'
        f"<title>{title} · Grace Ground Station</title>"
        '<link rel="stylesheet" href="/ack/style.css">'
        f'<h1>{title}</h1>{body}<p><a href="/log">Open the station\'s page</a></p></html>'
    )
    return Response(html, status, media_type="text/html", headers=_HEADERS)
