"""Compiled twin of ``autonomy.planner.leg.edge``: the same shape gives the same edge."""

import math

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_kernel, inner_kernel, kernel
from autonomy.planner.leg.edge import (
    AIMS,
    SAME_PLACE_M,
    SHAPE_BEARING,
    SHAPE_COLUMNS,
    SHAPE_DEPTH,
    SHAPE_FIRST,
    SHAPE_KIND,
    SHAPE_SECOND,
    SHAPE_SIDE,
)
from autonomy.planner.leg.flow_kernel import flow_at, is_uniform
from autonomy.planner.leg.leg_kernel import (
    DIVE,
    DURATION,
    ENERGY,
    GLIDE,
    HEADING,
    KIND,
    RADIUS,
    SPEED,
    SPIRAL,
    SWIM,
    TURN,
    X0,
    X1,
    Y0,
    Y1,
    Z0,
    Z1,
    Carried,
    after,
    fresh,
    knows_place,
    leg_current,
    on_circle,
    really_at,
    stays,
)
from autonomy.planner.leg.primitive import HEADWAY_MIN
from autonomy.planner.leg.waterway import Waterway
from autonomy.planner.limits import Limits


@kernel
def propose(
    limits: Limits,
    water: Waterway,
    start: tuple[float, float],
    goal: tuple[float, float],
    shape: FloatArray,
    legs: FloatArray,
    begin_s: float,
) -> int:
    """Build the legs of a shape between two surface points (``edge.propose_edge``).

    Args:
        limits: What edges are made from.
        water: Where there is water enough.
        start: North and east of the surfacing that the edge leaves.
        goal: North and east of the surfacing that it must reach.
        shape: What the primitives are made from (``edge.random_shape``).
        legs: Receives the legs, shape ``(legs_max, LEG_COLUMNS)``.
        begin_s: When it begins, s since the plan began.

    Returns:
        Number of legs; 0 if the edge does not reach the goal or breaks the budget.
    """
    here = (start[0], start[1], 0.0)
    begin = fresh(limits, begin_s)
    count = 0
    for i in range(1 + int(shape[0] * limits.primitives_max)):
        row = shape[1 + i * SHAPE_COLUMNS : 1 + (i + 1) * SHAPE_COLUMNS]
        heading = _heading_to(limits, here, begin, goal)
        heading += limits.bearing_noise * row[SHAPE_BEARING]
        leg = legs[count]
        if _shape_leg(limits, here, heading, row, leg, begin[2]):
            current = leg_current(limits, leg, begin)
            if stays(limits, water, leg, begin, current):
                here, begin = after(limits, leg, begin, current)
                count += 1
    count = _close(limits, water, here, begin, goal, legs, count)
    return count if energy_of(limits, legs, count) <= limits.budget else 0


@inner_kernel
def energy_of(limits: Limits, legs: FloatArray, count: int) -> float:
    """Return the energy of legs and of what prepares them (``edge.legs_energy``)."""
    energy = 0.0
    for i in range(count):
        energy += legs[i, ENERGY]
        if legs[i, Z0] <= 0.0:
            energy += limits.surfacing_energy
    return energy


@inlined_kernel
def _shape_leg(
    limits: Limits,
    here: tuple[float, float, float],
    heading: float,
    row: FloatArray,
    leg: FloatArray,
    begin_s: float,
) -> bool:
    """Write the primitive of one row of a shape; tell whether it can be flown."""
    x, y, z = here
    kind = int(row[SHAPE_KIND] * 4)
    if kind == SWIM:
        if z > 0.0 and not limits.swims_under_water:
            return False
        length = _between(limits.swim_length_min, limits.swim_length_max, row[SHAPE_FIRST])
        end = (x + length * math.cos(heading), y + length * math.sin(heading), z)
        speed = _headway(limits, here, end, begin_s)
        if speed == 0.0:
            return False
        _write(limits, leg, SWIM, here, end, speed, length)
        return True
    depth = row[SHAPE_DEPTH] * limits.depth_max
    if depth < limits.depth_change_min:
        depth = 0.0
    change = abs(depth - z)
    if change < limits.depth_change_min:
        return False
    if kind == DIVE:
        _write(limits, leg, DIVE, here, (x, y, depth), limits.dive_speed, change)
    elif kind == GLIDE:
        angle = _between(limits.glide_angle_min, limits.glide_angle_max, row[SHAPE_FIRST])
        reach = change / math.tan(angle)
        end = (x + reach * math.cos(heading), y + reach * math.sin(heading), depth)
        _write(limits, leg, GLIDE, here, end, limits.glide_speed, change)
    else:
        radius = _between(limits.spiral_radius_min, limits.spiral_radius_max, row[SHAPE_FIRST])
        rise = _between(limits.spiral_rise_min, limits.spiral_rise_max, row[SHAPE_SECOND])
        turn = math.copysign(change / rise, row[SHAPE_SIDE] - 0.5)
        x1, y1 = on_circle(x, y, heading, radius, turn)
        _write(limits, leg, SPIRAL, here, (x1, y1, depth), limits.spiral_speed, change)
        leg[HEADING], leg[RADIUS], leg[TURN] = heading, radius, turn
    return True


