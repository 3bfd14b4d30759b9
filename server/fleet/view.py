"""A robot as the operator sees it."""

from dataclasses import dataclass, replace
from datetime import datetime
from typing import Annotated, TypeVar

from autonomy.site import Site
from robot_link.messages import OnboardPlanState, RobotMode
from server.base.view import RobotLevel, View, name_of, one_of
from server.fleet.capability import RobotCapabilityView
from server.fleet.link_view import LinkStateName, RobotLinkView
from server.fleet.target_view import TargetReportView

RobotModeName = Annotated[str, name_of(RobotMode)]


@dataclass(frozen=True, slots=True)
class LinkView(View):
    """The link to a robot."""

    carrier: str
    """Kind of the link that was heard last, such as ``xbee``; empty before the first byte."""
    state: LinkStateName
    """``never_heard``, ``live``, ``stale``, ``submerged``, ``mute`` (the station's own radio does
    not answer), ``port_closed`` or ``unplugged``."""
    heard_at: datetime | None
    age_s: float | None
    """Time since the last byte."""
    rssi_dbm: float | None
    frames_received: int
    frames_bad: int
    """Frames dropped for a bad checksum, a foreign sender or an unreadable content."""


@dataclass(frozen=True, slots=True)
class ContactView(View):
    """When the robot will be heard next."""

    at: datetime
    text: str


@dataclass(frozen=True, slots=True)
class ChannelView(View):
    """Newest value of one channel; the unit belongs to ``value``."""

    value: float
    unit: str
    display_unit: str | None
    """Unit on a screen where it differs."""
    measured_at: datetime
    received_at: datetime
    age_s: float
    """Age of the measurement by the station's clock when this was written."""
    limit_s: float
    """Age from which the value must look old."""
    is_derived: bool = False
    """Whether it was computed ashore of what the robot measured."""
    impossible: int = 0
    """Values outside of the channel's range since the station started: kept, used for nothing."""


@dataclass(frozen=True, slots=True)
class PositionView(View):
    """Where the robot believes to be."""

    ned_m: tuple[float, float, float]
    """North, east, down in the site's frame."""
    std_m: float | None
    """Standard deviation of the horizontal position, larger axis; ``null`` where a vehicle of
    another maker does not tell it."""
    latitude_deg: float
    longitude_deg: float
    has_fix: bool
    """Whether the position was fixed from outside at that moment."""
    measured_at: datetime
    received_at: datetime
    age_s: float
    fix_text: str = ""
    """Who fixed it, such as "fixed by 3 cameras", where the robot says that cameras did."""
    fix_age_s: float | None = None
    """Age of the newest fix that was sent to it; ``null`` where none was of late."""


@dataclass(frozen=True, slots=True)
class ForeignVehicleView(View):
    """What a vehicle of another maker says of itself beside its channels."""

    autopilot: str
    """Such as ``ArduSub``."""
    kind: str
    """Such as ``submarine``."""
    mode_name: str
    """The autopilot's own name of its mode, such as ``ALT_HOLD``; empty before it is told."""
    mode_number: int
    is_armed: bool | None
    """Whether its motors may turn; ``null`` before it is told."""
    text: str
    """Mode and arming in words."""
    depth_source: str
    """The message that the depth is taken from; empty where none tells it."""
    std_source: str
    """The message that the position's uncertainty is taken from; empty where none tells it."""
    mission_item: int | None
    mission_items: int | None
    unhealthy: list[str]
    """Sensors and motors that it says are not well."""
    landed: str
    """Whether it stands or is under way; empty where it does not say."""
    word: str
    """Its newest grave sentence; empty if there was none."""
    word_age_s: float | None
    age_s: float


@dataclass(frozen=True, slots=True)
class CurrentView(View):
    """What the robot believes of the water's current, and how far its positions are doubted."""

    north_m_s: float
    east_m_s: float
    std_m_s: float
    """Standard deviation of the current, larger axis."""
    doubt: float
    """How many times larger its stated uncertainties are, because its last fixes surprised it."""
    is_doubted: bool
    """Whether that is so much that a person is told of it."""
    dives: int
    """How many dives that was judged by."""
    fixes_refused: int
    """Fixes that it did not believe since it was switched on."""
    text: str
    """All of that in words."""
    measured_at: datetime
    received_at: datetime
    age_s: float


