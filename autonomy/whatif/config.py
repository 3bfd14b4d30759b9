"""The scenario of a trial as one generated form; free of compiled code."""

import math
from dataclasses import dataclass
from typing import Literal, Self

from pydantic import model_validator

from autonomy.configuration import Configuration, quantity
from autonomy.control.catalogue import ControllerConfig
from autonomy.control.trajectory import LINEAR_GLIDE_VELOCITY_NED
from autonomy.described import Described
from autonomy.site import Site

ReferenceName = Literal[
    "linear_glide", "sawtooth", "diagonal", "figure_eight", "straight_glide", "level_swim"
]
"""The trajectories of thesis sections 3.3 and 3.4, and two whose numbers are free."""
MOST_STEPS = 400_000
"""Longest trial, in steps of the model: with a command at each, about 150 MB while it flies."""


class StraightConfig(Configuration):
    """A straight glide, or a level swim, of one's own."""

    glide_angle_rad: float = quantity(
        math.radians(-45.0),
        "rad",
        title="Glide angle",
        ge=math.radians(-85.0),
        le=math.radians(85.0),
        display_unit="deg",
    )
    """Inclination of the path of a straight glide, negative down. Its pitch is the one that the
    vehicle glides with on that path."""
    vertical_speed_m_s: float = quantity(0.03, "m/s", title="Vertical speed", gt=0.0, le=2.0)
    """Rate of depth of a straight glide, a magnitude."""
    heading_rad: float = quantity(
        0.0, "rad", title="Heading", ge=-math.pi, le=math.pi, display_unit="deg"
    )
    """Direction over the horizontal plane."""
    depth_m: float = quantity(0.0, "m", title="Depth at the start", ge=0.0, le=1000.0)
    """Depth of the reference at the start."""
    swim_speed_m_s: float = quantity(0.05, "m/s", title="Swimming speed", gt=0.0, le=2.0)
    """Speed of a level swim."""


class StartConfig(Configuration):
    """Where and how the robot starts, against the first point of the reference."""

    north_m: float = quantity(-3.0, "m", title="North of the reference", ge=-1e4, le=1e4)
    """Distance of the robot north of the reference's first point."""
    east_m: float = quantity(-1.5, "m", title="East of the reference", ge=-1e4, le=1e4)
    """Distance of the robot east of the reference's first point."""
    down_m: float = quantity(0.0, "m", title="Below the reference", ge=-1e3, le=1e3)
    """Distance of the robot below the reference's first point."""
    heading_rad: float = quantity(
        0.0, "rad", title="Heading", ge=-math.pi, le=math.pi, display_unit="deg"
    )
    """Heading at the start."""
    pitch_rad: float = quantity(0.0, "rad", title="Pitch", ge=-1.4, le=1.4, display_unit="deg")
    """Pitch at the start, positive nose up."""
    forward_speed_m_s: float = quantity(0.06, "m/s", title="Forward speed", ge=0.0, le=2.0)
    """Speed through the water along the hull."""
    position_scatter_m: float = quantity(0.0, "m", title="Scatter of position", ge=0.0, le=1e3)
    """Standard deviation of north and east of the start from seed to seed."""
    heading_scatter_rad: float = quantity(
        0.0, "rad", title="Scatter of heading", ge=0.0, le=math.pi, display_unit="deg"
    )
    """Standard deviation of the heading at the start from seed to seed."""


