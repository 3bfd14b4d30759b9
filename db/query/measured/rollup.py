"""Counting and finding extremes of millions of values by the stretches that were summed up."""

from collections.abc import Generator
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import BigInteger, ColumnElement, func, select, type_coerce
from sqlalchemy.orm import Session

from db.column import microseconds
from db.sample_tables import (
    COARSE_S,
    FINE_S,
    ChannelRow,
    ReadingRollup,
    ReadingRow,
    SampleRollup,
    SampleRow,
)
from db.state_sums import StateRollup

SECOND_US = 1_000_000
AnyRollup = SampleRollup | ReadingRollup | StateRollup
_FAR_US = 50_000_000 * COARSE_S * SECOND_US
"""Whole stretches from the epoch, and beyond every sample."""


@dataclass(frozen=True, slots=True)
class Piece:
    """A part of a range of time: whole stretches of one length, or what is shorter than any."""

    length_s: int
    """0 for what must be read value by value."""
    begin_us: int
    end_us: int
    """Not included."""

    def holds(self, rollup: type[AnyRollup]) -> list[ColumnElement[bool]]:
        """Return what holds for the stretches of this piece."""
        length_us = self.length_s * SECOND_US
        return [
            rollup.length_s == self.length_s,
            rollup.stretch >= self.begin_us // length_us,
            rollup.stretch < self.end_us // length_us,
        ]


def pieces(
    begin_us: int, end_us: int, lengths_s: tuple[int, ...] = (COARSE_S, FINE_S)
) -> Generator[Piece]:
    """Cut a range of time into the longest whole stretches, in order; the end is not included."""
    if begin_us >= end_us:
        return
    if not lengths_s:
        yield Piece(0, begin_us, end_us)
        return
    length_us = lengths_s[0] * SECOND_US
    first, last = -(-begin_us // length_us) * length_us, end_us // length_us * length_us
    if first >= last:
        yield from pieces(begin_us, end_us, lengths_s[1:])
        return
    yield from pieces(begin_us, first, lengths_s[1:])
    yield Piece(lengths_s[0], first, last)
    yield from pieces(last, end_us, lengths_s[1:])


def counts(
    session: Session,
    table: type[SampleRow | ReadingRow],
    robot_key: int,
    start: datetime | None = None,
    end: datetime | None = None,
) -> dict[str, int]:
    """Return how many values of each channel a robot has, both ends of the time included.

    At most the values of two of the shortest stretches are counted one by one. Channels are named
    one by one in both tables: each is one range of their own order.
    """
    begin_us = -_FAR_US if start is None else microseconds(start)
    end_us = _FAR_US if end is None else microseconds(end) + 1
    rollup = SampleRollup if table is SampleRow else ReadingRollup
    at = type_coerce(table.measured_at, BigInteger)
    found: dict[str, int] = {}
    for piece in pieces(begin_us, end_us):
        if piece.length_s:
            source, number = rollup, func.sum(rollup.size)
            where = [rollup.robot_key == robot_key, *piece.holds(rollup)]
            where.append(rollup.channel_key.in_(select(ChannelRow.key)))
        else:
            source, number = table, func.count()
            where = [
                table.robot_key == robot_key,
                table.channel_key.in_(select(ChannelRow.key)),
                at >= piece.begin_us,
                at < piece.end_us,
            ]
        statement = (
            select(ChannelRow.name, number)
            .join(source, source.channel_key == ChannelRow.key)
            .where(*where)
            .group_by(ChannelRow.name)
        )
        for name, size in session.execute(statement):
            found[name] = found.get(name, 0) + int(size)
    return found
