"""Settings of the informative planner."""

import itertools
import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator
from pydantic.json_schema import SkipJsonSchema

from autonomy.configuration import Configuration, quantity
from autonomy.current.table import FlowRecord, FlowTable, table_of, uniform_table
from autonomy.estimation.config import EstimatorConfig
from autonomy.site import Area, Box

_KEEP_OUTS_MAX = 32
_SWITCH_SHARE = 0.5


class PrimitiveConfig(Configuration):
    """Which motion primitives may be combined, and how fast they are flown (thesis Table 5.1)."""

    glide_speed_m_s: float = quantity(0.05, "m/s", title="Glide vertical speed", gt=0.0)
    """Vertical speed held on every straight glide, up and down."""
    glide_angle_min_rad: float = quantity(
        math.radians(20.0),
        "rad",
        title="Shallowest glide",
        gt=0.0,
        lt=math.pi / 2,
        display_unit="deg",
    )
    """Smallest angle of a glide path below or above the horizon. The vehicle's best ratio of lift
    to drag sets it: 33 degrees down and 39 degrees up for the identified Miniglider."""
    glide_angle_max_rad: float = quantity(
        math.radians(60.0),
        "rad",
        title="Steepest glide",
        gt=0.0,
        lt=math.pi / 2,
        display_unit="deg",
    )
    """Greatest angle of a glide path below or above the horizon."""
    spiral_speed_m_s: float = quantity(0.05, "m/s", title="Spiral vertical speed", gt=0.0)
    """Vertical speed held on every spiral."""
    spiral_radius_min_m: float = quantity(0.15, "m", title="Tightest spiral", gt=0.0)
    """Smallest radius of a spiral; full tail sets it."""
    spiral_radius_max_m: float = quantity(0.35, "m", title="Widest spiral", gt=0.0)
    """Greatest radius of a spiral."""
    spiral_rise_min_m_rad: float = quantity(0.04, "m/rad", title="Flattest spiral", gt=0.0)
    """Smallest change of depth for each radian that a spiral turns."""
    spiral_rise_max_m_rad: float = quantity(0.12, "m/rad", title="Steepest spiral", gt=0.0)
    """Greatest change of depth for each radian that a spiral turns."""
    dive_speed_m_s: float = quantity(0.06, "m/s", title="Flat dive speed", gt=0.0)
    """Vertical speed of a dive with level hull, straight down or up."""
    swim_speed_m_s: float = quantity(0.10, "m/s", title="Swimming speed", gt=0.0)
    """Speed over ground while the tail drives the robot at constant depth."""
    swim_length_min_m: float = quantity(0.2, "m", title="Shortest swim", gt=0.0, advanced=True)
    """Shortest swim; the robot does not hold a course over less."""
    swim_length_max_m: float = quantity(0.6, "m", title="Longest swim", gt=0.0)
    """Longest swim between two other primitives, or at the end before a surfacing."""
    keep_radius_min_m: float = quantity(
        0.6, "m", title="Tightest station keeping", gt=0.0, advanced=True
    )
    """Smallest radius within which the robot can stay at the surface: it must be able to tell that
    it has swum back."""
    swims_under_water: bool = quantity(True, title="Swim under water", advanced=True)
    """Whether the robot may swim at depth, which needs neutral trim; else only at the surface."""
    depth_change_min_m: float = quantity(0.1, "m", title="Smallest depth change", gt=0.0)
    """Glides, spirals and dives change depth by at least this much, so that buoyancy and mass
    actuators can finish their travel well before the end of the leg."""
    primitives_max: int = quantity(4, title="Primitives per edge", ge=1, le=8, advanced=True)
    """Most primitives drawn at random between two surfacings, before those that close the edge."""
    bearing_noise_rad: float = quantity(
        0.6,
        "rad",
        title="Spread of bearings",
        ge=0.0,
        le=math.pi,
        display_unit="deg",
        advanced=True,
    )
    """Standard deviation of a primitive's bearing about the bearing of the next surfacing."""
    point_interval_s: float = quantity(2.0, "s", title="Planned sampling interval", gt=0.0)
    """Time between two planned samples; the points at which information is counted."""

    @model_validator(mode="after")
    def _ranges_are_not_empty(self) -> Self:
        for low, high in (
            ("glide_angle_min_rad", "glide_angle_max_rad"),
            ("spiral_radius_min_m", "spiral_radius_max_m"),
            ("spiral_rise_min_m_rad", "spiral_rise_max_m_rad"),
            ("swim_length_min_m", "swim_length_max_m"),
        ):
            if getattr(self, high) < getattr(self, low):
                raise ValueError(f"{high} must not be less than {low}")
        return self


