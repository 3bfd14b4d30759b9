"""The log book of a shift, a day or a week as one HTML file: it loads nothing, and prints well."""

from base64 import b64encode
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from html import escape
from typing import Any, Final

from sqlalchemy.orm import Session

from db.deployment_span import Period
from db.query.fleet.robots import RobotRecord
from db.query.log_book.entries import LogEntry, LogFilter
from db.query.log_book.pages import ShiftPage, pages_in
from db.query.log_book.shifts import shifts_in
from db.query.log_book.told import ToldFilter
from db.query.measured.telemetry import history, track
from db.query.station.events import EventRecord
from server.logbook.export import items_of
from server.logbook.figure import Curve, curve_figure, track_figure
from server.logbook.markdown import html_of
from server.logbook.page import standing_of
from server.logbook.picture import Pictures

_POINTS: Final = 1200
_CURVES: Final = (
    ("depth_m", "Depth", "m", True, 1.0),
    ("battery_v", "Battery", "V", False, 0.5),
)
"""Channel, title, unit, whether it is drawn downwards, and the least span of its axis."""
POLICY: Final = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
HEADERS: Final = {"Content-Security-Policy": f"{POLICY}; sandbox", "Cache-Control": "no-store"}
"""A report that is opened at the station can do there as little as from a disk."""
STYLE: Final = """
body { font: 14px/1.45 system-ui, sans-serif; color: #111; background: #fff; max-width: 780px;
  margin: 24px auto; padding: 0 16px; }
h1 { font-size: 22px; margin: 0 0 4px; } h2 { font-size: 17px; margin: 22px 0 6px;
  border-bottom: 1px solid #bbb; } h3 { font-size: 14px; margin: 14px 0 4px; }
p { margin: 4px 0; } .muted { color: #555; } .simulated { font-weight: 700; color: #a00; }
table { border-collapse: collapse; width: 100%; } td, th { text-align: left; padding: 2px 8px 2px 0;
  vertical-align: baseline; } td:first-child { white-space: nowrap; }
.entry { border-left: 3px solid #0b5cad; padding: 4px 0 4px 10px; margin: 8px 0;
  break-inside: avoid; } .struck { text-decoration: line-through; color: #555; }
.told { padding-left: 13px; margin: 2px 0; color: #333; } .grave { font-weight: 700; }
.hash { font: 11px ui-monospace, monospace; overflow-wrap: anywhere; }
img { max-width: 100%; max-height: 300px; display: block; margin: 4px 0; }
figure { margin: 8px 0; break-inside: avoid; } figcaption { font-weight: 600; }
svg { max-width: 100%; height: auto; } svg text { font: 11px system-ui, sans-serif; fill: #333; }
pre { white-space: pre-wrap; } blockquote { margin: 4px 0; padding-left: 10px;
  border-left: 2px solid #bbb; }
h2, h3 { break-after: avoid; } tr, li { break-inside: avoid; } ul { margin: 2px 0 6px; }
@page { margin: 16mm; }
@media print { body { margin: 0; max-width: none; padding: 0; } a { color: inherit; } }
"""


@dataclass(frozen=True, slots=True)
class ReportOrder:
    """What a report is about."""

    period: Period
    until: datetime
    """Its end, now where the period lasts."""
    robots: Sequence[RobotRecord]
    """Whose figures it has."""
    has_watches: bool
    """Whether who asks may see shifts and signed pages."""
    made_at: datetime
    made_by: str
    is_simulation: bool


def report_blocks(
    session: Session,
    order: ReportOrder,
    entries: LogFilter | None,
    told: ToldFilter,
    pictures: Pictures,
) -> Generator[str]:
    """Return the file in pieces, each as soon as it is made."""
    yield _head(order)
    if order.has_watches:
        yield from _watches(session, order)
    yield "<h2>Log</h2>"
    day = ""
    # A report is read from its beginning.
    for item in reversed(list(items_of(session, entries, told))):
        at = item.place.at
        if f"{at:%Y-%m-%d}" != day:
            day = f"{at:%Y-%m-%d}"
            yield f"<h3>{day}, UTC</h3>"
        if item.entry is not None:
            yield from entry_html(item.entry, pictures)
        elif item.event is not None:
            yield event_html(item.event)
    if not day:
        yield "<p class=muted>Nothing is written of this time.</p>"
    for robot in order.robots:
        yield from _figures(session, robot, order)
    yield "</body></html>\n"


def _head(order: ReportOrder) -> str:
    first, last = moment_text(order.period.first), moment_text(order.until)
    simulated = "<p class=simulated>SIMULATION: no robot was in the water.</p>"
    robots = ", ".join(escape(robot.name) for robot in order.robots) or "no robot"
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Log book, {first} to {last}</title><style>{STYLE}</style></head><body>"
        f"<h1>Log book</h1><p>{first} to {last}</p>"
        f"{simulated if order.is_simulation else ''}"
        f"<p class=muted>{robots}. Made for {escape(order.made_by)}, {moment_text(order.made_at)}; "
        "all times are UTC.</p>"
    )


def _watches(session: Session, order: ReportOrder) -> Iterator[str]:
    period = Period(order.period.first, order.until)
    shifts = shifts_in(session, period)
    if shifts:
        yield "<h2>On watch</h2><table><tr><th>Who</th><th>From</th><th>To</th><th>Hours</th></tr>"
        for shift in shifts:
            hours = shift.hours_in(period.first, order.until)
            end = "on watch" if shift.ended_at is None else moment_text(shift.ended_at)
            yield (
                f"<tr><td>{escape(shift.person)}</td><td>{moment_text(shift.began_at)}</td>"
                f"<td>{end}</td><td>{hours:.1f}</td></tr>"
            )
        yield "</table>"
    for page in pages_in(session, period):
        yield _page(page)


