"""What is kept of the measurements on a robot's card, by the numbers that the robot gave them."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from sqlalchemy import BigInteger, ColumnElement, select, type_coerce
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray, IntArray
from db.column import moment
from db.ingest import receiver_name
from db.sample_ingest import place_columns, unclaimed, upsert
from db.sample_tables import ChannelRow, RecoveredSample, SampleLog, SampleRow
from db.tables import Robot
from db.tag_tables import DetectionRow
from robot_link.messages import PositionNed

BATCH_ROWS = 5_000
_MARGIN_US = 3_600_000_000


@dataclass(frozen=True, slots=True, eq=False)
class NumberedSamples:
    """Kept measurements of one log, ascending in their numbers, shape ``(m,)`` each."""

    log_key: int
    sequence: IntArray
    at_us: IntArray
    value: FloatArray
    position_ned: FloatArray
    """Shape ``(m, 3)``, m."""
    channel: Sequence[str]


@dataclass(frozen=True, slots=True)
class CardWord:
    """What a card says of a measurement that is kept."""

    log_key: int
    sequence: int
    measured_at: datetime
    value: float
    position_ned: PositionNed
    position_std_m: float


def numbered_samples(
    session: Session, robot_key: int, log: int, numbers: Sequence[int], first_us: int, last_us: int
) -> NumberedSamples | None:
    """Return what is kept of some numbers of a log of a robot; None if nothing of the log is.

    Measurements are looked for near their own time first. Only where a number that is kept is not
    found so (the robot's clock was wrong, and the station dated them) all of the robot's are read.

    Args:
        session: A session.
        robot_key: The robot.
        log: The log.
        numbers: Ascending.
        first_us: When the first of them was measured, microseconds.
        last_us: When the last was.
    """
    log_key = session.scalar(
        select(SampleLog.key).where(SampleLog.robot_key == robot_key, SampleLog.log == log)
    )
    if log_key is None:
        return None
    kept = len(numbers) - len(unclaimed(session, log_key, numbers))
    of_time = (
        SampleRow.measured_at >= moment(first_us - _MARGIN_US),
        SampleRow.measured_at <= moment(last_us + _MARGIN_US),
    )
    wanted = np.asarray(numbers, dtype=np.int64)
    found = _numbered(session, robot_key, log_key, of_time)
    if int(np.isin(wanted, found.sequence).sum()) < kept:
        found = _numbered(session, robot_key, log_key, ())
    return found


def _numbered(
    session: Session, robot_key: int, log_key: int, of_time: Sequence[ColumnElement[bool]]
) -> NumberedSamples:
    rows = session.execute(
        select(
            SampleRow.sequence,
            type_coerce(SampleRow.measured_at, BigInteger),
            SampleRow.value,
            SampleRow.north_mm,
            SampleRow.east_mm,
            SampleRow.depth_mm,
            ChannelRow.name,
        )
        .join(ChannelRow, ChannelRow.key == SampleRow.channel_key)
        .where(
            SampleRow.robot_key == robot_key,
            SampleRow.log_key == log_key,
            *of_time,
        )
        .order_by(SampleRow.sequence)
    ).all()
    names = np.array([row[:2] for row in rows], dtype=np.int64).reshape(-1, 2)
    numbers = np.array([row[2:6] for row in rows], dtype=np.float64).reshape(-1, 4)
    return NumberedSamples(
        log_key,
        names[:, 0],
        names[:, 1],
        numbers[:, 0],
        numbers[:, 1:] / 1e3,
        [row[6] for row in rows],
    )


def robots_of_log(session: Session, log: int) -> list[str]:
    """Return the ids of the robots of which a log of this number is known."""
    statement = (
        select(Robot.id)
        .join(SampleLog, SampleLog.robot_key == Robot.key)
        .where(SampleLog.log == log)
        .order_by(Robot.id)
    )
    return [str(one) for one in session.scalars(statement)]


def keep_card_words(session: Session, words: Sequence[CardWord], received_at: datetime) -> None:
    """Keep what a card says beside what came first; it takes the place of a second file's word."""
    statement = upsert(session, RecoveredSample)
    columns = ("measured_at", "value", "north_mm", "east_mm", "depth_mm", "position_std_um")
    told = {name: statement.excluded[name] for name in (*columns, "received_at", "is_card")}
    for begin in range(0, len(words), BATCH_ROWS):
        session.execute(
            statement.on_conflict_do_update(index_elements=["log_key", "sequence"], set_=told),
            [
                {
                    "log_key": one.log_key,
                    "sequence": one.sequence,
                    "measured_at": one.measured_at,
                    "value": one.value,
                    **place_columns(one.position_ned, one.position_std_m),
                    "received_at": received_at,
                    "is_card": True,
                }
                for one in words[begin : begin + BATCH_ROWS]
            ],
        )


DetectionName = tuple[datetime, str, str]
"""When, which tag, and on which receiver: the same transmission is kept once."""


def known_detections(
    session: Session, robot_key: int, first: datetime, last: datetime
) -> Collection[DetectionName]:
    """Return the names of the detections that are kept of a stretch of time."""
    rows = session.execute(
        select(DetectionRow.measured_at, DetectionRow.tag, DetectionRow.receiver).where(
            DetectionRow.robot_key == robot_key,
            DetectionRow.measured_at >= first,
            DetectionRow.measured_at <= last,
        )
    )
    return {(row[0], row[1], row[2]) for row in rows}


def detection_name(measured_at: datetime, tag: str, receiver: int) -> DetectionName:
    """Return the name of a detection on a robot's own receiver."""
    return measured_at, tag, receiver_name(receiver)
