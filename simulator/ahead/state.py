"""What one flight is made of: the numbers that stay, and those that change with every step.

The names are those of the onboard program (``onboard.flight``) and of the simulated robot, whose
classes these records stand for.
"""

from typing import Annotated, NamedTuple

from autonomy.arrays import FloatArray
from autonomy.control import law
from autonomy.current.table import FlowTable
from autonomy.estimation import model_kernel
from autonomy.estimation.fix_watch import DIVES
from autonomy.vehicle import kernel as body
from onboard.flight.actuator_watch import SWINGS

PACKED_MOST = body.ENERGY_DELTA + 1
"""Numbers of a packed vehicle."""
HEADINGS_MAX = 128
"""Most headings that a mean over one beat of the tail is made of."""
SENSED = 13
"""Numbers that the sensors draw an error for: depth, three angles, three rates, net mass, sliding
mass, tail, voltage, and two of a fix."""
NOISE = SENSED + 2
"""Standard normal numbers of one step: two of the water's eddies, then those of the sensors."""

_Two = Annotated[FloatArray, (2,)]
_Three = Annotated[FloatArray, (3,)]
_Fifteen = Annotated[FloatArray, (15,)]
_Fourteen = Annotated[FloatArray, (model_kernel.STATES,)]


class Setup:
    """What stays the same in one flight."""

    # how time is cut
    period_s: float
    """Between two steps of the onboard program; its own 0.1 s, or longer for a coarse flight."""
    plant_steps: int
    """Runge-Kutta steps of the body in one period."""
    clear_steps: int
    """The same where nothing is near that the robot could touch."""
    belief_every: int
    """Periods from one step of the filter's covariance to the next; 1 is the filter itself."""
    model_steps: int
    """Runge-Kutta steps of the filter's model in one period of a coarse flight."""
    settling_s: float
    """Time at the surface before the mission starts."""
    row_every: int
    """Periods from one row of the track to the next."""
    # the robot and its water as they truly are
    noise_std: Annotated[FloatArray, (SENSED,)]
    buoyancy_bias_kg: float
    mass_position_bias_m: float
    fix_depth_m: float
    fix_period_s: float
    battery_j: float
    eddy_std_m_s: float
    eddy_kept: float
    """What is left of the eddies after a period."""
    eddy_fresh_m_s: float
    """Standard deviation of what comes to them in it."""
    steady_ne_m_s: _Two
    water_s: float
    """Time of the flow's table when the robot's life begins."""
    is_uneven: bool
    """Whether the floor is a grid of depths."""
    has_walls: bool
    # what the onboard program knows: manners
    surfaced_m: float
    reversal_m_s2: float
    depth_leash_m: float
    pitch_rate_rad_s: float
    swimming_speed_m_s: float
    entry_speed_m_s: float
    turn_s: float
    coast_s: float
    near_m: float
    aim_m: float
    arrival_m: float
    start_tolerance_m: float
    floor_margin_m: float
    shore_margin_m: float
    surface_min_s: float
    surface_max_s: float
    # the vehicle
    swim_rp1_m: float
    swim_amplitude_rad: float
    swim_frequency_hz: float
    headings: int
    """Of one beat of the tail."""
    # the filter
    kept: Annotated[FloatArray, (4,)]
    """What is left of steady current, eddies, bias and shares after a period."""
    noise: Annotated[FloatArray, (13,)]
    first_std: _Fourteen
    first_current_ne_m_s: _Two
    first_dives: int
    """Dives by which the filter doubts itself when it begins, and how far each was off."""
    first_squared: float
    surface_depth_m: float
    depth_variance: float
    fix_std_m: float
    least_doubt: float
    outlier_limit: float
    patience: int
    fix_patience: int
    gate_speed_m_s: float
    telling_stay_s: float
    told_std_m_s: float
    notice_jump_kg: float
    pump_rate_kg_s: float
    # the law
    law: int
    knows_mass: bool
    # the mission
    max_uncertainty_m: float
    timeout_s: float
    trim_kg: float
    trim_m: float
    time_price: float
    """Energy units of a second."""
    swim_price: float
    """Factor of the work of the tail in energy units."""
    tells_current: bool
    """Whether the plan tells of a current."""


