"""Keeps a robot off walls and shore: it may do what it wants while it could still turn away.

A robot that cannot stop, and turns on a circle, is safe as long as the hardest turn to one side or
the other keeps it clear of every wall. When after the next moment neither would, it turns now, to
the side that keeps it farther off.
"""

import math

from autonomy.site import Box
from autonomy.tracking.reading import Pair

AHEAD_S = 0.5
"""Time for which the wanted command is looked at."""
ARC_RAD = 5.0 * math.pi / 6.0
"""A turn by so much leads away from any wall."""
ARC_STEPS = 8
GIVEN_AWAY_M = 0.01
"""A robot nearer than the margin may come so much nearer along its way back."""


def turn_away(
    own_ne_m: Pair,
    heading_rad: float,
    speed_m_s: float,
    wanted: Pair,
    box: Box,
    margin_m: float,
    turn_rate_max_rad_s: float,
) -> Pair | None:
    """Return the command that keeps clear of the walls, or None where the wanted one may stand.

    Args:
        own_ne_m: Where the robot is.
        heading_rad: Where it heads.
        speed_m_s: How fast; its size counts.
        wanted: Turn rate rad/s and acceleration m/s2.
        box: Where it may swim.
        margin_m: Distance from the walls that it keeps where it can.
        turn_rate_max_rad_s: Its hardest turn.
    """
    speed = abs(speed_m_s)
    here = _clearance(own_ne_m, box)
    enough = min(margin_m, here - GIVEN_AWAY_M)
    heading = heading_rad + 0.5 * wanted[0] * AHEAD_S
    reach = speed * AHEAD_S
    ahead = (own_ne_m[0] + reach * math.cos(heading), own_ne_m[1] + reach * math.sin(heading))
    later = heading_rad + wanted[0] * AHEAD_S
    radius = speed / turn_rate_max_rad_s
    if _clearance(ahead, box) >= enough and any(
        _arc_clearance(ahead, later, side * radius, box) >= enough for side in (1.0, -1.0)
    ):
        return None
    starboard, port = (
        _arc_clearance(own_ne_m, heading_rad, side * radius, box) for side in (1.0, -1.0)
    )
    rate = turn_rate_max_rad_s if starboard >= port else -turn_rate_max_rad_s
    return (rate, min(wanted[1], 0.0))


def _clearance(ne_m: Pair, box: Box) -> float:
    """Return the distance to the nearest wall; negative outside."""
    north, east = ne_m
    return min(north - box.x_min_m, box.x_max_m - north, east - box.y_min_m, box.y_max_m - east)


def _arc_clearance(start_ne_m: Pair, heading_rad: float, radius_m: float, box: Box) -> float:
    """Return the least distance to a wall along a turn; a negative radius turns to port."""
    side = math.copysign(1.0, radius_m)
    centre_n = start_ne_m[0] - radius_m * math.sin(heading_rad)
    centre_e = start_ne_m[1] + radius_m * math.cos(heading_rad)
    least = math.inf
    for n in range(1, ARC_STEPS + 1):
        heading = heading_rad + side * ARC_RAD * n / ARC_STEPS
        place = (
            centre_n + radius_m * math.sin(heading),
            centre_e - radius_m * math.cos(heading),
        )
        least = min(least, _clearance(place, box))
    return least
