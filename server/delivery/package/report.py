"""The report of a deployment: one HTML file that loads nothing and prints well."""

from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime, timedelta
from html import escape
from pathlib import Path
from typing import Any, Final

import numpy as np
from sqlalchemy.orm import Session

from autonomy.site import Site
from db.column import microseconds, moment
from db.query.log_book.entries import LogFilter
from db.query.log_book.told import GROUPS, ToldFilter
from db.query.mission.commands import list_commands
from db.query.mission.plans import list_plans
from db.query.satellite.satellite_messages import messages_to
from db.query.station.alarms import alarms_of
from db.query.station.events import EventFilter, events_after
from server.delivery.file_order import FileOrder
from server.delivery.file_task import KeptFile
from server.delivery.finding import CheckReport
from server.delivery.judged import DEPTH, Judged
from server.delivery.package.sketch import BATTERY, Sketch
from server.logbook.export import items_of
from server.logbook.figure import Curve, curve_figure, legend_mark, track_figure
from server.logbook.report import POLICY, STYLE, entry_html, event_html, moment_text

NAME: Final = "report/report.html"
LINES_MAX: Final = 1000
"""Lines of a table at most; the files beside the report have all of them."""
_DIVES: Final = ("robot.dive_begun", "robot.dive_ended")
_FIX_WITHIN: Final = timedelta(minutes=15)
"""A fix that comes later after a dive is not the one that ended it."""
_WORDS: Final = {
    "passed": "passes",
    "findings": "does not pass",
    "unchecked": "could not be checked",
}
_MORE: Final = """
.band { background: #a00000; color: #fff; font-weight: 700; text-align: center; padding: 4px;
  letter-spacing: 1px; position: sticky; top: 0; }
.verdict { border: 2px solid; padding: 8px 12px; font-weight: 600; }
.passes { border-color: #1b6e2d; } .fails { border-color: #a00000; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; }
td { overflow-wrap: anywhere; } td:first-child { white-space: normal; }
.legend svg { vertical-align: -1px; }
@media print { .band { position: fixed; left: 0; right: 0; top: 0;
  print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  body.simulated-data { padding-top: 30px; } section { break-inside: auto; } }
"""


def write_report(
    session: Session,
    order: FileOrder,
    found: Judged,
    file: KeptFile,
    sketch: Sketch,
    work: Path,
) -> str:
    """Write the report below a folder; return its name."""
    path = work / NAME
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8") as page:
        for part in _parts(session, order, found, file, sketch):
            page.write(part)
    return NAME


def _parts(
    session: Session, order: FileOrder, found: Judged, file: KeptFile, sketch: Sketch
) -> Iterator[str]:
    yield _head(order)
    yield from _verdict(order, file)
    yield from _who(order, file)
    yield from _figures(order, found, sketch)
    yield from _quality(order, found)
    yield from _dives(session, order, found, sketch)
    yield from _orders(session, order)
    yield from _alarms(session, order)
    yield from _log(session, order)
    yield from _imported(order)
    yield from _satellite(session, order)
    yield from _versions(order, file)
    yield "</body></html>\n"


def _head(order: FileOrder) -> str:
    title = escape(order.wanted.deployment.title or order.wanted.deployment.id)
    band, kind = "", ""
    if order.is_simulated:
        band = "<div class=band>SIMULATION: this robot does not exist</div>"
        kind = ' class="simulated-data"'
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(order.identity)}</title><style>{STYLE}{_MORE}</style></head>"
        f"<body{kind}>{band}<h1>{title}</h1><p class=muted>{escape(order.identity)}. "
        "All times are UTC.</p>"
    )