def _page(page: ShiftPage) -> str:
    taken = "nobody took over"
    if page.taken_by is not None and page.taken_at is not None:
        taken = f"taken over by <b>{escape(page.taken_by)}</b>, {moment_text(page.taken_at)}"
    document, standing = page.document, standing_of(page)
    alarms = [
        f"{one['level']}: {one['text']}"
        + (f" ({one['assigned_to']} looks after it)" if one["assigned_to"] else "")
        for one in standing["alarms"]
    ]
    plans = [f"{one['id']} of {one['robot']}: {one['standing']}" for one in standing["plans"]]
    late = [str(one["text"]) for one in standing["overdue"]]
    lists = [
        f"{one['title']} of {one['robot']}: {'; '.join(item['text'] for item in one['items'])}"
        for one in standing["checklists"] or ()
    ]
    open_lists = "" if standing["checklists"] is None else listed_html("Open checklists", lists)
    return (
        f"<h2>Signed: {page.id}</h2><p>{moment_text(page.began_at)} to "
        f"{moment_text(page.ended_at)}, signed by <b>{escape(page.left_by)}</b>, "
        f"{moment_text(page.left_at)}; {taken}.</p>"
        f"<p>Weather: {escape(_weather(document['weather']))}</p>"
        f"{html_of(document['remarks']) if document['remarks'] else ''}"
        f"{listed_html('Overdue', late)}{listed_html('Open alarms', alarms)}"
        f"{open_lists}{listed_html('Plans', plans)}"
        f"<p class=hash>SHA-256 {page.sha256}</p>"
    )


def listed_html(title: str, lines: Sequence[str]) -> str:
    """Return lines below a title; "none" where there are none."""
    if not lines:
        return f"<p>{title}: none</p>"
    return f"<p>{title}:</p><ul>{''.join(f'<li>{escape(line)}</li>' for line in lines)}</ul>"


def _weather(told: dict[str, Any]) -> str:
    """Return weather in words; what nobody saw is left out."""
    wind, source, waves = told["wind_m_s"], told["wind_from_deg"], told["wave_height_m"]
    parts = [
        "" if wind is None else f"wind {wind:g} m/s",
        "" if source is None else f"from {source:g}\N{DEGREE SIGN}",
        "" if waves is None else f"waves {waves:g} m",
        told["sky"],
        told["note"],
    ]
    return ", ".join(part for part in parts if part) or "nobody wrote it down"


def entry_html(entry: LogEntry, pictures: Pictures | None) -> Iterator[str]:
    """Return an entry; without pictures they are named alone."""
    newest = entry.newest
    marks = [
        newest.robot or "",
        f"corrects {entry.corrects}" if entry.corrects else "",
        ", ".join(newest.tags),
        f"signed, {entry.page}" if entry.page else "",
        f"version {newest.number}" if newest.number > 1 else "",
    ]
    more = " \N{MIDDLE DOT} ".join(escape(mark) for mark in (*marks, entry.id) if mark)
    struck = ' class="struck"' if newest.is_struck else ""
    yield (
        f'<div class="entry"><p>{newest.at:%H:%M:%S}Z <b>{escape(entry.written_by)}</b> '
        f"<span class=muted>{more}</span></p><div{struck}>{html_of(newest.text)}</div>"
    )
    if newest.is_struck:
        by, at = escape(newest.written_by), moment_text(newest.written_at)
        yield f"<p class=muted>Struck out by {by}, {at}</p>"
    for one in newest.attachments:
        if pictures is None:
            yield f"<p class=muted>With a picture: {escape(one.name)}</p>"
            continue
        found = pictures.find(one.sha256)
        if found is None:
            yield f"<p class=muted>The picture {escape(one.name)} is missing.</p>"
            continue
        media_type, data = found
        content = b64encode(data).decode()
        yield f'<img alt="{escape(one.name)}" src="data:{media_type};base64,{content}">'
    yield "</div>"


def event_html(event: EventRecord) -> str:
    """Return a line about something that happened."""
    grave = " grave" if event.level == "critical" else ""
    return f'<p class="told{grave}">{event.at:%H:%M:%S}Z {escape(event.text)}</p>'


def _figures(session: Session, robot: RobotRecord, order: ReportOrder) -> Iterator[str]:
    first, last = order.period.first, order.until
    figures = list[str]()
    for channel, title, unit, is_downwards, least_span in _CURVES:
        found = history(session, robot.id, channel, first, last, _POINTS)
        curve = Curve(title, unit, found.measured_at, found.value, is_downwards, least_span)
        figures.append(curve_figure(curve, first, last))
    way = track(session, robot.id, first, last, _POINTS)
    norths, easts = way.position_ned[:, 0].tolist(), way.position_ned[:, 1].tolist()
    figures.append(track_figure("Track from above", norths, easts))
    drawn = [figure for figure in figures if figure]
    yield f"<h2>{escape(robot.name)}</h2>"
    yield "".join(drawn) if drawn else "<p class=muted>Nothing was heard of this time.</p>"


def moment_text(at: datetime) -> str:
    """Return a moment as reports write it."""
    return f"{at:%Y-%m-%d %H:%M:%S}Z"
