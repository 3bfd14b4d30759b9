"""Settings of range-only target tracking, and presets per vehicle."""

import math
from typing import Literal, Self

from pydantic import model_validator

from autonomy.configuration import Configuration, quantity

ControllerName = Literal[
    "barrier", "nominal", "mpc_none", "mpc_trace", "mpc_determinant", "mpc_condition"
]


class TargetConfig(Configuration):
    """What is followed."""

    kind: Literal["virtual", "tag", "beacon"] = quantity("virtual", title="Target")
    """``virtual``: a target that the robot computes itself, as in the thesis's tank experiment
    (section 4.5). ``tag``: an acoustic tag that moves. ``beacon``: an acoustic beacon that stays
    where it is."""
    address: int = quantity(10, title="Acoustic address", ge=1, le=127)
    """Address of the tag's or beacon's acoustic modem; a virtual target has none."""
    depth_m: float = quantity(0.0, "m", title="Target depth", ge=0.0, le=1000.0)
    """Depth of the target; takes a slant range into the horizontal."""
    north_m: float = quantity(1.4, "m", title="Target north", ge=-1e5, le=1e5)
    """Northing in the site frame: where a virtual target begins and a beacon stands, and the first
    guess of where a tag is."""
    east_m: float = quantity(0.7, "m", title="Target east", ge=-1e5, le=1e5)
    """Easting in the site frame, as the northing."""
    guess_std_m: float = quantity(0.35, "m", title="First guess is right within", gt=0.0, le=1e4)
    """Standard deviation per axis of the first guess of the target's position."""
    path: Literal["static", "line", "sine", "circle"] = quantity("circle", title="Virtual path")
    """How a virtual target moves."""
    speed_m_s: float = quantity(0.01, "m/s", title="Virtual speed", ge=0.0, le=2.0)
    """Speed of a virtual target."""
    heading_rad: float = quantity(
        0.0, "rad", title="Virtual heading", ge=-math.pi, le=math.pi, display_unit="deg"
    )
    """Direction in which a virtual target sets out; 0 is north, positive to east."""
    width_m: float = quantity(0.3, "m", title="Path width", gt=0.0, le=1e4)
    """Amplitude of a sine path, radius of a circle."""
    period_s: float = quantity(120.0, "s", title="Sine period", gt=0.0, le=1e5, advanced=True)
    """Period of a sine path."""


class RangingConfig(Configuration):
    """How ranges are taken, and when they count as failed."""

    period_s: float = quantity(0.2, "s", title="Time between ranges", ge=0.05, le=600.0)
    """How often the target is asked for its range."""
    variance_m2: float = quantity(0.1, "m2", title="Range noise", gt=0.0, le=1e4)
    """Variance of one range (thesis section 4.4: 0.1)."""
    gate: float = quantity(4.0, "", title="Outlier gate", gt=0.0, le=20.0, advanced=True)
    """A range farther than this many standard deviations from what is expected is not believed."""
    sound_speed_m_s: float = quantity(
        1500.0, "m/s", title="Sound speed", ge=1300.0, le=1700.0, advanced=True
    )
    """Speed of sound between robot and target."""
    coast_after_s: float = quantity(3.0, "s", title="Coasting after", gt=0.0, le=3600.0)
    """Silence after which the robot counts as coasting."""
    lost_after_s: float = quantity(15.0, "s", title="Lost after", gt=0.0, le=3600.0)
    """Silence, or contradiction, after which the track counts as lost and the robot searches."""
    give_up_after_s: float = quantity(120.0, "s", title="Give up after", gt=0.0, le=86400.0)
    """A track lost for so long ends the mission."""

    @model_validator(mode="after")
    def _ascends(self) -> Self:
        if not self.coast_after_s < self.lost_after_s < self.give_up_after_s:
            raise ValueError("coast_after_s, lost_after_s, give_up_after_s must ascend")
        if not self.period_s < self.coast_after_s:
            raise ValueError(
                f"coast_after_s ({self.coast_after_s:g} s) must exceed period_s "
                f"({self.period_s:g} s): between two ranges nothing has failed"
            )
        return self


