"""Reference trajectories as turns: where and when a robot changes from going down to going up.

The thesis's two (Eq. 3.21, Eq. 3.22) swing in depth once in 75 s; a robot flies them as glides from
turn to turn at the vertical speed that the reference has in the mean. Its controller on board
shapes the way between.
"""

from autonomy.control.trajectory import diagonal, figure_eight
from autonomy.design.document import Reference

HALF_SWING_S = 37.5
"""Half the period of the depth in both trajectories of the thesis."""

Turn = tuple[float, float, float, float]
"""Time s, north, east m, depth m."""


def turns_of(content: Reference) -> list[Turn]:
    """Return the turns of a reference in the water's frame; it begins and ends at the surface."""
    north_m, east_m = content.origin.ne_m
    if content.shape == "rows":
        turns = [
            (row.time_s, north_m + row.north_m, east_m + row.east_m, row.depth_m)
            for row in content.rows
        ]
    else:
        shape = diagonal if content.shape == "diagonal" else figure_eight
        count = max(2, round(content.duration_s / HALF_SWING_S))
        turns = []
        for number in range(count + 1):
            time_s = number * HALF_SWING_S
            north, east, depth = shape(time_s).position_ned
            turns.append((time_s, north_m + north, east_m + east, depth))
        if count % 2:  # the last turn is a deep one: one more leads up
            turns.append((turns[-1][0] + HALF_SWING_S, *turns[-1][1:3], 0.0))
    first, last = turns[0], turns[-1]
    return [(*first[:3], 0.0), *turns[1:-1], (*last[:3], 0.0)]
