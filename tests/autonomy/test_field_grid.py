import numpy as np
import pytest

from autonomy.field.config import GridShape
from autonomy.field.grid import Grid
from autonomy.field.mask import water_mask
from autonomy.site import TANK, Area, Bathymetry, Box, Site

BOX = Box(x_min_m=0.0, x_max_m=10.0, y_min_m=0.0, y_max_m=10.0, depth_max_m=4.0)
SHAPE = GridShape(x=11, y=11, z=5)


def pond(shoreline: Area | None = None, bathymetry: Bathymetry | None = None) -> Site:
    changes = {"water": BOX, "domain": BOX, "shoreline": shoreline, "bathymetry": bathymetry}
    return TANK.model_copy(update=changes)


def test_without_a_mask_there_is_water_everywhere() -> None:
    assert Grid.over(BOX, SHAPE).mask.all()
    assert water_mask(TANK, Grid.over(TANK.domain, SHAPE).points).all()


def test_there_is_water_inside_the_shoreline_only() -> None:
    triangle = Area(name="Shore", corners_m=((0.0, 0.0), (10.0, 0.0), (0.0, 10.0)))
    grid = Grid.over(BOX, SHAPE, lambda points: water_mask(pond(triangle), points))
    wet = grid.mask.reshape(grid.shape)
    assert wet[2, 2].all()
    assert not wet[8, 8].any()


def test_there_is_water_above_the_floor_only_and_none_where_the_floor_is_dry() -> None:
    slope = Bathymetry(north_m=(0.0, 10.0), east_m=(0.0, 10.0), depth_m=((-1.0, -1.0), (4.0, 4.0)))
    grid = Grid.over(BOX, SHAPE, lambda points: water_mask(pond(bathymetry=slope), points))
    wet = grid.mask.reshape(grid.shape)
    assert not wet[:3].any()  # the floor rises through the surface at 2 m north
    assert wet[6, 5].tolist() == [True, True, True, False, False]  # floor at 2 m
    assert wet[10].all()


def test_beyond_the_box_of_water_there_is_none() -> None:
    points = np.array([[5.0, 5.0, 1.0], [-0.1, 5.0, 1.0], [5.0, 10.1, 1.0], [5.0, 5.0, 4.1]])
    assert water_mask(pond(), points).tolist() == [True, False, False, False]


def test_a_mask_may_be_flags_and_must_be_one_for_each_point() -> None:
    flags = np.zeros((11, 11, 5), dtype=bool)
    flags[3] = True
    assert np.array_equal(Grid.over(BOX, SHAPE, flags).mask, flags.reshape(-1))
    with pytest.raises(ValueError, match="4 flags for 605 grid points"):
        Grid.over(BOX, SHAPE, np.ones(4, dtype=bool))
