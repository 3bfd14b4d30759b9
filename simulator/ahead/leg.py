"""The legs of a plan, compiled.

``onboard.flight.leg``, ``depth_change``, ``pitch_aim``, ``course`` and ``keep`` are the readable
form.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel
from autonomy.planner.plan import PrimitiveKind
from autonomy.vehicle import kernel as body
from onboard.flight import depth_change, pitch_aim
from onboard.flight import leg as manner
from robot_link.messages import RobotMode
from simulator.ahead import maneuver as maneuvers
from simulator.ahead import pilot
from simulator.ahead.state import Leg, Polars, Robot, Setup, State

GLIDE, SPIRAL, DIVE = maneuvers.GLIDE, maneuvers.SPIRAL, maneuvers.DIVE
SWIM, KEEP = maneuvers.SWIM, maneuvers.KEEP
KIND_OF = {
    PrimitiveKind.GLIDE: GLIDE,
    PrimitiveKind.SPIRAL: SPIRAL,
    PrimitiveKind.DIVE: DIVE,
    PrimitiveKind.SWIM: SWIM,
    PrimitiveKind.KEEP: KEEP,
}
"""A leg's kind by the number of its maneuver."""
GLIDING, SPIRALLING = int(RobotMode.GLIDING), int(RobotMode.SPIRALLING)
DIVING = int(RobotMode.DIVING)
is_surfaced, distance, bearing = maneuvers.is_surfaced, maneuvers.distance, maneuvers.bearing
enter_swim, is_swim_done = maneuvers.enter_swim, maneuvers.is_swim_done
step_swim = maneuvers.step_swim
enter_keep, step_keep = maneuvers.enter_keep, maneuvers.step_keep
wrap, forward_speed = pilot.wrap, pilot.forward_speed
glide_on, spiral_on, sink_on = pilot.glide, pilot.spiral, pilot.sink
M0_RATE, MASS_1 = body.M0_RATE, body.MASS_1
WATER_DENSITY, AREA, DRAG_0 = body.WATER_DENSITY, body.AREA, body.DRAG_0
"""Names that numba resolves once, when it compiles."""

SURFACE_M = 1e-3
"""A planned depth above this means the surface (``course.is_surface``)."""
UPWARDS, GENTLE = 1, 2
"""Added to the number of a leg's polar: for the way up, and for the gentle gait."""


@inner_kernel
def is_steerable(leg: Leg) -> bool:
    """Tell whether a leg leads to a point, wherever it begins."""
    return leg.kind in (GLIDE, SWIM)


@inner_kernel
def anchored_end(s: State, legs: np.ndarray, first: int) -> tuple[float, float]:
    """Return where a leg should end that begins where the robot is (``course.anchored_end``)."""
    leg = legs[first]
    last = leg.dive_end
    steerable_s = 0.0
    for k in range(first, last + 1):
        if is_steerable(legs[k]):
            steerable_s += legs[k].duration_s
    kept = 1.0
    if is_steerable(leg) and steerable_s > 0.0:
        kept -= leg.duration_s / steerable_s
    elif last == first:
        kept = 0.0
    return (
        leg.end_ned[0] + kept * (s.position_ned[0] - leg.start_ned[0]),
        leg.end_ned[1] + kept * (s.position_ned[1] - leg.start_ned[1]),
    )


@inner_kernel
def upstream(
    s: State, legs: np.ndarray, first: int, last: int, north: float, east: float, tells: bool
) -> tuple[float, float]:
    """Return where to begin legs instead, so that the water carries them along the plan.

    Args:
        s: The flight.
        legs: All legs.
        first: The first of those that are to begin there.
        last: The last of the dive.
        north: Where the plan has the first one begin.
        east: Likewise.
        tells: Whether the plan counts on a current.
    """
    if s.sure_ne_m_s[0] == 0.0 and s.sure_ne_m_s[1] == 0.0:
        return north, east
    adrift_s = 0.0
    for k in range(first, last + 1):
        if is_steerable(legs[k]):
            break
        adrift_s += legs[k].duration_s
    planned_north, planned_east = 0.0, 0.0
    if tells:
        planned_north = legs[s.leg].current_ne_m_s[0]
        planned_east = legs[s.leg].current_ne_m_s[1]
    return (
        north - 0.5 * adrift_s * (s.sure_ne_m_s[0] - planned_north),
        east - 0.5 * adrift_s * (s.sure_ne_m_s[1] - planned_east),
    )


