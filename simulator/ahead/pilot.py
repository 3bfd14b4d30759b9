"""From what is wanted of the motion to set points, compiled.

``onboard.flight.pilot`` is the readable form, and has the numbers.
"""

import math

from autonomy.compiled import inner_kernel
from autonomy.control import governor_kernel
from autonomy.control import law as laws
from autonomy.control.law_number import GOVERNOR
from autonomy.estimation import kernel as estimators
from autonomy.vehicle import kernel as body
from onboard.flight import pilot as manner
from simulator.ahead.state import Robot, Setup, State

control = laws.command_into
wrap = estimators.turn
FED, KNOWN, SENT = governor_kernel.FED, governor_kernel.KNOWN, governor_kernel.SENT
MASS_RATE_SHARE, MASS_DELAY = governor_kernel.MASS_RATE_SHARE, governor_kernel.MASS_DELAY
M0_MIN, RP1_MIN = body.M0_MIN, body.RP1_MIN
"""Names that numba resolves once, when it compiles."""


@inner_kernel
def heading_error(s: State, course_rad: float) -> float:
    """Return how far to starboard a course lies of the mean heading."""
    return wrap(course_rad - s.course_heading_rad)


@inner_kernel
def forward_speed(s: State) -> float:
    """Return the horizontal speed through the water along the heading."""
    heading = s.estimate[5]
    return s.velocity_ned[0] * math.cos(heading) + s.velocity_ned[1] * math.sin(heading)


@inner_kernel
def clip(value: float, limit: float) -> float:
    """Return a value within a limit either way."""
    return min(max(value, -limit), limit)


@inner_kernel
def begin_step(s: State) -> None:
    """Let a step begin: what the last one held is past."""
    s.last_pitch_rad, s.wanted_pitch_rad = s.wanted_pitch_rad, math.nan


@inner_kernel
def know_mass(s: State, setup: Setup) -> None:
    """Fly for a sliding mass that swings: a law that can count on it is told, another gives way."""
    if setup.knows_mass:
        s.gains[MASS_RATE_SHARE], s.gains[MASS_DELAY] = 1.0, 0.0
    elif not s.is_robust:
        s.is_robust = True
        s.robust_memory[:] = 0.0
        s.robust_gains[MASS_RATE_SHARE], s.robust_gains[MASS_DELAY] = 1.0, 0.0


@inner_kernel
def forget_mass(s: State) -> None:
    """Fly with the law that was chosen."""
    s.is_robust = False
    s.gains[:] = s.told_gains


@inner_kernel
def reset(s: State, setup: Setup) -> None:
    """Forget what the laws learned of an earlier leg."""
    s.memory[: SENT if setup.knows_mass else s.memory.shape[0]] = 0.0
    if s.is_robust:
        s.robust_memory[:SENT] = 0.0


@inner_kernel
def rest(s: State, setup: Setup, robot: Robot) -> None:
    """Lie at the surface."""
    s.set_points[:] = 0.0
    s.set_points[0] = manner.FLOATING_SHARE * robot.believed[M0_MIN]
    s.set_points[1] = setup.swim_rp1_m


@inner_kernel
def rise(s: State, robot: Robot) -> None:
    """Come up as fast as is safe."""
    s.set_points[:] = 0.0
    s.set_points[0] = manner.RISING_SHARE * robot.believed[M0_MIN]
    s.set_points[1] = manner.RISING_MASS_SHARE * robot.believed[RP1_MIN]


@inner_kernel
def _flap(s: State, setup: Setup, course_rad: float) -> None:
    """Let the tail beat, and turn by its bias; net mass and sliding mass are set already."""
    error = heading_error(s, course_rad)
    s.set_points[2] = clip(-manner.SWIMMING_GAIN * error, manner.SWIMMING_BIAS_MAX_RAD)
    s.set_points[3] = setup.swim_amplitude_rad
    s.set_points[4] = setup.swim_frequency_hz


@inner_kernel
def swim(s: State, setup: Setup, robot: Robot, course_rad: float) -> None:
    """Swim at the surface and turn towards a course."""
    excess = s.estimate[4] - manner.SWIMMING_PITCH_RAD
    s.set_points[0] = manner.FLOATING_SHARE * robot.believed[M0_MIN]
    s.set_points[1] = setup.swim_rp1_m + abs(robot.believed[RP1_MIN]) * excess
    _flap(s, setup, course_rad)


@inner_kernel
def swim_at_depth(s: State, setup: Setup, robot: Robot, course_rad: float, depth_m: float) -> None:
    """Swim level at a depth."""
    _track(s, setup, robot, depth_m, 0.0, 0.0, 0.0, math.inf)
    _flap(s, setup, course_rad)


