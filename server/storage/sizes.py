"""How much of what there is, how fast it grows, and when the disk is full; looked at now and then.

A request is answered from the newest look, with its age. A look asks the database many short
questions one after another, so that it holds up nobody.
"""

import asyncio
import contextlib
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Final

from sqlalchemy.orm import Session

from db.care import sqlite_file
from db.fault import StoreError
from db.query.station.settings import get_setting, put_setting
from db.query.storage import size as query
from db.query.storage.size import DatabaseSize, TableCount
from robot_link.clock import set_or_after
from robot_link.storage_config import StorageConfig
from server.base.foundation import Foundation
from server.storage.stored_kind import STORED_KINDS, StoredKind

CAUSE: Final = "storage:growth"
SETTING: Final = "storage.sizes"
PERIOD_S: Final = 300.0
"""Wall time between two looks."""
_FIRST_AFTER_S: Final = 10.0
"""A station that starts has other things to read."""
_HISTORY_EVERY: Final = timedelta(hours=1)
_HISTORY_MAX: Final = 24 * 14
_GROWTH_OVER: Final = timedelta(days=7)
_GROWTH_LEAST: Final = timedelta(minutes=10)
"""Growth is not told of less: it would be noise."""
_DAY_S: Final = 86_400.0


@dataclass(frozen=True, slots=True)
class KindSize:
    """One kind of data at one look."""

    key: str
    rows: int
    bytes: int
    oldest_at: datetime | None = None
    newest_at: datetime | None = None


@dataclass(frozen=True, slots=True)
class Look:
    """What was found at one look."""

    at: datetime
    kinds: Sequence[KindSize]
    other_bytes: int
    """Of all that has no name of its own."""
    elsewhere_bytes: int
    """Of a database that lies not on the data folder's disk, or nobody knows where."""
    free_inside_bytes: int
    """Inside the database's file."""
    disk_free_bytes: int
    """Of the data folder's disk."""
    disk_bytes: int

    @property
    def used_bytes(self) -> int:
        """Of all that the station keeps."""
        return sum(one.bytes for one in self.kinds) + self.other_bytes

    @property
    def on_disk_bytes(self) -> int:
        """Of these, what lies on the data folder's disk."""
        return self.used_bytes - self.elsewhere_bytes


@dataclass(frozen=True, slots=True)
class Mark:
    """What there was at an earlier moment."""

    at: datetime
    used_bytes: int
    on_disk_bytes: int
    rows: Mapping[str, int]
    """By kind, those that went since then counted in."""


@dataclass(slots=True)
class _Memory:
    """What outlives a restart."""

    counts: dict[str, TableCount] = field(default_factory=dict[str, TableCount])
    gone: dict[str, int] = field(default_factory=dict[str, int])
    """Rows of each kind that were pruned since the first look."""
    marks: list[Mark] = field(default_factory=list[Mark])


