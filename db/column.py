"""Column types that mean the same in SQLite and in PostgreSQL."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from sqlalchemy import BigInteger, Dialect
from sqlalchemy.types import TypeDecorator

from autonomy.arrays import FloatArray

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def microseconds(moment: datetime) -> int:
    """Return whole microseconds from the epoch to an aware moment.

    Raises:
        ValueError: If the moment carries no time zone.
    """
    if moment.tzinfo is None:
        raise ValueError("a stored time needs its time zone")
    return (moment - EPOCH) // timedelta(microseconds=1)


def moment(value: int) -> datetime:
    """Return the aware UTC moment of a number of microseconds from the epoch."""
    return EPOCH + timedelta(microseconds=value)


def moments(values: Sequence[int] | FloatArray) -> list[datetime]:
    """Return ``moment`` of each of many numbers, in a tenth of the time.

    A float holds whole microseconds exactly for another two hundred years.
    """
    naive: list[datetime] = np.asarray(values, np.int64).astype("datetime64[us]").tolist()
    return [one.replace(tzinfo=UTC) for one in naive]


class Utc(TypeDecorator[datetime]):
    """An aware UTC moment, kept as whole microseconds so that ranges and buckets are integers."""

    impl = BigInteger
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> int | None:
        """Turn a moment into what the table keeps."""
        del dialect
        return None if value is None else microseconds(value)

    def process_result_value(self, value: Any | None, dialect: Dialect) -> datetime | None:  # noqa: ANN401 - the driver's value
        """Turn what the table keeps into a moment."""
        del dialect
        return None if value is None else moment(int(value))
