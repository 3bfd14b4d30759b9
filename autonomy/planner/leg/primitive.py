"""Geometry, duration and energy of the motion primitives (thesis Table 5.1, Figure 5.2)."""

import math
from dataclasses import replace

from autonomy.current.table import flow_at, is_uniform
from autonomy.planner.config import EnergyConfig, PlannerConfig
from autonomy.planner.plan import Leg, PositionNed, PrimitiveKind
from autonomy.site import Box

HEADWAY_MIN = 0.25
"""Least part of a swim's speed that the current may leave over ground."""
_KEEPING_MOMENTS = 16
"""Moments of a stay at which a current that changes is looked up."""


def energy(kind: PrimitiveKind, duration_s: float, config: EnergyConfig) -> float:
    r"""Return the energy units of one primitive.

    Glides, spirals and dives cost a constant, since their actuators move at their beginning only.
    Swimming costs :math:`\int \dot\delta^2 dt = \frac12 \pi \delta_a^2 f (\sin 4 \pi f T + 4 \pi
    f T)`. Time costs the same for all (thesis sections 5.4.2 and 5.5.2).
    """
    constant = {
        PrimitiveKind.GLIDE: config.glide,
        PrimitiveKind.SPIRAL: config.spiral,
        PrimitiveKind.DIVE: config.dive,
    }
    work = constant.get(kind)
    if work is None:
        work = _tail_work(duration_s, config)
    return work + config.time_factor * duration_s


def _tail_work(duration_s: float, config: EnergyConfig) -> float:
    f = config.tail_frequency_hz
    phase = 4.0 * math.pi * f * duration_s
    return config.swim_factor * (
        0.5 * math.pi * config.tail_amplitude_rad**2 * f * (math.sin(phase) + phase)
    )


def energy_of(config: PlannerConfig, leg: Leg, begin_s: float = 0.0) -> float:
    """Return what a leg that begins so long after its plan costs, whatever it says of itself."""
    if leg.kind is not PrimitiveKind.KEEP:
        return energy(leg.kind, leg.duration_s, config.energy)
    motion = config.primitives.model_copy(update={"swim_speed_m_s": leg.speed_m_s})
    config = config.model_copy(update={"primitives": motion})
    swum_s = leg.duration_s * keeping_share(
        config, leg.end_ned, leg.radius_m, leg.duration_s, begin_s
    )
    return _tail_work(swum_s, config.energy) + config.energy.time_factor * leg.duration_s


def glide(config: PlannerConfig, start: PositionNed, end: PositionNed) -> Leg:
    """Return the straight glide from ``start`` to ``end``; its angle is the caller's business."""
    speed = config.primitives.glide_speed_m_s
    duration = abs(end[2] - start[2]) / speed
    return Leg(
        PrimitiveKind.GLIDE,
        start,
        end,
        speed,
        duration,
        energy(PrimitiveKind.GLIDE, duration, config.energy),
        heading_rad=bearing(start, end),
    )


def spiral(
    config: PlannerConfig,
    start: PositionNed,
    heading_rad: float,
    radius_m: float,
    turn_rad: float,
    depth_m: float,
) -> Leg:
    """Return the helix that leaves ``start`` at a heading and turns until it meets a depth.

    Args:
        config: Speed and prices.
        start: NED, m.
        heading_rad: Course at ``start``.
        radius_m: Of the circle, positive.
        turn_rad: Whole turn, positive to starboard.
        depth_m: Where it ends.
    """
    speed = config.primitives.spiral_speed_m_s
    duration = abs(depth_m - start[2]) / speed
    x, y = on_circle(start, heading_rad, radius_m, turn_rad)
    return Leg(
        PrimitiveKind.SPIRAL,
        start,
        (x, y, depth_m),
        speed,
        duration,
        energy(PrimitiveKind.SPIRAL, duration, config.energy),
        heading_rad,
        radius_m,
        turn_rad,
    )


def dive(config: PlannerConfig, start: PositionNed, depth_m: float) -> Leg:
    """Return the dive with level hull, straight down or up to a depth."""
    speed = config.primitives.dive_speed_m_s
    duration = abs(depth_m - start[2]) / speed
    return Leg(
        PrimitiveKind.DIVE,
        start,
        (start[0], start[1], depth_m),
        speed,
        duration,
        energy(PrimitiveKind.DIVE, duration, config.energy),
    )


def swim(config: PlannerConfig, start: PositionNed, end: PositionNed, begin_s: float = 0.0) -> Leg:
    """Return the straight swim from ``start`` to ``end``, which has the same depth.

    It begins so long after its plan.

    Raises:
        ValueError: If the current at the surface is too strong (``headway_m_s``).
    """
    speed = headway_m_s(config, start, end, begin_s)
    if speed == 0.0:
        raise ValueError("current is too strong to swim against it")
    duration = math.hypot(end[0] - start[0], end[1] - start[1]) / speed
    return Leg(
        PrimitiveKind.SWIM,
        start,
        end,
        speed,
        duration,
        energy(PrimitiveKind.SWIM, duration, config.energy),
        heading_rad=bearing(start, end),
    )


def keep(
    config: PlannerConfig,
    place: PositionNed,
    radius_m: float,
    duration_s: float,
    begin_s: float = 0.0,
) -> Leg:
    """Return the stay within a radius of a place at the surface, begun so long after its plan.

    Raises:
        ValueError: If the current there is too strong to swim against it at some time.
    """
    fault = keeping_fault(config, place, duration_s, begin_s)
    if fault:
        raise ValueError(fault)
    speed = config.primitives.swim_speed_m_s
    here = (place[0], place[1], 0.0)
    leg = Leg(PrimitiveKind.KEEP, here, here, speed, duration_s, 0.0, radius_m=radius_m)
    return replace(leg, energy=energy_of(config, leg, begin_s))


