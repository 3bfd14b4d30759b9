"""Everything that a robot told in a deployment, one row for each moment, block by block.

States and the samples of each channel lie in tables of their own, each in order of time. They are
read side by side and merged, so that a deployment of any length takes the memory of one block.
"""

from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sqlalchemy import BigInteger, Integer, Select, func, null, select, type_coerce
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, FloatArray, IntArray
from db.map_tables import SmoothedSample
from db.query.fleet.deployments import DeploymentRecord
from db.query.fleet.robots import robot_key
from db.query.measured.samples import channel_key, is_smoothed
from db.sample_tables import RecoveredSample as Card
from db.sample_tables import SampleLog, SampleRow
from db.tables import STATE_CHANNELS, StateRow

ROWS_AT_ONCE = 8192
STATE_KEYS = (
    *("roll_rad", "pitch_rad", "heading_rad"),
    *("net_buoyancy_kg", "mass_position_m", "tail_rad", "battery_v"),
)
"""Channels of a state that rows carry beside the place."""
_PLACE = 4
"""Numbers of a place: north, east, depth and standard deviation."""
_MM, _UM = 1e3, 1e6


@dataclass(frozen=True, slots=True, eq=False)
class RowBlock:
    """Moments in a row, strictly ascending, shape ``(n,)`` each; NaN where nobody told."""

    measured_at_us: IntArray
    position_ned: FloatArray
    """Shape ``(n, 3)``, m: of a sample its own, smoothed where asked for, else the state's."""
    position_std_m: FloatArray
    is_smoothed: BoolArray
    has_fix: BoolArray
    mode: IntArray
    """``robot_link.messages.RobotMode``, -1 where no state told."""
    state: Mapping[str, FloatArray]
    """By the keys of ``STATE_KEYS``."""
    value: Mapping[str, FloatArray]
    """By channel."""
    left_out: int
    """Further measurements of a channel at a moment of which there is one already."""

    def __len__(self) -> int:
        return len(self.measured_at_us)


class _Stream:
    """Rows of one table in order of time, as arrays, read a part at a time."""

    def __init__(self, session: Session, statement: Select[*tuple[Any, ...]]) -> None:
        # by the connection: plain rows cost the ORM's loading of a session as much again
        found = session.connection().execute(
            statement, execution_options={"yield_per": ROWS_AT_ONCE}
        )
        self._parts: Iterator[Sequence[Sequence[Any]]] = iter(found.partitions())
        self.at_us: IntArray = np.empty(0, dtype=np.int64)
        self.numbers: FloatArray = np.empty((0, 0))
        self.is_over = False
        self.fill()

    def fill(self) -> None:
        """Read the next part once nothing is left."""
        if len(self.at_us) or self.is_over:
            return
        rows = next(self._parts, None)
        if rows is None:
            self.is_over = True
            return
        # a float holds whole microseconds up to the year 2255
        numbers = np.array([tuple(row) for row in rows], dtype=np.float64)
        self.at_us, self.numbers = numbers[:, 0].astype(np.int64), numbers[:, 1:]

    def take(self, until_us: int) -> tuple[IntArray, FloatArray]:
        """Take what is not later than a moment."""
        count = int(np.searchsorted(self.at_us, until_us, side="right"))
        taken = self.at_us[:count], self.numbers[:count]
        self.at_us, self.numbers = self.at_us[count:], self.numbers[count:]
        return taken


def iterate_rows(
    session: Session,
    deployment: DeploymentRecord,
    channels: Sequence[str],
    *,
    smoothed: bool,
) -> Generator[RowBlock]:
    """Yield the rows of a deployment in order of time.

    Args:
        session: A reading session, which sees one moment of the database throughout.
        deployment: One that has begun.
        channels: Keys of the sampled channels that rows carry.
        smoothed: Whether samples are where they were after all, not where the robot believed, and
            say what the robot's card says of them, where one was recovered.

    Raises:
        NotBegunError: If it has not begun.
    """
    states = _Stream(session, _state_rows(session, deployment))
    samples = [
        _Stream(session, _sample_rows(session, deployment, one, smoothed=smoothed))
        for one in channels
    ]
    carried: set[int] = set()
    while True:
        live = [one for one in (states, *samples) if len(one.at_us)]
        if not live:
            return
        until_us = min(int(one.at_us[-1]) for one in live)
        yield _merged(
            states.take(until_us), [one.take(until_us) for one in samples], channels, carried
        )
        for one in (states, *samples):
            one.fill()
        # a part may end between two measurements of one moment
        carried = {until_us}


