"""Field models that a task makes of stored samples: a belief for the planner, a comparison."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import FieldConfig, GridShape
from autonomy.field.grid import Grid
from autonomy.field.live.live_map import LiveMap
from autonomy.field.samples import FieldSamples
from autonomy.site import Box

PLANNING = (60, 4)
"""10 x 6 x 4 points in the tank's domain."""
SCORING = (84, 5)
"""12 x 7 x 5 points in the tank's domain."""
_SMALLEST = GridShape(x=2, y=2, z=2)


def map_of(config: FieldConfig, domain: Box, samples: FieldSamples) -> LiveMap:
    """Condition a map on samples; it is meant for ``predict``, so its own grid is tiny."""
    field_map = LiveMap(config, Grid.over(domain, _SMALLEST))
    field_map.replace(samples)
    return field_map


def domain_points(domain: Box, resolution: tuple[int, int]) -> FloatArray:
    """Return points that stand for a domain (X* of the thesis), edges included, ``(q, 3)``.

    Args:
        domain: The part of the water that is explored.
        resolution: About how many points in plan, spread over its two axes by their lengths, and
            how many in depth: ``PLANNING`` or ``SCORING``.
    """
    across, depth = resolution
    length_m = domain.x_max_m - domain.x_min_m
    width_m = domain.y_max_m - domain.y_min_m
    along_x = int(np.clip(round(np.sqrt(across * length_m / width_m) - 0.5), 2, across // 2))
    along_y = max(2, round(across / along_x))
    return Grid.over(domain, GridShape(x=along_x, y=along_y, z=depth)).points
