"""Compiled legs: where they lead, in belief and really, and whether they stay in the water."""

import math

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_kernel, inner_kernel
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


@inlined_kernel
def stays(limits: Limits, water: Waterway, leg: FloatArray, under: float) -> bool:
    """Tell whether a leg really stays in the domain and the water (``edge.stays``)."""
    x_low, x_high, y_low, y_high = _bounds(leg)
    drifts = limits.has_current and not knows_place(leg)
    if drifts:
        x_room, y_room = water.x_room, water.y_room
        if leg[KIND] == SPIRAL and leg[Z0] <= 0.0:
            return False
        if x_low < x_room[0] or x_high > x_room[1] or y_low < y_room[0] or y_high > y_room[1]:
            return False
        x0, y0 = carried(limits, 0.0, 0.0, under)
        x1, y1 = carried(limits, 0.0, 0.0, under + leg[DURATION])
        if leg[KIND] == SPIRAL:
            x_low, x_high = x_low + min(x0, x1), x_high + max(x0, x1)
            y_low, y_high = y_low + min(y0, y1), y_high + max(y0, y1)
        else:
            x0, x1, y0, y1 = x0 + leg[X0], x1 + leg[X1], y0 + leg[Y0], y1 + leg[Y1]
            x_low, x_high, y_low, y_high = min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1)
    if not _holds(limits, x_low, y_low) or not _holds(limits, x_high, y_high):
        return False
    return water.is_everywhere or _is_in_water(limits, water, leg, under, drifts)


@inlined_kernel
def knows_place(leg: FloatArray) -> bool:
    """Tell whether a leg is a swim along the surface (``drift.knows_place``)."""
    return leg[KIND] == SWIM and leg[Z0] <= 0.0


@inlined_kernel
def carried(limits: Limits, x: float, y: float, under: float) -> tuple[float, float]:
    """Return where a robot is that believes to be at a place (``drift.carried``)."""
    return x + limits.current_north * under, y + limits.current_east * under


@inlined_kernel
def after(limits: Limits, leg: FloatArray, under: float) -> tuple[float, float, float, float]:
    """Return where the robot believes to be after a leg, and for how long it has not seen."""
    x, y, z = leg[X1], leg[Y1], leg[Z1]
    then = under + leg[DURATION]
    if z > 0.0:
        return x, y, z, then
    if limits.has_current and not knows_place(leg):
        x, y = carried(limits, x, y, then)
    return x, y, z, 0.0


@inlined_kernel
def really_at(
    limits: Limits, leg: FloatArray, under: float, drifts: bool, fraction: float
) -> tuple[float, float, float]:
    """Return where the robot really is on a leg (``drift.position_at``)."""
    x, y, z = _at(leg, fraction)
    if drifts:
        x, y = carried(limits, x, y, under + fraction * leg[DURATION])
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
    limits: Limits, water: Waterway, leg: FloatArray, under: float, drifts: bool
) -> bool:
    """Tell whether the true way is above the floor and off shores and keep-outs."""
    count = chords(water, leg[RADIUS], leg[TURN]) if leg[KIND] == SPIRAL else 1
    here = really_at(limits, leg, under, drifts, 0.0)
    for i in range(1, count + 1):
        there = really_at(limits, leg, under, drifts, i / count)
        if not holds_line(water, here, there):
            return False
        here = there
    return True