@dataclass(frozen=True, slots=True)
class ActuatorFollowingView(View):
    """How an actuator follows its commands, as the robot learned it from the feedback."""

    rate_share: float
    """Greatest speed as a share of the nominal one; 1 while nothing refutes it."""
    delay_s: float
    """Time between a command and the beginning of the answer; 0 while nothing refutes it."""
    learned_age_s: float | None
    """How long ago a command last said something of it; ``null`` for never."""


@dataclass(frozen=True, slots=True)
class ActuatorsView(View):
    """How the robot's actuators follow their commands, and what the robot makes of that."""

    mass: ActuatorFollowingView
    pump: ActuatorFollowingView
    speed_share: float
    """Vertical speed of its legs as a share of the planned one."""
    is_mass_off: bool
    """Whether the sliding mass is so slow or late that the robot flies differently."""
    is_swinging: bool
    """Whether pitch and sliding mass chased each other of late; it flies its gentlest gait then."""
    stuck: list[str]
    """Actuators that stood still though they were told to move."""
    text: str
    """All of that in words."""
    measured_at: datetime
    received_at: datetime
    age_s: float


@dataclass(frozen=True, slots=True)
class OnboardPlanView(View):
    """The plan that the robot says it holds."""

    plan_id: str | None
    """The station's plan with this hash; ``null`` when the robot holds a stranger's."""
    sha256: str | None
    state: Annotated[str, name_of(OnboardPlanState)]
    leg: int
    legs: int
    energy_used: float
    age_s: float


@dataclass(frozen=True, slots=True)
class WaitingPlanView(View):
    """A plan that waits on board for the next surfacing, by the robot's own word."""

    plan_id: str | None
    """``null`` of a plan that this station does not know."""
    sha256: str
    starts: bool
    """Whether it begins at the next surfacing; else it waits for *start*."""
    flown_plan_id: str | None
    """The plan that is flown until then; ``null`` where none is flown, or an unknown one."""
    flown_sha256: str | None
    at: datetime | None
    """When the robot is expected to surface next; ``null`` where nobody knows."""
    measured_at: datetime
    """When the robot says that this became so."""
    age_s: float
    text: str
    """One sentence."""


@dataclass(frozen=True, slots=True)
class StateView(View):
    """Newest value of everything that a robot reports."""

    robot: str
    channels: dict[str, ChannelView]
    """By channel key, which carries the unit; field variables are channels too."""
    position: PositionView | None
    mode: RobotModeName | None
    activity: str
    """What the robot is doing, in words."""
    plan: OnboardPlanView | None
    waiting_plan: WaitingPlanView | None
    """The plan that waits on board behind that one; ``null`` where the robot says of none."""
    link: LinkView
    links: list[RobotLinkView]
    """Every link that the robot has; ``link`` is the best of them."""
    clock_fault: str | None
    """What is wrong with the robot's clock; its values are then in the order of their arrival."""
    current: CurrentView | None
    """What the robot believes of the current; ``null`` of one that never told."""
    actuators: ActuatorsView | None
    """How its actuators follow; ``null`` of one that never told."""
    vehicle: ForeignVehicleView | None
    """What a vehicle of another maker says of itself; ``null`` of our robots."""
    tracking: TargetReportView | None
    """Newest report on the target that the robot follows, or followed last; ``null`` for one that
    flies something else."""


@dataclass(frozen=True, slots=True)
class DeploymentBriefView(View):
    """The deployment that a robot is in."""

    id: str
    name: str
    started_at: datetime


@dataclass(frozen=True, slots=True)
class SuggestionView(View):
    """What the station takes to have happened to a robot, for a person to confirm."""

    kind: Annotated[str, one_of("begin", "end")]
    """``begin`` or ``end`` of a deployment."""
    at: datetime
    text: str


@dataclass(frozen=True, slots=True)
class LiveRobotView(StateView):
    """State with what the fleet page shows beside it."""

    suggestion: SuggestionView | None
    mission_id: str | None
    plan_id: str | None
    next_contact: ContactView | None
    surface_forecast: str
    driver: str
    """Who drives it by hand; empty for nobody of this station."""
    drive_refusal: str
    """One sentence on why nobody can begin to drive it by hand now; empty where somebody can."""
    alarm_level: RobotLevel | None


PublicState = TypeVar("PublicState", StateView, LiveRobotView)


def to_the_public(view: PublicState) -> PublicState:
    """Return of a robot's state what anybody may know: no address of a link, no person."""
    if isinstance(view, LiveRobotView):
        return replace(view, links=[], driver="", drive_refusal="")
    return replace(view, links=[])


