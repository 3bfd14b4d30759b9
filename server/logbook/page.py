"""A page of the log book as it is signed, and as it is shown before that."""

from dataclasses import dataclass
from datetime import datetime
from hashlib import sha256
from typing import Annotated, Any, Literal

import msgspec
from pydantic import Field

from db.query.log_book.pages import ShiftPage
from db.record import same
from server.base.view import Body, View
from server.logbook.handover import StandView
from server.logbook.markdown import html_of
from server.logbook.view import DIGEST, EntryView

Sky = Literal["", "clear", "partly cloudy", "overcast", "fog", "rain", "snow", "thunderstorm"]


class Weather(Body):
    """Weather of the last shift, as whoever leaves saw it; what nobody saw is left open."""

    wind_m_s: Annotated[float, Field(ge=0.0, le=80.0)] | None = None
    """Mean wind, m/s."""
    wind_from_deg: Annotated[float, Field(ge=0.0, le=360.0)] | None = None
    """Where the wind comes from, degrees from true north."""
    wave_height_m: Annotated[float, Field(ge=0.0, le=25.0)] | None = None
    """Significant height of the waves, m."""
    sky: Sky = ""
    """Clouds and what falls from them, in words."""
    note: Annotated[str, Field(max_length=500)] = ""
    """What else is said of the weather."""


class PageToSign(Body):
    """What somebody signs as they leave."""

    seen: Annotated[str, Field(pattern=DIGEST)]
    """``seen`` of the hand-over that they looked at."""
    weather: Weather
    """Weather of the watch, as it was seen."""
    remarks: Annotated[str, Field(max_length=5000)] = ""
    """Markdown: what the next watch has to know besides."""


class PageToTake(Body):
    """What somebody takes over."""

    sha256: Annotated[str, Field(pattern=DIGEST)]
    """Of the page that they looked at."""


@dataclass(frozen=True, slots=True)
class WatchView(View):
    """Who was on watch, and how long of the time of a page."""

    person: str
    began_at: datetime
    ended_at: datetime | None
    hours: float


@dataclass(frozen=True, slots=True)
class HandoverView(View):
    """What would be signed now."""

    began_at: datetime
    """When the page begins: where the one before ended."""
    now: datetime
    previous: str
    """Id of the page before, empty where there is none."""
    people: list[WatchView]
    standing: StandView
    entries: list[EntryView]
    """On no page yet, the oldest moments first."""
    seen: str
    """Names what was shown; send it to sign that."""


@dataclass(frozen=True, slots=True)
class WeatherView(View):
    """Weather of the last shift, as somebody saw it."""

    wind_m_s: float | None
    wind_from_deg: float | None
    wave_height_m: float | None
    sky: str
    note: str


@dataclass(frozen=True, slots=True)
class SignedEntryView(View):
    """An entry as it was signed."""

    id: str
    version: int
    sha256: str
    at: datetime
    by: str
    robot: str | None
    text: str
    html: str
    tags: list[str]
    is_struck: bool
    corrects: str | None
    attachments: list[str]
    """Hashes of its pictures."""


@dataclass(frozen=True, slots=True)
class PageContentView(View):
    """What was signed."""

    people: list[WatchView]
    standing: StandView
    weather: WeatherView
    remarks: str
    remarks_html: str
    entries: list[SignedEntryView]


@dataclass(frozen=True, slots=True)
class PageBriefView(View):
    """A signed page in the list."""

    id: str
    began_at: datetime
    ended_at: datetime
    sha256: str
    left_by: str
    left_at: datetime
    taken_by: str | None
    taken_at: datetime | None


@dataclass(frozen=True, slots=True)
class PageView(PageBriefView):
    """A signed page."""

    content: PageContentView


def seen_of(previous: str, entries: list[EntryView], standing: StandView) -> str:
    """Return what names a hand-over: it changes with whatever somebody should look at again.

    Batteries, expected contacts and what robots answer of checklists change all the time and are
    left out.
    """
    told = {
        "previous": previous,
        "entries": [(one.id, one.newest.number) for one in entries],
        "alarms": [
            (one.id, one.level, one.assigned_to, one.is_normal_again) for one in standing.alarms
        ],
        "overdue": [(one.robot, one.kind) for one in standing.overdue],
        "checklists": [
            (one.id, [item.key for item in one.items if item.is_manual])
            for one in standing.checklists or ()
        ],
        "plans": [(one.id, one.standing) for one in (*standing.plans, *standing.drafts)],
    }
    return sha256(msgspec.json.encode(told)).hexdigest()


def standing_of(page: ShiftPage) -> dict[str, Any]:
    """Return what a page tells of how everything stood.

    A page that was signed before pages told of checklists tells of none, and of what was overdue
    that robots were to be heard.
    """
    told = page.document["standing"]
    late = [
        {
            "robot": one["robot"],
            "kind": "contact",
            "text": f"{one['name']} was to be heard by then.",
        }
        for one in told["robots"]
        if one["is_overdue"]
    ]
    alarms = [{"assigned_to": None, **one} for one in told["alarms"]]
    return {"checklists": None, "overdue": late, **told, "alarms": alarms}


def page_brief(page: ShiftPage) -> PageBriefView:
    """Return a page as the list shows it."""
    return same(PageBriefView, page)


def page_view(page: ShiftPage) -> PageView:
    """Return a page as it was signed."""
    document = page.document
    document["standing"] = standing_of(page)
    document["remarks_html"] = html_of(document["remarks"])
    for entry in document["entries"]:
        entry["html"] = html_of(entry["text"])
    return same(PageView, page, content=msgspec.convert(document, PageContentView, strict=False))
