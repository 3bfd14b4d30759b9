"""What robots report beside state, samples and plan; and what is a report, an event of a link.

Frozen values in SI, radians and NED, as in ``robot_link.messages``.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime

from autonomy.tracking.phase import SpeedClass, TargetPhase
from robot_link.channel_table import ChannelPage, TableVersion
from robot_link.messages import (
    CommandReport,
    LinkReport,
    LogId,
    PlanQueue,
    PlanReport,
    PositionNed,
    RawFrame,
    RobotId,
    Sample,
    StateReport,
    SystemId,
    UploadReport,
)


@dataclass(frozen=True, slots=True)
class TargetEstimate:
    """Where the robot believes its target to be, by one hypothesis."""

    position_ne_m: tuple[float, float]
    """North and east in the site frame."""
    velocity_ne_m_s: tuple[float, float]
    covariance_m2: tuple[float, float, float]
    """Of the position: north-north, north-east, east-east."""
    weight: float
    """Probability of this hypothesis, 0..1; those of all hypotheses add up to 1."""


@dataclass(frozen=True, slots=True)
class TargetReport:
    """What a robot that follows a target says of its hold on it, and of what it does for it."""

    robot: RobotId
    measured_at: datetime
    received_at: datetime
    phase: TargetPhase
    position_ne_m: tuple[float, float]
    """Where the robot believed to be itself."""
    hypotheses: tuple[TargetEstimate, ...]
    """One or two, the likeliest first; none before the first range. Of two, the likeliest alone
    arrives by satellite where a record has no room for both."""
    range_m: float | None
    """Newest horizontal range that was heard, believed or not; None before the first."""
    range_age_s: float
    """How old that range is; of no meaning without one."""
    ranges_heard: int
    """Since the mission began."""
    ranges_rejected: int
    """Of them, those that were not believed."""
    determinant_m2_s: float
    """Determinant of the observability matrix at the estimate (thesis 4.3)."""
    barrier: float
    """B by the form that the mission chose; below 0 the target is not observable enough."""
    inverse_condition: float
    """Inverse condition number of the observability matrix at the estimate, 0..1."""
    nominal: tuple[float, float]
    """What the pursuit law wanted: turn rate rad/s, acceleration m/s2; within the limits."""
    command: tuple[float, float]
    """What the robot asks of its tail: turn rate rad/s, acceleration m/s2."""
    is_barrier_on: bool
    """False in the teaching mode, in which nothing keeps the target observable."""
    is_feasible: bool
    """Whether the barrier could be kept at this step."""
    is_quiet: bool
    """Whether the robot was told not to ping."""
    true_ne_m: tuple[float, float] | None
    """Where a virtual target is, which its robot computes; None for a real one."""
    is_too_fast: bool = False
    """Whether the target seems too fast to follow."""
    speed_class: SpeedClass | None = None
    """How the target seems to swim; None where the robot does not estimate it."""
    delay_s: float | None = None
    """By how much ranges seem older than they are told, s; None as above."""


@dataclass(frozen=True, slots=True)
class CurrentReport:
    """What a robot believes of the water's current, and how far its own positions may be believed.

    It stays good for the dive that follows: the robot reckons its position with this current.
    """

    robot: RobotId
    measured_at: datetime
    received_at: datetime
    current_ne_m_s: tuple[float, float]
    """The current that stays, north and east; zero of a robot that learns none."""
    current_std_m_s: float
    """Its standard deviation per axis, the larger one, ``doubt`` counted."""
    doubt: float
    """How many times larger than its filter's own the standard deviations are that the robot
    states, 1 or more, because its last fixes surprised it."""
    dives: int
    """How many dives that was judged by, 0 to 255."""
    fixes_refused: int
    """Fixes that were not believed since the robot was switched on."""


@dataclass(frozen=True, slots=True)
class ActuatorFollowing:
    """How an actuator follows its commands, as the robot learned it."""

    rate_share: float
    """Greatest speed as a share of the nominal one; 1 while nothing refutes it."""
    rate_std_octaves: float
    """Standard deviation of its logarithm to base 2."""
    delay_s: float
    """Time between a command and the beginning of the answer; 0 while nothing refutes it."""
    delay_std_s: float
    learned_age_s: float | None
    """How long before the report a command last said something of it; None for never."""


@dataclass(frozen=True, slots=True)
class ActuatorReport:
    """How a robot's actuators follow their commands, and what it makes of that."""

    robot: RobotId
    measured_at: datetime
    received_at: datetime
    mass: ActuatorFollowing
    """The sliding mass."""
    pump: ActuatorFollowing
    """The buoyancy pump."""
    speed_share: float
    """Vertical speed of legs as a share of the planned one."""
    is_mass_off: bool
    """Whether the sliding mass is so slow or late that the robot flies differently."""
    is_swinging: bool
    """Whether pitch and sliding mass chased each other of late."""
    stuck: tuple[str, ...]
    """Actuators that do not move though they were told to: sliding mass, pump, tail."""


