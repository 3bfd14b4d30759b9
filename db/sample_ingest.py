"""Measurements as they enter the tables: each kept once, and summed up as it is kept."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any, Final, NamedTuple, cast

from sqlalchemy import Table, bindparam, case, delete, func, insert, or_, select, tuple_, update
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.orm import Session

from db.column import microseconds
from db.sample_tables import (
    COARSE_S,
    FINE_S,
    ChannelRow,
    ReadingRollup,
    ReadingRow,
    Rollup,
    SampleLog,
    SampleRollup,
    SampleRow,
    SampleRun,
)
from db.tables import Base

_ASKED_AT_ONCE = 1000
"""Readings that one statement asks for; databases limit the parameters of a statement."""
_LENGTHS = tuple((length_s, length_s * 1_000_000) for length_s in (FINE_S, COARSE_S))

_LOGS: Final = cast("Table", SampleLog.__table__)
_LOWER_UNSMOOTHED: Final = (
    update(_LOGS)
    .where(
        _LOGS.c.key == bindparam("of"),
        or_(_LOGS.c.unsmoothed_from.is_(None), _LOGS.c.unsmoothed_from > bindparam("at")),
    )
    .values(unsmoothed_from=bindparam("at"))
)
"""Made once: each batch with samples runs it."""


class NewSample(NamedTuple):
    """A measurement that may be kept already."""

    robot_key: int
    log: int
    sequence: int
    channel: str
    measured_at: datetime
    received_at: datetime
    value: float
    position_ned: tuple[float, float, float]
    position_std_m: float


class NewReading(NamedTuple):
    """A reading that may be kept already."""

    robot_key: int
    channel: str
    measured_at: datetime
    value: float


def insert_samples(session: Session, samples: Iterable[NewSample]) -> None:
    """Insert measurements, and skip those whose number in their log is taken."""
    by_log: dict[tuple[int, int], dict[int, NewSample]] = {}
    for sample in samples:
        by_log.setdefault((sample.robot_key, sample.log), {}).setdefault(sample.sequence, sample)
    channels = channel_keys(
        session, {one.channel for log in by_log.values() for one in log.values()}
    )
    log_keys = _log_keys(session, by_log)
    rows = [
        _sample_row(by_number[number], channels, log_keys[log])
        for log, by_number in by_log.items()
        for number in claim(session, log_keys[log], sorted(by_number))
    ]
    if rows:
        session.execute(insert(SampleRow), rows)
        _sum_up(session, SampleRollup, rows)
        note_unsmoothed(session, ((row["log_key"], row["measured_at"]) for row in rows))


def note_unsmoothed(session: Session, samples: Iterable[tuple[int, datetime]]) -> None:
    """Note that smoothing has not looked at samples, of which log and time are given."""
    first: dict[int, datetime] = {}
    for log_key, at in samples:
        first[log_key] = min(first.get(log_key, at), at)
    logs = [{"of": log_key, "at": at} for log_key, at in first.items()]
    session.connection().execute(_LOWER_UNSMOOTHED, logs)


def take_out(session: Session, rows: Sequence[Mapping[str, Any]]) -> None:
    """Delete measurements by their keys, and take them off the sums of their stretches of time.

    The extremes of a stretch stay: whoever takes one out puts the same value in its place. Their
    numbers stay taken.
    """
    if not rows:
        return
    of = SampleRow.__table__.c
    names = ("robot_key", "channel_key", "measured_at", "log_key", "sequence")
    session.connection().execute(
        delete(cast("Table", SampleRow.__table__)).where(
            *(of[name] == bindparam(f"of_{name}") for name in names)
        ),
        [{f"of_{name}": row[name] for name in names} for row in rows],
    )
    gone = Counter(
        (row["robot_key"], row["channel_key"], length_s, microseconds(row["measured_at"]) // us)
        for row in rows
        for length_s, us in _LENGTHS
    )
    of = SampleRollup.__table__.c
    keys = ("robot_key", "channel_key", "length_s", "stretch")
    session.connection().execute(
        update(cast("Table", SampleRollup.__table__))
        .where(*(of[name] == bindparam(f"of_{name}") for name in keys))
        .values(size=of.size - bindparam("gone")),
        [
            {**{f"of_{name}": one for name, one in zip(keys, key, strict=True)}, "gone": count}
            for key, count in gone.items()
        ],
    )


def insert_readings(session: Session, readings: Iterable[NewReading]) -> None:
    """Insert readings, and skip those of a moment of which the channel has one."""
    asked = list(readings)
    channels = channel_keys(session, {one.channel for one in asked})
    rows = {
        (one.robot_key, channels[one.channel], one.measured_at): one.value
        for one in reversed(asked)
    }
    key = tuple_(ReadingRow.robot_key, ReadingRow.channel_key, ReadingRow.measured_at)
    keys = list(rows)
    for place in range(0, len(keys), _ASKED_AT_ONCE):
        for known in session.execute(
            select(ReadingRow.robot_key, ReadingRow.channel_key, ReadingRow.measured_at).where(
                key.in_(keys[place : place + _ASKED_AT_ONCE])
            )
        ):
            del rows[known.robot_key, known.channel_key, known.measured_at]
    new = [
        {"robot_key": robot, "channel_key": channel, "measured_at": at, "value": value}
        for (robot, channel, at), value in rows.items()
    ]
    if new:
        session.execute(insert(ReadingRow), new)
        _sum_up(session, ReadingRollup, new)


def channel_keys(session: Session, names: Iterable[str]) -> dict[str, int]:
    """Return the numbers of channels, and give numbers to those that have none."""
    known = {row.name: row.key for row in session.execute(select(ChannelRow.name, ChannelRow.key))}
    for name in sorted(set(names) - known.keys()):
        row = ChannelRow(name=name)
        session.add(row)
        session.flush()
        known[name] = row.key
    return known


def upsert(session: Session, table: type[Base]) -> "sqlite.Insert | postgresql.Insert":
    """Return an insert that can say what to do with a key that is taken."""
    dialect = sqlite if session.get_bind().dialect.name == "sqlite" else postgresql
    target = table.__table__
    if not isinstance(target, Table):
        raise TypeError(f"{table.__name__} is not a plain table")
    return dialect.insert(target)


def _log_keys(
    session: Session, logs: Mapping[tuple[int, int], Mapping[int, NewSample]]
) -> dict[tuple[int, int], int]:
    """Return the numbers of logs, and note when the newest sample of each came."""
    if not logs:
        return {}
    statement = upsert(session, SampleLog)
    session.execute(
        statement.on_conflict_do_update(
            index_elements=["robot_key", "log"],
            set_={"received_at": statement.excluded.received_at},
        ),
        [
            {
                "robot_key": robot_key,
                "log": log,
                "received_at": max(one.received_at for one in samples.values()),
            }
            for (robot_key, log), samples in logs.items()
        ],
    )
    found = session.execute(
        select(SampleLog.robot_key, SampleLog.log, SampleLog.key).where(
            tuple_(SampleLog.robot_key, SampleLog.log).in_(list(logs))
        )
    )
    return {(row.robot_key, row.log): row.key for row in found}


def unclaimed(session: Session, log_key: int | None, numbers: Sequence[int]) -> list[int]:
    """Return those of ascending numbers of a log that are not kept."""
    return list(numbers) if log_key is None else _outside(numbers, _near(session, log_key, numbers))


def _near(session: Session, log_key: int, numbers: Sequence[int]) -> list[tuple[int, int]]:
    """Return the runs of a log that hold, or touch, any of ascending numbers."""
    of_log = SampleRun.log_key == log_key
    before = (
        select(func.max(SampleRun.first))
        .where(of_log, SampleRun.first <= numbers[0])
        .scalar_subquery()
    )
    near = session.execute(
        select(SampleRun.first, SampleRun.last)
        .where(
            of_log,
            SampleRun.first >= func.coalesce(before, numbers[0]),
            SampleRun.first <= numbers[-1] + 1,
        )
        .order_by(SampleRun.first)
    )
    return [(row.first, row.last) for row in near]


def claim(session: Session, log_key: int, numbers: Sequence[int]) -> list[int]:
    """Return those of ascending numbers of a log that were not kept, and note them as kept."""
    kept = _near(session, log_key, numbers)
    new = _outside(numbers, kept)
    if not new:
        return []
    runs = _joined(sorted([*kept, *((number, number) for number in new)]))
    was = dict(kept)
    gone = was.keys() - dict(runs).keys()
    if gone:
        session.execute(
            delete(SampleRun).where(SampleRun.log_key == log_key, SampleRun.first.in_(gone))
        )
    statement = upsert(session, SampleRun)
    session.execute(
        statement.on_conflict_do_update(
            index_elements=["log_key", "first"], set_={"last": statement.excluded.last}
        ),
        [
            {"log_key": log_key, "first": first, "last": last}
            for first, last in runs
            if was.get(first) != last
        ],
    )
    return new


def _outside(numbers: Sequence[int], runs: Sequence[tuple[int, int]]) -> list[int]:
    """Return those of ascending numbers that lie in none of ascending runs."""
    new: list[int] = []
    place = 0
    for number in numbers:
        while place < len(runs) and runs[place][1] < number:
            place += 1
        if place == len(runs) or number < runs[place][0]:
            new.append(number)
    return new


def _joined(runs: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return ascending runs with those that touch made one."""
    joined: list[tuple[int, int]] = []
    for first, last in runs:
        if joined and first <= joined[-1][1] + 1:
            joined[-1] = (joined[-1][0], max(last, joined[-1][1]))
        else:
            joined.append((first, last))
    return joined