class Leg:
    """A leg over ground, and what the executive knows of it in advance."""

    kind: int
    start_ned: _Three
    end_ned: _Three
    speed_m_s: float
    duration_s: float
    energy: float
    heading_rad: float
    radius_m: float
    turn_rad: float
    dive_end: int
    """Number of the leg that next ends at the surface."""
    current_ne_m_s: _Two
    polar: int
    """Number of the polar downwards; those after it: upwards, and both at the gentle gait."""


class State:
    """What a step changes."""

    steps: int
    """Of the onboard program."""
    began_s: float
    """When the mission was started, of the robot's life."""
    # the truth
    x: Annotated[FloatArray, (16,)]
    """As of ``simulator.plant``, and the energy used in this period."""
    plant_s: float
    eddy_ne_m_s: _Two
    next_fix_s: float
    battery: float
    """Charge left, 0..1."""
    driven: Annotated[FloatArray, (5,)]
    """Set points as the servos act on them."""
    # readings, in the model's terms
    depth_m: float
    angles_rad: _Three
    gyro_rad_s: _Three
    actuators: _Three
    has_reading_fix: bool
    fix_ne_m: _Two
    # what the filters hold
    attitude_rad: _Three
    rates_rad_s: _Three
    headings: Annotated[FloatArray, (HEADINGS_MAX,)]
    heading_count: int
    belief: _Fourteen
    factor: Annotated[FloatArray, (model_kernel.STATES, model_kernel.STATES)]
    covariance: Annotated[FloatArray, (model_kernel.STATES, model_kernel.STATES)]
    """Of a coarse flight."""
    since_belief: int
    before_attitude: _Three
    before_gyro: _Three
    before_actuators: _Three
    refused_depths: _Two
    believed_fix: _Two
    has_believed_fix: bool
    since_fix_s: float
    stay_s: float
    doubt: float
    dive_squared: Annotated[FloatArray, (DIVES,)]
    dive_weight: Annotated[FloatArray, (DIVES,)]
    dives: int
    strange_fix: _Two
    has_strange_fix: bool
    strange_in_a_row: int
    refused_fixes: int
    has_expected_current: bool
    expected_ne_m_s: _Two
    # the estimate
    position_ned: _Three
    position_std_m: float
    velocity_ned: _Three
    estimate: Annotated[FloatArray, (12,)]
    course_heading_rad: float
    fix_age_s: float
    sure_ne_m_s: _Two
    # the pilot
    set_points: Annotated[FloatArray, (5,)]
    wanted_pitch_rad: float
    """Not a number while no law holds a pitch."""
    last_pitch_rad: float
    last_pitch_rate_rad_s: float
    flaps: bool
    is_robust: bool
    """Whether the robust law flies in place of the chosen one."""
    gains: Annotated[FloatArray, (40,)]
    told_gains: Annotated[FloatArray, (40,)]
    robust_gains: Annotated[FloatArray, (40,)]
    memory: Annotated[FloatArray, (law.MEMORY_SIZE,)]
    robust_memory: Annotated[FloatArray, (law.MEMORY_SIZE,)]
    # the gait, and what makes it gentle
    speed_share: float
    gait_pitch_rate_rad_s: float
    gait_pitch_growth_rad_s2: float
    minded_s: float
    watch_s: float
    swung_s: float
    pitch_swing: Annotated[FloatArray, (3 + SWINGS,)]
    mass_swing: Annotated[FloatArray, (3 + SWINGS,)]
    # the executive
    stage: int
    plan_state: int
    leg: int
    mission_s: float
    surfaced_s: float
    settled_energy: float
    leg_work: float
    leg_share: float
    reason: int
    abort_reason: int
    dives_cut: int
    """Dives that a limit ended early."""
    trim_kg: float
    trim_m: float
    # the maneuver
    maneuver: int
    mode: int
    target_ne_m: _Two
    course_rad: float
    swim_depth_m: float
    distance_m: float
    closest_m: float
    left_s: float
    returns: bool
    """Whether a floating robot swims back into the domain."""
    aligned_s: float
    elapsed_s: float
    headed: int
    turn_speed_share: float
    # a stay at the surface
    kept_s: float
    """Time of it that is over."""
    keep_radius_m: float
    coasted_s: float
    # a leg that changes depth
    flown: int
    """Number of the leg whose maneuver is flown, -1 for none."""
    rate_m_s: float
    start_depth_m: float
    end_depth_m: float
    goes_on: bool
    reference_m: float
    reference_m_s: float
    wanted_m_s: float
    patience_s: float
    # the pitch of a glide
    polar: int
    slew_rad_s: float
    slew_growth_rad_s2: float
    slew_now_rad_s: float
    aimed_rad: float
    pitch_rad: float
    next_aim_s: float
    speeding_up_s: float
    run_out_s: float
    falls_short: bool
    # the record
    row: int
    change: int
    told_leg: int
    told_mode: int
    told_sampling: bool
    # where the water's border was looked up
    border_at: _Two
    border_m: float
    worst_std_m: float
    deepest_over_floor_m: float
    # room to work in, so that no step has to ask for memory
    slope: _Fifteen
    total: _Fifteen
    probe: _Fifteen
    sensed: _Fifteen
    """What the sensors say of the 15 states."""
    middle: _Fifteen
    """The 15 states as the filter's model has them, at the begin and in the middle of a step."""
    swum: _Fifteen
    order: Annotated[FloatArray, (5,)]
    altered: Annotated[FloatArray, (PACKED_MOST,)]
    """The packed vehicle as the filter believes it."""
    later: _Fourteen
    during: _Three
    reference: Annotated[FloatArray, (12,)]
    # the same for the covariance
    column: _Fourteen
    carrying: Annotated[FloatArray, (model_kernel.STATES, model_kernel.STATES)]
    carried: Annotated[FloatArray, (model_kernel.STATES, model_kernel.STATES)]
    drift: Annotated[FloatArray, (3, 7)]
    turn: Annotated[FloatArray, (3, 3)]
    answer: Annotated[FloatArray, (6, 7)]
    shaken: Annotated[FloatArray, (6, 6)]
    answer_rate: Annotated[FloatArray, (3, 7)]
    answer_probe: Annotated[FloatArray, (6, 7)]
    push: _Three
    # the same for the law
    wanted: Annotated[FloatArray, (law.COMMAND_SIZE,)]
    law_rows: Annotated[FloatArray, (5, 16)]


