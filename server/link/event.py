"""What robots said, by whichever link it came.

Reports are told as soon as they are believed, with their rows on the way to the database; samples
once they are committed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from robot_link.messages import (
    CommandReport,
    PlanQueue,
    PlanReport,
    Sample,
    StateReport,
    UploadReport,
)
from robot_link.report import (
    ControlAsked,
    ControlReport,
    Detection,
    Reading,
    ReceiverReport,
    TargetReport,
)


@dataclass(frozen=True, slots=True)
class SamplesStored:
    """Measurements that are in the database or the raw journal: their robot may forget them."""

    samples: Sequence[Sample]
    """Believable; some may have been told before."""
    refused: Sequence[Sample]
    """Of these only the bytes are kept."""


@dataclass(frozen=True, slots=True)
class DetectionsStored:
    """Heard tags that are in the database or the raw journal: their robot may forget them."""

    detections: Sequence[Detection]
    """Believable; some may have been told before."""
    refused: Sequence[Detection]
    """Of these only the bytes are kept."""


@dataclass(frozen=True, slots=True)
class TelemetryBridged:
    """What is in the bridge journal while the database fails: its robot may forget it.

    ``SamplesStored`` and ``DetectionsStored`` tell of it once more when it is in the database.
    """

    samples: SamplesStored
    heard: DetectionsStored


@dataclass(frozen=True, slots=True)
class ReceiverReported:
    """A robot said how its tag receiver fares; believable."""

    report: ReceiverReport


@dataclass(frozen=True, slots=True)
class ReadingsStored:
    """Believable readings that are in the database."""

    readings: Sequence[Reading]


@dataclass(frozen=True, slots=True)
class ValuesStored:
    """States, samples or readings of a robot are in the database or the journal."""

    robot: str


@dataclass(frozen=True, slots=True)
class StateReported:
    """A robot said how it is; believable, and of one of ours."""

    report: StateReport
    is_prompt: bool
    """Whether it came as soon as the robot said it; not so by satellite."""


@dataclass(frozen=True, slots=True)
class PlanReported:
    """A robot said what becomes of the plan on board."""

    report: PlanReport
    is_prompt: bool = True
    """As of a state."""


@dataclass(frozen=True, slots=True)
class PlanQueueReported:
    """A robot said which plan waits behind the one on board, and how the one before ended."""

    queue: PlanQueue


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
class ControlReported:
    """A robot said which ground station controls it by MAVLink."""

    report: ControlReport


@dataclass(frozen=True, slots=True)
class ControlRequested:
    """Another ground station asks for a robot, or no more; the robot passed it on."""

    asked: ControlAsked


@dataclass(frozen=True, slots=True)
class RadiosChanged:
    """Robots got other radios: what waited for one may be sent."""