def _verdict(order: FileOrder, file: KeptFile) -> Iterator[str]:
    passes = all(one.state == "passed" for one in file.checks)
    look, words = ("passes", "&#9679; The file passes every check.")
    if not passes:
        failed = any(one.state == "findings" for one in file.checks)
        look = "fails"
        words = (
            "&#10005; The file does not pass."
            if failed
            else "&#9670; Not every check could be made: this is no pass."
        )
    yield f'<h2>Verdict</h2><p class="verdict {look}">{words}</p>'
    yield _table(("Checks", "", "What"), [_check(one) for one in file.checks])
    findings = [
        (one.suite, each.variable or each.check, each.message, each.fix)
        for one in file.checks
        for each in one.findings
    ]
    if findings:
        yield _table(("Checks", "Of", "Finding", "What to do"), findings)
    missing = [title for _, title in order.metadata.missing()]
    if missing:
        yield f"<p>The metadata lack: {escape('; '.join(missing))}.</p>"


def _check(one: CheckReport) -> tuple[str, str, str]:
    more = f"{one.message} {one.version}".strip()
    return one.suite, _WORDS[one.state], more


def _who(order: FileOrder, file: KeptFile) -> Iterator[str]:
    deployment, said = order.wanted.deployment, order.metadata
    end = "it still runs" if deployment.ended_at is None else moment_text(deployment.ended_at)
    people = "; ".join(
        f"{person.name}, {role}" + (f" ({person.email})" if person.email else "")
        for person, role in said.contributors()
    )
    rows = [
        ("Robot", f"{order.robot.name} ({order.robot.id}) {order.robot.model}".strip()),
        ("Water", deployment.site.name),
        ("Began", moment_text(deployment.begun_at)),
        ("Ended", end),
        ("Purpose", deployment.purpose),
        ("Crew", ", ".join(deployment.people)),
        ("Contributors", people),
        ("Institutions", "; ".join(f"{name}, {role}" for name, role in said.institutions())),
        ("Licence", said.license),
        ("Mode", {"R": "R, from telemetry", "P": "P, recovered, not reviewed"}.get(order.mode, "")
         or f"D, reviewed by {order.signed_by}"),
        ("Rows", f"{file.rows:,}"),
        ("Left out", f"{file.left_out:,} further measurements of a channel at one moment"),
        ("Raised", f"{file.raised:,} depths just above the surface stand as 0"),
    ]  # fmt: skip
    yield "<h2>Who, where, when</h2>" + _table((), [row for row in rows if row[1]])


def _figures(order: FileOrder, found: Judged, sketch: Sketch) -> Iterator[str]:
    yield "<h2>Where</h2>"
    track = track_figure(
        "Track in the water, from above",
        *sketch.places(),
        outline=_outline(order.wanted.deployment.site),
        marks=sketch.marked_places(),
    )
    yield track or "<p class=muted>Nobody told where.</p>"
    yield (
        f'<h2>What was measured</h2><p class="legend">{legend_mark("suspect")} suspect '
        f"{legend_mark('bad')} bad {legend_mark('doubtful')} probably good, set by hand. "
        "The first of each flag in each part of the time is marked; lines join the least and the "
        "greatest value of each part.</p>"
    )
    if not len(found.at_us):
        yield "<p class=muted>Nothing was measured.</p>"
        return
    first, last = moment(int(found.at_us[0])), moment(int(found.at_us[-1]))
    titles = {key: (channel.title, channel.unit) for key, channel in order.channels.items()}
    for key, (title, unit) in {DEPTH: ("Depth", "m"), **titles}.items():
        figure = curve_figure(_curve(sketch, key, title, unit), first, last)
        yield figure or f"<p class=muted>{escape(title)}: no value.</p>"


def _curve(sketch: Sketch, key: str, title: str, unit: str) -> Curve:
    at: list[datetime] = []
    values: list[float] = []
    for time, low, high in zip(
        sketch.times(), sketch.low[key].tolist(), sketch.high[key].tolist(), strict=True
    ):
        at += [moment(time)] * 2
        values += [low, high]
    shown = "" if unit == "1" else unit
    is_depth = key == DEPTH
    return Curve(title, shown, at, values, is_depth, 1.0 if is_depth else 0.0, sketch.marks(key))


