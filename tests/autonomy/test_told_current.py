"""Told currents: constant, profile and ocean model, and the files of ocean models."""

import netCDF4
import numpy as np
import pytest

from autonomy.current import ocean_file
from autonomy.current.ocean_file import OceanFileError, read_ocean_file
from autonomy.current.told import ToldCurrent, ToldGrid, ToldProfile, find_grid, keep_grid
from autonomy.frames import ned_from_wgs84, wgs84_from_ned
from autonomy.site import LAKE
from tests.autonomy.ocean import EPOCH_S, ORIGIN, ocean, rate

RNG = np.random.default_rng(8)
POINTS = np.column_stack(
    [
        RNG.uniform(LAKE.water.x_min_m, LAKE.water.x_max_m, 50),
        RNG.uniform(LAKE.water.y_min_m, LAKE.water.y_max_m, 50),
        RNG.uniform(0.5, 20.0, 50),
        EPOCH_S + RNG.uniform(0.0, 86_400.0, 50),
    ]
)


def truth(points=POINTS):
    places = wgs84_from_ned(points[:, :2], *ORIGIN)
    return np.stack(rate(*places.T, points[:, 2], (points[:, 3] - EPOCH_S) / 3600.0), axis=1)


@pytest.mark.parametrize(
    "said",
    [
        {},
        {"units": "cm/s", "scale": 100.0},
        {"is_packed": True},
        {"is_packed": True, "units": "cm s-1", "scale": 100.0},
        {"is_up": True},
        {"is_360": True},
        {"is_turned": True},
        {"calendar": "proleptic_gregorian"},
        {"dims": ("longitude", "time", "latitude", "depth")},
        {"names": ("sea_surface_eastward_sea_water_velocity", "northward_sea_water_velocity")},
    ],
)
def test_an_ocean_model_is_read_as_it_was_drawn(tmp_path, said):
    found = read_ocean_file(ocean(tmp_path / "model.nc", **said), ORIGIN, LAKE.water)
    told = ToldCurrent(found.grid, ORIGIN)
    tolerance = 1e-4 if said.get("is_packed") else 2e-5  # north of the frame is not quite true
    np.testing.assert_allclose(told.velocity_ne_m_s(POINTS), truth(), atol=tolerance)
    assert found.source == "Bay model"
    assert found.made_at is not None
    assert found.made_at.isoformat() == "2026-09-21T10:00:00+00:00"
    assert found.unknown_share == 0.0
    # what is far from the water is left in the file
    assert found.grid.velocity.shape[2] < 5
    kept = find_grid(tmp_path, keep_grid(tmp_path, found.grid))
    assert kept is not None
    again = ToldCurrent(kept, ORIGIN)
    np.testing.assert_array_equal(again.velocity_ne_m_s(POINTS), told.velocity_ne_m_s(POINTS))


def test_a_model_over_the_antimeridian_is_read(tmp_path):
    origin = (10.0, 179.999)

    def field(latitude, longitude, depth, hours):
        return latitude - 10.0, 0.0 * longitude

    path = ocean(tmp_path / "model.nc", origin=origin, is_360=True, field=field)
    with netCDF4.Dataset(path, "a") as data:
        data["longitude"][:] = (data["longitude"][:] + 180.0) % 360.0 - 180.0
    found = read_ocean_file(path, origin, LAKE.water)
    said = ToldCurrent(found.grid, origin).velocity_ne_m_s(POINTS)
    places = wgs84_from_ned(POINTS[:, :2], *origin)
    np.testing.assert_allclose(said[:, 0], places[:, 0] - 10.0, atol=1e-6)


def test_north_is_that_of_the_frame():
    axes = (np.array([40.0, 46.0]), np.array([-85.0, -75.0]), np.zeros(1), np.array([0.0, 9.0]))
    velocity = np.zeros((2, 1, 2, 2, 2), np.float32)
    velocity[..., 0] = 1.0
    told = ToldCurrent(ToldGrid(*axes, velocity), (43.0, -80.0))
    place = np.array([1000.0, 50_000.0])
    (latitude, longitude) = wgs84_from_ned(place, 43.0, -80.0).tolist()
    way = ned_from_wgs84(latitude + 1e-3, longitude, 43.0, -80.0) - place
    (said,) = told.velocity_ne_m_s(np.array([[*place, 0.0, 1.0]]))
    np.testing.assert_allclose(said, way / np.hypot(*way), atol=1e-5)


def test_it_says_nothing_beyond_its_place_depth_and_time(tmp_path):
    found = read_ocean_file(ocean(tmp_path / "model.nc"), ORIGIN, LAKE.water)
    told = ToldCurrent(found.grid, ORIGIN)
    noon = EPOCH_S + 43_200.0
    beyond = np.array(
        [
            [0.0, 0.0, 5.0, EPOCH_S - 1.0],
            [0.0, 0.0, 5.0, EPOCH_S + 86_401.0],
            [0.0, 0.0, 41.0, noon],
            [9000.0, 0.0, 5.0, noon],
            [0.0, -9000.0, 5.0, noon],
        ]
    )
    assert np.isnan(told.velocity_ne_m_s(beyond)).all()
    # the water above the shallowest level flows as it does there
    surface = told.velocity_ne_m_s(np.array([[0.0, 0.0, 0.0, noon], [0.0, 0.0, 0.5, noon]]))
    np.testing.assert_array_equal(surface[0], surface[1])