class EnergyConfig(Configuration):
    """What each primitive costs, in energy units (thesis section 5.5.2)."""

    dive: float = quantity(1.0, title="Cost of a dive", ge=0.0)
    """Energy of the actuators for one flat dive."""
    glide: float = quantity(1.5, title="Cost of a glide", ge=0.0)
    """Energy of the actuators for one straight glide."""
    spiral: float = quantity(1.5, title="Cost of a spiral", ge=0.0)
    """Energy of the actuators for one spiral."""
    swim_factor: float = quantity(0.2, title="Cost of tail work", ge=0.0)
    """Multiplies the integral of the squared tail rate while swimming. The thesis inflates it in
    the tank so that plans look like those of a large field, where swimming drains the battery."""
    time_factor: float = quantity(0.005, "1/s", title="Cost of time", ge=0.0)
    """Energy that the electronics draw each second."""
    tail_amplitude_rad: float = quantity(
        0.35, "rad", title="Tail amplitude", gt=0.0, display_unit="deg", advanced=True
    )
    """Amplitude of the tail beat while swimming."""
    tail_frequency_hz: float = quantity(1.0, "Hz", title="Tail frequency", gt=0.0, advanced=True)
    """Frequency of the tail beat while swimming."""


class ErgodicConfig(Configuration):
    """Objective that spends time where the field is high or unknown (thesis Appendix D)."""

    exploitation: float = quantity(0.2, title="Exploitation", ge=0.0, le=1.0)
    """Weight of the map's mean against its standard deviation: 0 looks only for what is unknown,
    1 only for high values."""
    schedule: Literal["constant", "linear", "switch"] = quantity(
        "constant", title="Schedule of exploitation", advanced=True
    )
    """How exploitation goes on to its final value while the total budget is spent: constant stays
    as it begins, linear follows the share that is spent, switch changes when half is spent."""
    exploitation_end: float | None = quantity(
        None, title="Exploitation at the end", ge=0.0, le=1.0, advanced=True
    )
    """Exploitation when the whole budget is spent, for a schedule that is not constant; without a
    value it stays as it begins."""
    reach_north_m: float = quantity(0.25, "m", title="Reach to the north", gt=0.0, advanced=True)
    """Standard deviation, northward, of the region that one sample stands for."""
    reach_east_m: float = quantity(0.25, "m", title="Reach to the east", gt=0.0, advanced=True)
    """Standard deviation, eastward, of the region that one sample stands for."""
    reach_depth_m: float = quantity(0.15, "m", title="Reach in depth", gt=0.0, advanced=True)
    """Standard deviation, in depth, of the region that one sample stands for."""