@dataclass(frozen=True, slots=True)
class RobotView(View):
    """A robot of the fleet."""

    id: str
    name: str
    model: str
    """Title of the vehicle model."""
    model_key: str
    """Key of the vehicle in the catalogue, empty for a recording of something unknown."""
    model_note: str
    """What to know about the model's parameters."""
    model_origin: Annotated[str, one_of("built-in", "file", "identified", "")]
    """Where the model comes from: ``built-in``, ``file`` or ``identified``; empty for a
    recording of something unknown."""
    kind: Annotated[str, one_of("real", "simulated", "recorded")]
    """``real``, ``simulated`` or ``recorded``."""
    protocol: Annotated[str, one_of("grace", "mavlink")]
    """What it speaks by radio: ``grace``, or ``mavlink`` of another maker's vehicle."""
    capabilities: tuple[RobotCapabilityView, ...]
    """What it can do, and why it cannot do the rest."""
    system_id: int | None
    simulated: bool
    water: str | None
    """Id of the water that it works in; ``null`` where the site is its own."""
    retired_at: datetime | None
    deployment: DeploymentBriefView | None
    """Which it is in now."""
    is_in_workshop: bool
    """Whether it is between two deployments: what it says belongs to none."""
    suggestion: SuggestionView | None
    site: Site
    """The water's document."""
    link: LinkView
    mode: RobotModeName | None
    activity: str
    mission_id: str | None
    """The mission that concerns the operator now."""
    plan_id: str | None
    """The plan that concerns the operator now."""
    next_contact: ContactView | None
    surface_forecast: str
    """What "surface now" would do, in one sentence."""
    alarm_level: RobotLevel | None
    """Worst level among the robot's alarms that are not closed."""


@dataclass(frozen=True, slots=True)
class AnnouncedView(View):
    """A channel as the newest table of its robot has it."""

    number: int
    """On the wire."""
    key: str
    unit: str
    period_s: float | None
    """Time between two values; ``null`` where it is not fixed."""
    version: str
    """Of the table."""
    since_at: datetime
    """Since when the table holds, by the robot's clock."""
    heard_at: datetime
    """When the station heard it last."""


@dataclass(frozen=True, slots=True)
class ToldChannelView(View):
    """A channel of which a robot has told values, or of which such can be computed."""

    key: str
    """As in `GET /api/channels`."""
    title: str
    unit: str
    samples: int | None
    """How many values are stored; ``null`` of what every state report tells or is computed."""
    is_derived: bool
    can_map: bool
    announced: AnnouncedView | None = None
    """What the robot itself says of the channel; ``null`` where it announced nothing of it."""
    problem: str = ""
    """What the robot says otherwise than the catalogue; its values are then not used."""


@dataclass(frozen=True, slots=True)
class SamplesView(View):
    """History of one channel."""

    robot: str
    channel: str
    unit: str
    measured_at: list[datetime]
    value: list[float]
    decimated: bool
    """Whether values were left out; the extremes of every interval are kept."""
    pruned: list[str]
    """What of that time is no longer all there, sentences."""
    is_derived: bool = False
    """Whether they were computed ashore of what the robot measured."""
    received_at: list[datetime] | None = None
    """When the station heard of each, of a channel of the state; of others that is not kept."""
    flag: list[int] | None = None
    """Flag of OG1.0 of each, of a deployment that is asked for and has flags: 1 good, 2 probably
    good, 3 suspect, 4 bad, 0 without any control."""
    north_m: list[float] | None = None
    """Where each was taken, of a field variable and if asked for; smoothed where that was done."""
    east_m: list[float] | None = None
    depth_m: list[float] | None = None
    std_m: list[float] | None = None
    """Standard deviation of the horizontal position."""
    fidelity: list[int] | None = None
    """Fidelity level by the planner's thresholds; the highest is the best located."""
    smoothed: list[bool] | None = None
    """Whether the fix at the end of its dive located it better than the robot had."""


@dataclass(frozen=True, slots=True)
class TrackView(View):
    """Where the robot believed to be, point by point."""

    robot: str
    measured_at: list[datetime]
    north_m: list[float]
    east_m: list[float]
    depth_m: list[float]
    std_m: list[float | None]
    """``null`` where a vehicle of another maker does not tell it."""
    fidelity: list[int]
    """Fidelity level by the planner's thresholds; the highest is the best located."""
    adrift: list[bool]
    """Whether it floated at the surface with nothing to fly there."""
    received_at: list[datetime] | None
    """When the station heard of each point, if that was asked for."""
    latitude_deg: list[float]
    longitude_deg: list[float]
    decimated: bool
    pruned: list[str]
    """What of that time is no longer all there, sentences."""