def _outline(site: Site) -> Sequence[tuple[float, float]]:
    if site.shoreline is not None:
        return site.shoreline.corners_m
    box = site.water
    north, east = (box.x_min_m, box.x_max_m), (box.y_min_m, box.y_max_m)
    return [(north[0], east[0]), (north[1], east[0]), (north[1], east[1]), (north[0], east[1])]


def _quality(order: FileOrder, found: Judged) -> Iterator[str]:
    rules = order.wanted.rules
    names = ("good", "not_evaluated", "suspect", "fail")
    rows = [
        (series, test, *(counts[name] for name in names))
        for series, judgement in found.judgements.items()
        for test, counts in judgement.counts.items()
    ]
    yield (
        f"<h2>Quality</h2><p>{escape(rules.name)} {escape(rules.version)}, "
        f"<span class=hash>SHA-256 {rules.sha256}</span></p>"
    )
    yield _table(("Series", "Test", "Good", "Not evaluated", "Suspect", "Fail"), rows, 2)
    flags = [
        (one.series, moment_text(one.first_at), moment_text(one.last_at), one.flag, one.reason,
         f"{one.by}, {moment_text(one.at)}")
        for one in order.manual
    ]  # fmt: skip
    yield "<h3>Flags set by hand</h3>"
    yield _table(("Series", "From", "To", "Flag", "Reason", "By"), flags)


def _dives(session: Session, order: FileOrder, found: Judged, sketch: Sketch) -> Iterator[str]:
    deployment = order.wanted.deployment
    wanted = EventFilter(robot=order.robot.id, kinds=_DIVES, period=deployment.period)
    begun: int | None = None
    rows: list[tuple[object, ...]] = []
    for event in events_after(session, 0, wanted, 10 * LINES_MAX):
        at = microseconds(datetime.fromisoformat(event.data["measured_at"]))
        if event.kind == _DIVES[0]:
            begun = at
        elif begun is not None:
            rows.append(_dive(found, sketch, begun, at))
            begun = None
    yield "<h2>Dives</h2>"
    heads = ("Began", "Ended", "Deepest, m", "Fix moved it, m", "Battery then, V")
    yield _table(heads, rows, 2)


def _dive(found: Judged, sketch: Sketch, begun_us: int, ended_us: int) -> tuple[object, ...]:
    rows = slice(*np.searchsorted(found.at_us, (begun_us, ended_us)).tolist())
    depths = found.depth_m[rows]
    depths = depths[np.isfinite(depths)]
    within_us = _FIX_WITHIN // timedelta(microseconds=1)
    moved = next(
        (f"{far:.1f}" for at, far in sketch.jumps if begun_us < at <= ended_us + within_us), ""
    )
    part = int(np.searchsorted(sketch.times(), ended_us))
    volts = sketch.low[BATTERY][max(0, part - 2) : part + 3]
    volts = volts[np.isfinite(volts)]
    return (
        moment_text(moment(begun_us)),
        moment_text(moment(ended_us)),
        f"{depths.max():.2f}" if depths.size else "",
        moved,
        f"{volts[-1]:.2f}" if volts.size else "",
    )


def _orders(session: Session, order: FileOrder) -> Iterator[str]:
    robot, period = order.robot.id, order.wanted.deployment.period
    plans = [
        (one.id, one.kind, one.state.replace("_", " "), moment_text(one.created_at),
         "" if one.running_at is None else moment_text(one.running_at), (one.sha256 or "")[:12])
        for one in reversed(list_plans(session, robot=robot, period=period, limit=LINES_MAX))
    ]  # fmt: skip
    yield "<h2>Plans</h2>"
    yield _table(("Plan", "Kind", "State", "Made", "Begun", "SHA-256 begins"), plans)
    commands = [
        (moment_text(one.created_at), one.kind.value, one.created_by,
         ", ".join(f"{level.level.value} by {level.carrier}" for level in one.levels) or one.level)
        for one in reversed(list_commands(session, robot=robot, period=period, limit=LINES_MAX))
    ]  # fmt: skip
    yield "<h2>Commands</h2>" + _table(("At", "Command", "By", "Proved"), commands)


