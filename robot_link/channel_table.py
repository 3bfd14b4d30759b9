"""What a robot measures, as it announces it: rows, their octets, pages, and tables put together.

A row of a table:

    u8      number of the channel on the wire
    u8      kind: 0 field, 1 housekeeping, 2 switch; bit 7: key and unit follow
    varint  time between two values, 0.1 s; 0 where it is not fixed
    u8, key, u8, unit    each its length and its text in UTF-8

Without key and unit they are those of the delivered channel of this number: so satellite records
have them. A table's version is made of all keys and units, and proves that both ends mean the same.
"""

import hashlib
from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime

from autonomy.channel import CHANNELS, ChannelCatalogue, ChannelKind
from autonomy.unit_text import is_same_unit
from robot_link.messages import LogId, RobotId
from robot_link.sample_log import SampleKey
from robot_link.satellite.octets import OctetReader, varint

_KINDS: tuple[ChannelKind, ...] = ("field", "housekeeping", "switch")
_HAS_TEXT = 0x80
_TENTHS = 10
_TEXT_MAX = 80
ROWS_MAX = 239
"""Numbers that a robot can give to channels."""
PAGES_MAX = 255
_UNDER_WAY = 4
"""Tables of one robot that may be incomplete at once."""


@dataclass(frozen=True, slots=True)
class TableRow:
    """One channel as its robot means it."""

    number: int
    """On the wire."""
    key: str
    unit: str
    kind: ChannelKind = "field"
    period_s: float = 0.0
    """Time between two values; 0 where it is not fixed."""

    @property
    def is_delivered(self) -> bool:
        """Whether key, unit and kind are those of the delivered channel of this number."""
        channel = CHANNELS.numbered(self.number)
        return channel is not None and (channel.key, channel.unit, channel.kind) == (
            self.key,
            self.unit,
            self.kind,
        )


@dataclass(frozen=True, slots=True)
class ChannelTable:
    """All channels of a robot.

    Raises:
        ValueError: If a number is given twice, or a row cannot travel.
    """

    rows: tuple[TableRow, ...]
    """By number."""

    def __post_init__(self) -> None:
        """Refuse what no robot can mean."""
        numbers = [row.number for row in self.rows]
        if numbers != sorted(set(numbers)):
            raise ValueError("each number of a table is given once, ascending")
        for row in self.rows:
            row_octets(row, is_short=False)

    @classmethod
    def of(cls, rows: Iterable[TableRow]) -> "ChannelTable":
        """Return the table of rows in any order."""
        return cls(tuple(sorted(rows, key=lambda row: row.number)))

    @property
    def version(self) -> int:
        """Names exactly this table, 32 bits, never 0."""
        octets = b"".join(row_octets(row, is_short=False) for row in self.rows)
        return int.from_bytes(hashlib.sha256(octets).digest()[:4], "big") or 1

    def row(self, number: int) -> TableRow | None:
        """Return the row of a number."""
        return next((row for row in self.rows if row.number == number), None)


@dataclass(frozen=True, slots=True)
class ChannelPage:
    """Some rows of the table of a robot, and from which measurement on it holds."""

    robot: RobotId
    version: int
    log: LogId
    sequence: int
    """The table holds for this number of the log and those behind it."""
    page: int
    pages: int
    rows: tuple[TableRow, ...]
    is_short: bool
    """Whether it came by satellite, where pages are cut otherwise."""
    measured_at: datetime
    """Since when the table holds, by the robot's clock."""
    received_at: datetime


@dataclass(frozen=True, slots=True)
class TableVersion:
    """By which table a robot measures; it says so more often than the table itself."""

    robot: RobotId
    version: int
    measured_at: datetime
    """When it said so."""
    received_at: datetime


@dataclass(frozen=True, slots=True)
class Announcement:
    """A whole table that a robot announced."""

    robot: RobotId
    table: ChannelTable
    since: SampleKey
    """The table holds for this measurement and those behind it."""
    since_at: datetime
    heard_at: datetime

    @property
    def version(self) -> str:
        """Version of the table as people read it."""
        return version_text(self.table.version)


def version_text(version: int) -> str:
    """Return a version as people read it."""
    return f"{version:08x}"


def row_octets(row: TableRow, *, is_short: bool) -> bytes:
    """Return the octets of a row.

    Args:
        row: What is announced.
        is_short: Whether a delivered channel travels without key and unit.

    Raises:
        ValueError: If its number, period or texts do not travel.
    """
    if not 0 < row.number <= ROWS_MAX:
        raise ValueError(f"number {row.number} of a channel does not travel")
    kind = _KINDS.index(row.kind)
    period = varint(round(row.period_s * _TENTHS))
    if is_short and row.is_delivered:
        return bytes([row.number, kind]) + period
    return bytes([row.number, kind | _HAS_TEXT]) + period + _text(row.key) + _text(row.unit)