@inner_kernel
def enter_leg(s: State, setup: Setup, robot: Robot, legs: np.ndarray, polars: Polars) -> None:
    """Begin to fly the next leg from where the robot is."""
    number = s.leg
    leg = legs[number]
    last = leg.dive_end
    if leg.kind == KEEP:
        enter_keep(s, setup, leg.end_ned[0], leg.end_ned[1], leg.radius_m)
        s.flown = number
        return
    north, east = anchored_end(s, legs, number)
    if is_steerable(leg):
        north, east = upstream(s, legs, number + 1, last, north, east, setup.tells_current)
    end_m = leg.end_ned[2]
    if leg.kind == SWIM:
        enter_swim(s, setup, north, east, 0.0 if end_m < SURFACE_M else end_m)
        s.flown = number
        return
    s.maneuver, s.flown = leg.kind, number
    s.target_ne_m[0], s.target_ne_m[1] = north, east
    rate = math.copysign(s.speed_share * leg.speed_m_s, end_m - s.position_ned[2])
    if leg.kind == DIVE:
        s.mode = DIVING
    else:
        s.mode = GLIDING if leg.kind == GLIDE else SPIRALLING
        s.polar = (
            leg.polar + (0 if rate > 0.0 else UPWARDS) + (GENTLE if s.speed_share < 1.0 else 0)
        )
        rate = polars.rate_m_s[s.polar]
    _begin_depth(s, setup, legs, number, rate)
    if leg.kind != DIVE:
        stops = number < last and legs[number + 1].kind == DIVE
        _begin_aim(s, setup, robot, stops)
    if leg.kind == GLIDE:
        aimed = _aimed_at(s)
        s.course_rad = bearing(s, aimed[0], aimed[1])


@inner_kernel
def _begin_depth(s: State, setup: Setup, legs: np.ndarray, number: int, rate: float) -> None:
    leg = legs[number]
    s.rate_m_s = rate
    s.start_depth_m, s.end_depth_m = s.position_ned[2], leg.end_ned[2]
    s.goes_on = number < leg.dive_end and (legs[number + 1].end_ned[2] - s.end_depth_m) * rate > 0.0
    s.reference_m, s.reference_m_s, s.wanted_m_s = s.start_depth_m, s.velocity_ned[2], rate
    s.patience_s = depth_change.TIMEOUT_FACTOR * time_left_s(s) + depth_change.TIMEOUT_S


@inner_kernel
def time_left_s(s: State) -> float:
    """Return how long the rest of a depth change takes at the leg's rate."""
    return abs((s.end_depth_m - s.position_ned[2]) / s.rate_m_s)


@inner_kernel
def _step_depth(s: State, setup: Setup) -> float:
    """Move the depth to be at on, and return its acceleration (``DepthProfile``)."""
    dt, limit = setup.period_s, setup.reversal_m_s2
    s.patience_s -= dt
    acceleration = min(max((s.wanted_m_s - s.reference_m_s) / dt, -limit), limit)
    s.reference_m_s += acceleration * dt
    depth = s.position_ned[2]
    ahead = s.reference_m + s.reference_m_s * dt - depth
    s.reference_m = depth + math.copysign(min(abs(ahead), setup.depth_leash_m), ahead)
    return acceleration