def keeping_fault(
    config: PlannerConfig, place: PositionNed, duration_s: float, begin_s: float
) -> str:
    """Return that the current is too strong at a place to stay there, "" if it is not."""
    swims = config.primitives.swim_speed_m_s
    fastest = max(_speeds_at(config, place, duration_s, begin_s))
    if swims - fastest >= HEADWAY_MIN * swims:
        return ""
    return (
        f"the current of {fastest:.2g} m/s is too strong to keep a place; "
        f"the robot swims at {swims:.2g} m/s"
    )


def keeping_share(
    config: PlannerConfig, place: PositionNed, radius_m: float, duration_s: float, begin_s: float
) -> float:
    """Return the part (0..1) of its time that a robot swims to stay within a radius of a place.

    A current c carries it out in ``r / c``, and a robot that swims at s is back in ``r / (s - c)``,
    so it swims the part ``c / s`` whatever the radius. What nobody knows of the current counts by
    its mean square. Eddies alone carry it out, as a walk of d per root second and axis, in
    ``r^2 / (2 d^2)`` in the mean, which adds ``1 / (1 + r s / (2 d^2))``.
    """
    swims, position = config.primitives.swim_speed_m_s, config.position_filter
    speeds = _speeds_at(config, place, duration_s, begin_s)
    known2 = sum(speed**2 for speed in speeds) / len(speeds)
    current = math.sqrt(known2 + 2.0 * position.steady_current_m_s**2)
    walk2 = 2.0 * position.drift_m_sqrt_s**2
    return min(current / swims + walk2 / (walk2 + radius_m * swims), 1.0)


def _speeds_at(
    config: PlannerConfig, place: PositionNed, duration_s: float, begin_s: float
) -> list[float]:
    """Return how fast the water moves at the surface of a place at moments of a stay, m/s."""
    moments = 1 if is_uniform(config.current.table) else _KEEPING_MOMENTS
    parts = [(number + 0.5) / moments for number in range(moments)]
    return [
        math.hypot(*surface_current(config, place, begin_s + part * duration_s)) for part in parts
    ]


def headway_m_s(
    config: PlannerConfig, start: PositionNed, end: PositionNed, begin_s: float = 0.0
) -> float:
    """Return how fast a swim gets on, 0 where the current leaves too little of its speed.

    At the surface the robot sees its position and steers over ground: it heads into the current
    so far that it keeps the line. Under water its speed is that through the water.
    """
    speed = config.primitives.swim_speed_m_s
    north, east = surface_current(config, start, begin_s)
    if start[2] > 0.0 or (north == 0.0 and east == 0.0):
        return speed
    course = bearing(start, end)
    along = north * math.cos(course) + east * math.sin(course)
    across = east * math.cos(course) - north * math.sin(course)
    if abs(across) >= speed:
        return 0.0
    headway = along + math.sqrt(speed**2 - across**2)
    return headway if headway >= HEADWAY_MIN * speed else 0.0


def surface_current(
    config: PlannerConfig, place: PositionNed, time_s: float
) -> tuple[float, float]:
    """Return how fast the water moves at the surface of a place, so long after a plan."""
    return flow_at(config.current.table, place[0], place[1], 0.0, time_s)


def bearing(start: PositionNed, end: PositionNed) -> float:
    """Return the course from one point to another, rad from north to starboard."""
    return math.atan2(end[1] - start[1], end[0] - start[0])


def on_circle(
    start: PositionNed, heading_rad: float, radius_m: float, turn_rad: float
) -> tuple[float, float]:
    """Return north and east after a turn of ``turn_rad`` (positive to starboard)."""
    side = math.copysign(radius_m, turn_rad)
    later = heading_rad + turn_rad
    return (
        start[0] + side * (math.sin(later) - math.sin(heading_rad)),
        start[1] - side * (math.cos(later) - math.cos(heading_rad)),
    )


def position_at(leg: Leg, fraction: float) -> PositionNed:
    """Return where the robot is after this part (0..1) of a leg's duration."""
    x0, y0, z0 = leg.start_ned
    x1, y1, z1 = leg.end_ned
    z = z0 + fraction * (z1 - z0)
    if leg.kind is PrimitiveKind.SPIRAL:
        return (
            *on_circle(leg.start_ned, leg.heading_rad, leg.radius_m, fraction * leg.turn_rad),
            z,
        )
    return (x0 + fraction * (x1 - x0), y0 + fraction * (y1 - y0), z)


def bounds(leg: Leg) -> tuple[PositionNed, PositionNed]:
    """Return the smallest and the greatest coordinates that a leg reaches."""
    reached = [leg.start_ned, leg.end_ned]
    if leg.kind is PrimitiveKind.SPIRAL:
        quarter = math.pi / 2.0
        low, high = sorted((leg.heading_rad, leg.heading_rad + leg.turn_rad))
        reached += [
            position_at(leg, (k * quarter - leg.heading_rad) / leg.turn_rad)
            for k in range(math.ceil(low / quarter), math.floor(high / quarter) + 1)
        ]
    north, east, down = zip(*reached, strict=True)
    return (min(north), min(east), min(down)), (max(north), max(east), max(down))


def is_inside(leg: Leg, domain: Box) -> bool:
    """Tell whether no point of a leg leaves the domain."""
    return all(domain.contains(*corner, margin_m=1e-9) for corner in bounds(leg))
