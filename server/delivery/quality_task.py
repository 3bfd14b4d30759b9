"""Judges a deployment by rules, in a worker process."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from db.engine import reading
from db.query.measured.quality import QualityStretch, packed_moments
from db.query.measured.samples import sampled_variables
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
    samples: int
    """Measurements that there are of the deployment."""
    seen: bytes
    """At which moments series had a value, packed."""


def run(wanted: Wanted, report: Report, is_cancelled: IsCancelled) -> QualityFound:
    """Judge all rows of a deployment.

    Raises:
        ValueError: If the rules flag so many stretches that they cannot be kept.
    """
    report((0.1, "Reading"))
    with reading(wanted.database_url) as session:
        found = judged(session, wanted, is_cancelled)
        record = wanted.deployment
        sampled = sampled_variables(
            session, record.robot, start=record.begun_at, end=record.last_at, log=record.log
        )
    report((0.8, "Summing up"))
    counts = {series: one.counts for series, one in found.judgements.items()}
    stretches = found.found()
    if len(stretches) > STRETCHES_MAX:
        raise ValueError(
            f"the rules flag {len(stretches)} stretches, more than {STRETCHES_MAX};"
            " they do not fit these data"
        )
    return QualityFound(
        rows=len(found.at_us),
        counts=counts,
        stretches=stretches,
        left_out=found.left_out,
        samples=sum(sampled.values()),
        seen=packed_moments(found.at_us, found.told),
    )
