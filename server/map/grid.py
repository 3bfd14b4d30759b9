"""The grid on which a map is kept and shown."""

from functools import partial

from autonomy.field.config import FieldConfig
from autonomy.field.grid import Grid
from autonomy.field.mask import water_mask
from autonomy.site import Box, Site


def grid_of(config: FieldConfig, domain: Box, site: Site) -> Grid:
    """Return the grid of a map with its mask of the water."""
    if site.shore is None and site.depth_lines is None:
        return Grid.over(domain, config.grid)
    return Grid.over(domain, config.grid, partial(water_mask, site))
