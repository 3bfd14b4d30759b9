"""A plan and its way to the robot."""

from dataclasses import dataclass, field
from datetime import datetime
from typing import Annotated

from autonomy.planner.plan import PrimitiveKind
from server.base.view import SettingsDocument, View, numbers, one_of
from server.fleet.link_view import TransferPartView
from server.fleet.routing import RequestedLink

PlanState = Annotated[
    str,
    one_of(
        "planning", "draft", "sent", "waiting", "on_board", "running",
        "done", "failed", "superseded", "cancelled",
    ),
]  # fmt: skip
PlanKind = Annotated[str, one_of("adaptive_survey", "primitives", "design", "track_target")]
PlanStage = Annotated[str, one_of("waiting", "searching", "rehearsing")]
TrajectoryPoint = Annotated[list[float], numbers(5)]
"""Time s, north, east, down m, standard deviation of the position m."""


@dataclass(frozen=True, slots=True)
class LegView(View):
    """One motion primitive."""

    kind: PrimitiveKind
    """``glide``, ``spiral``, ``dive``, ``swim`` or ``keep``."""
    start_ned: tuple[float, float, float]
    end_ned: tuple[float, float, float]
    speed_m_s: float
    duration_s: float
    energy: float
    heading_rad: float
    radius_m: float
    turn_rad: float


@dataclass(frozen=True, slots=True)
class BatteryView(View):
    """What a plan takes from the robot's battery; all but the time are parts of a full one."""

    used: float
    """About what the plan takes; above 1 where a full battery does not last."""
    left: float | None
    """What the robot said was left when the plan was made."""
    reserve: float
    """What the plan and the way home must leave."""
    lasts_s: float | None
    """How long the robot could go on like this, from what is left to the reserve, the way home
    taken off."""
    used_wh: float | None = None
    """About what the plan takes; ``null`` in plans of an earlier version."""
    used_low_wh: float | None = None
    """It takes between this and the next in 90 of 100 cases."""
    used_high_wh: float | None = None
    home_wh: float = 0.0
    """What the swim from its end to where the robot was put into the water takes."""
    home_m: float = 0.0
    """How far that is; 0 where nobody knows."""
    capacity_wh: float | None = None
    """Of the full battery."""
    is_learned: bool = False
    """Whether past flights taught what it takes; else the vehicle's model says it."""


@dataclass(frozen=True, slots=True)
class WayThereView(View):
    """The swim from where a robot is, or comes up next, to where a plan begins: no leg of it."""

    start_ned: tuple[float, float, float]
    distance_m: float
    duration_s: float
    energy: float


@dataclass(frozen=True, slots=True)
class AccountView(View):
    """What the legs of a plan cost, and beside them the way to the first one."""

    energy: float
    duration_s: float
    """Surfacings included; of the flights of its dry run where a track is expected."""
    worst_std_m: float
    """Along the expected track, where there is one."""
    bytes: int
    """Size of the mission document."""
    credits: int | None
    """Satellite credits that sending it takes if it goes that way and no part is lost; radio costs
    none. ``null`` for one that is too long for satellite."""
    surfacings: int = 0
    """How often the robot comes up, its last time included; of a plan that follows a target about
    so often."""
    satellite_bytes: int = 0
    """What the robot says by satellite at these surfacings, where there is no radio."""
    energy_wh: float | None = None
    """About what the energy units of a survey's plan are in watt-hours, by the work of the glides
    that it is made of; ``null`` where the vehicle is not known."""
    battery: BatteryView | None = None
    """``null`` where the vehicle is not known, and in plans of an earlier version."""
    expected_from: int = 0
    """How many flights of the dry run duration and uncertainty are of; 0 where they are as
    planned."""
    planned_duration_s: float | None = None
    """What the legs take by the planner's account, where a track is expected."""
    way_there: WayThereView | None = None
    """From where the robot was when the plan was made; ``null`` where it was there, or had not said
    where it is. The battery pays for it."""


@dataclass(frozen=True, slots=True)
class ViolationView(View):
    """One limit that a plan breaks."""

    field: str
    message: str


@dataclass(frozen=True, slots=True)
class InheritedView(View):
    """A setting that nobody named for this plan, as an earlier one left it."""

    field: str
    """Its path, such as ``barrier.alpha``."""
    value: str | float
    usual: str | float
    """What the preset says."""


@dataclass(frozen=True, slots=True)
class ProgressView(View):
    """How far planning is."""

    elapsed_s: float
    seconds_left: float
    objective: float | None
    """Best so far; ``null`` before the first complete trajectory."""
    candidates: int
    waiting: str = ""
    """What the search waits for before it begins, a sentence; "" once it has begun."""