class FilterConfig(Configuration):
    """The estimator of the target (specification: EKF of 4 states, target velocity, bank)."""

    hypotheses: Literal["one", "two", "cloud"] = quantity("cloud", title="Hypotheses")
    """``cloud``: the joint filter beside the bank, for anything that swims by itself; ``two``: the
    bank alone, which also follows the mirrored estimate, for a target that hardly changes its
    velocity; ``one``: the thesis's single filter."""
    target_velocity: Literal["estimated", "known"] = quantity("estimated", title="Target velocity")
    """``known`` is possible for a virtual target or a beacon only."""
    position_density_m2_s: float = quantity(
        3.5e-3, "m2/s", title="Position noise", gt=0.0, le=100.0, advanced=True
    )
    """Growth of the variance of the relative position, per axis."""
    heading_density_rad2_s: float = quantity(
        4e-4, "rad2/s", title="Heading noise", gt=0.0, le=1.0, advanced=True
    )
    """Growth of the heading's variance."""
    speed_density_m2_s3: float = quantity(
        6e-5, "m2/s3", title="Speed noise", gt=0.0, le=1.0, advanced=True
    )
    """Growth of the speed's variance."""
    heading_variance_rad2: float = quantity(
        0.0175, "rad2", title="Heading measurement noise", gt=0.0, le=1.0, advanced=True
    )
    """Variance of one measured heading."""
    speed_variance_m2_s2: float = quantity(
        0.1, "m2/s2", title="Speed measurement noise", gt=0.0, le=10.0, advanced=True
    )
    """Variance of one measured speed."""
    target_speed_std_m_s: float = quantity(
        0.1, "m/s", title="Target speed is within", gt=0.0, le=10.0, advanced=True
    )
    """Standard deviation per axis of the target's velocity before any range was heard. Where it is
    not well below the robot's own speed and ranges are rare, a target that stays seems to move at
    first."""
    target_acceleration_density: float = quantity(
        2e-6, "m2/s3", title="Target acceleration noise", gt=0.0, le=1.0, advanced=True
    )
    """How much the target's velocity may change."""
    target_position_variance_m2: float = quantity(
        2.5, "m2", title="Target position noise", gt=0.0, le=1e4, advanced=True
    )
    """Variance of the target's position as the velocity filter measures it ten times a second;
    rarer ranges count for more."""


class BarrierConfig(Configuration):
    """What the robot gives up of its course so that the target stays observable."""

    controller: ControllerName = quantity("barrier", title="Controller")
    """``barrier``: the pursuit law, changed as little as keeps the target observable. ``nominal``:
    the pursuit law and a single filter alone, whose estimate diverges: for teaching only.
    ``mpc_...``: predictive controllers that weigh tracking against nothing, trace of the
    covariance, determinant, or condition number; they are slower."""
    shape: Literal["absolute", "squared"] = quantity("absolute", title="Barrier", advanced=True)
    """``absolute``: |det| - sqrt(eps). ``squared``: det^2 - eps, the thesis's, with a dead spot
    where robot, course and target lie on one line."""
    epsilon: float = quantity(0.0065, "m4/s2", title="Barrier level (eps_B)", gt=0.0, le=1e6)
    """The squared determinant that must be kept; its root, by the most turn rate, is the squared
    radius of the orbit around a target that stays."""
    alpha: Literal["linear", "cubic", "negative", "zero", "root", "constant"] = quantity(
        "linear", title="Class-K function", advanced=True
    )
    """How fast the barrier may fall: slope times B, B^3, -B, 0, sgn(B) sqrt|B|, or -1 (Appendix C).
    Only the first two are class K; with the negative ones the robot may run away."""
    slope: float = quantity(0.13, "1/s", title="Slope", gt=0.0, le=100.0)
    """Factor of the class-K function."""
    fallback: Literal["best_effort", "nominal"] = quantity(
        "best_effort", title="When it cannot be kept", advanced=True
    )
    """``best_effort``: do what raises the barrier most. ``nominal``: the thesis's, a trap."""
    heading_gain_per_s: float = quantity(1.0, "1/s", title="Heading gain (k_psi)", gt=0.0, le=10.0)
    """Turn rate by heading error of the pursuit law."""
    distance_gain_per_s2: float = quantity(
        0.1, "1/s2", title="Distance gain (k_rho)", gt=0.0, le=10.0
    )
    """Acceleration by distance of the pursuit law."""
    lead_m: float = quantity(0.25, "m", title="Lead (epsilon)", ge=0.0, le=100.0, advanced=True)
    """The pursuit law steers a point so far ahead of the robot onto the target."""

    @property
    def is_teaching(self) -> bool:
        """Whether nothing keeps the target observable, to show what comes of it.

        Such a mission has the thesis's single filter and neither gate nor search.
        """
        return self.controller == "nominal"


