"""Layers, fronts and patches that the simulated instruments meet."""

import math

import gsw
import numpy as np
import pytest

from autonomy.channel import CHANNELS
from autonomy.field.synthetic import truth
from autonomy.site import LAKE, TANK
from simulator.water_field import WaterField, oxygen_solubility

SEA = LAKE.model_copy(
    update={
        "kind": "sea",
        "water": LAKE.water.model_copy(update={"depth_max_m": 80.0}),
        "shoreline": None,
        "bathymetry": None,
    }
)
WATERS = {"tank": TANK, "lake": LAKE, "sea": SEA}
MEASURED = [
    key
    for key, channel in CHANNELS.items()
    if channel.kind == "field" and channel.wire_number and channel.key != "blue_light"
]


def points_of(site, count=400):
    box, rng = site.water, np.random.default_rng(1)
    low = (box.x_min_m, box.y_min_m, 0.0)
    high = (box.x_max_m, box.y_max_m, box.depth_max_m)
    return rng.uniform(low, high, (count, 3))


def down(site, depths, north=None):
    box = site.water
    middle = 0.5 * (box.x_min_m + box.x_max_m) if north is None else north
    east = 0.5 * (box.y_min_m + box.y_max_m)
    return np.array([(middle, east, depth) for depth in depths])


@pytest.mark.parametrize("kind", WATERS)
def test_every_channel_is_what_can_be_everywhere_and_has_a_field_of_its_own(kind):
    site = WATERS[kind]
    points, field = points_of(site), WaterField(site)
    for key in MEASURED:
        values = field.truth(key, points)
        assert values.shape == (len(points),)
        assert all(CHANNELS[key].fault(value) is None for value in values), key
        assert not np.allclose(values, field.truth("own", points)), f"{key} has no field"


def test_planned_fields_are_those_that_maps_are_scored_with():
    for site, key in ((TANK, "blue_light"), (LAKE, "chlorophyll")):
        points = points_of(site)
        assert np.array_equal(WaterField(site).truth(key, points), truth(key, points))


@pytest.mark.parametrize("site", [LAKE, SEA], ids=["lake", "sea"])
def test_water_is_cold_salty_dark_and_short_of_oxygen_below_the_thermocline(site):
    top, bottom = down(site, (0.5, 0.97 * site.water.depth_max_m))
    field = WaterField(site)
    for key, falls in (
        ("temperature", True),
        ("oxygen_saturation", True),
        ("par", True),
        ("blue_green_algae", True),
        ("salinity", False),
        ("nitrate", False),
        ("pressure", False),
    ):
        above, below = field.truth(key, np.array([top, bottom]))
        assert bool(above > below) is falls, key
    depths = np.linspace(0.0, site.water.depth_max_m, 200)
    profile = field.truth("temperature", down(site, depths))
    steepest = depths[int(np.argmin(np.gradient(profile, depths)))]
    assert steepest == pytest.approx(field.layer_m, rel=0.3)


def test_a_front_parts_warm_and_salty_water_from_the_other():
    surface = [(north, 250.0, 0.5) for north in np.linspace(20.0, 480.0, 300)]
    for key, change in (("temperature", 1.0), ("salinity", 0.8)):
        along = WaterField(SEA).truth(key, np.array(surface))
        assert along[-1] - along[0] > change
        in_50_m = along[33:] - along[:-33]
        assert in_50_m.max() > 0.6 * (along[-1] - along[0]), "most of it within a tenth of the way"


def test_conductivity_pressure_and_salinity_tell_of_one_water():
    points, field = points_of(SEA), WaterField(SEA)
    told = {key: field.truth(key, points) for key in ("conductivity", "temperature", "pressure")}
    salinity = gsw.SP_from_C(told["conductivity"], told["temperature"], told["pressure"])
    assert salinity == pytest.approx(field.truth("salinity", points), abs=1e-6)


@pytest.mark.parametrize(
    ("temperature", "salinity"), [(5.0, 0.0), (22.0, 0.3), (10.0, 35.0), (25.0, 35.0)]
)
def test_oxygen_in_balance_with_air_is_that_of_the_seawater_library(temperature, salinity):
    per_kg = float(gsw.O2sol_SP_pt(salinity, temperature)) * 31.9988e-3
    absolute = gsw.SA_from_SP(salinity, 0.0, LAKE.origin_longitude_deg, LAKE.origin_latitude_deg)
    density = float(gsw.rho_t_exact(absolute, temperature, 0.0))
    found = float(oxygen_solubility(np.array([temperature]), np.array([salinity]))[0])
    assert found == pytest.approx(1e-3 * per_kg * density, rel=0.006)


def test_a_channel_of_a_teams_own_is_patches():
    values = WaterField(LAKE).truth("zooplankton", points_of(LAKE))
    assert values.std() > 0.1
    assert math.isfinite(values.sum())