class SearchConfig(Configuration):
    """How the graph of surfacings grows (thesis Algorithm 1), and what it may take."""

    step_m: float = quantity(1.4, "m", title="Longest distance between surfacings", gt=0.0)
    """Two successive surfacings are at most this far apart."""
    near_radius_m: float = quantity(0.9, "m", title="Near radius", gt=0.0, advanced=True)
    """A new surfacing is also reached from every other one within this radius."""
    nearest_radius_m: float = quantity(1.0, "m", title="Preferred distance", ge=0.0, advanced=True)
    """The graph grows from the surfacing whose distance is closest to this."""
    transects: int = quantity(0, title="Transects to begin with", ge=0, le=64, advanced=True)
    """Lines of like dives, in so many directions evenly spread, that the search begins with and
    refines; each turns aside where the water ends. In water much wider than a dive they show how
    far the budget reaches, where random surfacings stay near the start; 0 begins at random."""
    near_max: int = quantity(20, title="Most near surfacings", ge=1, le=30, advanced=True)
    """At most this many surfacings within the near radius, drawn at random, are joined to a new
    one; the graph would otherwise grow deep before it grows wide."""
    edges_per_call: int = quantity(3, title="Edges per pair", ge=1, le=10, advanced=True)
    """Trajectories tried each time two surfacings are joined."""
    min_budget_fraction: float = quantity(
        0.9, title="Least budget spent", ge=0.0, lt=1.0, advanced=True
    )
    """Only trajectories that spend more than this part of the budget are compared; the best
    shorter one is offered when none does."""
    paths_per_node: int = quantity(60, title="Paths kept per surfacing", ge=1, advanced=True)
    """Trajectories remembered at each surfacing for extension; their number grows exponentially
    otherwise. A result says when the limit was met."""
    iterations_max: int = quantity(0, title="Most iterations", ge=0, advanced=True)
    """Ends the search after this many steps, each a new surfacing or one refinement of a
    trajectory, which makes it repeatable whatever the speed of the machine; 0 lets the planning
    time decide alone."""
    memory_mb: int = quantity(300, "MB", title="Memory", ge=32, le=4000, advanced=True)
    """Most memory that the tables of the search may grow to; the search ends when they are full."""
    points_per_edge_max: int = quantity(
        16, title="Points per trajectory piece", ge=2, le=64, advanced=True
    )
    """Runs of successive planned samples between two surfacings are averaged until no more than
    this many remain, while trajectories are compared; offered ones are judged with all of them."""
    past_samples_max: int = quantity(256, title="Past samples", ge=1, advanced=True)
    """Runs of successive past samples are averaged until no more than this many remain, while
    trajectories are compared; offered ones are judged with up to 600."""
    runners_up: int = quantity(3, title="Alternatives", ge=0, le=10, advanced=True)
    """Distinct trajectories shown beside the best one."""

    @model_validator(mode="after")
    def _near_is_within_a_step(self) -> Self:
        if self.near_radius_m > self.step_m:
            raise ValueError("near_radius_m must not exceed step_m")
        return self


class MissionConfig(Configuration):
    """What surrounds the legs of a plan: surfacings, patience, and how long a draft stays true."""

    turn_time_s: float = quantity(20.0, "s", title="Time of a surfacing", ge=0.0, le=600.0)
    """Time that each dive takes beside its legs: the last slow centimetres to the surface, the
    fix, and the turn to the next leg. It counts in a plan's duration and, as time, in its energy.
    Over six simulated rounds it makes planned and flown time agree: 20 s for Miniglider, 25 s for
    GRACE 3."""
    approach_share: float = quantity(0.5, title="Longest way to the domain", ge=0.0, le=1.0)
    """A robot outside the domain may spend at most this part of a round's budget on the swim back;
    farther away it is not planned for."""
    surfacing_bytes: int = quantity(
        100, "B", title="Message of a surfacing", ge=0, le=100_000, advanced=True
    )
    """Satellite bytes that each surfacing takes: the robot's report and the samples it sends."""
    patience_factor: float = quantity(2.0, title="Patience, relative", ge=1.0, le=10.0)
    """The robot comes up and ends its mission when that takes this many times its planned
    duration, and the time of the following setting on top."""
    patience_s: float = quantity(900.0, "s", title="Patience, added", ge=0.0, le=86400.0)
    """Time that a mission may take beyond its planned duration times the setting above."""
    draft_distance_m: float = quantity(3.0, "m", title="Draft's start, distance", gt=0.0)
    """A draft counts as outdated once the robot is farther than this from where it begins: a robot
    swims back to there first, and as long as the way is free that costs little."""
    draft_age_s: float = quantity(3600.0, "s", title="Draft's age", gt=0.0, le=604800.0)
    """A draft counts as outdated this long after it was made."""


