"""What is kept of a robot when a recording comes in, and how the recording joins it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, cast

import numpy as np
from sqlalchemy import BigInteger, Table, bindparam, func, or_, select, type_coerce, update
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray, IntArray
from db.column import moment
from db.ingest import insert_new
from db.sample_ingest import NewSample, insert_samples, place_columns, take_out
from db.sample_tables import (
    COARSE_S,
    ChannelRow,
    RecoveredSample,
    SampleLog,
    SampleRollup,
    SampleRow,
    SampleRun,
)
from db.state_sums import sum_up_late
from db.tables import STATE_CHANNELS, Deployment, Event, StateRow
from robot_link.messages import STATE

BATCH_ROWS = 5_000
FLIGHT = tuple(channel.key for channel in STATE.channels if channel.recorded is not None)
_MM = 1e3
_NEAR_US = 1000


@dataclass(frozen=True, slots=True, eq=False)
class KnownSamples:
    """Kept measurements of one channel, ascending in time, shape ``(m,)`` each."""

    at_us: IntArray
    value: FloatArray
    position_ned: FloatArray
    """Shape ``(m, 3)``, m."""
    log_key: IntArray
    sequence: IntArray
    is_imported: IntArray
    """1 for those of recordings, 0 for telemetry, which is never taken out."""


def known_samples(
    session: Session, robot_key: int, channel: str, first_us: int, last_us: int
) -> KnownSamples:
    """Return what is kept of a channel between two moments; void recordings hold nothing."""
    at = type_coerce(SampleRow.measured_at, BigInteger)
    rows = session.execute(
        select(
            at,
            SampleRow.value,
            SampleRow.north_mm,
            SampleRow.east_mm,
            SampleRow.depth_mm,
            SampleRow.log_key,
            SampleRow.sequence,
            Deployment.key.is_not(None),
        )
        .join(SampleLog, SampleLog.key == SampleRow.log_key)
        .join(ChannelRow, ChannelRow.key == SampleRow.channel_key)
        .outerjoin(
            Deployment,
            (Deployment.robot_key == SampleLog.robot_key) & (Deployment.log == SampleLog.log),
        )
        .where(
            SampleRow.robot_key == robot_key,
            ChannelRow.name == channel,
            SampleRow.measured_at >= moment(first_us),
            SampleRow.measured_at <= moment(last_us),
            or_(Deployment.key.is_(None), Deployment.void_reason == ""),
        )
        .order_by(SampleRow.measured_at, SampleRow.log_key, SampleRow.sequence)
    ).all()
    numbers = np.array([row[1:5] for row in rows], dtype=np.float64).reshape(-1, 4)
    names = np.array([(row[0], row[5], row[6], row[7]) for row in rows], dtype=np.int64)
    names = names.reshape(-1, 4)
    return KnownSamples(
        names[:, 0], numbers[:, 0], numbers[:, 1:] / _MM, names[:, 1], names[:, 2], names[:, 3]
    )


def known_states(
    session: Session, robot_key: int, first_us: int, last_us: int
) -> tuple[IntArray, Mapping[str, FloatArray]]:
    """Return the moments of kept states, ascending, and what they told of the flight."""
    keys = [key for key in FLIGHT if key != "position_std_m"]
    rows = session.execute(
        select(
            type_coerce(StateRow.measured_at, BigInteger),
            *(STATE_CHANNELS[key] for key in keys),
        )
        .where(
            StateRow.robot_key == robot_key,
            StateRow.measured_at >= moment(first_us - _NEAR_US),
            StateRow.measured_at <= moment(last_us + _NEAR_US),
        )
        .order_by(StateRow.measured_at)
    ).all()
    at = np.array([row[0] for row in rows], dtype=np.int64)
    table = np.array([row[1:] for row in rows], dtype=np.float64).reshape(-1, len(keys))
    return at, {key: table[:, place] for place, key in enumerate(keys)}


def kept_mark(session: Session, robot_key: int, first_us: int, last_us: int) -> tuple[int, ...]:
    """Return what is another one after anything was kept of a robot between two moments.

    It reads sums alone. Measurements that telemetry brings are counted, and so are void recordings;
    what recordings and cards put in the place of others is told by events.
    """
    samples = session.scalar(
        select(func.coalesce(func.sum(SampleRollup.size), 0)).where(
            SampleRollup.robot_key == robot_key,
            SampleRollup.channel_key.in_(select(ChannelRow.key)),
            SampleRollup.length_s == COARSE_S,
            SampleRollup.stretch >= first_us // (COARSE_S * 1_000_000),
            SampleRollup.stretch <= last_us // (COARSE_S * 1_000_000),
        )
    )
    states = session.scalar(
        select(func.count())
        .select_from(StateRow)
        .where(
            StateRow.robot_key == robot_key,
            StateRow.measured_at >= moment(first_us),
            StateRow.measured_at <= moment(last_us),
        )
    )
    event = session.scalar(
        select(func.max(Event.cursor)).where(
            Event.robot_key == robot_key, Event.kind.startswith("deployment.")
        )
    )
    void = session.scalar(
        select(func.count())
        .select_from(Deployment)
        .where(Deployment.robot_key == robot_key, Deployment.void_reason != "")
    )
    return int(samples or 0), int(states or 0), int(event or 0), int(void or 0)


@dataclass(frozen=True, slots=True, eq=False)
class NewSamples:
    """Measurements of one channel that are to be kept, shape ``(n,)`` each."""

    channel: str
    at_us: IntArray
    value: FloatArray
    position_ned: FloatArray
    """Shape ``(n, 3)``, m."""


def add_samples(
    session: Session,
    robot_key: int,
    log: int,
    samples: NewSamples,
    received_us: int,
    go_on: Callable[[], None],
) -> None:
    """Add measurements to the log of a recording, behind what it has."""
    newest = session.scalar(
        select(func.max(SampleRun.last))
        .join(SampleLog, SampleLog.key == SampleRun.log_key)
        .where(SampleLog.robot_key == robot_key, SampleLog.log == log)
    )
    first, received_at = -1 if newest is None else newest, moment(received_us)
    for begin in range(0, len(samples.at_us), BATCH_ROWS):
        go_on()
        part = slice(begin, begin + BATCH_ROWS)
        columns = (samples.at_us[part], samples.value[part], samples.position_ned[part])
        rows = zip(*(column.tolist() for column in columns), strict=True)
        insert_samples(
            session,
            [
                NewSample(
                    robot_key, log, number, samples.channel, moment(at_us), received_at, value,
                    tuple(place), 0.0,
                )
                for number, (at_us, value, place) in enumerate(rows, start=first + begin + 1)
            ],
        )  # fmt: skip


def remove_samples(
    session: Session, robot_key: int, channel: str, known: KnownSamples, rows: IntArray
) -> None:
    """Take measurements of recordings out, for which a denser source has better ones."""
    channel_key = session.scalar(select(ChannelRow.key).where(ChannelRow.name == channel))
    take_out(
        session,
        [
            {
                "robot_key": robot_key,
                "channel_key": channel_key,
                "measured_at": moment(int(known.at_us[row])),
                "log_key": int(known.log_key[row]),
                "sequence": int(known.sequence[row]),
            }
            for row in rows.tolist()
        ],
    )


def add_states(
    session: Session,
    robot_key: int,
    rows: Sequence[Mapping[str, Any]],
    received_us: int,
    go_on: Callable[[], None],
) -> None:
    """Add states: ``at_us``, ``position_ned`` and ``flight``, what they tell of the flight."""
    received_at = moment(received_us)
    for begin in range(0, len(rows), BATCH_ROWS):
        go_on()
        states = [_state(robot_key, row, received_at) for row in rows[begin : begin + BATCH_ROWS]]
        insert_new(session, StateRow, states)
        _sum_up(session, robot_key, [state["measured_at"] for state in states])


def _sum_up(session: Session, robot_key: int, times: Sequence[datetime]) -> None:
    sum_up_late(session, [robot_key] * len(times), times)


def _state(robot_key: int, row: Mapping[str, Any], received_at: Any) -> dict[str, Any]:  # noqa: ANN401 - a moment
    north_m, east_m, depth_m = row["position_ned"]
    told = row["flight"]
    return {
        "robot_key": robot_key,
        "measured_at": moment(row["at_us"]),
        "received_at": received_at,
        "north_m": north_m,
        "east_m": east_m,
        "depth_m": depth_m,
        **{key: told.get(key) for key in FLIGHT},
        "position_std_m": told.get("position_std_m", 0.0),
        "has_fix": "position_std_m" in told,
    }


def complete_states(
    session: Session, robot_key: int, rows: Sequence[tuple[int, Mapping[str, float]]]
) -> None:
    """Tell states that are kept what they did not know: ``(at_us, flight)``; the rest stays."""
    keys = [key for key in FLIGHT if key != "position_std_m"]
    known = [{key: told.get(key) for key in keys} | {"at": moment(at)} for at, told in rows]
    if not known:
        return
    of = StateRow.__table__.c
    session.connection().execute(
        update(cast("Table", StateRow.__table__))
        .where(of.robot_key == robot_key, of.measured_at == bindparam("at"))
        .values({key: func.coalesce(of[key], bindparam(f"{key}_told")) for key in keys}),
        [{"at": row["at"], **{f"{key}_told": row[key] for key in keys}} for row in known],
    )
    _sum_up(session, robot_key, [moment(at) for at, _ in rows])


@dataclass(frozen=True, slots=True)
class Recovered:
    """Another word on a measurement that is kept: a second source's, or the card's."""

    log_key: int
    sequence: int
    at_us: int
    value: float
    position_ned: tuple[float, float, float]


def note_recovered(session: Session, rows: Sequence[Recovered], received_us: int) -> None:
    """Keep other words beside the measurements that they are about; the first one stays."""
    if rows:
        insert_new(
            session,
            RecoveredSample,
            [
                {
                    "log_key": row.log_key,
                    "sequence": row.sequence,
                    "measured_at": moment(row.at_us),
                    "value": row.value,
                    **place_columns(row.position_ned, 0.0),
                    "received_at": moment(received_us),
                }
                for row in rows
            ],
        )
