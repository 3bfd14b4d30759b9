"""The robot's records: one compact message that says all that fits."""

from dataclasses import dataclass
from datetime import datetime
from enum import IntEnum

from robot_link.messages import (
    CommandNumber,
    OnboardPlanState,
    RobotId,
    Sample,
    StateReport,
    SystemId,
)
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.blob import TransferId

BEST_SIZES = (70, 205, 340)
"""Sizes that fill whole segments over the air."""


class TransferState(IntEnum):
    """What the robot says of a mission transfer."""

    RECEIVING = 0
    APPLIED = 1
    BAD_HASH = 2
    BAD_SCHEMA = 3
    REFUSED = 4


class Reason(IntEnum):
    """Why the robot refused a mission or gave up a plan, in one byte."""

    NONE = 0
    OTHER = 1
    MISSION_RUNS = 2
    COMING_UP = 3
    SURFACED_BY_COMMAND = 4

    @property
    def sentence(self) -> str:
        """Return the words, "" for NONE."""
        raise NotImplementedError

    @classmethod
    def of(cls, sentence: str) -> "Reason":
        """Return the reason that a robot's sentence says; OTHER for one that is not listed."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class TransferAck:
    """The robot's word on one transfer."""

    transfer_id: TransferId
    count: int
    received: frozenset[int]
    """Indices of the chunks that it holds or held."""
    state: TransferState
    reason: Reason = Reason.NONE


@dataclass(frozen=True, slots=True)
class CommandAnswer:
    """The robot's word on one command."""

    number: CommandNumber
    outcome: CommandOutcome


@dataclass(frozen=True, slots=True)
class ShortPlanReport:
    """The robot's word on the plan on board."""

    digits: str
    """First 16 hexadecimal digits of the plan's hash, "" without one."""
    state: OnboardPlanState
    leg: int
    legs: int
    energy_used: float
    reason: Reason = Reason.NONE


@dataclass(frozen=True, slots=True)
class MobileOriginatedContent:
    """All that one record says."""

    counter: int
    """Newer for each record of a robot."""
    state: StateReport | None = None
    plan: ShortPlanReport | None = None
    acks: tuple[TransferAck, ...] = ()
    answers: tuple[CommandAnswer, ...] = ()
    samples: tuple[Sample, ...] = ()
    """To ``compose``: the most telling first; as read: by log and number."""


def compose(
    content: MobileOriginatedContent, key: bytes, system: SystemId, max_bytes: int
) -> bytes:
    """Return one message of at most ``max_bytes`` that says as much of the content as fits.

    What proves a level comes first: acks, answers, state, plan; samples fill the rest.

    Args:
        content: What there is to say.
        key: The robot's key.
        system: The robot's MAVLink system id.
        max_bytes: Bytes that the operator allows; ``BEST_SIZES`` fill whole segments.

    Raises:
        ValueError: If ``max_bytes`` cannot hold a record at all, or a number is not finite.
    """
    raise NotImplementedError


def read_mobile_originated(
    data: bytes, key: bytes, system: SystemId, robot: RobotId, received_at: datetime
) -> MobileOriginatedContent:
    """Read a robot's record.

    Raises:
        WireError: If it is none of this robot.
    """
    raise NotImplementedError
