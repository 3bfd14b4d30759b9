"""Which points of a map lie in the water."""

from autonomy.arrays import BoolArray, FloatArray
from autonomy.site import Site


def water_mask(site: Site, points: FloatArray) -> BoolArray:
    """Tell which points are inside the water's box and shoreline and above the floor.

    Args:
        site: The water body.
        points: NED, shape ``(q, 3)``, m.

    Returns:
        Shape ``(q,)``; true on the floor itself.
    """
    north, east, depth = points.T
    floor_m, box = site.floor_m(north, east), site.water
    inside = (depth >= 0.0) & (depth <= floor_m) & (floor_m > 0.0)
    inside &= (north >= box.x_min_m) & (north <= box.x_max_m)
    inside &= (east >= box.y_min_m) & (east <= box.y_max_m)
    shore = site.shore
    if shore is not None:
        inside &= shore.contains(north, east)
    return inside