class MotionConfig(Configuration):
    """What the robot can do as a unicycle, and where it must not go."""

    turn_rate_max_rad_s: float = quantity(
        math.pi / 4, "rad/s", title="Most turn rate", gt=0.0, le=10.0, display_unit="deg/s"
    )
    """Limit of the turn rate, either way."""
    acceleration_min_m_s2: float = quantity(
        -0.01, "m/s2", title="Most braking", ge=-10.0, le=0.0, advanced=True
    )
    """Lower limit of the acceleration; 0 for a robot that cannot brake."""
    acceleration_max_m_s2: float = quantity(
        0.01, "m/s2", title="Most acceleration", gt=0.0, le=10.0, advanced=True
    )
    """Upper limit of the acceleration."""
    speed_max_m_s: float = quantity(0.6, "m/s", title="Speed cap", gt=0.0, le=10.0)
    """The controller does not ask for more speed than this."""
    speed_min_m_s: float = quantity(
        0.05, "m/s", title="Speed floor", ge=-10.0, le=10.0, advanced=True
    )
    """The controller does not ask for less speed: a robot that stands learns nothing from ranges.
    Negative for one that may swim backwards, as the thesis's unicycle does."""
    depth_m: float = quantity(0.0, "m", title="Swimming depth", ge=0.0, le=1000.0)
    """Depth at which the robot swims; 0 is the surface, where it can talk."""
    margin_m: float = quantity(0.3, "m", title="Distance from walls and shore", ge=0.0, le=1e3)
    """A robot nearer to walls or shore than this turns inward; outside of the water it ends."""
    duration_s: float = quantity(600.0, "s", title="Duration", gt=0.0, le=86400.0)
    """The mission ends after this time."""

    @model_validator(mode="after")
    def _leaves_a_speed(self) -> Self:
        if not self.speed_min_m_s < self.speed_max_m_s:
            raise ValueError("speed_min_m_s must be below speed_max_m_s")
        return self


class TrackingConfig(Configuration):
    """A mission that follows a target: what, by which ranges, filter and controller, how long."""

    target: TargetConfig = TargetConfig()
    ranging: RangingConfig = RangingConfig()
    filter: FilterConfig = FilterConfig()
    barrier: BarrierConfig = BarrierConfig()
    motion: MotionConfig = MotionConfig()


THESIS_TRACKING = TrackingConfig(
    target=TargetConfig(path="line", speed_m_s=0.0235, north_m=0.0, east_m=0.0),
    barrier=BarrierConfig(shape="squared", fallback="nominal"),
    filter=FilterConfig(hypotheses="one"),
    motion=MotionConfig(speed_min_m_s=-10.0, speed_max_m_s=10.0),
)
"""The scenario that reproduces the tables of chapter 4; not the author's own settings, which the
thesis does not print."""

_MINIGLIDER = TrackingConfig(
    target=TargetConfig(north_m=1.375, east_m=0.385, speed_m_s=0.005, width_m=0.3, guess_std_m=0.2),
    ranging=RangingConfig(period_s=0.2, variance_m2=0.1),
    filter=FilterConfig(
        target_speed_std_m_s=0.015,
        position_density_m2_s=1e-3,
        heading_density_rad2_s=2e-3,
        speed_density_m2_s3=3e-5,
        heading_variance_rad2=3e-3,
        speed_variance_m2_s2=3e-4,
        target_acceleration_density=1e-8,
        target_position_variance_m2=300.0,
    ),
    barrier=BarrierConfig(epsilon=4.5e-4, slope=0.4),
    motion=MotionConfig(
        turn_rate_max_rad_s=0.1,
        acceleration_min_m_s2=0.0,
        speed_min_m_s=0.01,
        speed_max_m_s=0.06,
        margin_m=0.5,
    ),
)
"""A virtual target in the middle of the tank. The robot turns by 0.1 rad/s at the most, and the
faster it swims the wider it turns: 0.06 m/s is what keeps the orbit small. The barrier's level is
what the tail reaches on an orbit that leaves room to turn before the walls."""

_GRACE3 = TrackingConfig(
    target=TargetConfig(
        kind="tag", north_m=120.0, east_m=144.0, depth_m=3.0, guess_std_m=12.0, path="static"
    ),
    ranging=RangingConfig(
        period_s=1.0,
        variance_m2=2.8,
        coast_after_s=10.0,
        lost_after_s=40.0,
        give_up_after_s=600.0,
    ),
    filter=FilterConfig(
        hypotheses="cloud",
        target_speed_std_m_s=0.03,
        position_density_m2_s=0.02,
        heading_density_rad2_s=5e-3,
        speed_density_m2_s3=1e-4,
        heading_variance_rad2=0.1,
        speed_variance_m2_s2=3e-3,
        target_acceleration_density=1e-7,
        target_position_variance_m2=1e4,
    ),
    barrier=BarrierConfig(
        epsilon=0.6,
        slope=0.05,
        heading_gain_per_s=0.05,
        distance_gain_per_s2=0.01,
        lead_m=2.0,
    ),
    motion=MotionConfig(
        turn_rate_max_rad_s=0.05,
        speed_min_m_s=0.04,
        speed_max_m_s=0.15,
        margin_m=15.0,
        duration_s=1800.0,
    ),
)
"""An acoustic tag in the lake. Eddies there are a third as fast as the robot, so it knows its own
course badly: an orbit of some metres is what its estimate allows, what looks like a moving target
is believed slowly, and a joint filter stands beside the bank."""

TRACKING_PRESETS: dict[str, TrackingConfig] = {"miniglider": _MINIGLIDER, "grace3": _GRACE3}
"""Settings a robot starts with, by vehicle, found on the simulated robots with all their
dynamics."""