def _sample_row(sample: NewSample, channels: Mapping[str, int], log_key: int) -> dict[str, Any]:
    return {
        "robot_key": sample.robot_key,
        "channel_key": channels[sample.channel],
        "measured_at": sample.measured_at,
        "log_key": log_key,
        "sequence": sample.sequence,
        "value": sample.value,
        **place_columns(sample.position_ned, sample.position_std_m),
    }


def place_columns(
    position_ned: tuple[float, float, float], position_std_m: float
) -> dict[str, int]:
    """Return a position in m as the columns that keep it."""
    north_m, east_m, depth_m = position_ned
    return {
        "north_mm": round(north_m * 1e3),
        "east_mm": round(east_m * 1e3),
        "depth_mm": round(depth_m * 1e3),
        "position_std_um": round(position_std_m * 1e6),
    }


def _sum_up(session: Session, table: type[Rollup], rows: Sequence[Mapping[str, Any]]) -> None:
    """Add new rows to the stretches of time in which they were measured."""
    stretches: dict[tuple[int, int, int, int], dict[str, Any]] = {}
    for row in rows:
        at, value = row["measured_at"], row["value"]
        at_us = microseconds(at)
        for length_s, length_us in _LENGTHS:
            key = (row["robot_key"], row["channel_key"], length_s, at_us // length_us)
            found = stretches.get(key)
            if found is None:
                stretches[key] = {
                    "robot_key": key[0],
                    "channel_key": key[1],
                    "length_s": length_s,
                    "stretch": key[3],
                    "size": 1,
                    "least": value,
                    "least_at": at,
                    "greatest": value,
                    "greatest_at": at,
                }
                continue
            found["size"] += 1
            if value < found["least"]:
                found["least"], found["least_at"] = value, at
            if value > found["greatest"]:
                found["greatest"], found["greatest_at"] = value, at
    statement = upsert(session, table)  # type: ignore[arg-type]
    new = statement.excluded
    is_less, is_greater = new.least < table.least, new.greatest > table.greatest
    session.execute(
        statement.on_conflict_do_update(
            index_elements=["robot_key", "channel_key", "length_s", "stretch"],
            set_={
                "size": table.size + new.size,
                "least": case((is_less, new.least), else_=table.least),
                "least_at": case((is_less, new.least_at), else_=table.least_at),
                "greatest": case((is_greater, new.greatest), else_=table.greatest),
                "greatest_at": case((is_greater, new.greatest_at), else_=table.greatest_at),
            },
        ),
        list(stretches.values()),
    )
