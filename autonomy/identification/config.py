"""Settings of the identification; the station's forms are generated from them."""

import math
from typing import Literal

from autonomy.configuration import Configuration, quantity


class NoiseLevels(Configuration):
    """Standard deviations of what was measured; every residual is divided by its own."""

    horizontal_m: float = quantity(0.05, "m", title="Horizontal position", gt=0.0, le=100.0)
    """Of a position fix, per axis; a fix that was recorded with a larger one keeps that."""
    fix_hold_s: float = quantity(2.0, "s", title="Fix, held for", ge=0.0, le=60.0, advanced=True)
    """A robot goes on saying that it has a fix for so long after one arrived, while its position
    is a filter's: of reports within this time only the first counts as a fix. 0 if every row has
    a fix of its own, as from cameras."""
    depth_m: float = quantity(0.005, "m", title="Depth", gt=0.0, le=10.0)
    """Of one depth measurement."""
    tilt_rad: float = quantity(
        0.01, "rad", title="Roll and pitch", gt=0.0, le=1.0, display_unit="deg"
    )
    """Of roll and of pitch."""
    heading_rad: float = quantity(
        0.03, "rad", title="Heading", gt=0.0, le=math.pi, display_unit="deg"
    )
    """Of the heading."""


class SegmentRules(Configuration):
    """Which parts of a recording can be held against the model."""

    longest_gap_s: float = quantity(3.0, "s", title="Longest gap", gt=0.0, le=60.0)
    """Where no row came for longer, the recording is cut: what the actuators did is unknown."""
    shortest_segment_s: float = quantity(8.0, "s", title="Shortest segment", gt=0.0, le=600.0)
    """Shorter pieces are left out: their unknown starting velocity says all that they could."""
    longest_segment_s: float = quantity(80.0, "s", title="Longest segment", gt=1.0, le=3600.0)
    """Longer pieces are cut, so that an unseen disturbance does not spoil all that follows it."""
    surface_depth_m: float = quantity(0.05, "m", title="Surface", ge=0.0, le=5.0)
    """Shallower than this the hull meets the air, which the model does not know."""
    stuck_s: float = quantity(5.0, "s", title="Stuck sensor", gt=0.0, le=600.0)
    """A noisy sensor that repeats the very same value for so long is taken to be stuck."""
    flap_swing_rad: float = quantity(
        0.15, "rad", title="Flap, swing", gt=0.0, le=math.pi, display_unit="deg", advanced=True
    )
    """Smaller movements of the tail to and fro are steering, not flapping."""
    flap_beat_s: float = quantity(3.0, "s", title="Flap, half a beat", gt=0.0, advanced=True)
    """Slower movements of the tail to and fro are steering, not flapping."""


class FreeParameters(Configuration):
    """Which parameters may change; the others keep their values."""

    masses: bool = quantity(True, title="Masses")
    """The three masses with added mass."""
    inertias: bool = quantity(True, title="Inertias")
    """The three moments of inertia with added inertia."""
    sliding_mass: bool = quantity(True, title="Sliding mass")
    """Switch off if it was weighed: it then gives all moments their scale."""
    offset_mass: bool = quantity(True, title="Offset mass and its depth")
    """Only the product of the two acts on the robot. Switch off if they were measured."""
    drag: bool = quantity(True, title="Drag")
    """The three drag coefficients."""
    side_force: bool = quantity(True, title="Side force")
    """Side force by sideslip and by the tail."""
    lift: bool = quantity(True, title="Lift")
    """Both lift coefficients."""
    roll_moment: bool = quantity(True, title="Roll moment")
    """Roll moment by sideslip, and roll damping."""
    pitch_moment: bool = quantity(True, title="Pitch moment")
    """Pitch moment, its slope, and pitch damping."""
    yaw_moment: bool = quantity(True, title="Yaw moment")
    """Yaw moment by sideslip and by the tail, and yaw damping."""


