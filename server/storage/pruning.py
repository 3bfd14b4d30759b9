"""One pass over what is kept: thins, moves to files and deletes what is due, day by day.

It can be killed at any moment and begun again: what went is noted in the transaction in which it
went; a file is durable, read back and noted before the first of its rows goes; and what was thinned
once loses nothing more when it is thinned again.
"""

import logging
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from db.query.storage.hold import Hold, holds, is_held
from db.query.storage.prunable import (
    PRUNABLE,
    Prunable,
    beside_columns,
    channels,
    day_begins,
    day_of,
    days,
    parts,
)
from db.query.storage.rows import HourOf, has_late_rows, names_in, old_rows, rows_of
from db.query.storage.taking import HeldError, Row, mark_whole, take_rows, thinned_days
from db.query.storage.thinning import kept_rows
from db.storage_tables import NOBODY, ArchiveFileRow, PrunedDayRow
from db.store import Store
from db.tables import Robot
from robot_link.storage_config import RawRule, SeriesRule, StorageConfig
from server.storage.archive import (
    FOLDER,
    ArchiveError,
    Header,
    check_archive,
    read_header,
    read_rows,
    write_archive,
)
from server.storage.pace import Pace

logger = logging.getLogger(__name__)
Rule = SeriesRule | RawRule
Action = Literal["thin", "move", "delete"]
_HOURS: Final = 24


@dataclass(slots=True)
class PassResult:
    """What a pass did."""

    thinned: Counter[str] = field(default_factory=Counter[str])
    """Rows that went, by kind."""
    moved: Counter[str] = field(default_factory=Counter[str])
    deleted: Counter[str] = field(default_factory=Counter[str])
    files: int = 0
    longest_s: float = 0.0
    """The longest transaction."""

    @property
    def rows(self) -> int:
        """All that went."""
        return self.thinned.total() + self.moved.total() + self.deleted.total()

    def of(self, action: str) -> Counter[str]:
        """Return what went in one way."""
        return {"thin": self.thinned, "move": self.moved, "delete": self.deleted}[action]

    def sentence(self) -> str:
        """Return what it did in words."""
        words = {"thin": "thinned out", "move": "moved to files", "delete": "deleted"}
        told = [
            f"{rows:,} {PRUNABLE[kind].title} {words[action]}".replace(",", " ")
            for action in ("thin", "move", "delete")
            for kind, rows in sorted(self.of(action).items())
            if rows
        ]
        return f"Storage: {', '.join(told)}." if told else "Storage: nothing was due."


def due_day(now: datetime, rule: Rule) -> int:
    """Return the first day that is not old enough for a rule, in days from the epoch."""
    return day_of(now - timedelta(days=rule.after_days))


def rule_of(config: StorageConfig, kind: str) -> Rule:
    """Return the rule of a kind of data."""
    rule: Rule = getattr(config, kind)
    return rule


