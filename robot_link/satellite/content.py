"""What a robot's record says, as values."""

from dataclasses import dataclass, field
from enum import IntEnum

from robot_link.messages import (
    SURFACED_BY_COMMAND,
    CommandNumber,
    OnboardPlanState,
    Sample,
    StateReport,
)
from robot_link.report import CurrentReport, Detection, TargetReport
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.blob import TransferId
from robot_link.satellite.channel_code import ChannelPart


class TransferState(IntEnum):
    """What the robot says of a mission transfer."""

    RECEIVING = 0
    APPLIED = 1
    BAD_HASH = 2
    BAD_SCHEMA = 3
    REFUSED = 4


class Reason(IntEnum):
    """Why the robot refused a mission or gave up a plan, in five bits."""

    NONE = 0
    OTHER = 1
    MISSION_RUNS = 2
    COMING_UP = 3
    SURFACED_BY_COMMAND = 4
    TIMEOUT = 5
    BATTERY = 6
    UNCERTAIN = 7
    FLOOR = 8
    SHORE = 9
    NO_LEGS = 10
    LEAVES_WATER = 11
    NO_SPEED = 12
    TRIM = 13
    WITHDRAWN = 14
    TARGET_LOST = 15
    TARGET_FASTER = 16
    LEFT_WATER = 17
    TARGET_SILENT = 18
    NEXT_WAITS = 19
    """Of a mission that came in whole: it waits behind the plan being flown, for START."""
    NEXT_STARTS = 20
    """Of such a mission: it begins at the next surfacing."""
    RULE = 21
    """Of a dive that ended early."""

    @property
    def sentence(self) -> str:
        """Return the words, "" for NONE."""
        return "" if self is Reason.NONE else _WORDS[self][1]

    @classmethod
    def of(cls, sentence: str) -> "Reason":
        """Return the reason that a robot's sentence says; OTHER for one that is not listed."""
        if not sentence:
            return cls.NONE
        return next(reason for reason, (mark, _) in _WORDS.items() if mark in sentence)


_WORDS = {
    Reason.RULE: ("by rule", "brought up by rule"),
    Reason.MISSION_RUNS: (
        "a mission is running",
        "a mission is running: wait for its end, or surface the robot",
    ),
    Reason.COMING_UP: ("coming up", "the robot is coming up"),
    Reason.SURFACED_BY_COMMAND: (SURFACED_BY_COMMAND, SURFACED_BY_COMMAND),
    Reason.TIMEOUT: ("the mission took longer", "the mission took longer than it may"),
    Reason.BATTERY: ("the battery is below", "the battery is below its reserve"),
    Reason.UNCERTAIN: ("position is too uncertain", "the position is too uncertain"),
    Reason.FLOOR: ("the floor is near", "the floor is near"),
    Reason.SHORE: ("the shore is near", "a wall or the shore is near"),
    Reason.NO_LEGS: ("no legs", "the plan has no legs"),
    Reason.LEAVES_WATER: ("leaves the water", "a leg leaves the water"),
    Reason.NO_SPEED: ("no speed", "a leg has no speed"),
    Reason.TRIM: ("trim", "the trim is more than the robot's limits allow"),
    Reason.TARGET_LOST: ("track lost", "track lost for too long"),
    Reason.TARGET_SILENT: ("no range of the target", "no range of the target was heard"),
    Reason.TARGET_FASTER: ("target is faster", "the target is faster than the robot may swim"),
    Reason.LEFT_WATER: ("left the water", "the robot left the water that it was to stay in"),
    Reason.NEXT_WAITS: ("waits behind", "it waits behind the plan being flown, for START"),
    Reason.NEXT_STARTS: ("begins at the next surfacing", "it begins at the next surfacing"),
    Reason.WITHDRAWN: (
        "withdrawn",
        "it was withdrawn, or the robot was told to surface after it was sent",
    ),
    Reason.OTHER: ("", "a reason that the robot can only tell by radio"),
}
"""What tells a robot's sentence, the last of them any; and what is said of it ashore: numbers and
names within it do not travel."""


@dataclass(frozen=True, slots=True)
class TransferAck:
    """The robot's word on one transfer."""

    transfer_id: TransferId
    count: int
    received: frozenset[int]
    """Indices of the chunks that it holds or held."""
    state: TransferState
    reason: Reason = Reason.NONE
    sending: int | None = None
    """Of a last word: ``sending_of`` the counter that it answers, for the same mission may be sent
    again. None while receiving, and where any sending is meant."""


def waiting_ack(transfer_id: TransferId, count: int, *, starts: bool) -> TransferAck:
    """Return the word on a mission that came in whole and waits behind the plan being flown.

    It is a word on one that is being received: a station that knows of no waiting plans takes it
    for that, and hears of its end when it comes on board.
    """
    reason = Reason.NEXT_STARTS if starts else Reason.NEXT_WAITS
    whole = frozenset(range(count))
    return TransferAck(transfer_id, count, whole, TransferState.RECEIVING, reason)


def is_waiting(ack: TransferAck) -> bool:
    """Tell whether a word says that the mission waits behind the plan being flown."""
    is_coming = ack.state is TransferState.RECEIVING
    return is_coming and ack.reason in (Reason.NEXT_WAITS, Reason.NEXT_STARTS)


def sending_of(counter: int) -> int:
    """Return the one byte by which a last word names the sending that it answers."""
    return counter & 0xFF


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
    target: TargetReport | None = None
    """What it knows of its target; goes with the state alone, and without the second hypothesis."""
    current: CurrentReport | None = None
    """What it believes of the current; goes with the state alone, where there is room."""
    detections: tuple[Detection, ...] = ()
    """Tags that it heard, to ``compose`` the oldest first."""
    channels: ChannelPart = field(default_factory=ChannelPart)
    """What it measures, and readings of itself."""
