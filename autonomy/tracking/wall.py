"""Keeps a robot off walls and shore: it may do what it wants while it could still turn away.

A robot that cannot stop, and turns on a circle, is safe as long as the hardest turn to one side or
the other keeps it clear of every wall. When after the next moment neither would, it turns now, to
the side that keeps it farther off.
"""

import math

from autonomy.site import Site
from autonomy.tracking.reading import Pair

AHEAD_S = 0.5
"""Time for which the wanted command is looked at."""
ARC_RAD = 5.0 * math.pi / 6.0
"""A turn by so much leads away from any wall."""
ARC_STEPS = 8
GIVEN_AWAY_M = 0.01
"""A robot nearer than the margin may come so much nearer on the turn that leads it back."""
INWARD = 0.25
"""Part of its way by which a robot nearer than the margin gets farther off."""


def turn_away(
    own_ne_m: Pair,
    heading_rad: float,
    speed_m_s: float,
    wanted: Pair,
    site: Site,
    margin_m: float,
    turn_rate_max_rad_s: float,
) -> Pair | None:
    """Return the command that keeps clear of the walls, or None where the wanted one may stand.

    Args:
        own_ne_m: Where the robot is.
        heading_rad: Where it heads.
        speed_m_s: How fast; its size counts.
        wanted: Turn rate rad/s and acceleration m/s2.
        site: Its water, with walls and shore.
        margin_m: Distance from walls and shore that it keeps where it can.
        turn_rate_max_rad_s: Its hardest turn.
    """
    speed = abs(speed_m_s)
    here = site.clearance_m(*own_ne_m)
    reach, radius = speed * AHEAD_S, speed / turn_rate_max_rad_s
    # no arc leads farther than its diameter
    if here >= margin_m + reach + 2.0 * radius:
        return None
    heading = heading_rad + 0.5 * wanted[0] * AHEAD_S
    ahead = (own_ne_m[0] + reach * math.cos(heading), own_ne_m[1] + reach * math.sin(heading))
    later = heading_rad + wanted[0] * AHEAD_S
    enough = min(margin_m, here - GIVEN_AWAY_M)
    if site.clearance_m(*ahead) >= min(margin_m, here + INWARD * reach) and any(
        _arc_clearance(ahead, later, side * radius, site) >= enough for side in (1.0, -1.0)
    ):
        return None
    starboard, port = (
        _arc_clearance(own_ne_m, heading_rad, side * radius, site) for side in (1.0, -1.0)
    )
    rate = turn_rate_max_rad_s if starboard >= port else -turn_rate_max_rad_s
    return (rate, min(wanted[1], 0.0))


def _arc_clearance(start_ne_m: Pair, heading_rad: float, radius_m: float, site: Site) -> float:
    """Return the least distance to a wall along a turn; a negative radius turns to port."""
    side = math.copysign(1.0, radius_m)
    centre_n = start_ne_m[0] - radius_m * math.sin(heading_rad)
    centre_e = start_ne_m[1] + radius_m * math.cos(heading_rad)
    least = math.inf
    for n in range(1, ARC_STEPS + 1):
        heading = heading_rad + side * ARC_RAD * n / ARC_STEPS
        north = centre_n + radius_m * math.sin(heading)
        east = centre_e - radius_m * math.cos(heading)
        least = min(least, site.clearance_m(north, east))
    return least
