"""What the robot does at the surface and on its way up, compiled.

``onboard.flight.maneuver`` and ``onboard.flight.keep`` are the readable form.
"""

import math

from autonomy.compiled import inner_kernel
from onboard.flight import keep
from onboard.flight import maneuver as manner
from robot_link.messages import RobotMode
from simulator.ahead import pilot
from simulator.ahead.state import Robot, Setup, State, Water

FLOAT, SWIM, TURN, RISE, GLIDE, SPIRAL, DIVE, KEEP = range(8)
"""Maneuvers."""
SWIMMING, TURNING = int(RobotMode.SWIMMING), int(RobotMode.TURNING)
ABORTING, LYING = int(RobotMode.ABORTING), int(RobotMode.SURFACED)
wrap, heading_error, forward_speed = pilot.wrap, pilot.heading_error, pilot.forward_speed
swim_to, swim_at_depth, rest = pilot.swim, pilot.swim_at_depth, pilot.rest
"""Names that numba resolves once, when it compiles."""


@inner_kernel
def is_surfaced(s: State, setup: Setup) -> bool:
    """Tell whether the robot lies at the surface, as it believes."""
    return s.position_ned[2] < setup.surfaced_m


@inner_kernel
def distance(s: State, north: float, east: float) -> float:
    """Return the horizontal distance to a point."""
    return math.hypot(north - s.position_ned[0], east - s.position_ned[1])


@inner_kernel
def bearing(s: State, north: float, east: float) -> float:
    """Return the course to a point."""
    return math.atan2(east - s.position_ned[1], north - s.position_ned[0])


@inner_kernel
def enter_float(s: State, mode: int) -> None:
    """Begin to lie at the surface."""
    s.maneuver, s.mode, s.returns, s.flown = FLOAT, mode, False, -1


@inner_kernel
def enter_rise(s: State) -> None:
    """Begin to come up."""
    s.maneuver, s.mode, s.flown = RISE, ABORTING, -1


@inner_kernel
def enter_turn(s: State, headed: int) -> None:
    """Begin to turn towards a leg."""
    s.maneuver, s.mode, s.flown = TURN, TURNING, -1
    s.aligned_s = s.elapsed_s = 0.0
    s.headed, s.turn_speed_share = headed, s.speed_share


@inner_kernel
def aim_swim(s: State, setup: Setup, north: float, east: float, depth_m: float) -> None:
    """Begin to swim straight to a point."""
    s.target_ne_m[0], s.target_ne_m[1] = north, east
    s.swim_depth_m = depth_m
    s.distance_m = max(distance(s, north, east), setup.arrival_m)
    s.course_rad = _towards(s, setup)
    s.closest_m = s.distance_m
    s.left_s = 2.0 * s.distance_m / setup.swimming_speed_m_s + manner.SWIM_TIMEOUT_S


@inner_kernel
def enter_swim(s: State, setup: Setup, north: float, east: float, depth_m: float) -> None:
    """Swim straight to a point as a maneuver of its own."""
    s.maneuver, s.mode, s.flown = SWIM, SWIMMING, -1
    aim_swim(s, setup, north, east, depth_m)


@inner_kernel
def _towards(s: State, setup: Setup) -> float:
    """Return the heading that leads straight to the target over ground."""
    course = bearing(s, s.target_ne_m[0], s.target_ne_m[1])
    aside = s.sure_ne_m_s[1] * math.cos(course) - s.sure_ne_m_s[0] * math.sin(course)
    share = aside / setup.swimming_speed_m_s
    return course - math.asin(min(max(share, -manner.CRAB_MOST), manner.CRAB_MOST))


@inner_kernel
def step_swim(s: State, setup: Setup, robot: Robot) -> None:
    """Swim on."""
    s.left_s -= setup.period_s
    if distance(s, s.target_ne_m[0], s.target_ne_m[1]) > setup.near_m:
        s.course_rad = _towards(s, setup)
    if s.swim_depth_m == 0.0:
        swim_to(s, setup, robot, s.course_rad)
    else:
        swim_at_depth(s, setup, robot, s.course_rad, s.swim_depth_m)


@inner_kernel
def is_swim_done(s: State, setup: Setup) -> bool:
    """Tell whether the point is reached, or was passed closely."""
    left_m = distance(s, s.target_ne_m[0], s.target_ne_m[1])
    arrival_m = setup.arrival_m
    s.closest_m = min(s.closest_m, left_m)
    passed = s.closest_m < 2.0 * arrival_m and left_m > s.closest_m + 0.25 * arrival_m
    return left_m < arrival_m or passed or s.left_s < 0.0


@inner_kernel
def step_float(s: State, setup: Setup, robot: Robot, water: Water) -> None:
    """Stay where it is; swim back once the water has carried it out of the domain."""
    domain, slack = water.domain, setup.arrival_m
    north, east = s.position_ned[0], s.position_ned[1]
    is_inside = (
        domain[0] - slack <= north <= domain[1] + slack
        and domain[2] - slack <= east <= domain[3] + slack
    )
    if not s.returns and not is_inside:
        s.returns = True
        to_north = min(max(north, domain[0]), domain[1])
        aim_swim(s, setup, to_north, min(max(east, domain[2]), domain[3]), 0.0)
    if s.returns and is_swim_done(s, setup):
        s.returns = False
    if s.returns:
        step_swim(s, setup, robot)
    else:
        rest(s, setup, robot)


@inner_kernel
def enter_keep(s: State, setup: Setup, north: float, east: float, radius_m: float) -> None:
    """Begin to keep a place at the surface, or go on with it."""
    s.maneuver, s.mode, s.returns = KEEP, LYING, False
    s.target_ne_m[0], s.target_ne_m[1] = north, east
    s.keep_radius_m, s.coasted_s = max(radius_m, setup.arrival_m), math.inf


@inner_kernel
def step_keep(s: State, setup: Setup, robot: Robot) -> None:
    """Keep the place: float, and swim back when the water has carried it too far."""
    s.kept_s += setup.period_s
    s.coasted_s += setup.period_s
    north, east = s.target_ne_m[0], s.target_ne_m[1]
    away_m, to_place = distance(s, north, east), bearing(s, north, east)
    closing = s.velocity_ned[0] * math.cos(to_place) + s.velocity_ned[1] * math.sin(to_place)
    if s.returns and away_m - setup.coast_s * closing < keep.INNER_SHARE * s.keep_radius_m:
        s.returns, s.coasted_s = False, 0.0
    elif not s.returns and s.coasted_s >= setup.coast_s and away_m > s.keep_radius_m:
        s.returns = True
        aim_swim(s, setup, north, east, 0.0)
    s.mode = SWIMMING if s.returns else LYING
    if s.returns:
        step_swim(s, setup, robot)
    else:
        rest(s, setup, robot)


@inner_kernel
def step_turn(s: State, setup: Setup, robot: Robot, course_rad: float) -> None:
    """Swim towards a course."""
    s.elapsed_s += setup.period_s
    aligned = abs(heading_error(s, course_rad)) < manner.ALIGNED_RAD
    aligned = aligned and forward_speed(s) > setup.entry_speed_m_s
    s.aligned_s = s.aligned_s + setup.period_s if aligned else 0.0
    swim_to(s, setup, robot, course_rad)


@inner_kernel
def is_turn_done(s: State) -> bool:
    """Tell whether the robot has swum along the course for a moment."""
    return s.aligned_s >= manner.ALIGNED_S or s.elapsed_s > manner.TURN_TIMEOUT_S