class Sizes:
    """Knows how large everything is. Belongs to one event loop; ``run`` is its task."""

    def __init__(self, foundation: Foundation) -> None:
        self._foundation = foundation
        self._store = foundation.store
        self._memory = _Memory()
        self._wake = asyncio.Event()
        self.look: Look | None = None
        """``None`` before the first."""

    async def load(self) -> None:
        """Take up what was counted before the station stopped."""
        kept = await self._store.query(lambda session: get_setting(session, SETTING))
        if kept is not None:
            self._memory = _read(kept)

    async def run(self) -> None:
        """Look now and then until cancelled."""
        await set_or_after(self._wake, _FIRST_AFTER_S)
        while True:
            self._wake.clear()
            with contextlib.suppress(StoreError):  # The station says so already, and looks again.
                await self.renew()
            await set_or_after(self._wake, PERIOD_S)

    def wake(self) -> None:
        """Have another look soon."""
        self._wake.set()

    def went(self, kind: str, tables: Mapping[str, int]) -> None:
        """Note that rows of tables were pruned."""
        for name, rows in tables.items():
            count = self._memory.counts.get(name)
            if count is not None:
                left = max(0, count.rows - rows)
                self._memory.counts[name] = TableCount(
                    left, count.whole_at_s, count.took_s, count.marks
                )
        self._memory.gone[kind] = self._memory.gone.get(kind, 0) + next(iter(tables.values()), 0)

    async def renew(self) -> Look:
        """Look now.

        Raises:
            StoreError: If the database does not answer.
        """
        bytes_of: dict[str, int] = {}
        for name in query.table_names():
            last = self._memory.counts.get(name)
            count = await self._store.query(
                lambda session, name=name, last=last: query.count_table(session, name, last)
            )
            self._memory.counts[name] = count
            bytes_of[name] = await self._store.query(
                lambda session, name=name, count=count: query.table_bytes(session, name, count.rows)
            )
        database = await self._store.query(query.database_size)
        folder = self._foundation.settings.data_dir
        folders, disk = await asyncio.to_thread(_folders, folder)
        url = self._foundation.settings.resolved_database_url
        is_here = await asyncio.to_thread(_lies_on_disk_of, folder, url)
        spans = {
            kind.key: await self._store.query(
                lambda session, kind=kind: query.span(session, kind.tables[0], kind.at)
            )
            for kind in STORED_KINDS
            if kind.at
        }
        kinds = _kinds(self._memory.counts, _fitted(bytes_of, database), folders, spans)
        named = sum(one.bytes for one in kinds)
        all_bytes = database.used + sum(folders.values())
        look = Look(
            self._foundation.clock.now(),
            kinds,
            max(0, all_bytes - named),
            0 if is_here else database.used,
            database.free,
            disk.free,
            disk.total,
        )
        self._remember(look)
        self.look = look
        await self._store.write(self._save)
        await self._alarm(look)
        self._foundation.feed.mark("storage")
        return look

    def growth_bytes_per_day(self) -> float | None:
        """Return by how much all grows a day; ``None`` as long as that is not known."""
        before = self._before()
        if before is None or self.look is None:
            return None
        return (self.look.used_bytes - before.used_bytes) / _days(self.look.at - before.at)

    def growth_rows_per_day(self, kind: str) -> float | None:
        """Return how many rows of a kind come a day; ``None`` as long as that is not known."""
        before = self._before()
        if before is None or self.look is None or kind not in before.rows:
            return None
        return max(0.0, (self._ever()[kind] - before.rows[kind]) / _days(self.look.at - before.at))

    def full_in_days(self) -> float | None:
        """Return in how many days the data folder's disk is full, at the growth of what lies on it.

        ``None`` if that does not grow, or as long as it is not known.
        """
        before, look = self._before(), self.look
        if before is None or look is None or look.on_disk_bytes <= before.on_disk_bytes:
            return None
        growth = (look.on_disk_bytes - before.on_disk_bytes) / _days(look.at - before.at)
        inside = 0 if look.elsewhere_bytes else look.free_inside_bytes
        return (look.disk_free_bytes + inside) / growth

    def _ever(self) -> dict[str, int]:
        rows = {} if self.look is None else {one.key: one.rows for one in self.look.kinds}
        return {key: count + self._memory.gone.get(key, 0) for key, count in rows.items()}

    def _before(self) -> Mark | None:
        """Return the mark that growth is counted from."""
        if self.look is None:
            return None
        at = self.look.at
        usable = [one for one in self._memory.marks if one.at <= at - _GROWTH_LEAST]
        recent = [one for one in usable if one.at >= at - _GROWTH_OVER]
        return (recent or usable[-1:] or [None])[0]

    def _remember(self, look: Look) -> None:
        self.look = look
        marks = self._memory.marks
        if not marks or look.at - marks[-1].at >= _HISTORY_EVERY:
            marks.append(Mark(look.at, look.used_bytes, look.on_disk_bytes, self._ever()))
            del marks[:-_HISTORY_MAX]

    def _save(self, session: Session) -> None:
        put_setting(session, SETTING, _written(self._memory))

    async def _alarm(self, look: Look) -> None:
        current = await self._foundation.configurations.current("storage", None)
        within = current.value_as(StorageConfig).full_within_days
        left = self.full_in_days()
        if left is None or left > within:
            await self._foundation.alarms.clear(CAUSE)
            return
        free_gb = look.disk_free_bytes / 1e9
        unseen = " The database's own disk is not seen." if look.elsewhere_bytes else ""
        days = "within a day" if left < 1.0 else f"in about {left:.0f} days"
        await self._foundation.alarms.raise_(
            CAUSE,
            f"The disk of the station's data folder is full {days} at the growth of late; "
            f"{free_gb:.1f} GB are free.{unseen}",
            level="warning",
            action="See Settings, Sizes and retention: what may be thinned, moved or deleted.",
        )