def _merged(
    state: tuple[IntArray, FloatArray],
    samples: Sequence[tuple[IntArray, FloatArray]],
    channels: Sequence[str],
    done_us: set[int],
) -> RowBlock:
    parts = [state, *samples]
    fresh = [np.isin(at, list(done_us), invert=True) for at, _ in parts]
    parts = [(at[new], rows[new]) for (at, rows), new in zip(parts, fresh, strict=True)]
    left_out = sum(int(np.count_nonzero(~new)) for new in fresh)
    at_us = np.unique(np.concatenate([at for at, _ in parts]))
    count = len(at_us)
    place = np.full((count, _PLACE), np.nan)
    flags = np.zeros((count, 2), dtype=np.bool_)
    mode = np.full(count, -1, dtype=np.int64)
    told = np.full((count, len(STATE_KEYS)), np.nan)
    if len(parts[0][0]):
        rows = np.searchsorted(at_us, parts[0][0])
        numbers = parts[0][1]
        place[rows] = numbers[:, :_PLACE]
        flags[rows, 1] = numbers[:, _PLACE] == 1.0
        mode[rows] = np.where(np.isnan(numbers[:, 5]), -1, numbers[:, 5]).astype(np.int64)
        told[rows] = numbers[:, 6:]
    values: dict[str, FloatArray] = {}
    for key, (at, numbers) in zip(channels, parts[1:], strict=True):
        column = values[key] = np.full(count, np.nan)
        first_at, first = np.unique(at, return_index=True)
        left_out += len(at) - len(first_at)
        rows = np.searchsorted(at_us, first_at)
        if len(rows):
            column[rows] = numbers[first, 0]
            place[rows] = numbers[first, 1:5] / (_MM, _MM, _MM, _UM)
            flags[rows, 0] = numbers[first, 5] == 1.0
    return RowBlock(
        measured_at_us=at_us,
        position_ned=place[:, :3],
        position_std_m=place[:, 3],
        is_smoothed=flags[:, 0],
        has_fix=flags[:, 1],
        mode=mode,
        state={key: told[:, number] for number, key in enumerate(STATE_KEYS)},
        value=values,
        left_out=left_out,
    )


def _state_rows(session: Session, deployment: DeploymentRecord) -> Select[*tuple[Any, ...]]:
    at = StateRow.measured_at
    statement = select(
        type_coerce(at, BigInteger),
        *(StateRow.north_m, StateRow.east_m, StateRow.depth_m, StateRow.position_std_m),
        type_coerce(StateRow.has_fix, Integer),
        StateRow.mode,
        *(STATE_CHANNELS[key] for key in STATE_KEYS),
    ).where(StateRow.robot_key == robot_key(session, deployment.robot), at >= deployment.begun_at)
    if deployment.last_at is not None:
        statement = statement.where(at <= deployment.last_at)
    return statement.order_by(at)


def _sample_rows(
    session: Session, deployment: DeploymentRecord, channel: str, *, smoothed: bool
) -> Select[*tuple[Any, ...]]:
    at, better = SampleRow.measured_at, SmoothedSample
    own = (SampleRow.north_mm, SampleRow.east_mm, SampleRow.depth_mm, SampleRow.position_std_um)
    found = (better.north_mm, better.east_mm, better.depth_mm, better.position_std_um)
    card = (Card.north_mm, Card.east_mm, Card.depth_mm, Card.position_std_um)
    ways = zip(found, card, own, strict=True)
    place = [func.coalesce(*way) for way in ways] if smoothed else own
    value = func.coalesce(Card.value, SampleRow.value) if smoothed else SampleRow.value
    is_better = better.north_mm.is_not(None) if smoothed else null()
    statement = select(
        type_coerce(at, BigInteger), value, *place, type_coerce(is_better, Integer)
    ).where(
        SampleRow.robot_key == robot_key(session, deployment.robot),
        SampleRow.channel_key == channel_key(channel),
        at >= deployment.begun_at,
    )
    if smoothed:
        statement = statement.outerjoin(better, is_smoothed()).outerjoin(
            Card,
            (Card.log_key == SampleRow.log_key)
            & (Card.sequence == SampleRow.sequence)
            & Card.is_card,
        )
    if deployment.log is not None:
        statement = statement.join(SampleLog, SampleLog.key == SampleRow.log_key).where(
            SampleLog.log == deployment.log
        )
    if deployment.last_at is not None:
        statement = statement.where(at <= deployment.last_at)
    return statement.order_by(at, SampleRow.log_key, SampleRow.sequence)
