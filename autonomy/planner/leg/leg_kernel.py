"""Compiled legs: where they lead, in belief and really, and whether they stay in the water."""

import math

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_kernel, inner_kernel
from autonomy.planner.leg.drift import MIDPOINTS, ROUNDS
from autonomy.planner.leg.flow_kernel import flow_at, is_uniform
from autonomy.planner.leg.waterway import Waterway
from autonomy.planner.leg.waterway_kernel import chords, holds_line
from autonomy.planner.limits import Limits
from autonomy.planner.plan import Leg, PrimitiveKind

GLIDE, SPIRAL, DIVE, SWIM = range(4)
KINDS = (PrimitiveKind.GLIDE, PrimitiveKind.SPIRAL, PrimitiveKind.DIVE, PrimitiveKind.SWIM)
"""Primitive of each number above."""
KIND, X0, Y0, Z0, X1, Y1, Z1, SPEED, DURATION, ENERGY, HEADING, RADIUS, TURN = range(13)
LEG_COLUMNS = 13
"""Columns of a leg in an array of legs."""
_EDGE_MARGIN_M = 1e-9

Carried = tuple[float, float, float]
"""How far north and east the water has carried a robot from where it believes to be, and when that
is, s since the plan began (``drift.Carried``)."""


def leg_of(row: FloatArray) -> Leg:
    """Return one row of an array of legs as a value."""
    return Leg(
        kind=KINDS[int(row[KIND])],
        start_ned=(float(row[X0]), float(row[Y0]), float(row[Z0])),
        end_ned=(float(row[X1]), float(row[Y1]), float(row[Z1])),
        speed_m_s=float(row[SPEED]),
        duration_s=float(row[DURATION]),
        energy=float(row[ENERGY]),
        heading_rad=float(row[HEADING]),
        radius_m=float(row[RADIUS]),
        turn_rad=float(row[TURN]),
    )


@inner_kernel
def leg_current(limits: Limits, leg: FloatArray, begin: Carried) -> tuple[float, float]:
    """Return the mean current along a leg that begins so (``drift.course_of``)."""
    x, y, t = begin
    u, v = flow_at(limits.flow, leg[X0] + x, leg[Y0] + y, leg[Z0], t)
    if is_uniform(limits.flow):
        return u, v
    for _ in range(ROUNDS):
        north, east = 0.0, 0.0
        for share in MIDPOINTS:
            px, py, pz = _at(leg, share)
            passed = share * leg[DURATION]
            un, ue = flow_at(limits.flow, px + x + passed * u, py + y + passed * v, pz, t + passed)
            north += un / len(MIDPOINTS)
            east += ue / len(MIDPOINTS)
        u, v = north, east
    return u, v


@inlined_kernel
def stays(
    limits: Limits,
    water: Waterway,
    leg: FloatArray,
    begin: Carried,
    current: tuple[float, float],
) -> bool:
    """Tell whether a leg really stays in the domain and the water (``edge.stays``)."""
    x_low, x_high, y_low, y_high = _bounds(leg)
    drifts = limits.has_current and not knows_place(leg)
    if drifts:
        x_room, y_room = water.x_room, water.y_room
        if leg[KIND] == SPIRAL and leg[Z0] <= 0.0:
            return False
        if x_low < x_room[0] or x_high > x_room[1] or y_low < y_room[0] or y_high > y_room[1]:
            return False
        x0, y0 = begin[0], begin[1]
        x1, y1 = x0 + current[0] * leg[DURATION], y0 + current[1] * leg[DURATION]
        if leg[KIND] == SPIRAL:
            x_low, x_high = x_low + min(x0, x1), x_high + max(x0, x1)
            y_low, y_high = y_low + min(y0, y1), y_high + max(y0, y1)
        else:
            x0, x1, y0, y1 = x0 + leg[X0], x1 + leg[X1], y0 + leg[Y0], y1 + leg[Y1]
            x_low, x_high, y_low, y_high = min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1)
    if not _holds(limits, x_low, y_low) or not _holds(limits, x_high, y_high):
        return False
    return water.is_everywhere or _is_in_water(limits, water, leg, begin, current, drifts)


@inlined_kernel
def knows_place(leg: FloatArray) -> bool:
    """Tell whether a leg is a swim along the surface (``drift.knows_place``)."""
    return leg[KIND] == SWIM and leg[Z0] <= 0.0