@inner_kernel
def is_leg_done(s: State, setup: Setup, robot: Robot, legs: np.ndarray) -> bool:
    """Tell whether the leg that is flown is over."""
    if s.maneuver == KEEP:
        return s.kept_s >= legs[s.flown].duration_s
    if s.maneuver == SWIM:
        return is_swim_done(s, setup)
    if s.patience_s < 0.0:
        return True
    if s.end_depth_m < SURFACE_M:
        return is_surfaced(s, setup)
    down = math.copysign(1.0, s.rate_m_s)
    coasting_m = 0.0
    if not s.goes_on:
        rate = max(down * s.velocity_ned[2], 0.0)
        pumping_s = max(down * s.actuators[0], 0.0) / robot.believed[M0_RATE]
        reversing_s = rate / setup.reversal_m_s2
        coasting_m = rate * (0.5 * reversing_s + depth_change.PUMPING_SHARE * pumping_s)
    return down * (s.end_depth_m - s.position_ned[2]) <= coasting_m


@inner_kernel
def share_of_leg(s: State, legs: np.ndarray) -> float:
    """Return the part of the leg that is flown."""
    if s.maneuver == KEEP:
        return s.kept_s / legs[s.flown].duration_s
    if s.maneuver == SWIM:
        return 1.0 - distance(s, s.target_ne_m[0], s.target_ne_m[1]) / s.distance_m
    return _share_of_depth(s)


@inner_kernel
def _share_of_depth(s: State) -> float:
    whole = s.end_depth_m - s.start_depth_m
    return (
        1.0 if whole == 0.0 else min(max((s.position_ned[2] - s.start_depth_m) / whole, 0.0), 1.0)
    )


@inner_kernel
def _begin_aim(s: State, setup: Setup, robot: Robot, stops: bool) -> None:
    """Begin to choose the path angle of a glide (``PitchAim``)."""
    p = robot.believed
    s.slew_rad_s = min(setup.pitch_rate_rad_s, s.gait_pitch_rate_rad_s)
    s.slew_growth_rad_s2, s.slew_now_rad_s = s.gait_pitch_growth_rad_s2, 0.0
    s.aimed_rad = s.pitch_rad = s.estimate[4]
    s.next_aim_s = 0.0
    drag_kg_m = p[WATER_DENSITY] * p[AREA] * p[DRAG_0]
    s.speeding_up_s = p[MASS_1] / (drag_kg_m * math.sqrt(2.0) * abs(s.rate_m_s))
    s.run_out_s = pitch_aim.RUN_OUT_SHARE * s.speeding_up_s if stops else 0.0
    s.falls_short = False


@inner_kernel
def _step_aim(s: State, setup: Setup, polars: Polars, left_m: float) -> float:
    """Return the pitch to hold when ``left_m`` metres of horizontal way are left."""
    s.next_aim_s -= setup.period_s
    if s.next_aim_s <= 0.0:
        s.next_aim_s = pitch_aim.AIM_INTERVAL_S
        _aim(s, polars, left_m)
    s.pitch_rad += _slewed(s, setup.period_s)
    return s.pitch_rad


@inner_kernel
def _slewed(s: State, dt_s: float) -> float:
    """Return by how much the pitch to hold moves on towards the wanted one."""
    left, slew = s.aimed_rad - s.pitch_rad, s.slew_rad_s
    if math.isinf(s.slew_growth_rad_s2):
        return min(max(left, -slew * dt_s), slew * dt_s)
    stopping = math.sqrt(2.0 * s.slew_growth_rad_s2 * abs(left))
    rate = math.copysign(min(stopping, slew, abs(left) / dt_s), left)
    most = s.slew_growth_rad_s2 * dt_s
    s.slew_now_rad_s += min(max(rate - s.slew_now_rad_s, -most), most)
    return s.slew_now_rad_s * dt_s


