"""The flags of quality that some values of a deployment have."""

from collections.abc import Sequence

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, IntArray
from autonomy.quality.flag import GOOD, UNKNOWN, FlagArray, og1_flags
from db.column import microseconds
from db.query.measured.quality import (
    ManualFlag,
    QualityRun,
    flag_spans,
    manual_flags,
    newest_quality_run,
    seen_moments,
)

_SERIES = {"depth_m": "depth"}
"""Series of quality that are called otherwise than their channels."""


def flags_at(session: Session, deployment: str, channel: str, at_us: IntArray) -> FlagArray | None:
    """Return the flags of OG1.0 of values of a channel, shape ``(n,)``; 0 without any control.

    A flag of a person counts before those of the newest run of rules, which says nothing of what
    came after it. ``None`` where nobody has run rules or set a flag.

    Args:
        session: A reading session.
        deployment: Id of the deployment that all values are of.
        channel: Key of the channel.
        at_us: Their moments, ascending, us since 1970, shape ``(n,)``.

    Raises:
        UnknownIdError: If there is no such deployment.
    """
    run, manual = newest_quality_run(session, deployment), manual_flags(session, deployment)
    if run is None and not manual:
        return None
    told = np.ones(len(at_us), dtype=np.bool_)
    return flags_of(session, run, manual, _SERIES.get(channel, channel), at_us, told)


def flags_of(
    session: Session,
    run: QualityRun | None,
    manual: Sequence[ManualFlag],
    series: str,
    at_us: IntArray,
    told: BoolArray,
) -> FlagArray:
    """Return the flags of OG1.0 of a series, shape ``(n,)``; 0 for what no rule and no person saw.

    Args:
        session: A reading session.
        run: The newest of the deployment.
        manual: What people flagged in it.
        series: Key of the series, as rules have it.
        at_us: Moments of rows, ascending, us since 1970, shape ``(n,)``.
        told: Which rows have a value, shape ``(n,)``.
    """
    qartod = np.full(len(at_us), UNKNOWN, dtype=np.int8)
    if run is not None and series in run.counts:
        seen = _seen(session, run, series, at_us, told)
        qartod[seen] = GOOD
        spans = flag_spans(session, run.key, series)
        begins = np.searchsorted(at_us, spans[:, 0], side="left")
        ends = np.searchsorted(at_us, spans[:, 1], side="right")
        for begin, end, flag in zip(begins, ends, spans[:, 2], strict=True):
            qartod[begin:end][seen[begin:end]] = flag
    flags = og1_flags(qartod)
    for one in manual:
        if one.series == series:
            begin = np.searchsorted(at_us, microseconds(one.first_at), side="left")
            end = np.searchsorted(at_us, microseconds(one.last_at), side="right")
            flags[begin:end] = one.flag
    return flags


def _seen(
    session: Session, run: QualityRun, series: str, at_us: IntArray, told: BoolArray
) -> BoolArray:
    """Return which rows have a value that the run saw, shape ``(n,)``.

    Of a run that did not keep it nothing is known, unless there are as many values now as it
    counted.
    """
    moments = seen_moments(session, run.key, series)
    if moments is not None:
        return np.isin(at_us, moments)
    before = told & (at_us <= microseconds(run.at))
    return before & (np.count_nonzero(before) == sum(run.counts[series]["all"].values()))
