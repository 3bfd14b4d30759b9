"""Flags of quality: what runs of rules found in deployments, and what people said of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from io import BytesIO
from typing import Any

import numpy as np
from sqlalchemy import BigInteger, insert, select, type_coerce
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, FloatArray, IntArray
from db.fault import StoreError, UnknownIdError
from db.identity import key_of, public_id
from db.quality_tables import ManualFlagRow, QualityRunRow, QualityStretchRow
from db.query.change import row_of
from db.query.fleet.deployments import DeploymentRecord, get_deployment
from db.record import same

OPEN_STATES = ("in_water", "recovered")
"""States in which flags may be set: nobody answers for the data yet."""
_FLAG = "flag"
_SERIES = "series:"
"""Before the key of a series, in what is kept of the moments that a run saw."""


class FlagStateError(StoreError):
    """The deployment is signed, or the flag was withdrawn already."""


@dataclass(frozen=True, slots=True)
class QualityStretch:
    """Values of a series in a row that have the same flag, which is not good."""

    series: str
    first_at: datetime
    last_at: datetime
    flag: int
    tests: str


@dataclass(frozen=True, slots=True)
class QualityRun:
    """One run of rules over a deployment."""

    key: int
    rules: Mapping[str, Any]
    sha256: str
    counts: Mapping[str, Any]
    rows: int
    samples: int | None
    """Measurements that there were; ``None`` of a run of before this was kept."""
    at: datetime
    by: str


@dataclass(frozen=True, slots=True)
class ManualFlag:
    """A flag that a person gave a stretch of time, both ends included."""

    id: str
    series: str
    first_at: datetime
    last_at: datetime
    flag: int
    reason: str
    at: datetime
    by: str


def add_quality_run(
    session: Session,
    deployment: str,
    *,
    rules: Mapping[str, Any],
    sha256: str,
    counts: Mapping[str, Any],
    rows: int,
    samples: int,
    seen: bytes,
    found: Sequence[QualityStretch],
    at: datetime,
    by: str,
) -> QualityRun:
    """Keep what a run found, and what it saw; what earlier ones found stays.

    Raises:
        UnknownIdError: If there is no such deployment.
    """
    get_deployment(session, deployment)
    row = QualityRunRow(
        deployment_key=key_of("deployment", deployment),
        rules=dict(rules),
        sha256=sha256,
        counts=dict(counts),
        rows=rows,
        samples=samples,
        seen=seen,
        at=at,
        by=by,
    )
    session.add(row)
    session.flush()
    if found:
        names = ("series", "first_at", "last_at", "flag", "tests")
        session.execute(
            insert(QualityStretchRow),
            [{"run_key": row.key, **{n: getattr(one, n) for n in names}} for one in found],
        )
    return same(QualityRun, row)


def newest_quality_run(
    session: Session, deployment: str, until: datetime | None = None
) -> QualityRun | None:
    """Return the run that counts, or that counted at a moment; ``None`` before the first."""
    runs = select(QualityRunRow).where(
        QualityRunRow.deployment_key == key_of("deployment", deployment)
    )
    if until is not None:
        runs = runs.where(QualityRunRow.at <= until)
    row = session.scalar(runs.order_by(QualityRunRow.key.desc()).limit(1))
    return None if row is None else same(QualityRun, row)


def quality_stretches(
    session: Session, run: int, *, least: int, limit: int
) -> list[QualityStretch]:
    """Return what a run found with at least this flag, in order of series and time."""
    rows = session.scalars(
        select(QualityStretchRow)
        .where(QualityStretchRow.run_key == run, QualityStretchRow.flag >= least)
        .order_by(QualityStretchRow.series, QualityStretchRow.first_at)
        .limit(limit)
    )
    return [same(QualityStretch, row) for row in rows]


def flag_spans(session: Session, run: int, series: str) -> FloatArray:
    """Return first and last moment, us, and flag of what a run found in a series, shape ``(n, 3)``.

    Whole microseconds of this age are exact in a float.
    """
    rows = session.execute(
        select(
            type_coerce(QualityStretchRow.first_at, BigInteger),
            type_coerce(QualityStretchRow.last_at, BigInteger),
            QualityStretchRow.flag,
        )
        .where(QualityStretchRow.run_key == run, QualityStretchRow.series == series)
        .order_by(QualityStretchRow.first_at)
    )
    return np.array([tuple(row) for row in rows], dtype=np.float64).reshape(-1, 3)


def packed_moments(at_us: IntArray, told: Mapping[str, BoolArray]) -> bytes:
    """Return the moments at which series have a value, for ``add_quality_run``.

    A moment takes one to three bytes: as the time since the one before, and a bit for each series,
    deflated.

    Args:
        at_us: Strictly ascending, shape ``(n,)``.
        told: Whether there is a value, by series, shape ``(n,)`` each.
    """
    file = BytesIO()
    bits: dict[str, Any] = {f"{_SERIES}{key}": np.packbits(one) for key, one in told.items()}
    np.savez_compressed(file, at=np.diff(at_us, prepend=np.int64(0)), **bits)
    return file.getvalue()


def seen_moments(session: Session, run: int, series: str) -> IntArray | None:
    """Return the moments at which a run saw a value of a series, ascending.

    ``None`` of a run of before they were kept.
    """
    packed = session.scalar(select(QualityRunRow.seen).where(QualityRunRow.key == run))
    if packed is None:
        return None
    with np.load(BytesIO(packed), allow_pickle=False) as arrays:
        name = f"{_SERIES}{series}"
        if name not in arrays:
            return np.empty(0, dtype=np.int64)
        at_us = np.cumsum(arrays["at"])
        return at_us[np.unpackbits(arrays[name], count=len(at_us)).astype(np.bool_)]


def add_manual_flag(
    session: Session,
    deployment: str,
    *,
    series: str,
    first_at: datetime,
    last_at: datetime,
    flag: int,
    reason: str,
    at: datetime,
    by: str,
) -> ManualFlag:
    """Give a stretch of time a flag, which counts before any test and any earlier flag.

    Raises:
        UnknownIdError: If there is no such deployment.
        FlagStateError: If the deployment is not open.
    """
    _open(session, deployment)
    row = ManualFlagRow(
        deployment_key=key_of("deployment", deployment),
        series=series,
        first_at=first_at,
        last_at=last_at,
        flag=flag,
        reason=reason,
        at=at,
        by=by,
        withdrawn_at=None,
        withdrawn_by=None,
    )
    session.add(row)
    session.flush()
    return _record(row)


def withdraw_manual_flag(
    session: Session, deployment: str, flag: str, at: datetime, by: str
) -> ManualFlag:
    """Let a flag count no more; it is kept.

    Raises:
        UnknownIdError: If the deployment has no such flag.
        FlagStateError: If the deployment is not open, or the flag was withdrawn already.
    """
    _open(session, deployment)
    row = row_of(session, ManualFlagRow, _FLAG, flag)
    if row.deployment_key != key_of("deployment", deployment):
        raise UnknownIdError(_FLAG, flag)
    if row.withdrawn_at is not None:
        raise FlagStateError(f"{flag} was withdrawn already, by {row.withdrawn_by}.")
    row.withdrawn_at, row.withdrawn_by = at, by
    session.flush()
    return _record(row)


def manual_flags(session: Session, deployment: str) -> list[ManualFlag]:
    """Return the flags that count, in the order in which they were set: later ones win."""
    rows = session.scalars(
        select(ManualFlagRow)
        .where(
            ManualFlagRow.deployment_key == key_of("deployment", deployment),
            ManualFlagRow.withdrawn_at.is_(None),
        )
        .order_by(ManualFlagRow.key)
    )
    return [_record(row) for row in rows]


def _open(session: Session, deployment: str) -> DeploymentRecord:
    record = get_deployment(session, deployment)
    if record.void_reason or record.state not in OPEN_STATES:
        state = "void" if record.void_reason else record.state.replace("_", " ")
        raise FlagStateError(f"{deployment} is {state}; its flags are changed once it is reopened.")
    return record


def _record(row: ManualFlagRow) -> ManualFlag:
    return same(ManualFlag, row, id=public_id(_FLAG, row.key))
