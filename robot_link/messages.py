"""What travels between a robot and the station, once decoded: frozen values, SI, radians, NED.

``measured_at`` is the robot's clock, ``received_at`` the station's; both are aware UTC. The fields
of a state report carry what wires, tables and screens must know of them
(``robot_link.report_field``).
"""

import math
from dataclasses import dataclass
from datetime import datetime
from enum import IntEnum, StrEnum
from typing import Annotated, NewType

from robot_link.report_field import Catalogue, Gauge, Octets, Possible, Recorded, ReportField, Wire

RobotId = NewType("RobotId", str)
"""Operator's name of a robot, such as ``mini-1``: lower case letters, digits and dashes."""
SystemId = NewType("SystemId", int)
"""MAVLink system id of a robot, 1..249; the station is 255."""
LogId = NewType("LogId", int)
"""Names one sample log on board; sample numbers count from 0 within it."""
CommandNumber = NewType("CommandNumber", int)
"""Station's number of a command, 1..2**24-1, echoed by the robot's acknowledgement."""
FIRST_EMERGENCY_NUMBER = CommandNumber(2**24 - 2**16 + 1)
"""From here on are the numbers of orders to surface that leave although they cannot be written
down; each is newer than every ordinary one."""
PlanHash = NewType("PlanHash", str)
"""SHA-256 of a mission's canonical bytes, 64 lower-case hexadecimal digits."""

PositionNed = tuple[float, float, float]

_OCTET_OF_RAD = 128.0 / math.pi


class RobotMode(IntEnum):
    """What the robot says it is doing; the number is the wire's."""

    IDLE = 0
    """At the surface without a mission to fly."""
    DIVING = 1
    GLIDING = 2
    SPIRALLING = 3
    SWIMMING = 4
    TURNING = 5
    """At the surface, swimming towards the heading of the next leg."""
    SURFACED = 6
    """At the surface between legs: taking a fix and talking."""
    ABORTING = 7
    """On its way up because it was told to, or because a limit was met."""
    HOLDING = 8
    """At the surface, mission suspended by command."""
    TRACKING = 9
    """Following a target of which it measures the range."""
    SEARCHING = 10
    """Circling to find a target that it lost."""
    DRIVEN = 11
    """Driven by hand; without a stick it stops and comes up."""


class OnboardPlanState(IntEnum):
    """State of the plan that the robot holds, as the robot itself says it."""

    NONE = 0
    RECEIVING = 1
    ON_BOARD = 2
    RUNNING = 3
    DONE = 4
    FAILED = 5
    REFUSED = 6
    WAITING = 7
    """Kept behind the plan being flown; said only in answer to an offer that may wait."""


SURFACED_BY_COMMAND = "surfaced by command"
"""Reason of a FAILED plan that a robot gives when it was told to surface: nothing went wrong."""


class CommandKind(StrEnum):
    """What an operator can tell a robot in one short message; each is idempotent."""

    SURFACE = "surface"
    """Abort the mission, come up, stay there."""
    HOLD = "hold"
    """Suspend at the next surfacing."""
    RESUME = "resume"
    """Continue a suspended mission."""
    START = "start"
    """Fly the plan on board, if its hash begins with the given digits."""
    QUIET = "quiet"
    """Stop pinging the target."""
    PING = "ping"
    """Ping the target again."""
    ARM = "arm"
    """Let the motors turn; like ``DISARM`` for vehicles of other makers alone."""
    DISARM = "disarm"
    """Stop the motors, wherever the vehicle is."""
    ZERO_DEPTH = "zero_depth"
    """Take the present reading of the depth sensor as the surface."""


class CommandLevel(StrEnum):
    """How far a command is proved to have come; never shown before it is proved."""

    QUEUED = "queued"
    RADIO = "radio"
    APPLIED = "applied"
    REFUSED = "refused"
    EXPIRED = "expired"