class DisturbanceConfig(Configuration):
    """How the robot that flies differs from the model that its controller believes in."""

    net_buoyancy_error_kg: float = quantity(
        0.0, "kg", title="Net buoyancy error", ge=-1.0, le=1.0, display_unit="g"
    )
    """Net mass that is there and that no sensor sees; positive sinks, as a positive offset of a
    robot's trim does: an error of -1 g and a trim of +1 g cancel. A trial flies without the
    robot's trim, so what its pump leaves uncorrected stands here."""
    mass_position_error_m: float = quantity(
        0.0, "m", title="Mass position error", ge=-0.2, le=0.2, display_unit="mm"
    )
    """How far the sliding mass stands forward of what its sensor says; an offset of a robot's trim
    with the opposite sign cancels it."""
    current_source: Literal["typed", "map"] = quantity("typed", title="Current from")
    """``typed``: steady, by the two numbers that follow. ``map``: what dives told of the robot's
    water, by place, depth and time, from where the robot is and from now on."""
    current_north_m_s: float = quantity(0.0, "m/s", title="Current north", ge=-2.0, le=2.0)
    """Northward velocity of the water."""
    current_east_m_s: float = quantity(0.0, "m/s", title="Current east", ge=-2.0, le=2.0)
    """Eastward velocity of the water."""
    parameter_error: float = quantity(0.0, "", title="Parameter error", ge=0.0, le=0.3)
    """Standard deviation of each parameter's error as a share of it; drawn anew for each seed."""
    actuator_rate_share: float = quantity(1.0, "", title="Rate of the sliding mass", gt=0.0, le=2.0)
    """Greatest speed of the sliding mass as a share of the nominal one."""
    actuator_delay_s: float = quantity(0.0, "s", title="Delay of the sliding mass", ge=0.0, le=2.0)
    """Time between a command and the beginning of the sliding mass's answer."""


class SensingConfig(Configuration):
    """What the controller gets to know of the state."""

    exact: bool = quantity(True, title="Exact states")
    """Whether the controller sees the true state. If not, it sees measurements with the noise
    below and the velocity of the model-based observer."""
    position_std_m: float = quantity(0.055, "m", title="Position noise", ge=0.0, le=100.0)
    """Standard deviation of north and east, each."""
    position_correlation_s: float = quantity(
        5.0, "s", title="Correlation of position noise", ge=0.0, le=1000.0, advanced=True
    )
    """Time over which the position noise stays alike; 0 for white noise."""
    depth_std_m: float = quantity(0.003, "m", title="Depth noise", ge=0.0, le=10.0)
    """Standard deviation of the depth."""
    tilt_std_rad: float = quantity(
        math.radians(0.5), "rad", title="Roll and pitch noise", ge=0.0, le=1.0, display_unit="deg"
    )
    """Standard deviation of roll and pitch, each."""
    heading_std_rad: float = quantity(
        math.radians(2.0), "rad", title="Heading noise", ge=0.0, le=1.0, display_unit="deg"
    )
    """Standard deviation of the heading."""
    gyro_std_rad_s: float = quantity(0.005, "rad/s", title="Gyro noise", ge=0.0, le=1.0)
    """Standard deviation of each angular velocity."""
    observer_velocity_gain: float = quantity(
        0.25, "1/s2", title="Observer gain K1", ge=0.0, le=25.0, advanced=True
    )
    """How strongly the depth error corrects the observer's velocity."""
    observer_depth_gain: float = quantity(
        1.0, "1/s", title="Observer gain K2", ge=0.0, le=10.0, advanced=True
    )
    """How strongly the depth error corrects the observer's depth."""


class TrialConfig(Configuration):
    """A scenario that several controllers are tried in.

    The default is the linear glide of thesis Table 3.1, whose start the thesis does not print.
    """

    reference: ReferenceName = quantity("linear_glide", title="Reference")
    """The trajectory to track."""
    straight: StraightConfig = quantity(StraightConfig(), title="Straight path")
    """Numbers of a straight glide or a level swim."""
    duration_s: float = quantity(540.0, "s", title="Duration", gt=0.0, le=36_000.0)
    """How long the robot tracks."""
    control_period_s: float = quantity(
        0.0, "s", title="Control period", ge=0.0, le=10.0, advanced=True
    )
    """Time for which a command is held, rounded to whole steps; 0 lets the controller work at
    every step."""
    step_s: float = quantity(0.01, "s", title="Step of the model", ge=1e-4, le=0.1, advanced=True)
    """Step of the Runge-Kutta integration."""
    model: Literal["thesis", "extended"] = quantity("thesis", title="Model")
    """The 12 states of chapter 3 with actuators that only have a greatest rate, or the 15 states
    of section 5.3, whose tail also pushes."""
    start: StartConfig = quantity(StartConfig(), title="Start")
    """State at the beginning."""
    disturbance: DisturbanceConfig = quantity(DisturbanceConfig(), title="Disturbance")
    """What the controller does not know."""
    sensing: SensingConfig = quantity(SensingConfig(), title="Sensing")
    """What the controller sees."""
    runs: int = quantity(1, title="Runs", ge=1, le=200)
    """How many seeds each controller is tried on."""
    seed: int = quantity(1, title="First seed", ge=0, le=2**31 - 1)
    """Seed of the first run; the others follow on."""

    @model_validator(mode="after")
    def _is_bounded(self) -> Self:
        if self.duration_s > MOST_STEPS * self.step_s:
            raise ValueError(f"a trial has at most {MOST_STEPS} steps; take a longer step_s")
        if self.duration_s < self.step_s:
            raise ValueError("duration_s must be at least one step_s")
        return self

    @property
    def steps_per_period(self) -> int:
        """Steps of the model for which a command is held."""
        return max(1, round(self.control_period_s / self.step_s))

    @property
    def period_s(self) -> float:
        """Time between two commands."""
        return self.steps_per_period * self.step_s

    @property
    def periods(self) -> int:
        """Number of commands."""
        return max(1, round(self.duration_s / self.period_s))

    @property
    def seeds(self) -> tuple[int, ...]:
        """Seed of every run."""
        return tuple(range(self.seed, self.seed + self.runs))