@inner_kernel
def sink(
    s: State,
    setup: Setup,
    robot: Robot,
    depth_m: float,
    rate_m_s: float,
    acceleration_m_s2: float,
    forward_speed_m_s: float,
) -> None:
    """Change depth with nearly level hull and straight tail."""
    excess = forward_speed(s) - forward_speed_m_s
    down = math.copysign(1.0, rate_m_s)
    pitch = down * clip(manner.BRAKING_GAIN_S_M * excess, manner.BRAKING_PITCH_MAX_RAD)
    _track(s, setup, robot, depth_m, rate_m_s, acceleration_m_s2, pitch, math.inf)


@inner_kernel
def glide(
    s: State,
    setup: Setup,
    robot: Robot,
    depth_m: float,
    rate_m_s: float,
    acceleration_m_s2: float,
    pitch_rad: float,
    net_buoyancy_max_kg: float,
) -> None:
    """Glide towards the leg's course."""
    _track(s, setup, robot, depth_m, rate_m_s, acceleration_m_s2, pitch_rad, net_buoyancy_max_kg)
    error = heading_error(s, s.course_rad)
    s.flaps = abs(error) > (manner.GLIDE_AT_RAD if s.flaps else manner.FLAP_AT_RAD)
    if s.flaps or s.falls_short:
        _flap(s, setup, s.course_rad)
    else:
        s.set_points[2] = clip(-manner.RUDDER_GAIN * error, manner.RUDDER_MAX_RAD)


@inner_kernel
def spiral(
    s: State,
    setup: Setup,
    robot: Robot,
    heading_rad: float,
    turn_sign: float,
    depth_m: float,
    rate_m_s: float,
    acceleration_m_s2: float,
    pitch_rad: float,
    net_buoyancy_max_kg: float,
) -> None:
    """Glide around a bend by the rudder alone."""
    _track(s, setup, robot, depth_m, rate_m_s, acceleration_m_s2, pitch_rad, net_buoyancy_max_kg)
    error = heading_error(s, heading_rad)
    tail = -manner.SPIRAL_RUDDER_RAD * turn_sign - manner.SWIMMING_GAIN * error
    s.set_points[2] = clip(tail, manner.SPIRAL_RUDDER_MAX_RAD)


@inner_kernel
def _track(
    s: State,
    setup: Setup,
    robot: Robot,
    depth_m: float,
    rate_m_s: float,
    acceleration_m_s2: float,
    pitch_rad: float,
    net_buoyancy_max_kg: float,
) -> None:
    """Set net mass and sliding mass by the law, tail straight."""
    heading, speed = s.estimate[5], forward_speed(s)
    north, east = math.cos(heading), math.sin(heading)
    law = GOVERNOR if s.is_robust else setup.law
    gains = s.robust_gains if s.is_robust else s.gains
    memory = s.robust_memory if s.is_robust else s.memory
    pitch_rate, pitch_acceleration = 0.0, 0.0
    if law == GOVERNOR:
        memory[FED] = KNOWN
        for i in range(3):
            memory[FED + 1 + i] = s.actuators[i]
        if not math.isnan(s.last_pitch_rad):
            change = (pitch_rad - s.last_pitch_rad) / setup.period_s
            pitch_rate = clip(change, manner.PITCH_RATE_MAX_RAD_S)
            change = (pitch_rate - s.last_pitch_rate_rad_s) / setup.period_s
            pitch_acceleration = clip(change, manner.PITCH_ACCELERATION_MAX_RAD_S2)
    s.last_pitch_rate_rad_s = pitch_rate
    s.wanted_pitch_rad = pitch_rad
    reference, found, rows = s.reference, s.wanted, s.law_rows
    reference[:] = 0.0
    reference[0] = s.position_ned[0] + manner.AHEAD_M * north
    reference[1] = s.position_ned[1] + manner.AHEAD_M * east
    reference[2], reference[3] = depth_m, pitch_rad
    reference[4], reference[5], reference[6] = speed * north, speed * east, rate_m_s
    reference[7] = pitch_rate
    reference[10], reference[11] = acceleration_m_s2, pitch_acceleration
    scratch = rows[0], rows[1], rows[2], rows[3], rows[4]
    period_s, believed = setup.period_s, robot.believed
    control(law, s.estimate, reference, gains, believed, period_s, memory, scratch, found)
    s.set_points[:] = 0.0
    s.set_points[0] = clip(found[0], net_buoyancy_max_kg)
    s.set_points[1] = found[1]
