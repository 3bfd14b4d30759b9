"""Takes rows out of the tables, a few at a time, and notes what went in the same transaction."""

from collections.abc import Collection, Mapping, Sequence
from datetime import datetime
from typing import Any, cast

from sqlalchemy import CursorResult, Table, bindparam, delete, insert, select
from sqlalchemy.orm import Session

from db.column import moment
from db.migrate import METADATA
from db.query.storage.hold import holds, is_held
from db.query.storage.prunable import BESIDE_SAMPLES, DAY_US, Prunable, plain
from db.sample_ingest import upsert
from db.sample_tables import COARSE_S, FINE_S, Rollup, SampleLog
from db.state_sums import sum_up_late
from db.storage_tables import NOBODY, PrunedDayRow

Row = Mapping[str, Any]
"""A row by its columns, moments as whole microseconds from the epoch."""
_S = 1_000_000


class HeldError(Exception):
    """The day may not be touched any more: what may was changed since it was looked at."""


def take_rows(
    session: Session,
    kind: Prunable,
    rows: Sequence[Row],
    action: str,
    period_s: int,
    now: datetime,
    before: datetime,
) -> int:
    """Take rows of one day and robot out, with all that hangs on them; return how many there were.

    Args:
        session: The writer's.
        kind: Of the rows.
        rows: Of one channel where the kind has channels.
        action: What is noted: ``thin``, ``move`` or ``delete``.
        period_s: Of which one row stayed, 0 where none did.
        now: By the station's clock.
        before: What came later than this stays.

    Raises:
        HeldError: If the day may not be touched.
    """
    robot_key = rows[0]["robot_key"] or NOBODY
    day = rows[0][kind.at] // DAY_US
    if is_held(holds(session, now, robot_key or None), robot_key, day):
        raise HeldError
    if kind.key == "samples":
        rows = _of_logs_before(session, rows, before)
        gone = _take(session, "sample", kind.keys, rows)
        for beside in BESIDE_SAMPLES:
            _take(session, beside.__tablename__, ["log_key", "sequence"], rows)
    else:
        gone = _take(session, kind.table.name, kind.keys, rows)
    if kind.rollup is not None and rows:
        channel = rows[0]["channel_key"]
        stretches = {row[kind.at] // (FINE_S * _S) for row in rows}
        sum_up_again(session, kind, robot_key, channel, stretches)
    if kind.key == "states":
        sum_up_late(session, [robot_key] * len(rows), [moment(row[kind.at]) for row in rows])
    if gone:
        moments = [row[kind.at] for row in rows]
        note = (kind.key, robot_key, day, action, period_s)
        _note(session, note, gone, moment(min(moments)), moment(max(moments)))
    return gone


def _of_logs_before(session: Session, rows: Sequence[Row], before: datetime) -> list[Row]:
    """Return the rows of logs to which nothing was added of late."""
    logs = {row["log_key"] for row in rows}
    late = set(
        session.scalars(
            select(SampleLog.key).where(SampleLog.key.in_(logs), SampleLog.received_at >= before)
        )
    )
    return [row for row in rows if row["log_key"] not in late]


def _take(session: Session, name: str, keys: Sequence[str], rows: Sequence[Row]) -> int:
    if not rows:
        return 0
    table = METADATA.tables[name]
    # Moments as they are kept: nothing is made of a number that becomes a number again.
    same = [
        plain(table.c[key]) == bindparam(f"of_{key}", type_=plain(table.c[key]).type)
        for key in keys
    ]
    done = session.connection().execute(
        delete(table).where(*same),
        [{f"of_{key}": row[key] for key in keys} for row in rows],
        execution_options={"preserve_rowcount": True},
    )
    return cast("CursorResult[Any]", done).rowcount


def mark_whole(session: Session, kind: str, robot_key: int, day: int, period_s: int) -> None:
    """Note that all of a day of a robot was thinned, so that nobody looks at it again."""
    statement = upsert(session, PrunedDayRow).values(
        kind=kind,
        robot_key=robot_key,
        day=day,
        action="thin",
        period_s=period_s,
        rows=0,
        is_whole=True,
    )
    session.execute(
        statement.on_conflict_do_update(
            index_elements=["kind", "robot_key", "day", "action", "period_s"],
            set_={"is_whole": True},
        )
    )


def thinned_days(session: Session, kind: str, robot_key: int, period_s: int) -> set[int]:
    """Return the days of a robot that were thinned to this or longer already, all of each."""
    return set(
        session.scalars(
            select(PrunedDayRow.day).where(
                PrunedDayRow.kind == kind,
                PrunedDayRow.robot_key == robot_key,
                PrunedDayRow.action == "thin",
                PrunedDayRow.period_s >= period_s,
                PrunedDayRow.is_whole,
            )
        )
    )


def _note(
    session: Session,
    note: tuple[str, int, int, str, int],
    rows: int,
    first_at: datetime,
    last_at: datetime,
) -> None:
    row = session.get(PrunedDayRow, note)
    if row is None:
        names = ("kind", "robot_key", "day", "action", "period_s")
        row = PrunedDayRow(**dict(zip(names, note, strict=True)), rows=0, is_whole=False)
        session.add(row)
    row.rows += rows
    row.first_at = first_at if row.first_at is None else min(row.first_at, first_at)
    row.last_at = last_at if row.last_at is None else max(row.last_at, last_at)
    session.flush()


def note_back(session: Session, kind: str, robot_key: int, day: int, rows: int) -> None:
    """Note that rows of a day which had been moved to a file are in the tables again."""
    row = session.get(PrunedDayRow, (kind, robot_key, day, "move", 0))
    if row is None:
        return
    row.rows -= rows
    if row.rows <= 0:
        session.delete(row)
    session.flush()


def sum_up_again(
    session: Session,
    kind: Prunable,
    robot_key: int,
    channel_key: int,
    stretches: Collection[int],
) -> None:
    """Make the sums of stretches of ``FINE_S`` anew, and those of the days that they are of."""
    if kind.rollup is None:
        return
    fine_us = FINE_S * _S
    at = kind.column(kind.at)
    found = session.execute(
        select(at, kind.table.c.value)
        .where(
            kind.table.c.robot_key == robot_key,
            kind.table.c.channel_key == channel_key,
            at >= min(stretches) * fine_us,
            at < (max(stretches) + 1) * fine_us,
        )
        .order_by(at)
    ).all()
    sums = _sums([(at_us // fine_us, 1, value, at_us, value, at_us) for at_us, value in found])
    of = {"robot_key": robot_key, "channel_key": channel_key}
    _put_sums(session, kind.rollup, of | {"length_s": FINE_S}, stretches, sums)
    session.flush()
    days = {stretch * FINE_S // COARSE_S for stretch in stretches}
    per_day = COARSE_S // FINE_S
    rollup = _table_of(kind.rollup).c
    parts = session.execute(
        select(
            rollup.stretch,
            rollup.size,
            rollup.least,
            plain(rollup.least_at),
            rollup.greatest,
            plain(rollup.greatest_at),
        )
        .where(
            rollup.robot_key == robot_key,
            rollup.channel_key == channel_key,
            rollup.length_s == FINE_S,
            rollup.stretch >= min(days) * per_day,
            rollup.stretch < (max(days) + 1) * per_day,
        )
        .order_by(rollup.stretch)
    ).all()
    sums = _sums([(part[0] // per_day, *part[1:]) for part in parts])
    _put_sums(session, kind.rollup, of | {"length_s": COARSE_S}, days, sums)


_Part = tuple[int, int, float, int, float, int]
"""Stretch, size, smallest value and its moment, largest value and its moment."""


def _sums(parts: Sequence[_Part]) -> dict[int, _Part]:
    """Return the sums of parts that are given in order; of equal extremes the first counts."""
    sums: dict[int, _Part] = {}
    for part in parts:
        was = sums.get(part[0])
        if was is None:
            sums[part[0]] = part
            continue
        least = min(was[2:4], part[2:4])
        greatest = was[4:6] if was[4] >= part[4] else part[4:6]
        sums[part[0]] = (part[0], was[1] + part[1], *least, *greatest)
    return sums


def _put_sums(
    session: Session,
    rollup: type[Rollup],
    of: Mapping[str, int],
    stretches: Collection[int],
    sums: Mapping[int, _Part],
) -> None:
    table = _table_of(rollup)
    where = [table.c[name] == value for name, value in of.items()]
    session.execute(delete(table).where(*where, table.c.stretch.in_(stretches)))
    fresh = [
        {
            **of,
            "stretch": stretch,
            "size": size,
            "least": least,
            "least_at": moment(least_us),
            "greatest": greatest,
            "greatest_at": moment(greatest_us),
        }
        for stretch, size, least, least_us, greatest, greatest_us in sums.values()
        if stretch in stretches
    ]
    if fresh:
        session.execute(insert(table), fresh)


def _table_of(rollup: type[Rollup]) -> Table:
    table: Table = cast("Any", rollup).__table__
    return table