@dataclass(frozen=True, slots=True)
class ObjectiveView(View):
    """Best objective after some planning time."""

    elapsed_s: float
    objective: float
    candidates: int


@dataclass(frozen=True, slots=True)
class RunnerUpView(View):
    """A trajectory that was not chosen; `POST /api/plans/{id}/choose` makes it the draft."""

    objective: float
    energy: float
    duration_s: float
    worst_std_m: float
    legs: list[LegView]
    """Empty in plans of an earlier version."""
    points: list[TrajectoryPoint]
    """As those of the plan."""
    searched_objective: float | None = None
    """As in the plan itself."""


@dataclass(frozen=True, slots=True)
class NearestView(View):
    """How near the expected track comes to a keep-out or to the shoreline."""

    name: str
    distance_m: float
    """From its outline, horizontally; not above 0 if the track crosses that."""
    margin_m: float
    """What was to be kept."""
    is_shore: bool = False


@dataclass(frozen=True, slots=True)
class ChanceView(View):
    """How often something happened in the flights of a dry run."""

    name: str
    """What, or the name of a keep-out."""
    share: float
    """Part of the flights, 0..1."""


@dataclass(frozen=True, slots=True)
class SurfacingBandView(View):
    """When and where the flights of a dry run came up after a leg."""

    leg: int
    """Counted from 0."""
    share: float
    """Part of the flights that did."""
    time_s: Annotated[list[float], numbers(3)]
    """Low, median and high of the band, s since the start."""
    north_m: float
    """Of the middle of the ellipse."""
    east_m: float
    ellipse_m: Annotated[list[float], numbers(2)]
    """Half axes of the ellipse that holds the band's part of them, the longer first."""
    ellipse_rad: float
    """Direction of the longer axis, from north towards east."""
    battery: Annotated[list[float], numbers(3)]
    """Charge then: low, median and high, parts of a full battery."""


@dataclass(frozen=True, slots=True)
class FlightBandView(View):
    """Where the flights of a dry run were, and what became of them."""

    level: float
    """Part of the flights that a band holds, 0..1."""
    along: list[Annotated[list[float], numbers(15)]]
    """Along the legs: leg, time of the plan s, median time since the start s; low and high of
    north, of east and of depth m; north and east of the middle of the ellipse m; its half axes
    m, the longer first, and its direction rad; part of the flights that came so far."""
    over_time: list[Annotated[list[float], numbers(14)]]
    """Along time: time since the start s; low, median and high of north, of east, of depth m, and
    of the charge 0..1; part of the flights under way."""
    surfacings: list[SurfacingBandView]
    battery_end: Annotated[list[float], numbers(3)]
    """Charge at the end: low, median and high, parts of a full battery."""
    duration_s: Annotated[list[float], numbers(3)]
    """Low, median and high."""
    worst_std_m: Annotated[list[float], numbers(3)]
    """Largest deviation of the position that the robot states on the way: low, median, high."""
    leaves_water: float
    """Probability that it is outside of the water's outline at some time."""
    leaves_domain: float
    """Probability that it is outside of the water's box to explore."""
    touches: list[ChanceView]
    """Probability of being in each keep-out at some time."""
    not_back: float
    """Probability of not coming back as planned: mission failed, or the water left."""
    outcomes: list[ChanceView]
    """How the flights ended; the shares add up to 1."""
    dives_cut: float
    """Probability that a limit ends a dive early."""


@dataclass(frozen=True, slots=True)
class FailedFlightView(View):
    """A flight of a dry run that could not be computed."""

    number: int
    """Counted from 0."""
    seed: int
    """Of the dry run; with the number it repeats the flight."""
    reason: str


@dataclass(frozen=True, slots=True)
class LegOutView(View):
    """Flights that were out of the water, or in a keep-out, for the first time on one leg."""

    leg: int
    """Counted from 0."""
    where: str
    """The keep-out's name, or "the water" that they left."""
    flights: int
    beyond_m: float
    """How far out, or in, they came at most; the median of them."""


@dataclass(frozen=True, slots=True)
class SafetyView(View):
    """How often the flights of a dry run were where none may be."""

    flights: int
    out: int
    """Of them left the water or entered a keep-out."""
    legs: list[LegOutView]
    """By the leg on which they first did."""
    short_m: float
    """By so much more margin as few would have as the plan's settings allow; 0 where they do."""