@dataclass(frozen=True, slots=True)
class Detection:
    """One transmission of an acoustic tag that a robot heard; kept on board until it is ashore."""

    robot: RobotId
    log: LogId
    """Log and number name it, within the same count as samples."""
    sequence: int
    receiver: int
    """Serial number of the receiver."""
    tag: str
    """Transmitter as the makers of tags write it, such as ``A69-1601-179``."""
    sensor: int | None
    """Raw value of the tag's sensor; None for a tag without one."""
    position_ned: PositionNed
    """Where the robot believed to be."""
    position_std_m: float
    measured_at: datetime
    received_at: datetime

    @property
    def code_space(self) -> str:
        """The tag's code space, such as ``A69-1601``."""
        return self.tag.rpartition("-")[0]


@dataclass(frozen=True, slots=True)
class ReceiverReport:
    """How a robot's tag receiver fares since the robot was switched on."""

    robot: RobotId
    measured_at: datetime
    received_at: datetime
    receiver: int
    """Serial number; 0 before the first line that could be believed."""
    heard: int
    """Detections that were passed on."""
    refused_sum: int
    """Lines with a wrong sum; they are kept as they came in the robot's own log."""
    refused_date: int
    """Lines with a date that is none."""
    refused_code: int
    """Lines that say neither a tag nor the receiver's condition."""
    clock_offset_s: float | None
    """The receiver's clock minus the robot's; None before the first line."""


@dataclass(frozen=True, slots=True)
class VehicleValue:
    """A number that a vehicle of another maker said."""

    value: float
    """In the channel's own unit: SI for those of a state, the catalogue's for the others."""
    at: datetime
    """When it came."""


@dataclass(frozen=True, slots=True)
class VehiclePlace:
    """Where a vehicle of another maker is."""

    position_ned: tuple[float, float, float]
    """In its water's frame; the depth is never negative."""
    std_m: float | None
    """Of the horizontal position, larger axis; None where the vehicle does not say."""
    has_fix: bool
    at: datetime


@dataclass(frozen=True, slots=True)
class VehicleReport:
    """What a vehicle says that speaks standard MAVLink: put together from many messages.

    What it did not say is absent.
    """

    robot: RobotId
    measured_at: datetime
    """When the newest of it came: such a vehicle does not say when it measured."""
    received_at: datetime
    autopilot: str
    """Such as ArduSub."""
    kind: str
    """Such as submarine."""
    mode: str
    """The autopilot's own name of its mode, such as ALT_HOLD; "" before its first heartbeat."""
    mode_number: int
    """Its custom mode."""
    mode_words: str
    """What it does in that mode, such as "holds its depth"; "" where only the name is known."""
    is_armed: bool | None
    """Whether its motors may turn; None before the first heartbeat."""
    is_critical: bool
    """Whether it says that it is in an emergency."""
    values: Mapping[str, VehicleValue]
    """By the keys of a state's channels and of the catalogue."""
    place: VehiclePlace | None
    depth_source: str
    """What the depth was taken from, such as GLOBAL_POSITION_INT; "" where there is none."""
    std_source: str
    """What the position's uncertainty was taken from; "" where nobody knows it."""
    mission_item: int | None
    """The item that it flies to."""
    mission_items: int | None
    """How many items its mission has."""
    unhealthy: tuple[str, ...]
    """Sensors that are there, switched on, and not healthy; and motors that fail."""
    landed: str = ""
    """Whether it stands or is under way, such as "on the ground"; "" where it does not say."""


@dataclass(frozen=True, slots=True)
class VehicleWord:
    """A sentence that a vehicle said (STATUSTEXT), put together where it came in pieces."""

    robot: RobotId
    severity: int
    """MAV_SEVERITY: 0 emergency to 7 debug; 4 is a warning."""
    text: str
    at: datetime


@dataclass(frozen=True, slots=True)
class Reading:
    """One value of a channel that belongs to no place: the robot's own condition."""

    robot: RobotId
    channel: str
    """Its key in the catalogue."""
    value: float
    """In the channel's unit."""
    measured_at: datetime
    received_at: datetime


@dataclass(frozen=True, slots=True)
class ControlReport:
    """What a robot says of which ground station controls it by MAVLink."""

    robot: RobotId
    system: SystemId
    """MAVLink system id of the ground station; 0 for none."""
    is_takeover_allowed: bool
    """Whether another one that asks will get it."""
    received_at: datetime


@dataclass(frozen=True, slots=True)
class ControlAsked:
    """Another ground station asks for a robot, or asks for it no more; the robot passed it on."""

    robot: RobotId
    system: SystemId
    is_request: bool
    stands_s: float
    """How long the request stands, s of the wall."""
    received_at: datetime


_Told = (
    StateReport
    | Sample
    | Reading
    | PlanReport
    | PlanQueue
    | TargetReport
    | CurrentReport
    | Detection
)
SatelliteReport = _Told | ChannelPage | TableVersion
"""What a robot tells of itself by satellite too; of its actuators and of its tag receiver it says
nothing there."""
RobotReport = _Told | ActuatorReport | ReceiverReport
"""What a robot tells of itself, each with the time by its own clock."""
LinkEvent = (
    RobotReport
    | ChannelPage
    | TableVersion
    | VehicleReport
    | VehicleWord
    | CommandReport
    | UploadReport
    | LinkReport
    | ControlReport
    | ControlAsked
    | RawFrame
)
