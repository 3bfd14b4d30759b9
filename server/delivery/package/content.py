"""What a delivery holds beside the measurements: log, map, plans, settings, checks, metadata.

Never secrets: keys of robots and accounts are in no table that is read here, orders that carry a
key are left out of the packets, and addresses of mail are those of the named contributors alone.
"""

import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from sqlalchemy.orm import Session

from db.deployment_span import Period
from db.query.log_book.entries import LogFilter
from db.query.log_book.told import GROUPS, ToldFilter
from db.query.measured.quality import newest_quality_run
from db.query.mission.commands import list_commands
from db.query.mission.plans import list_plans
from db.query.station.configurations import configurations_in_force
from db.query.station.events import EventFilter, events_after
from db.query.station.journal import JournalRange, iterate_frames
from server.delivery.file_order import FileOrder
from server.delivery.file_task import KeptFile
from server.delivery.judged import Judged
from server.delivery.package.order import PackageOrder
from server.logbook.export import cell, csv_blocks, csv_line
from server.logbook.picture import Pictures
from server.logbook.report import ReportOrder, report_blocks
from server.recording.export import geojson, kml
from server.recording.tlog import tlog_blocks

ALL: Final = 100_000
"""More commands or plans than any deployment has."""
_EVENTS_AT_ONCE: Final = 1000
_ADDRESS: Final = re.compile(r"[\w.+%-]+@[\w-]+(?:\.[\w-]+)+")
_KEYS: Final = frozenset({"SETUP_SIGNING"})
"""Messages that carry the key of a robot."""


def write_content(
    session: Session,
    order: PackageOrder,
    file_order: FileOrder,
    found: Judged,
    file: KeptFile,
    work: Path,
) -> list[str]:
    """Write everything below a folder; return the names, in the order of a delivery.

    Args:
        session: The one that the rows were read in.
        order: What is to be packed.
        file_order: By what the file was written.
        found: What the rules say of the rows.
        file: The NetCDF file, with its checks.
        work: Where files are written.
    """
    write = _Writing(work, file_order)
    deployment, robot = file_order.wanted.deployment, file_order.robot
    write.text("map/track.kml", [kml(session, deployment, robot)])
    write.text("map/track.geojson", [geojson(session, deployment, robot), "\n"])
    entries = LogFilter(robot=robot.id, period=deployment.period)
    told = ToldFilter(tuple(GROUPS), robot.id, deployment.period)
    pictures = Pictures(order.data_dir)
    log = _log_order(file_order)
    write.text("log/logbook.html", report_blocks(session, log, entries, told, pictures))
    write.text("log/logbook.csv", csv_blocks(session, entries, told))
    write.text("log/commands.csv", _commands(session, robot.id, deployment.period))
    write.text("log/events.csv", _events(session, robot.id, deployment.period))
    write.json("meta/metadata.json", _metadata(file_order))
    write.json("meta/qc_rules.json", _rules(session, file_order, found))
    write.json("meta/checks.json", {"file": file.name, "checks": [asdict(c) for c in file.checks]})
    write.json("meta/config.json", _settings(session, robot.id, deployment.period))
    plans = list_plans(session, robot=robot.id, period=deployment.period, limit=ALL)
    for plan in reversed(plans):
        write.json(f"plans/{plan.id}.json", asdict(plan))
    if order.has_journal:
        write.packets(f"raw/{robot.id}.tlog", session, robot.id, deployment.period)
    return write.names


class _Writing:
    """Writes texts without addresses that nobody has published."""

    def __init__(self, work: Path, order: FileOrder) -> None:
        self._work = work
        self._published = {person.email for person, _ in order.metadata.contributors()}
        self.names: list[str] = []

    def text(self, name: str, parts: Iterable[str]) -> None:
        with self._path(name).open("w", encoding="utf-8", newline="") as file:
            for part in parts:
                file.write(_ADDRESS.sub(self._shown, part))

    def json(self, name: str, document: object) -> None:
        text = json.dumps(document, indent=1, sort_keys=True, ensure_ascii=False, default=_plain)
        self.text(name, [text, "\n"])

    def packets(self, name: str, session: Session, robot: str, period: Period) -> None:
        frames = iterate_frames(session, JournalRange(robot, period.first, period.last))
        with self._path(name).open("wb") as file:
            for block in tlog_blocks(frames, without=_KEYS):
                file.write(block)

    def _path(self, name: str) -> Path:
        path = self._work / name
        path.parent.mkdir(parents=True, exist_ok=True)
        self.names.append(name)
        return path

    def _shown(self, found: re.Match[str]) -> str:
        return found[0] if found[0] in self._published else "(address left out)"


def _plain(value: Any) -> Any:  # noqa: ANN401 - what JSON does not know
    return value.isoformat() if hasattr(value, "isoformat") else str(value)


def _log_order(order: FileOrder) -> ReportOrder:
    deployment = order.wanted.deployment
    return ReportOrder(
        period=deployment.period,
        until=deployment.last_at or order.written_at,
        robots=[order.robot],
        has_watches=False,
        made_at=order.written_at,
        made_by=order.metadata.operating_agency,
        is_simulation=order.is_simulated,
    )


def _commands(session: Session, robot: str, period: Period) -> Iterator[str]:
    yield csv_line(("created_at", "id", "kind", "by", "level", "proved_at", "carrier", "reason"))
    for one in reversed(list_commands(session, robot=robot, period=period, limit=ALL)):
        head = [one.created_at.isoformat(), one.id, one.kind.value, cell(one.created_by)]
        for level in one.levels:
            said = [level.level.value, level.at.isoformat(), level.carrier, cell(level.reason)]
            yield csv_line([*head, *said])
        if not one.levels:
            yield csv_line([*head, one.level, "", "", ""])


def _events(session: Session, robot: str, period: Period) -> Iterator[str]:
    yield csv_line(("at", "kind", "level", "by", "text"))
    wanted, cursor = EventFilter(robot=robot, period=period), 0
    while part := events_after(session, cursor, wanted, _EVENTS_AT_ONCE):
        cursor = part[-1].cursor
        for one in part:
            yield csv_line([one.at.isoformat(), one.kind, one.level, cell(one.by), cell(one.text)])


def _metadata(order: FileOrder) -> dict[str, Any]:
    deployment, robot = order.wanted.deployment, order.robot
    return {
        "id": order.identity,
        "mode": order.mode,
        "is_simulated": order.is_simulated,
        "written_at": order.written_at,
        "software": order.software,
        "deployment": {
            "id": deployment.id,
            "title": deployment.title,
            "purpose": deployment.purpose,
            "people": list(deployment.people),
            "started_at": deployment.started_at,
            "ended_at": deployment.ended_at,
            "state": deployment.state,
            "water": deployment.site.name,
        },
        "robot": {"id": robot.id, "name": robot.name, "model": robot.model},
        "metadata": order.metadata.model_dump(mode="json"),
    }


def _rules(session: Session, order: FileOrder, found: Judged) -> dict[str, Any]:
    rules, deployment = order.wanted.rules, order.wanted.deployment
    run = newest_quality_run(session, deployment.id)
    return {
        "sha256": rules.sha256,
        "rules": rules.model_dump(mode="json"),
        "counts": {key: one.counts for key, one in found.judgements.items()},
        "flags_by_hand": [asdict(one) for one in order.manual],
        "last_run": None if run is None else {"at": run.at, "by": run.by, "sha256": run.sha256},
    }


def _settings(session: Session, robot: str, period: Period) -> dict[str, Any]:
    return {"versions": [asdict(one) for one in configurations_in_force(session, robot, period)]}