@inlined_kernel
def _between(low: float, high: float, part: float) -> float:
    return low + (high - low) * part


@inner_kernel
def _close(
    limits: Limits,
    water: Waterway,
    here: tuple[float, float, float],
    begin: Carried,
    goal: tuple[float, float],
    legs: FloatArray,
    count: int,
) -> int:
    """Append what brings the robot up and to the goal; return the number of legs, 0 if nothing."""
    x, y, z = here
    if z > 0.0:
        u, v = _aim(limits, here, begin, goal, legs[count])
        angle = math.atan2(z, math.hypot(legs[count, X1] - x, legs[count, Y1] - y))
        if limits.glide_angle_min <= angle <= limits.glide_angle_max:
            return count + 1 if stays(limits, water, legs[count], begin, (u, v)) else 0
        _write(limits, legs[count], DIVE, here, (x, y, 0.0), limits.dive_speed, z)
        current = leg_current(limits, legs[count], begin)
        if not stays(limits, water, legs[count], begin, current):
            return 0
        (x, y, _), begin = after(limits, legs[count], begin, current)
        count += 1
    distance = math.hypot(goal[0] - x, goal[1] - y)
    if distance < SAME_PLACE_M:
        return count
    if not limits.swim_length_min <= distance <= limits.swim_length_max:
        return 0
    end = (goal[0], goal[1], 0.0)
    speed = _headway(limits, (x, y, 0.0), end, begin[2])
    if speed == 0.0:
        return 0
    _write(limits, legs[count], SWIM, (x, y, 0.0), end, speed, distance)
    return count + 1 if stays(limits, water, legs[count], begin, (0.0, 0.0)) else 0


@inner_kernel
def _aim(
    limits: Limits,
    here: tuple[float, float, float],
    begin: Carried,
    goal: tuple[float, float],
    leg: FloatArray,
) -> tuple[float, float]:
    """Write the glide that really leads up to the goal; return the current along it.

    ``edge._closing_glide`` is the readable form.
    """
    duration = here[2] / limits.glide_speed
    u, v = flow_at(limits.flow, here[0] + begin[0], here[1] + begin[1], here[2], begin[2])
    for number in range(AIMS):
        up = (goal[0] - begin[0] - u * duration, goal[1] - begin[1] - v * duration, 0.0)
        _write(limits, leg, GLIDE, here, up, limits.glide_speed, here[2])
        u, v = leg_current(limits, leg, begin)
        if is_uniform(limits.flow) or number == AIMS - 1:
            break
    return u, v


@inlined_kernel
def _heading_to(
    limits: Limits,
    here: tuple[float, float, float],
    begin: Carried,
    goal: tuple[float, float],
) -> float:
    """Return the heading of a glide that leads to the goal over ground (``edge._heading_to``)."""
    x, y = here[0] + begin[0], here[1] + begin[1]
    if not limits.has_current:
        return math.atan2(goal[1] - y, goal[0] - x)
    u, v = flow_at(limits.flow, x, y, here[2], begin[2])
    middle = 0.5 * (limits.glide_angle_min + limits.glide_angle_max)
    way = math.hypot(goal[0] - x, goal[1] - y) * math.tan(middle) / limits.glide_speed
    return math.atan2(goal[1] - v * way - y, goal[0] - u * way - x)


@inlined_kernel
def _headway(
    limits: Limits,
    start: tuple[float, float, float],
    end: tuple[float, float, float],
    begin_s: float,
) -> float:
    """Return how fast a swim gets on, 0 if hardly at all (``primitive.headway_m_s``)."""
    speed = limits.swim_speed
    if start[2] > 0.0:
        return speed
    north, east = flow_at(limits.flow, start[0], start[1], 0.0, begin_s)
    if north == 0.0 and east == 0.0:
        return speed
    course = math.atan2(end[1] - start[1], end[0] - start[0])
    along = north * math.cos(course) + east * math.sin(course)
    across = east * math.cos(course) - north * math.sin(course)
    if abs(across) >= speed:
        return 0.0
    headway = along + math.sqrt(speed**2 - across**2)
    return headway if headway >= HEADWAY_MIN * speed else 0.0