class Pruner:
    """Prunes in a thread of its own, by changes of the one writer.

    Args:
        store: The station's memory.
        data_dir: Where the folder of archives is.
        now: By the station's clock.
        go_on: Called between two steps; raises where the pass is to end.
        report: Told how far it is, 0 .. 1, and at what.
    """

    def __init__(
        self,
        store: Store,
        data_dir: Path,
        now: datetime,
        go_on: Callable[[], None] = lambda: None,
        report: Callable[[float, str], None] = lambda _share, _text: None,
    ) -> None:
        self._store = store
        self._folder = data_dir / FOLDER
        self._now = now
        self._go_on = go_on
        self._report = report
        self._pace = Pace(store)
        self.result = PassResult()

    def run(self, config: StorageConfig, *, again: bool = False) -> PassResult:
        """Do what is due.

        Args:
            config: The rules.
            again: Look also at days that were thinned already: rows may have come to them since.

        Raises:
            StoreError: If the database does not answer; what was done stays done.
            ArchiveError: If a file cannot be written; or, once all else was seen to, if one that
                rows left for is damaged or gone.
        """
        bad = self._finish_files()
        due = [
            (PRUNABLE[key], rule_of(config, key))
            for key in PRUNABLE
            if rule_of(config, key).then != "keep"
        ]
        for place, (kind, rule) in enumerate(due):
            self._prune(kind, rule, again, place / len(due), 1.0 / len(due))
        if bad:
            raise ArchiveError(" ".join(bad))
        return self.result

    @property
    def longest_s(self) -> float:
        """The longest transaction so far."""
        return self._pace.longest_s

    @property
    def transactions(self) -> int:
        """How many there were so far."""
        return self._pace.transactions

    def _prune(self, kind: Prunable, rule: Rule, again: bool, begun: float, share: float) -> None:
        with self._store.read() as session:
            robots = parts(session, kind)
        until = due_day(self._now, rule)
        for place, robot_key in enumerate(robots):
            with self._store.read() as session:
                found = list(days(session, kind, robot_key, until))
                if rule.then == "thin" and not again:
                    period_s = period_of(rule)
                    done = thinned_days(session, kind.key, robot_key, period_s)
                    found = [day for day in found if day not in done]
            for number, day in enumerate(found):
                self._go_on()
                part = (place + number / len(found)) / len(robots)
                self._report(begun + share * part, f"{kind.title} of {day_begins(day):%Y-%m-%d}")
                self._prune_day(kind, rule, robot_key, day)

    def _prune_day(self, kind: Prunable, rule: Rule, robot_key: int, day: int) -> None:
        with self._store.read() as session:
            held = holds(session, self._now, robot_key or None)
            if kind.is_by_robot and is_held(held, robot_key, day):
                return
            out = [] if kind.is_by_robot else held_robots(session, held, day)
        before = self._before(rule)
        if rule.then == "move":
            self._move(kind, robot_key, day, before, out)
        else:
            self._take_day(kind, rule, robot_key, day, before, out)

    def _before(self, rule: Rule) -> datetime:
        return day_begins(due_day(self._now, rule))

    def _take_day(
        self, kind: Prunable, rule: Rule, robot_key: int, day: int, before: datetime, out: list[int]
    ) -> None:
        """Thin or delete the rows of a day."""
        period_s = period_of(rule)
        action = "thin" if rule.then == "thin" else "delete"
        where = old_rows(kind, before, out)
        rows = gone_of_day(self._store, kind, robot_key, day, where, period_s)
        might_go = self._take(kind, rows, action, period_s, before)
        if action == "delete" or not might_go:
            return
        with self._store.read() as session:
            if has_late_rows(session, kind, robot_key, day, where):
                return
        self._store.change(
            lambda session: mark_whole(session, kind.key, robot_key, day, period_s)
        ).result()

    def _move(
        self, kind: Prunable, robot_key: int, day: int, before: datetime, out: list[int]
    ) -> None:
        """Write the rows of a day to a file, and take them out once that is safe."""
        with self._store.read() as session:
            file = self._new_file(session, kind, robot_key, day)
            header = _header(session, kind, robot_key, day)
            where = old_rows(kind, before, out)
            rows = (
                row
                for channel_key in channels(session, kind, robot_key, day)
                for row in rows_of(session, kind, HourOf(robot_key, day, channel_key), where)
            )
            written = write_archive(file, header, self._watched(rows), kind.at)
        if written is None:
            return
        row = ArchiveFileRow(
            kind=kind.key,
            robot_key=robot_key,
            day=day,
            path=str(file.relative_to(self._folder)),
            rows=written.rows,
            bytes=written.bytes,
            sha256=written.sha256,
            first_at=_at(written.first_us),
            last_at=_at(written.last_us),
            state="written",
            written_at=self._now,
            restored_at=None,
        )
        self._store.change(lambda session: session.add(row)).result()
        self.result.files += 1
        self._empty_into(file, kind, before)
        self._set_moved(row.key)

    def _watched(self, rows: Iterable[Row]) -> Iterator[Row]:
        for number, row in enumerate(rows):
            if number % 1000 == 0:
                self._go_on()
            yield row

    def _new_file(self, session: Session, kind: Prunable, robot_key: int, day: int) -> Path:
        """Return the name of the next file of a day: never that of one which is noted."""
        name = session.scalar(select(Robot.id).where(Robot.key == robot_key)) or "all"
        noted = set(
            session.scalars(
                select(ArchiveFileRow.path).where(
                    ArchiveFileRow.kind == kind.key,
                    ArchiveFileRow.robot_key == robot_key,
                    ArchiveFileRow.day == day,
                )
            )
        )
        begin = f"{kind.key}/{name}/{day_begins(day):%Y-%m-%d}"
        ends = ("", *(f"-{number}" for number in range(2, len(noted) + 2)))
        paths = (f"{begin}{end}.jsonl.gz" for end in ends)
        return self._folder / next(path for path in paths if path not in noted)

    def _finish_files(self) -> list[str]:
        """Take out the rows of files that were written when a pass was cut off.

        A file that is damaged or gone is forgotten if all its rows are still there.

        Returns:
            What is wrong with other files, sentences.
        """
        with self._store.read() as session:
            left = [
                (row.key, row.kind, self._folder / row.path, row.sha256, row.written_at)
                for row in session.scalars(
                    select(ArchiveFileRow).where(ArchiveFileRow.state == "written")
                )
            ]
        bad: list[str] = []
        for key, kind, file, sha256, written_at in left:
            self._go_on()
            try:
                check_archive(file, sha256)
                self._empty_into(file, PRUNABLE[kind], written_at)
            except ArchiveError as error:
                if self._store.change(lambda session, key=key: _forget_file(session, key)).result():
                    logger.warning("%s Its rows are still in the database.", error)
                else:
                    bad.append(f"{error} Rows left the database for it: put it back from a backup.")
            else:
                self._set_moved(key)
        return bad

    def _set_moved(self, key: int) -> None:
        def change(session: Session) -> None:
            row = session.get(ArchiveFileRow, key)
            if row is None:
                raise ArchiveError(f"The note of file {key} is missing.")
            if row.state == "written":  # Else it is being read back.
                row.state = "moved"

        self._store.change(change).result()

    def _empty_into(self, file: Path, kind: Prunable, before: datetime) -> None:
        """Take out of the tables what a file holds."""
        header = read_header(file)
        key = _key(kind)
        self._take(kind, map(key, read_rows(file, header)), "move", 0, before)

    def _take(
        self, kind: Prunable, rows: Iterable[Row], action: Action, period_s: int, before: datetime
    ) -> bool:
        """Take rows out, a few at a time, those of a robot and channel together.

        Returns:
            Whether none was of a day that may not be touched, which can change at any time.
        """
        might_go = True
        for series in _series(rows, self._pace):
            self._go_on()
            begun: list[float] = []

            def change(
                session: Session, series: list[Row] = series, begun: list[float] = begun
            ) -> int:
                begun.append(time.perf_counter())
                return take_rows(session, kind, series, action, period_s, self._now, before)

            try:
                gone = self._store.change(change).result()
            except HeldError:
                might_go = False
                continue
            self.result.of(action)[kind.key] += gone
            self._pace.rest_after(time.perf_counter() - begun[0], len(series))
            self.result.longest_s = self._pace.longest_s
        return might_go