def pages(table: ChannelTable, room: int, *, is_short: bool) -> list[bytes]:
    """Return the rows of a table in pages of at most ``room`` octets.

    Raises:
        ValueError: If a page has no room for one of the rows.
    """
    found = [b""]
    for row in table.rows:
        octets = row_octets(row, is_short=is_short)
        if len(octets) > room:
            raise ValueError(f"a page of {room} octets has no room for {row.key}")
        if len(found[-1]) + len(octets) > room:
            found.append(b"")
        found[-1] += octets
    return found


def short_rows(rows: Iterable[TableRow]) -> bytes:
    """Return the octets of a page by satellite."""
    return b"".join(row_octets(row, is_short=True) for row in rows)


def rows_of(octets: bytes) -> tuple[TableRow, ...]:
    """Read the rows of a page.

    Raises:
        ValueError: If they are none, or stand for a delivered channel that is not known here.
    """
    reader = OctetReader(octets)
    rows: list[TableRow] = []
    while not reader.is_at_end:
        number, word = reader.take(2)
        kind = word & ~_HAS_TEXT
        period_s = reader.varint() / _TENTHS
        if not 0 < number <= ROWS_MAX or kind >= len(_KINDS):
            raise ValueError("a row of a table of channels is none")
        if word & _HAS_TEXT:
            key, unit = _read_text(reader), _read_text(reader)
        else:
            channel = CHANNELS.numbered(number)
            if channel is None:
                raise ValueError(f"channel {number} is not delivered")
            key, unit = channel.key, channel.unit
        rows.append(TableRow(number, key, unit, _KINDS[kind], period_s))
    return tuple(rows)


def contradictions(table: ChannelTable, catalogue: ChannelCatalogue) -> dict[int, str]:
    """Return what a table says otherwise than the catalogue, one sentence a number."""
    found = {row.number: contradiction(row, catalogue) for row in table.rows}
    return {number: fault for number, fault in found.items() if fault}


def contradiction(row: TableRow, catalogue: ChannelCatalogue) -> str:
    """Return what a row says otherwise than the catalogue, "" where both agree."""
    channel = catalogue.numbered(row.number)
    if channel is None:
        return (
            f"channel {row.key} (number {row.number}, {row.unit}) is not in the catalogue: "
            "add it in Settings, Channels"
        )
    if channel.key != row.key:
        return f"number {row.number} is {row.key} to the robot and {channel.key} in the catalogue"
    if not is_same_unit(channel.unit, row.unit):
        return f"{channel.title} is told in {row.unit}; the catalogue has {channel.unit}"
    return ""


class TableAssembler:
    """Puts the pages of robots together, in whatever order and how often they come."""

    def __init__(self) -> None:
        self._parts: dict[RobotId, OrderedDict[tuple[object, ...], dict[int, ChannelPage]]] = {}

    def add(self, page: ChannelPage) -> ChannelTable | None:
        """Take a page; return the table once it is complete.

        Raises:
            ValueError: If the pages together are not the table that was announced.
        """
        under_way = self._parts.setdefault(page.robot, OrderedDict())
        name = (page.version, page.log, page.sequence, page.pages, page.is_short)
        parts = under_way.setdefault(name, {})
        parts[page.page] = page
        under_way.move_to_end(name)
        while len(under_way) > _UNDER_WAY:
            under_way.popitem(last=False)
        if len(parts) < page.pages:
            return None
        del under_way[name]
        table = ChannelTable.of(row for part in parts.values() for row in part.rows)
        if table.version != page.version:
            raise ValueError(
                f"the table of version {version_text(page.version)} as put together has"
                f" {version_text(table.version)}"
            )
        return table


def difference(before: ChannelTable, after: ChannelTable) -> str:
    """Return what changed from one table to the next, in words."""
    was = {row.number: row for row in before.rows}
    now = {row.number: row for row in after.rows}
    said = [f"{now[number].key} came" for number in now.keys() - was.keys()]
    said += [f"{was[number].key} went" for number in was.keys() - now.keys()]
    for number in was.keys() & now.keys():
        old, new = was[number], now[number]
        if (old.key, old.unit) != (new.key, new.unit):
            said.append(f"number {number} was {old.key} ({old.unit}), is {new.key} ({new.unit})")
        elif old.period_s != new.period_s:
            said.append(f"{new.key} every {new.period_s:g} s, before {old.period_s:g} s")
    return "; ".join(sorted(said)) or "nothing but its kinds"


def _text(text: str) -> bytes:
    octets = text.encode()
    if not 0 < len(octets) <= _TEXT_MAX:
        raise ValueError(f"a key or unit has 1 to {_TEXT_MAX} octets, not {len(octets)}")
    return bytes([len(octets)]) + octets


def _read_text(reader: OctetReader) -> str:
    length = reader.take(1)[0]
    if not 0 < length <= _TEXT_MAX:
        raise ValueError("the text of a row is too long, or missing")
    text = reader.take(length).decode()
    if not text.isprintable():
        raise ValueError("the text of a row cannot be printed")
    return text