class PlannedCurrentConfig(Configuration):
    """The horizontal current that the planner allows for."""

    source: Literal["none", "typed", "map"] = quantity("typed", title="Current from")
    """``none``: plans take the water for still. ``typed``: a steady current, the same everywhere.
    ``map``: what finished dives told of it, at each dive's own place, depth and time; with too few
    or too old dives the typed one is used."""
    north_m_s: float = quantity(0.0, "m/s", title="Current to the north", ge=-3.0, le=3.0)
    """Speed at which the water moves north. The robot does not feel it under water: a plan aims
    off by it, so that the robot surfaces where it was meant to."""
    east_m_s: float = quantity(0.0, "m/s", title="Current to the east", ge=-3.0, le=3.0)
    """Speed at which the water moves east."""
    flow: SkipJsonSchema[FlowRecord | None] = quantity(None, title="Table", advanced=True)
    """What a plan of the map was made in; the station writes it."""

    @property
    def steady_ne_m_s(self) -> tuple[float, float]:
        """What is the same everywhere and always; nothing where a table holds, or none does."""
        if self.source == "none" or self.flow is not None:
            return 0.0, 0.0
        return self.north_m_s, self.east_m_s

    @property
    def table(self) -> FlowTable:
        """The current by place, depth and time."""
        if self.source != "none" and self.flow is not None:
            return table_of(self.flow)
        return uniform_table(*self.steady_ne_m_s)


class AdaptiveConfig(Configuration):
    """What happens between the rounds of a survey."""

    plan_ahead: bool = quantity(True, title="Plan ahead")
    """Plan the next round while the robot still flies the present one, from where it will
    surface; the plan is made anew if the map or the place turns out otherwise."""
    warm_start: bool = quantity(True, title="Begin with known plans")
    """Begin the search with the rest and the alternatives of the round before."""
    rehearse: bool = quantity(True, title="Rehearse plans")
    """Fly each draft with the robot's full dynamics before it is offered, and show how far planned
    and flown track lie apart."""
    greatest_chance: float = quantity(
        1.0, title="Chance of leaving the water, at most", gt=0.0, le=1.0
    )
    """Where more of a plan's rehearsed flights leave the water or enter a keep-out, it is planned
    again with a larger margin; a plan that still does is not ready, and says which leg it is. 200
    flights can promise 0.005 at best, the 24 of a long plan 0.04; 1 sets no limit."""