@inlined_kernel
def fresh(limits: Limits, begin: float) -> Carried:
    """Return that a robot knows its place, when it leaves the surface (``drift.fresh``)."""
    return 0.0, 0.0, begin + limits.turn_time


@inlined_kernel
def after(
    limits: Limits, leg: FloatArray, begin: Carried, current: tuple[float, float]
) -> tuple[tuple[float, float, float], Carried]:
    """Return where the robot believes to be after a leg, and how far it was carried from there."""
    x, y, z = leg[X1], leg[Y1], leg[Z1]
    way_x = begin[0] + current[0] * leg[DURATION]
    way_y = begin[1] + current[1] * leg[DURATION]
    then = begin[2] + leg[DURATION]
    if z > 0.0:
        return (x, y, z), (way_x, way_y, then)
    if not knows_place(leg):
        x, y = x + way_x, y + way_y
    return (x, y, z), fresh(limits, then)


@inlined_kernel
def really_at(
    leg: FloatArray, begin: Carried, current: tuple[float, float], drifts: bool, fraction: float
) -> tuple[float, float, float]:
    """Return where the robot really is on a leg (``drift.position_at``)."""
    x, y, z = _at(leg, fraction)
    if drifts:
        passed = fraction * leg[DURATION]
        x, y = x + begin[0] + current[0] * passed, y + begin[1] + current[1] * passed
    return x, y, z


@inlined_kernel
def _at(leg: FloatArray, fraction: float) -> tuple[float, float, float]:
    z = leg[Z0] + fraction * (leg[Z1] - leg[Z0])
    if leg[KIND] == SPIRAL:
        x, y = on_circle(leg[X0], leg[Y0], leg[HEADING], leg[RADIUS], fraction * leg[TURN])
        return x, y, z
    return (
        leg[X0] + fraction * (leg[X1] - leg[X0]),
        leg[Y0] + fraction * (leg[Y1] - leg[Y0]),
        z,
    )


@inlined_kernel
def on_circle(
    x: float, y: float, heading: float, radius: float, turn: float
) -> tuple[float, float]:
    """Return north and east after a turn (``primitive.on_circle``)."""
    side = math.copysign(radius, turn)
    later = heading + turn
    return (
        x + side * (math.sin(later) - math.sin(heading)),
        y - side * (math.cos(later) - math.cos(heading)),
    )


@inlined_kernel
def _bounds(leg: FloatArray) -> tuple[float, float, float, float]:
    """Return least and greatest north and east of a leg as believed (``primitive.bounds``)."""
    x_low, x_high = min(leg[X0], leg[X1]), max(leg[X0], leg[X1])
    y_low, y_high = min(leg[Y0], leg[Y1]), max(leg[Y0], leg[Y1])
    if leg[KIND] == SPIRAL:
        quarter = math.pi / 2.0
        heading, turn = leg[HEADING], leg[TURN]
        low = min(heading, heading + turn)
        high = max(heading, heading + turn)
        for k in range(math.ceil(low / quarter), math.floor(high / quarter) + 1):
            x, y = on_circle(leg[X0], leg[Y0], heading, leg[RADIUS], k * quarter - heading)
            x_low, x_high = min(x_low, x), max(x_high, x)
            y_low, y_high = min(y_low, y), max(y_high, y)
    return x_low, x_high, y_low, y_high


@inlined_kernel
def _holds(limits: Limits, x: float, y: float) -> bool:
    return (
        limits.x_min - _EDGE_MARGIN_M <= x <= limits.x_max + _EDGE_MARGIN_M
        and limits.y_min - _EDGE_MARGIN_M <= y <= limits.y_max + _EDGE_MARGIN_M
    )


@inner_kernel
def _is_in_water(
    limits: Limits,
    water: Waterway,
    leg: FloatArray,
    begin: Carried,
    current: tuple[float, float],
    drifts: bool,
) -> bool:
    """Tell whether the true way is above the floor and off shores and keep-outs."""
    count = chords(water, leg[RADIUS], leg[TURN]) if leg[KIND] == SPIRAL else 1
    here = really_at(leg, begin, current, drifts, 0.0)
    for i in range(1, count + 1):
        there = really_at(leg, begin, current, drifts, i / count)
        if not holds_line(water, here, there):
            return False
        here = there
    return True