@dataclass(frozen=True, slots=True)
class ControllerChoice(Described):
    """A controller with its settings, and what it is called in a comparison."""

    kind: str
    """Key of ``CONTROLLERS``."""
    title: str
    config: ControllerConfig
    """The whole settings."""


_AT_THE_REFERENCE = StartConfig(north_m=0.0, east_m=0.0, forward_speed_m_s=0.02)

TABLE_3_1_LINEAR = TrialConfig()
"""Linear glide of thesis Table 3.1: exact states, continuous control, start fitted."""
TABLE_3_1_SAWTOOTH = TrialConfig(
    reference="sawtooth", start=StartConfig(north_m=0.0, east_m=-1.0, down_m=-1.0)
)
"""Sawtooth of thesis Table 3.1."""
TABLE_3_3_DIAGONAL = TrialConfig(
    reference="diagonal",
    duration_s=225.0,
    control_period_s=0.1,
    start=_AT_THE_REFERENCE,
    disturbance=DisturbanceConfig(net_buoyancy_error_kg=0.001),
    sensing=SensingConfig(exact=False),
    runs=10,
)
"""Diagonal of thesis Table 3.3 (Eq. 3.21), whose start, noise and duration are chosen here."""
TABLE_3_3_FIGURE_EIGHT = TABLE_3_3_DIAGONAL.model_copy(update={"reference": "figure_eight"})
"""Figure of eight of thesis Table 3.3 (Eq. 3.22)."""

TRIAL_PRESETS: dict[str, TrialConfig] = {
    "miniglider": TABLE_3_1_LINEAR,
    "grace3": TrialConfig(
        reference="straight_glide",
        straight=StraightConfig(vertical_speed_m_s=0.06),
        duration_s=600.0,
        control_period_s=0.1,
        step_s=0.02,
        start=StartConfig(north_m=-7.5, east_m=-4.0, forward_speed_m_s=0.1),
    ),
}
"""Scenario that a form starts with, by vehicle, in water without bounds."""
_SHORTEST_S = 60.0
"""A glide that has room for less says little of a controller."""


def fitting(trial: TrialConfig, site: Site) -> TrialConfig:
    """Return a scenario whose glide stays in the water of a site.

    A glide that would go too deep ends where the surveyed part of the water ends; where too little
    is left of it, it becomes the diagonal of the thesis's own tank, from the reference's first
    point.

    Args:
        trial: The scenario as it is in deep water.
        site: Where the robot is.
    """
    if trial.reference == "linear_glide":
        sink_m_s = LINEAR_GLIDE_VELOCITY_NED[2]
    elif trial.reference == "straight_glide" and trial.straight.glide_angle_rad < 0.0:
        sink_m_s = trial.straight.vertical_speed_m_s
    else:
        return trial
    longest_s = math.floor(site.domain.depth_max_m / sink_m_s)
    if longest_s >= _SHORTEST_S:
        return trial.model_copy(update={"duration_s": min(trial.duration_s, longest_s)})
    tank = TABLE_3_3_DIAGONAL
    update = {"reference": tank.reference, "duration_s": tank.duration_s, "start": tank.start}
    return trial.model_copy(update=update)