def gone_of_day(
    store: Store,
    kind: Prunable,
    robot_key: int,
    day: int,
    where: Sequence[ColumnElement[bool]],
    period_s: int,
) -> Iterator[Row]:
    """Yield the keys of the rows of a day that go: all, or but one of each period.

    They are read by hours, so that no session is open while they go.
    """
    with store.read() as session:
        of_day = channels(session, kind, robot_key, day)
    for channel_key in of_day:
        for hour in range(_HOURS):
            of = HourOf(robot_key, day, channel_key, hour)
            with store.read() as session:
                rows = list(rows_of(session, kind, of, where))
            yield from _doomed(kind, rows, period_s) if period_s else map(_key(kind), rows)


def _forget_file(session: Session, key: int) -> bool:
    """Forget a file unless rows of its day left for one; return whether it was."""
    row = session.get(ArchiveFileRow, key)
    if row is None:
        return True
    gone = select(PrunedDayRow).where(
        PrunedDayRow.kind == row.kind, PrunedDayRow.day == row.day, PrunedDayRow.action == "move"
    )
    if PRUNABLE[row.kind].is_by_robot:
        gone = gone.where(PrunedDayRow.robot_key == row.robot_key)
    if session.scalars(gone).first() is not None:
        return False
    session.delete(row)
    return True


def _series(rows: Iterable[Row], pace: Pace) -> Iterator[list[Row]]:
    """Yield rows in pieces of one robot, day and channel each, as large as the pace allows."""
    waiting: dict[Any, list[Row]] = {}
    for row in rows:
        of = (row["robot_key"], row.get("channel_key"))
        piece = waiting.setdefault(of, [])
        piece.append(row)
        if len(piece) >= pace.size:
            yield waiting.pop(of)
    yield from waiting.values()


def _key(kind: Prunable) -> Callable[[Row], Row]:
    """Return what makes of a row what is needed to take it out."""
    names = {*kind.keys, kind.at, "robot_key"}
    return lambda row: {name: row[name] for name in names}


def _doomed(kind: Prunable, rows: list[Row], period_s: int) -> Iterator[Row]:
    """Yield the keys of the rows of an hour of a series that go when it is thinned."""
    key, value = _key(kind), str(kind.value)
    at_us = np.array([row[kind.at] for row in rows], dtype=np.int64)
    values = np.array(
        [np.nan if row[value] is None else row[value] for row in rows], dtype=np.float64
    )
    kept = kept_rows(at_us, values, period_s, _marks(kind, rows))
    return (key(row) for row, stays in zip(rows, kept, strict=True) if not stays)


def _marks(kind: Prunable, rows: list[Row]) -> np.ndarray[Any, np.dtype[np.int64]] | None:
    """Return what rows are marked with as numbers, the same for the same marks."""
    if not kind.marks:
        return None
    numbers: dict[tuple[Any, ...], int] = {}
    of_rows = (tuple(row[name] for name in kind.marks) for row in rows)
    return np.array([[numbers.setdefault(mark, len(numbers))] for mark in of_rows], dtype=np.int64)


def _header(session: Session, kind: Prunable, robot_key: int, day: int) -> Header:
    names = names_in(session, kind, robot_key)
    robot = names["robots"].get(str(robot_key), "") if kind.is_by_robot else ""
    columns = (*(column.name for column in kind.table.columns), *beside_columns(kind))
    return Header(kind.key, robot, f"{day_begins(day):%Y-%m-%d}", columns, names)


def held_robots(session: Session, held: list[Hold], day: int) -> list[int]:
    """Return the robots of which nothing may be touched on a day; ``NOBODY`` for strangers."""
    robots = [*session.scalars(select(Robot.key)), NOBODY]
    return [key for key in robots if is_held(held, key, day)]


def period_of(rule: Rule) -> int:
    """Return the period of which one row stays, s; 0 where none does."""
    return rule.period_s if isinstance(rule, SeriesRule) and rule.then == "thin" else 0


def _at(at_us: int) -> datetime:
    return day_begins(0) + timedelta(microseconds=at_us)