class IdentificationConfig(Configuration):
    """How a vehicle's parameters are sought (thesis section 3.4.2 and Appendix B)."""

    method: Literal["swarm", "least_squares"] = quantity("swarm", title="Method")
    """A swarm searches the whole box; least squares descend from the present values and are
    done in seconds, but need them to be good."""
    polish: bool = quantity(True, title="Polish")
    """Descend by least squares from the swarm's best point: far sooner exact than the swarm."""
    particles: int = quantity(100, title="Particles", ge=5, le=1000)
    """Members of the swarm."""
    iterations: int = quantity(60, title="Iterations", ge=1, le=2000)
    """Moves of the swarm in each run; without the polish take 250."""
    runs: int = quantity(1, title="Runs", ge=1, le=20)
    """How often the swarm starts anew; the best run counts."""
    inertia: float = quantity(0.72, title="Inertia", ge=0.0, lt=1.0, advanced=True)
    """Part of its velocity that a particle keeps (w of Appendix B)."""
    own_pull: float = quantity(1.49, title="Pull of the own best", ge=0.0, le=4.0, advanced=True)
    """Pull of the best point that the particle has seen (a1)."""
    shared_pull: float = quantity(
        1.49, title="Pull of the shared best", ge=0.0, le=4.0, advanced=True
    )
    """Pull of the best point that any particle has seen (a2)."""
    velocity_share: float = quantity(0.2, title="Fastest move", gt=0.0, le=1.0, advanced=True)
    """Greatest move of a particle in one iteration, as a part of the box's width."""
    bounds_share: float = quantity(0.5, title="Box", gt=0.0, lt=1.0)
    """How far a parameter may move from its present value at first, as a part of it."""
    widest_share: float = quantity(3.0, title="Widest box", gt=0.0, le=10.0, advanced=True)
    """The box grows where the descent presses against it, up to this part of the present value; a
    sign that physics demands is kept. If this is not above the box, the box never grows."""
    starts_at_present: bool = quantity(True, title="Seed one particle")
    """Let one particle start at the present values, measured or from fluid dynamics."""
    descents: int = quantity(100, title="Steps of least squares", ge=1, le=200, advanced=True)
    """Most steps of the least-squares descent."""
    seed: int = quantity(1, title="Seed", ge=0, le=2**31 - 1)
    """The same seed and recording give the same result."""
    model: Literal["thesis", "extended"] = quantity("extended", title="Model")
    """Forces of Eq. 3.4, or of Eq. 5.18 with cross-flow drag as simulator and observer fly."""
    by_cameras: bool = quantity(False, title="Positions by cameras")
    """Take the positions that cameras over the water saw, with their covariance, in place of the
    robot's own; under water these are dead reckoning."""
    fits_offsets: bool = quantity(True, title="Actuator offsets")
    """Also find constant errors of the net buoyancy's and the sliding mass's feedback, which
    would otherwise spoil lift and pitch moment."""
    step_s: float = quantity(0.1, "s", title="Step", gt=0.0, le=0.5, advanced=True)
    """Longest step of the integration."""
    noise: NoiseLevels = quantity(NoiseLevels(), title="Measurement noise")
    """How exact the recording is."""
    free: FreeParameters = quantity(FreeParameters(), title="Free parameters")
    """What may change."""
    rules: SegmentRules = quantity(SegmentRules(), title="What to leave out")
    """How the recording is cut into segments."""


IDENTIFICATION_PRESETS: dict[str, IdentificationConfig] = {
    "miniglider": IdentificationConfig(
        noise=NoiseLevels(depth_m=0.003, tilt_rad=math.radians(0.5), heading_rad=math.radians(2.0))
    ),
    "grace3": IdentificationConfig(
        noise=NoiseLevels(
            horizontal_m=1.5,
            depth_m=0.01,
            tilt_rad=math.radians(0.3),
            heading_rad=math.radians(1.5),
        ),
        rules=SegmentRules(shortest_segment_s=15.0, surface_depth_m=0.3, longest_segment_s=120.0),
    ),
}
"""Settings by vehicle: noise of its sensors, and how near the surface its hull meets the air."""
