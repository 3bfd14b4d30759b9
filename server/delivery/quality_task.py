"""Judges a deployment by rules, in a worker process."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from db.engine import reading
from db.query.measured.quality import QualityStretch
from server.base.worker import IsCancelled, Report
from server.delivery.judged import Wanted, judged

TASK = f"{__name__}:run"
STRETCHES_MAX = 200_000
"""A rule that flags more stretches than this fits the data so badly that no one reads them."""


@dataclass(frozen=True, slots=True)
class QualityFound:
    """What a run found."""

    rows: int
    counts: Mapping[str, Mapping[str, Mapping[str, int]]]
    """How many values have which flag, by series and test."""
    stretches: Sequence[QualityStretch]
    left_out: int


def run(wanted: Wanted, report: Report, is_cancelled: IsCancelled) -> QualityFound:
    """Judge all rows of a deployment.

    Raises:
        ValueError: If the rules flag so many stretches that they cannot be kept.
    """
    report((0.1, "Reading"))
    with reading(wanted.database_url) as session:
        found = judged(session, wanted, is_cancelled)
    report((0.8, "Summing up"))
    counts = {series: one.counts for series, one in found.judgements.items()}
    stretches = found.found()
    if len(stretches) > STRETCHES_MAX:
        raise ValueError(
            f"the rules flag {len(stretches)} stretches, more than {STRETCHES_MAX};"
            " they do not fit these data"
        )
    return QualityFound(len(found.at_us), counts, stretches, found.left_out)