def _days(span: timedelta) -> float:
    return span.total_seconds() / _DAY_S


@dataclass(frozen=True, slots=True)
class _Disk:
    free: int
    total: int


def _folders(data: Path) -> tuple[dict[str, int], _Disk]:
    """Return the bytes of each folder of the data folder, and those of the disk."""
    sizes: dict[str, int] = {}
    for folder in data.iterdir():
        if folder.is_dir() and not folder.is_symlink():
            sizes[folder.name] = _bytes_below(folder)
    usage = shutil.disk_usage(data)
    return sizes, _Disk(usage.free, usage.total)


def _lies_on_disk_of(data: Path, url: str) -> bool:
    """Tell whether a database is known to lie on the data folder's disk."""
    file = sqlite_file(url)
    return file is not None and file.resolve().parent.stat().st_dev == data.stat().st_dev


def _bytes_below(folder: Path) -> int:
    found = 0
    for place, _, names in os.walk(folder):
        for name in names:
            try:
                found += os.lstat(os.path.join(place, name)).st_size
            except OSError:
                continue  # It was removed meanwhile.
    return found


def _fitted(bytes_of: Mapping[str, int], database: DatabaseSize) -> dict[str, float]:
    """Return judged bytes of tables, made smaller where they are more than all that is used."""
    judged = sum(bytes_of.values())
    share = min(1.0, database.used / judged) if judged else 1.0
    return {name: size * share for name, size in bytes_of.items()}


def _kinds(
    counts: Mapping[str, TableCount],
    bytes_of: Mapping[str, float],
    folders: Mapping[str, int],
    spans: Mapping[str, tuple[datetime | None, datetime | None]],
) -> list[KindSize]:
    def size(kind: StoredKind) -> KindSize:
        in_tables = sum(bytes_of[name] for name in kind.tables)
        in_folders = sum(folders.get(name, 0) for name in kind.folders)
        rows = counts[kind.tables[0]].rows if kind.tables else 0
        return KindSize(
            kind.key, rows, round(in_tables) + in_folders, *spans.get(kind.key, (None, None))
        )

    return [size(kind) for kind in STORED_KINDS]


def _written(memory: _Memory) -> dict[str, Any]:
    marks = [{**asdict(one), "at": one.at.isoformat()} for one in memory.marks]
    counts = {name: asdict(one) for name, one in memory.counts.items()}
    return {"counts": counts, "gone": memory.gone, "marks": marks}


def _read(kept: Mapping[str, Any]) -> _Memory:
    marks = [
        Mark(
            datetime.fromisoformat(one["at"]), one["used_bytes"], one["on_disk_bytes"], one["rows"]
        )
        for one in kept["marks"]
        if "on_disk_bytes" in one
    ]
    counts = {name: TableCount(**one) for name, one in kept["counts"].items()}
    return _Memory(counts, dict(kept["gone"]), marks)