class PlannerConfig(Configuration):
    """Everything that a survey's planner can be told."""

    domain: Box = quantity(Box(), title="Domain")
    """The part of the water to explore; no planned point leaves it."""
    area: Area | None = quantity(None, title="Survey area")
    """A polygon within the domain that the survey is confined to; without one all of the domain."""
    total_budget: float = quantity(80.0, "units", title="Total energy budget", gt=0.0)
    """Energy units for the whole survey: a glide or spiral costs 1.5, a dive 1, and time."""
    round_budget: float = quantity(20.0, "units", title="Energy budget of a round", gt=0.0)
    """Energy units for one round, after which the map is updated and the next round planned."""
    time_budget_s: float = quantity(
        0.0, "s", title="Time budget of a round", ge=0.0, le=2_592_000.0
    )
    """Longest duration of one round, surfacings included; 0 sets no limit."""
    satellite_bytes: int = quantity(
        0, "B", title="Satellite budget of a round", ge=0, advanced=True
    )
    """Most bytes that the surfacings of one round may send by satellite; 0 sets no limit."""
    target_std: float = quantity(0.0, title="Map is good enough at", ge=0.0, advanced=True)
    """The survey ends when the map's standard deviation, averaged over the domain in the scale of
    the field's model, is at or below this; 0 never ends it before the budget is spent."""
    objective: Literal["information_gain", "ergodic", "weighted"] = quantity(
        "information_gain", title="Objective"
    )
    """Information gain removes as much uncertainty from the map as possible; ergodic spends time
    where the map is high or uncertain; weighted adds both up."""
    information_weight: float = quantity(
        0.5, title="Weight of information", ge=0.0, le=1.0, advanced=True
    )
    """Weight of information gain against the ergodic objective where the objective is weighted:
    1 is information gain alone, 0 ergodic alone."""
    max_uncertainty_m: float = quantity(0.25, "m", title="Maximum position uncertainty", gt=0.0)
    """Greatest standard deviation of the horizontal position that a plan may reach before the
    robot surfaces for a fix."""
    planning_time_s: float = quantity(5.0, "s", title="Planning time", gt=0.0, le=600.0)
    """How long the planner may search; it can be stopped earlier and then offers its best."""
    fidelity_thresholds_m: tuple[float, ...] = quantity((0.05, 0.12), "m", title="Fidelity levels")
    """Position uncertainties that part the levels of fidelity, best level first: samples below the
    first threshold are the most trusted."""
    fidelity_counts: bool = quantity(True, title="Fidelity counts", advanced=True)
    """Whether information gain takes samples of lower fidelity for noisier; otherwise every sample
    counts the same wherever it was taken."""
    seed: int = quantity(0, title="Random seed", ge=0, advanced=True)
    """Starting point of the random search; the same seed repeats it."""
    keep_outs: Annotated[tuple[Area, ...], Field(max_length=_KEEP_OUTS_MAX)] = quantity(
        (), title="Keep-outs"
    )
    """Areas that no leg may enter at any depth, such as moorings, nets or a bathing place."""
    margin_m: float = quantity(
        0.0, "m", title="Margin to the sides", ge=0.0, le=10_000.0, advanced=True
    )
    """Every leg stays at least this far from the shoreline and from keep-outs."""
    floor_margin_m: float = quantity(
        0.0, "m", title="Margin to the floor", ge=0.0, le=1000.0, advanced=True
    )
    """Every leg stays at least this far above the floor."""
    current: PlannedCurrentConfig = quantity(PlannedCurrentConfig(), title="Current")
    """Current that plans allow for."""
    primitives: PrimitiveConfig = quantity(PrimitiveConfig(), title="Motion", advanced=True)
    """Primitives that the robot can fly."""
    energy: EnergyConfig = quantity(EnergyConfig(), title="Energy", advanced=True)
    """Costs of the primitives."""
    position_filter: EstimatorConfig = quantity(
        EstimatorConfig(), title="Position filter", advanced=True
    )
    """What the robot's position filter assumes: how uncertain its position will be along a plan."""
    ergodic: ErgodicConfig = quantity(ErgodicConfig(), title="Ergodic objective", advanced=True)
    """Settings of the ergodic objective."""
    search: SearchConfig = quantity(SearchConfig(), title="Search", advanced=True)
    """Settings of the search itself."""
    mission: MissionConfig = quantity(MissionConfig(), title="Mission", advanced=True)
    """What surrounds the legs of a plan."""
    adaptive: AdaptiveConfig = quantity(AdaptiveConfig(), title="Between rounds", advanced=True)
    """What the station does by itself from one round to the next."""

    def counted_thresholds_m(self) -> tuple[float, ...]:
        """Return the fidelity thresholds that information gain heeds."""
        return self.fidelity_thresholds_m if self.fidelity_counts else ()

    @property
    def surfacing_energy(self) -> float:
        """Energy units that each dive takes beside its legs, which is the time of a surfacing."""
        return self.energy.time_factor * self.mission.turn_time_s

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if self.round_budget > self.total_budget:
            raise ValueError("round_budget must not exceed total_budget")
        levels = (0.0, *self.fidelity_thresholds_m)
        if any(low >= high for low, high in itertools.pairwise(levels)):
            raise ValueError("fidelity_thresholds_m must be positive and ascend strictly")
        names = [area.name for area in self.keep_outs]
        if len(set(names)) < len(names):
            raise ValueError("keep_outs must have different names")
        if self.primitives.depth_change_min_m > self.domain.depth_max_m:
            raise ValueError(
                "primitives.depth_change_min_m must not exceed the domain's depth_max_m"
            )
        return self


def exploitation_at(config: PlannerConfig, spent_share: float) -> float:
    """Return the weight of the map's mean in the ergodic objective at one time of a survey.

    Args:
        config: Where it begins and ends, and on which schedule.
        spent_share: Part (0..1) of the total budget that is spent.
    """
    begin, end = config.ergodic.exploitation, config.ergodic.exploitation_end
    share = min(max(spent_share, 0.0), 1.0)
    if end is None or config.ergodic.schedule == "constant":
        return begin
    if config.ergodic.schedule == "switch":
        return end if share >= _SWITCH_SHARE else begin
    return begin + share * (end - begin)
