"""Columns of imported files that are no channel: kept with their own names and units."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from sqlalchemy import select
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray, IntArray
from db.column import moment
from db.fault import UnknownIdError
from db.identity import key_of, public_id
from db.query.change import row_of
from db.sample_tables import OtherSeries
from db.tables import Deployment

_SERIES, _DEPLOYMENT = "series", "deployment"


@dataclass(frozen=True, slots=True)
class OtherSeriesRecord:
    """What is known of a series without its values."""

    id: str
    name: str
    unit: str
    count: int
    first_at: datetime
    last_at: datetime
    least: float
    greatest: float


def add_other_series(
    session: Session, deployment: str, *, name: str, unit: str, at_us: IntArray, value: FloatArray
) -> None:
    """Keep the finite values of a column whose moments its series does not have yet.

    Args:
        session: A session.
        deployment: Id of the deployment that the rows belong to.
        name: As in the file.
        unit: As a person confirmed it.
        at_us: Ascending, shape ``(n,)``, microseconds.
        value: Shape ``(n,)``, NaN where a row does not tell.

    Raises:
        UnknownIdError: If there is no such deployment.
    """
    key = row_of(session, Deployment, _DEPLOYMENT, deployment).key
    known = session.scalar(
        select(OtherSeries).where(
            OtherSeries.deployment_key == key, OtherSeries.name == name, OtherSeries.unit == unit
        )
    )
    told = np.isfinite(value)
    at_us, value = at_us[told], value[told]
    if known is not None:
        was_us, was = _unpacked(known.data)
        new = np.isin(at_us, was_us, invert=True)
        at_us, value = np.append(was_us, at_us[new]), np.append(was, value[new])
        order = np.argsort(at_us, kind="stable")
        at_us, value = at_us[order], value[order]
    if not len(at_us):
        return
    row = known or OtherSeries(deployment_key=key, name=name, unit=unit)
    row.count, row.data = len(at_us), _packed(at_us, value)
    row.first_at, row.last_at = moment(int(at_us[0])), moment(int(at_us[-1]))
    row.least, row.greatest = float(value.min()), float(value.max())
    session.add(row)
    session.flush()


def list_other_series(session: Session, deployment: str) -> Sequence[OtherSeriesRecord]:
    """Return the series of a deployment by name.

    Raises:
        UnknownIdError: If there is no such deployment.
    """
    key = row_of(session, Deployment, _DEPLOYMENT, deployment).key
    statement = select(OtherSeries).where(OtherSeries.deployment_key == key)
    found = session.scalars(statement.order_by(OtherSeries.name, OtherSeries.key))
    return [_record(one) for one in found]


def other_values(
    session: Session, deployment: str, series: str
) -> tuple[OtherSeriesRecord, IntArray, FloatArray]:
    """Return a series, the moments of its values in microseconds, ascending, and the values.

    Raises:
        UnknownIdError: If the deployment has no such series.
    """
    wanted = key_of(_DEPLOYMENT, deployment), key_of(_SERIES, series)
    row = session.scalar(
        select(OtherSeries).where(
            OtherSeries.deployment_key == wanted[0], OtherSeries.key == wanted[1]
        )
    )
    if row is None:
        raise UnknownIdError(_SERIES, series)
    return _record(row), *_unpacked(row.data)


def _record(row: OtherSeries) -> OtherSeriesRecord:
    return OtherSeriesRecord(
        public_id(_SERIES, row.key),
        row.name,
        row.unit,
        row.count,
        row.first_at,
        row.last_at,
        row.least,
        row.greatest,
    )


def _packed(at_us: IntArray, value: FloatArray) -> bytes:
    data = io.BytesIO()
    np.savez_compressed(data, at_us=at_us, value=value)
    return data.getvalue()


def _unpacked(data: bytes) -> tuple[IntArray, FloatArray]:
    with np.load(io.BytesIO(data), allow_pickle=False) as kept:
        return kept["at_us"], kept["value"]