@inner_kernel
def _write(
    limits: Limits,
    leg: FloatArray,
    kind: int,
    start: tuple[float, float, float],
    end: tuple[float, float, float],
    speed: float,
    way: float,
) -> None:
    leg[KIND] = kind
    leg[X0], leg[Y0], leg[Z0] = start
    leg[X1], leg[Y1], leg[Z1] = end
    leg[SPEED] = speed
    duration = way / speed
    leg[DURATION] = duration
    if kind == SWIM:
        phase = 4.0 * math.pi * limits.tail_frequency * duration
        squared_rate = 0.5 * math.pi * limits.tail_amplitude**2 * limits.tail_frequency
        work = limits.swim_factor * squared_rate * (math.sin(phase) + phase)
    elif kind == DIVE:
        work = limits.dive_energy
    elif kind == GLIDE:
        work = limits.glide_energy
    else:
        work = limits.spiral_energy
    leg[ENERGY] = work + limits.time_factor * duration
    straight = kind in (GLIDE, SWIM)
    leg[HEADING] = math.atan2(end[1] - start[1], end[0] - start[0]) if straight else 0.0
    leg[RADIUS] = 0.0
    leg[TURN] = 0.0


@kernel
def place_points(
    limits: Limits, legs: FloatArray, count: int, points: FloatArray, begin_s: float
) -> int:
    """Place the planned points of an edge (``edge.planned_points``).

    Args:
        limits: What edges are made from.
        legs: Legs of the edge, shape ``(legs_max, LEG_COLUMNS)``.
        count: Number of legs.
        points: Receives time, north, east, down, position std, shape ``(points_max, 5)``.
        begin_s: When the edge begins, s since the plan began.

    Returns:
        Number of points; 0 if the position becomes less certain than allowed on the way.
    """
    first, placed, departures = 0, 0, 0
    begin = 0.0
    total = 0.0
    for i in range(count):
        total += legs[i, DURATION]
        if legs[i, Z1] <= 0.0 or i == count - 1:
            from_s = begin_s + begin + departures * limits.turn_time
            number = _place_dive(limits, legs[first : i + 1], total, points[placed:], from_s)
            if number == 0:
                return 0
            points[placed : placed + number, 0] += begin
            placed += number
            begin += total
            departures += 1
            first, total = i + 1, 0.0
    return placed


@inner_kernel
def _place_dive(
    limits: Limits, legs: FloatArray, total: float, points: FloatArray, begin_s: float
) -> int:
    """Place the points of legs that take ``total`` from one surfacing to the next; 0 if lost."""
    number = max(math.ceil(total / limits.point_interval - 1e-9), 1)
    a, b, d = limits.surface_position, limits.surface_cross, limits.surface_velocity
    i = 0
    leg_end = legs[0, DURATION]
    carried = fresh(limits, begin_s)
    current = leg_current(limits, legs[0], carried)
    drifts = limits.has_current and not knows_place(legs[0])
    before = blind = 0.0
    for row in range(number):
        time = min((row + 1) * limits.point_interval, total)
        while i < len(legs) - 1 and leg_end < time:
            _, carried = after(limits, legs[i], carried, current)
            i += 1
            leg_end += legs[i, DURATION]
            current = leg_current(limits, legs[i], carried)
        fraction = 1.0 - (leg_end - time) / legs[i, DURATION]
        x, y, z = really_at(legs[i], carried, current, drifts, fraction)
        has_fix = z <= limits.surface_depth
        a, b, d = _step(limits, a, b, d, time - before, has_fix)
        blind = 0.0 if has_fix else blind + time - before
        by_current = blind * blind * (limits.steady_current**2 + limits.forgotten * blind)
        std = limits.doubt * math.sqrt(a + by_current)
        if std > limits.max_uncertainty:
            return 0
        points[row, 0], points[row, 1], points[row, 2], points[row, 3] = time, x, y, z
        points[row, 4] = std
        before = time
    return number


@inner_kernel
def _step(
    limits: Limits, a: float, b: float, d: float, dt: float, has_fix: bool
) -> tuple[float, float, float]:
    """Advance one axis of the position filter (``AxisCovariance.step``): P_pp, P_pv, P_vv."""
    q = limits.acceleration_density
    a += 2.0 * dt * b + dt * dt * d + q * dt**3 / 3.0
    b += dt * d + q * dt * dt / 2.0
    d += q * dt
    noise = limits.drift_variance / dt
    s = d + noise
    a, b, d = a - b * b / s, b * noise / s, d * noise / s
    if has_fix:
        noise = limits.fix_variance
        s = a + noise
        a, b, d = a * noise / s, b * noise / s, d - b * b / s
    return a, b, d