@dataclass(frozen=True, slots=True)
class StateReport:
    """The robot's own estimate of itself at one moment."""

    robot: RobotId
    measured_at: datetime
    received_at: datetime
    position_ned: Annotated[
        PositionNed,
        ReportField("north_m", "m", wire=Wire("x"), octets=Octets(0, 4, 1e3)),
        ReportField("east_m", "m", wire=Wire("y"), octets=Octets(1, 4, 1e3)),
        ReportField(
            "depth_m",
            "m",
            standard_name="depth",
            wire=Wire("z"),
            octets=Octets(2, 3, 1e3),
            gauge=Gauge(
                0, "Depth", "Depth of the robot below the surface, by its pressure sensor.", 2, 5.0
            ),
        ),
    ]
    position_std_m: Annotated[
        float,
        ReportField(
            unit="m",
            wire=Wire("position_std"),
            octets=Octets(3, 3, 1e3, signed=False),
            gauge=Gauge(
                1,
                "Position uncertainty",
                "Standard deviation of the horizontal position, as the robot estimates it: two "
                "thirds of all errors are smaller.",
                2,
                5.0,
            ),
            possible=Possible(0.0, math.inf, "a position uncertainty of {:.3g} m"),
            recorded=Recorded(0.0, 1e5),
        ),
    ]
    """Along the larger axis."""
    velocity_ned: Annotated[
        tuple[float, float, float],
        ReportField("velocity_north_m_s", "m/s", wire=Wire("vx", 1e3), octets=Octets(4, 1, 1e2)),
        ReportField("velocity_east_m_s", "m/s", wire=Wire("vy", 1e3), octets=Octets(5, 1, 1e2)),
        ReportField("velocity_down_m_s", "m/s", wire=Wire("vz", 1e3), octets=Octets(6, 1, 1e2)),
        ReportField(
            "speed_m_s",
            "m/s",
            standard_name="platform_speed_wrt_ground",
            gauge=Gauge(5, "Speed", "Speed through space, as the robot estimates it.", 3, 5.0),
            is_norm=True,
        ),
    ]
    roll_rad: Annotated[
        float,
        ReportField(
            unit="rad",
            display_unit="deg",
            standard_name="platform_roll_starboard_down",
            wire=Wire("roll", 1e4),
            octets=Octets(7, 1, _OCTET_OF_RAD),
            gauge=Gauge(4, "Roll", "Right wing down is positive.", 1, 5.0),
            recorded=Recorded(-180.0, 180.0),
        ),
    ]
    pitch_rad: Annotated[
        float,
        ReportField(
            unit="rad",
            display_unit="deg",
            standard_name="platform_pitch_fore_up",
            wire=Wire("pitch", 1e4),
            octets=Octets(8, 1, _OCTET_OF_RAD),
            gauge=Gauge(3, "Pitch", "Nose up is positive.", 1, 5.0),
            recorded=Recorded(-90.0, 90.0),
        ),
    ]
    heading_rad: Annotated[
        float,
        ReportField(
            unit="rad",
            display_unit="deg",
            standard_name="platform_orientation",
            wire=Wire("heading", 1e4),
            octets=Octets(9, 1, _OCTET_OF_RAD),
            gauge=Gauge(2, "Heading", "Direction of the nose, clockwise from north.", 0, 5.0),
            recorded=Recorded(-360.0, 360.0),
        ),
    ]
    """0 north, positive to starboard, in -pi..pi."""
    net_buoyancy_kg: Annotated[
        float,
        ReportField(
            unit="kg",
            display_unit="g",
            wire=Wire("net_buoyancy"),
            octets=Octets(11, 2, 1e4),
            gauge=Gauge(8, "Net buoyancy", "Excess mass. Positive sinks, negative rises.", 1, 5.0),
            recorded=Recorded(-5000.0, 5000.0),
        ),
    ]
    """Excess mass m0; positive sinks."""
    mass_position_m: Annotated[
        float,
        ReportField(
            unit="m",
            display_unit="mm",
            wire=Wire("mass_position"),
            octets=Octets(12, 2, 1e4),
            gauge=Gauge(
                9,
                "Mass position",
                "Position of the movable mass. Forward is positive and turns the nose down.",
                1,
                5.0,
            ),
            recorded=Recorded(-1000.0, 1000.0),
        ),
    ]
    tail_rad: Annotated[
        float,
        ReportField(
            unit="rad",
            display_unit="deg",
            wire=Wire("tail", 1e4),
            octets=Octets(10, 1, _OCTET_OF_RAD),
            gauge=Gauge(10, "Tail", "Angle of the tail. It turns the robot.", 1, 5.0),
            recorded=Recorded(-180.0, 180.0),
        ),
    ]
    battery_fraction: Annotated[
        float,
        ReportField(
            display_unit="%",
            wire=Wire("battery_remaining", 1e4),
            octets=Octets(13, 1, 255.0, signed=False),
            gauge=Gauge(6, "Battery", "Charge that is left.", 0, 60.0),
            possible=Possible(-0.01, 1.01, "a battery charge of {:.0%}"),
        ),
    ]
    battery_v: Annotated[
        float,
        ReportField(
            unit="V",
            wire=Wire("battery_voltage", 1e3),
            octets=Octets(14, 1, 5.0, signed=False),
            gauge=Gauge(
                7, "Battery voltage", "Voltage of the battery under its present load.", 2, 60.0
            ),
        ),
    ]
    energy_used: Annotated[
        float,
        ReportField(
            wire=Wire("energy_used"),
            gauge=Gauge(
                11,
                "Energy used",
                "Energy units of the plan\u2019s account since the mission began.",
                1,
                60.0,
            ),
        ),
    ]
    """Energy units spent since the mission began, by the plan's own account."""
    mode: RobotMode
    has_fix: bool
    """Whether the position was fixed from outside (GPS, cameras) at this moment."""
    is_by_cameras: bool = False
    """Whether cameras told the newest such fix."""
    is_by_own_camera: bool = False
    """Whether that was the robot's own."""