def test_land_is_bridged_from_the_water_beside_it_and_not_farther(tmp_path):
    path = ocean(
        tmp_path / "model.nc", land=lambda latitude, longitude: latitude > ORIGIN[0] + 0.001
    )
    told = ToldCurrent(read_ocean_file(path, ORIGIN, LAKE.water).grid, ORIGIN)
    near, far = [100.0, 0.0, 5.0, EPOCH_S + 60.0], [900.0, 0.0, 5.0, EPOCH_S + 60.0]
    said = told.velocity_ne_m_s(np.array([near, far]))
    assert np.isfinite(said[0]).all()
    assert np.isnan(said[1]).all()


def changed(path, change):
    with netCDF4.Dataset(path, "a") as data:
        change(data)


@pytest.mark.parametrize(
    ("said", "change", "named"),
    [
        ({"names": ("", "northward_sea_water_velocity")}, None, "no eastward_sea_water_velocity"),
        ({"names": ("air_u", "air_v")}, None, "no eastward_sea_water_velocity"),
        ({"units": "knots"}, None, "uo: is in 'knots'"),
        ({"units": "m s"}, None, "uo: is in 'm s'"),
        ({"units": ""}, None, "uo: has no units"),
        ({"calendar": "360_day"}, None, "time: counts in the calendar '360_day'"),
        ({"calendar": "noleap"}, None, "time: counts in the calendar 'noleap'"),
        ({"dims": ("depth", "latitude", "longitude")}, None, "uo: has no time"),
        ({"origin": (10.0, 20.0)}, None, "latitude: the file has 9.98 to 10.02"),
        ({"land": lambda latitude, longitude: latitude < 91.0}, None, "uo: knows no current"),
        ({"field": lambda *at: (at[0] * 0 + 99.0, at[0] * 0)}, None, "vo: has 99 m/s"),
        ({}, lambda d: d["depth"].setncattr("units", "1"), "depth: is in '1'"),
        ({}, lambda d: d["time"].setncattr("units", "hours since ever"), "time: has no times"),
        ({}, lambda d: d["time"].__setitem__(slice(None), 1.0), "time: needs two times"),
        ({}, lambda d: d["latitude"].__setitem__(0, np.nan), "latitude: has values that are no"),
    ],
)
def test_what_cannot_be_a_current_is_refused_by_its_name(tmp_path, said, change, named):
    path = ocean(tmp_path / "model.nc", **said)
    if change is not None:
        changed(path, change)
    with pytest.raises(OceanFileError, match=named.replace("(", r"\(")):
        read_ocean_file(path, ORIGIN, LAKE.water)


def test_empty_broken_and_huge_files_are_refused(tmp_path, monkeypatch):
    empty, broken = tmp_path / "empty.nc", tmp_path / "broken.nc"
    empty.touch()
    broken.write_bytes(ocean(tmp_path / "whole.nc").read_bytes()[:900])
    for path, reason in ((empty, "is empty"), (broken, "no NetCDF file")):
        with pytest.raises(OceanFileError, match=reason):
            read_ocean_file(path, ORIGIN, LAKE.water)
    monkeypatch.setattr(ocean_file, "VALUES_MAX", 50)
    with pytest.raises(OceanFileError, match=r"uo: has .* values about the water, more than 50"):
        read_ocean_file(tmp_path / "whole.nc", ORIGIN, LAKE.water)


def test_a_profile_tells_of_its_depths_and_times_everywhere():
    profile = ToldProfile(
        np.array([1.0, 11.0]), np.array([[0.2, 0.0], [0.0, -0.1]]), EPOCH_S, EPOCH_S + 3600.0
    )
    told = ToldCurrent(profile, ORIGIN)
    points = np.array([[1e5, 0.0, z, EPOCH_S + 60.0] for z in (0.0, 1.0, 6.0, 11.0, 11.5)])
    said = told.velocity_ne_m_s(points)
    np.testing.assert_allclose(said[:4], [[0.2, 0.0], [0.2, 0.0], [0.1, -0.05], [0.0, -0.1]])
    assert np.isnan(said[4]).all()
    points[:, 3] = EPOCH_S + 3601.0
    assert np.isnan(told.velocity_ne_m_s(points)).all()
    constant = ToldProfile(np.zeros(1), np.array([[0.3, 0.1]]), -np.inf, np.inf)
    said = ToldCurrent(constant, ORIGIN).velocity_ne_m_s(points)
    np.testing.assert_allclose(said, np.tile((0.3, 0.1), (5, 1)))