@inner_kernel
def _aim(s: State, polars: Polars, left_m: float) -> None:
    """Choose the steepness that ends the leg at its planned distance."""
    left_s = max(time_left_s(s), pitch_aim.AIM_INTERVAL_S)
    forward = max(forward_speed(s), 0.0)
    left_m -= s.run_out_s * forward
    coasting_s = s.speeding_up_s * -math.expm1(-left_s / s.speeding_up_s)
    settled_s = max(left_s - coasting_s, pitch_aim.LEAST_SETTLED_SHARE * left_s)
    needed_m_s = (left_m - forward * coasting_s) / settled_s
    rate = abs(polars.rate_m_s[s.polar])
    steepness = math.atan2(rate, needed_m_s) if needed_m_s > 0.0 else math.pi / 2.0
    grid = polars.steepness_rad[s.polar]
    s.aimed_rad = _interpolated(steepness, grid, polars.pitch_rad[s.polar])
    limit = pitch_aim.SHORT_OFF if s.falls_short else pitch_aim.SHORT_ON
    s.falls_short = needed_m_s > limit * rate / math.tan(grid[0])


@inner_kernel
def _interpolated(at: float, places: FloatArray, values: FloatArray) -> float:
    """Return a value between those at ascending places, kept within them (``numpy.interp``)."""
    if at <= places[0]:
        return values[0]
    for k in range(1, places.shape[0]):
        if at <= places[k]:
            part = (at - places[k - 1]) / (places[k] - places[k - 1])
            return values[k - 1] + part * (values[k] - values[k - 1])
    return values[-1]


@inner_kernel
def _aimed_at(s: State) -> tuple[float, float]:
    """Return the point from which the water carries a glide to its target in the time left."""
    left_s = time_left_s(s)
    return (
        s.target_ne_m[0] - s.sure_ne_m_s[0] * left_s,
        s.target_ne_m[1] - s.sure_ne_m_s[1] * left_s,
    )


@inner_kernel
def step_leg(s: State, setup: Setup, robot: Robot, legs: np.ndarray, polars: Polars) -> None:
    """Fly the leg on."""
    if s.maneuver == SWIM:
        step_swim(s, setup, robot)
        return
    if s.maneuver == KEEP:
        step_keep(s, setup, robot)
        return
    leg = legs[s.flown]
    acceleration = _step_depth(s, setup)
    depth, rate = s.reference_m, s.reference_m_s
    if s.maneuver == DIVE:
        left_s = time_left_s(s) + manner.SETTLING_S
        north = s.target_ne_m[0] - s.sure_ne_m_s[0] * left_s
        east = s.target_ne_m[1] - s.sure_ne_m_s[1] * left_s
        off = bearing(s, north, east) - s.course_heading_rad
        along_m = distance(s, north, east) * math.cos(off)
        sink_on(s, setup, robot, depth, rate, acceleration, along_m / left_s)
        return
    most = pitch_aim.BUOYANCY_RESERVE * polars.net_buoyancy_max_kg[s.polar]
    if s.maneuver == GLIDE:
        north, east = _aimed_at(s)
        left_m = distance(s, north, east)
        off = wrap(bearing(s, north, east) - s.course_rad)
        if abs(off) < manner.AHEAD_RAD and left_m > setup.near_m:
            s.course_rad = wrap(s.course_rad + off)
            off = 0.0
        pitch = _step_aim(s, setup, polars, left_m * math.cos(off))
        glide_on(s, setup, robot, depth, rate, acceleration, pitch, most)
        return
    done, turn = _share_of_depth(s), leg.turn_rad
    pitch = _step_aim(s, setup, polars, (1.0 - done) * abs(leg.radius_m * turn))
    heading, side = leg.heading_rad + done * turn, math.copysign(1.0, turn)
    spiral_on(s, setup, robot, heading, side, depth, rate, acceleration, pitch, most)


@inner_kernel
def turn_course(s: State, setup: Setup, legs: np.ndarray) -> float:
    """Return the course of the first leg that has one, from where the robot is now."""
    headed = legs[s.headed]
    if s.headed == s.leg and headed.kind == GLIDE:
        north, east = anchored_end(s, legs, s.leg)
        away_s = headed.duration_s / s.turn_speed_share
        north -= s.sure_ne_m_s[0] * away_s
        east -= s.sure_ne_m_s[1] * away_s
        if distance(s, north, east) > setup.aim_m:
            return bearing(s, north, east)
    return headed.heading_rad