STATE = Catalogue(StateReport)
"""The channels of a state report."""


@dataclass(frozen=True, slots=True)
class Sample:
    """One measurement of a field, where the robot believes that it took it."""

    robot: RobotId
    log: LogId
    sequence: int
    variable: str
    value: float
    position_ned: PositionNed
    position_std_m: float
    measured_at: datetime
    received_at: datetime


@dataclass(frozen=True, slots=True)
class PlanReport:
    """What the robot says of the plan on board."""

    robot: RobotId
    sha256: PlanHash | None
    state: OnboardPlanState
    leg: int
    legs: int
    energy_used: float
    reason: str
    """One sentence where the state is FAILED or REFUSED, else empty."""
    measured_at: datetime
    received_at: datetime


@dataclass(frozen=True, slots=True)
class PlanQueue:
    """What the robot says of the plan that waits behind the one on board, and of the one before."""

    robot: RobotId
    sha256: PlanHash | None
    """The plan on board."""
    next_sha256: PlanHash | None
    """The plan that waits for the next surfacing."""
    next_starts: bool
    """Whether that begins then; else it waits for START."""
    last_sha256: PlanHash | None
    """The plan that the one on board took the place of at a surfacing."""
    last_done: bool
    """Whether that was flown to its end."""
    measured_at: datetime
    """When this became so."""
    received_at: datetime


@dataclass(frozen=True, slots=True)
class CommandReport:
    """A level of one command, proved at ``at`` by ``carrier``."""

    robot: RobotId
    number: CommandNumber
    level: CommandLevel
    at: datetime
    carrier: str
    """The link that proved it, such as ``xbee``."""
    reason: str = ""


@dataclass(frozen=True, slots=True)
class UploadReport:
    """Progress of one mission upload as far as it is proved."""

    robot: RobotId
    sha256: PlanHash
    items_sent: int
    items: int
    state: OnboardPlanState
    """RECEIVING while under way; ON_BOARD, or WAITING behind the plan that is flown, only after the
    robot echoed the hash."""
    reason: str
    at: datetime


class LinkState(StrEnum):
    """What is known of the link to one robot."""

    NEVER_HEARD = "never_heard"
    LIVE = "live"
    STALE = "stale"
    """No byte for longer than the link's limit."""
    SUBMERGED = "submerged"
    """Silent because it said it would dive; not lost."""
    MUTE = "mute"
    """The port is open, but the station's own radio does not answer."""
    PORT_CLOSED = "port_closed"
    DISABLED = "unplugged"
    """The operator disabled it."""


@dataclass(frozen=True, slots=True)
class LinkReport:
    """Health of one link to one robot."""

    robot: RobotId
    carrier: str
    state: LinkState
    heard_at: datetime | None
    rssi_dbm: float | None
    frames_received: int
    frames_bad: int
    """Frames dropped since the link opened: bad checksum, foreign sender, impossible content."""
    uri: str = ""
    """The link, as it was registered."""
    is_enabled: bool = True
    """Whether the operator lets it be used."""
    radio: str = ""
    """Address of the radio that counts as the robot's, 16 hexadecimal digits; empty until known."""
    clock_offset_s: float | None = None
    """The robot's clock minus the station's; None until known."""
    trouble: str = ""
    """Sentence on what is wrong beside the state: a clock that is off by hours, or ``conflict``."""
    conflict: str = ""
    """Sentence on another robot that speaks under the robot's system id."""
    is_signed: bool = False
    """Whether a frame counts only with the robot's signature, and the robot knows ours."""
    words: str = ""
    """What its state means, of a link of which the state alone says too little; a sentence."""


@dataclass(frozen=True, slots=True)
class RawFrame:
    """Bytes of one packet as they crossed a link, for the journal."""

    robot: RobotId | None
    carrier: str
    outgoing: bool
    data: bytes
    at: datetime
    """The station's clock."""
    robot_at: datetime | None = None
    """Newest time that the robot wrote into it, by its own clock."""
    arrived_at: datetime | None = None
    """When a gateway ashore had it, where one lies in between."""
