"""What is odd about a what-if run: its reference may not fit into the robot's water."""

import numpy as np

from autonomy.site import Site
from autonomy.whatif.result import Track

_ABOVE_SURFACE_M = 0.05
"""Higher than this is above the surface; a reference that ends there may overshoot a little."""


def water_notices(reference: Track, site: Site) -> list[str]:
    """Say where a reference leaves the water, one sentence each.

    A run is computed without walls and floor, and begins wherever the robot is; what is told of
    walls is what fits nowhere between them.

    Args:
        reference: Where the robot is to be.
        site: Where the robot is.
    """
    north_m, east_m, depth_m = (
        np.array(along, dtype=np.float64)
        for along in (reference.north_m, reference.east_m, reference.depth_m)
    )
    water, place = site.water, f"{site.name} ({site.kind})"
    notices: list[str] = []
    deepest, highest = float(np.nanmax(depth_m)), float(np.nanmin(depth_m))
    if deepest > water.depth_max_m:
        notices.append(
            f"The reference goes {deepest:.1f} m deep; {place} is {water.depth_max_m:g} m deep."
        )
    if highest < -_ABOVE_SURFACE_M:
        notices.append(f"The reference rises {-highest:.1f} m above the surface.")
    for title, along, room_m in (
        ("from south to north", north_m, water.x_max_m - water.x_min_m),
        ("from west to east", east_m, water.y_max_m - water.y_min_m),
    ):
        span_m = float(np.nanmax(along) - np.nanmin(along))
        if span_m > room_m:
            notices.append(
                f"The reference takes {span_m:.1f} m {title}; {place} has {room_m:.1f} m."
            )
    return notices