def _alarms(session: Session, order: FileOrder) -> Iterator[str]:
    period = order.wanted.deployment.period
    rows = [
        (moment_text(one.raised_at), one.level, one.text, one.count,
         "nobody" if one.acknowledged_by is None or one.acknowledged_at is None
         else f"{one.acknowledged_by}, {moment_text(one.acknowledged_at)}")
        for one in reversed(alarms_of(session, order.robot.id, period, LINES_MAX))
    ]  # fmt: skip
    yield "<h2>Alarms</h2>"
    yield _table(("Raised", "Level", "What", "Times", "Acknowledged"), rows)


def _log(session: Session, order: FileOrder) -> Iterator[str]:
    robot, period = order.robot.id, order.wanted.deployment.period
    entries, told = LogFilter(robot=robot, period=period), ToldFilter(tuple(GROUPS), robot, period)
    yield "<h2>Log book</h2>"
    items = list(items_of(session, entries, told))
    if len(items) > LINES_MAX:
        yield f"<p>The last {LINES_MAX} of {len(items)} lines; log/logbook.html has all.</p>"
    for item in reversed(items[:LINES_MAX]):
        if item.entry is not None:
            yield from entry_html(item.entry, None)
        elif item.event is not None:
            yield event_html(item.event)
    if not items:
        yield "<p class=muted>Nothing was written.</p>"


def _imported(order: FileOrder) -> Iterator[str]:
    said = order.wanted.deployment.document
    if "source" not in said:
        return
    rows = [("File", said["source"]), ("Rows left out", said.get("skipped_rows", 0))]
    yield "<h2>Import</h2>" + _table((), rows)
    faults = [(one["line"], one["reason"]) for one in said.get("skipped", ())][:100]
    if faults:
        yield _table(("Line", "Why it was left out"), faults)


def _satellite(session: Session, order: FileOrder) -> Iterator[str]:
    period = order.wanted.deployment.period
    told = [
        one
        for one in messages_to(session, order.robot.id, 10 * LINES_MAX)
        if one.created_at >= period.first and (period.last is None or one.created_at <= period.last)
    ]
    cost = sum(one.credits for one in told if one.state not in ("refused", "dropped"))
    yield f"<h2>Satellite</h2><p>{len(told)} messages to the robot, {cost} credits.</p>"
    if told:
        rows = [
            (moment_text(one.created_at), one.kind, one.state, len(one.data), one.credits)
            for one in reversed(told[:LINES_MAX])
        ]
        yield _table(("At", "Kind", "State", "Bytes", "Credits"), rows, 3)


def _versions(order: FileOrder, file: KeptFile) -> Iterator[str]:
    rows: list[tuple[object, ...]] = [
        ("Software", order.software),
        ("File", file.name),
        ("SHA-256 of the file", file.sha256),
        ("SHA-256 of its source", file.source_sha256),
        ("Written", moment_text(order.written_at)),
    ]
    yield "<h2>Versions</h2>" + _table((), rows)


def _table(
    heads: Sequence[str], rows: Iterable[Sequence[Any]], numbers_from: int | None = None
) -> str:
    """Return a table; from one column on there are numbers."""

    def cells(tag: str, row: Sequence[Any]) -> str:
        kinds = (
            " class=number" if numbers_from is not None and number >= numbers_from else ""
            for number in range(len(row))
        )
        return "".join(
            f"<{tag}{kind}>{escape(str(one))}</{tag}>" for kind, one in zip(kinds, row, strict=True)
        )

    lines = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    if not lines:
        return "<p class=muted>None.</p>"
    head = f"<tr>{cells('th', heads)}</tr>" if heads else ""
    return f"<table>{head}{lines}</table>"