@dataclass(frozen=True, slots=True)
class DryRunView(View):
    """A plan flown ahead against the robot's full dynamics."""

    state: Annotated[str, one_of("working", "done", "failed", "skipped")]
    """``working``, ``done``, ``failed`` or ``skipped``."""
    completed: bool | None = None
    """Whether at least four in five flights flew the plan to its end."""
    rms_error_m: float | None = None
    """Root mean square distance of where it was from where the plan says."""
    worst_error_m: float | None = None
    surfacing_error_m: float | None = None
    """Greatest distance at a surfacing from where the plan comes up."""
    position_error_m: float | None = None
    """Root mean square distance of where it was from where it believed to be."""
    predicted_error_m: float | None = None
    """The same as the plan predicts it."""
    planned_worst_std_m: float | None = None
    within_share: float | None = None
    """Part of the flight that was nearer to the plan than its 95 % circle says."""
    entered: list[str] = field(default_factory=list)
    """Keep-outs that the robot was carried into in more than one of five flights; the station sends
    no such plan by itself."""
    runs: int | None = None
    duration_s: float | None = None
    energy: float | None = None
    flown: list[TrajectoryPoint] = field(default_factory=list)
    """Where it was: time s, north, east, down m, the position std that its filter states m."""
    expected: list[TrajectoryPoint] = field(default_factory=list)
    """Expected track, the mean of all flights at the same share of the same leg: time of the plan
    s, north, east, down m, the position std that they state m; as many points for each leg, in
    their order. Empty unless ``completed``."""
    expected_times_s: list[Annotated[list[float], numbers(2)]] = field(default_factory=list)
    """When each leg is expected to begin and to end, s since the start, surfacings included."""
    spread_m: float | None = None
    """Distance of another flight from the expected track, root mean square, by the scatter of
    those flown."""
    nearest: list[NearestView] = field(default_factory=list)
    """How near the expected track comes to keep-outs and shoreline."""
    broken: list[ViolationView] = field(default_factory=list)
    """Limits that the expected track breaks; they are among the plan's warnings."""
    band: FlightBandView | None = None
    """Where all flights were, and what became of them; ``null`` in plans of an earlier version."""
    safety: SafetyView | None = None
    """How often they left the water or entered a keep-out; likewise."""
    failed: list[FailedFlightView] = field(default_factory=list)
    """Flights that could not be computed; all figures are of the others."""
    not_rehearsed: str = ""
    """What the flights left out, a sentence."""
    message: str = ""


@dataclass(frozen=True, slots=True)
class ComesUpView(View):
    """Where a dive of a plan will come up, by the map of the current."""

    leg: int
    """Leg that ends the dive, counted from 0."""
    north_m: float
    east_m: float
    drift_ne_m: Annotated[list[float], numbers(2)]
    """How far the current carries the dive, north and east."""
    ellipse_m: Annotated[list[float], numbers(2)]
    """Half axes of the ellipse about the place that holds it in 90 of 100 cases, the longer one
    first."""
    ellipse_rad: float
    """Direction of the longer axis, from north towards east."""


@dataclass(frozen=True, slots=True)
class LadderView(View):
    """When each state was proved."""

    draft_at: datetime | None
    sent_at: datetime | None
    on_board_at: datetime | None
    running_at: datetime | None
    ended_at: datetime | None
    waiting_at: datetime | None = None
    """On board behind the plan being flown; ``null`` of one that never waited there."""


@dataclass(frozen=True, slots=True)
class OnboardView(View):
    """How far the robot says it is with this plan."""

    leg: int
    legs: int
    energy_used: float
    overspent: float = 0.0
    """Energy units that the robot used beyond the plan's account."""
    off_track_m: float | None = None
    """How far it says to be from the expected track of the leg that it flies, or from the leg
    itself where no track is expected; ``null`` between legs."""
    off_track_rms_m: float | None = None
    """The same of the whole flight so far, root mean square, once the plan has ended."""


