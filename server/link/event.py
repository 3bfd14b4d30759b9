"""What robots said, by whichever link it came.

Reports are told as soon as they are believed, with their rows on the way to the database; samples
once they are committed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from robot_link.messages import CommandReport, PlanReport, Sample, UploadReport
from robot_link.report import TargetReport


@dataclass(frozen=True, slots=True)
class SamplesStored:
    """Measurements that are in the database or the journal: their robot may forget them."""

    samples: Sequence[Sample]
    """Believable; some may have been told before."""
    refused: Sequence[Sample]
    """Of these only the bytes are kept."""


@dataclass(frozen=True, slots=True)
class ValuesStored:
    """States or samples of a robot are in the database or the journal."""

    robot: str


@dataclass(frozen=True, slots=True)
class PlanReported:
    """A robot said what becomes of the plan on board."""

    report: PlanReport


@dataclass(frozen=True, slots=True)
class TargetReported:
    """A robot said how it holds its target; believable."""

    report: TargetReport


@dataclass(frozen=True, slots=True)
class UploadReported:
    """A link or a robot said how far an upload is."""

    report: UploadReport


@dataclass(frozen=True, slots=True)
class CommandReported:
    """A link or a robot proved a level of a command."""

    report: CommandReport


@dataclass(frozen=True, slots=True)
class RadiosChanged:
    """Robots got other radios: what waited for one may be sent."""