class Water(NamedTuple):
    """Border and floor of the water, and what flows in it."""

    box: FloatArray
    """Edges of all the water south, north, west, east, m, shape ``(4,)``."""
    domain: FloatArray
    """Edges of the part to explore, shape ``(4,)``."""
    begins: FloatArray
    """Where each side of shoreline and islands begins, shape ``(s, 2)``; none without a shore."""
    ends: FloatArray
    floor_north: FloatArray
    floor_east: FloatArray
    floor_depth: FloatArray
    """Shape (north, east), m; of a flat floor one number."""
    flow: FlowTable


class Robot(NamedTuple):
    """Numbers of the vehicle, packed."""

    true: FloatArray
    """``Vehicle.packed()`` of the robot that flies."""
    believed: FloatArray
    """The same as the onboard program has it."""
    surroundings: FloatArray
    """``Surroundings.packed()``; its current and floor are written at every step."""
    still: FloatArray
    """``Surroundings.packed()`` of open, still water."""


class Polars(NamedTuple):
    """Steady glides, a row for each vertical speed and way."""

    steepness_rad: FloatArray
    """Shape ``(n, 51)``; beyond ``count`` the last is repeated."""
    pitch_rad: FloatArray
    rate_m_s: FloatArray
    """Rate of depth that is held, positive down, shape ``(n,)``."""
    net_buoyancy_max_kg: FloatArray


class Record(NamedTuple):
    """What is written down of a flight."""

    rows: FloatArray
    """Shape ``(n, ROW)``."""
    changes: FloatArray
    """Time s, mode, leg, whether it samples; a row at each change, shape ``(n, 4)``."""
    surfaced: FloatArray
    """By leg: when the robot was first seen at the surface after it s since the start, north, east
    m, charge, shape ``(legs, 4)``; not a number before."""


(
    ROW_TIME, ROW_LEG, ROW_SAMPLES, ROW_NORTH, ROW_EAST, ROW_DOWN,
    ROW_BELIEVED_NORTH, ROW_BELIEVED_EAST, ROW_BELIEVED_DOWN, ROW_STD, ROW_BATTERY,
) = range(11)  # fmt: skip
"""Columns of a row: time since the start s, leg, whether it is on it (0 or 1), where it truly is
and where it believes to be NED m, the deviation that it states m, and the charge left 0..1."""
ROW = 11