@dataclass(frozen=True, slots=True)
class PlanView(View):
    """A plan with everything that is known of it."""

    id: str
    robot: str
    kind: PlanKind
    mission_id: str | None
    round: int
    state: PlanState
    """``planning``, ``draft``, ``sent``, ``on_board``, ``running``, ``done``, ``failed``,
    ``superseded`` or ``cancelled``."""
    sha256: str | None
    config_id: str | None
    """The version of the planner's configuration that this plan was made with; ``null`` if a search
    went on for another time than that version says."""
    config: SettingsDocument
    trim_id: str | None
    """The version of the robot's trim that this plan brings on board; ``null`` for the preset."""
    trim_at: datetime | None
    """When that version of the trim was saved."""
    created_at: datetime
    legs: list[LegView]
    points: list[TrajectoryPoint]
    """Promised trajectory: time s, north, east, down m, position standard deviation m."""
    account: AccountView | None
    objective: float | None
    """What it is worth; information is counted at points that the search did not know, where
    ``searched_objective`` is given."""
    objective_unit: str
    violations: list[ViolationView]
    outdated: list[ViolationView]
    """Why it no longer fits the robot while it waits to be flown, as `POST /api/plans/{id}/check`
    says it; a person may send it all the same."""
    stage: PlanStage | None
    """What planning does now: ``waiting`` until other robots of the survey are planned for,
    ``searching`` or ``rehearsing``, which a draft may be too once a person wants that again;
    ``null`` once it has ended."""
    progress: ProgressView | None
    history: list[ObjectiveView]
    runners_up: list[RunnerUpView]
    rehearsal: DryRunView | None
    exploitation: float | None
    """Weight of the map's mean in this round, where the objective has one."""
    replaces: str | None
    """The draft whose place it took, or takes as soon as it is a draft."""
    message: str
    ladder: LadderView
    onboard: OnboardView | None
    transfer: "TransferView | None" = None
    """The newest attempt to bring it on board."""
    tracking: SettingsDocument | None = None
    """Settings of a plan of kind ``track_target``, which has no legs, rounded as they travel; see
    `GET /api/config/tracking/schema`."""
    target_path: list[Annotated[list[float], numbers(3)]] = field(default_factory=list)
    """Where a virtual target will be: time s from the plan's begin, north, east m; of a circle one
    round, of a sine no more swings than its points can show."""
    warnings: list[ViolationView] = field(default_factory=list)
    """What to know before it is sent; none of it keeps it from being sent. ``teaching`` marks a
    plan that lets the estimate of its target diverge."""
    teaches: bool = False
    """Whether it follows a target with nothing that keeps it observable, to show what comes of
    it."""
    inherited: list[InheritedView] = field(default_factory=list)
    """Settings of a plan of kind ``track_target`` that were kept from plans before and differ from
    the preset; plan with ``"base": "preset"`` to be rid of them."""
    searched_objective: float | None = None
    """What the search itself took it to be worth, by which it was found and its history counts;
    ``null`` in plans of an earlier version, and where information is not counted."""
    current_text: str = ""
    """Where the current comes from that it was planned in; empty where no map was asked for."""
    checklist: str = ""
    """Who started it although which checklist was not complete, and why; empty where nobody did."""
    comes_up: list[ComesUpView] = field(default_factory=list)
    """Where each dive will come up, as far as the map of the current tells."""
    rules: list[str] = field(default_factory=list)
    """By what the robot comes up by itself, beside what it always does."""


@dataclass(frozen=True, slots=True)
class PlanSummaryView(View):
    """A plan in a list."""

    id: str
    robot: str
    kind: PlanKind
    mission_id: str | None
    round: int
    state: PlanState
    sha256: str | None
    created_at: datetime
    account: AccountView | None
    objective: float | None
    objective_unit: str
    violations: int
    """How many limits it breaks."""
    message: str
    ladder: LadderView
    teaches: bool = False
    """As in the plan itself."""


@dataclass(frozen=True, slots=True)
class LivePlanView(View):
    """What changes of a plan while people watch."""

    state: PlanState
    stage: PlanStage | None
    progress: ProgressView | None
    ladder: LadderView
    onboard: OnboardView | None
    outdated: list[ViolationView]
    """As in the plan itself."""
    message: str
    transfer: "TransferView | None" = None
    """The newest attempt to bring it on board, while it is under way."""


@dataclass(frozen=True, slots=True)
class TransferView(View):
    """One attempt to bring a plan on board."""

    id: str
    robot: str
    plan_id: str
    state: Annotated[
        str,
        one_of(
            "waiting", "sending", "kept", "on_board", "running",
            "failed", "withdrawn", "superseded",
        ),
    ]  # fmt: skip
    """``waiting`` for a link, ``sending``, ``kept`` on board behind the plan being flown,
    ``on_board``, ``running``, ``failed``, ``withdrawn`` or ``superseded``."""
    items_sent: int
    items: int
    bytes: int
    level: Annotated[str, one_of("created", "queued", "radio", "applied")]
    """How far it is proved: ``created`` (nothing left the station), ``queued``, ``radio`` or
    ``applied``."""
    started_at: datetime
    ended_at: datetime | None
    reason: str
    route: RequestedLink = "auto"
    """What was asked for: ``auto``, ``radio`` or ``satellite``."""
    carrier: str = ""
    """What carries it now, such as ``xbee`` or ``rockblock``; empty before the first byte."""
    sha256: str | None = None
    """Name of the plan, which the robot echoes once it has it."""
    expires_at: datetime | None = None
    """When it is given up; nothing of it is sent after that."""
    credits: int = 0
    """Spent on this transfer so far, repetitions included."""
    parts: list[TransferPartView] = field(default_factory=list)
    """Messages of a transfer by satellite; empty for one by radio."""
    can_withdraw: bool = False
    """Whether it can be withdrawn; what a gateway took already may still reach the robot."""
    text: str = ""
    """How far it is, in one sentence."""
