"""Derived channels against the library itself, and against values that its manual prints."""

import gsw
import numpy as np
import pytest

from autonomy.channel import CHANNELS
from autonomy.seawater import DERIVED, can_derive, derived

PRESSURE = np.array([10.0, 50.0, 125.0, 250.0, 600.0, 1000.0])
TOLD = {
    "conductivity": np.array([34.5487, 34.7275, 34.8605, 34.6810, 34.5680, 34.5600]),
    "temperature": np.array([28.7856, 28.4329, 22.8103, 10.2600, 6.8863, 4.4036]),
    "pressure": PRESSURE,
}
DEPTH = -gsw.z_from_p(PRESSURE, 4.0)
WHERE = (4.0, 188.0)
"""Latitude and longitude of the examples in the manual."""


def test_practical_salinity_is_what_the_manual_prints() -> None:
    # gsw_SP_from_C, example of TEOS-10's documentation.
    printed = [
        20.009869599086951, 20.265511864874270, 22.981513062527689,
        31.204503263727982, 34.032315787432829, 36.400308494388170,
    ]  # fmt: skip
    assert derived("salinity", TOLD, DEPTH, *WHERE) == pytest.approx(printed, abs=1e-8)


def test_salinity_density_and_sound_speed_are_what_the_manual_prints() -> None:
    practical = np.array([34.5487, 34.7275, 34.8605, 34.6810, 34.5680, 34.5600])
    told = {"salinity": practical, **{k: TOLD[k] for k in ("temperature", "pressure")}}
    # gsw_SA_from_SP and gsw_rho, examples of TEOS-10's documentation.
    absolute = [34.711778344814114, 34.891522618230098, 35.025544862476920,
                34.847229026189588, 34.736628474576051, 34.732363065590846]  # fmt: skip
    density = [1021.839935738108, 1022.262457966867, 1024.427195413316,
               1027.790152759127, 1029.837779000189, 1032.002453224572]  # fmt: skip
    # gsw_sound_speed_t_exact of the same: the polynomial that is used here is near to it.
    speed = [1542.615803587414, 1542.703534065789, 1530.844979136360,
             1494.409996920661, 1487.377102518027, 1483.934609078705]  # fmt: skip
    assert derived("absolute_salinity", told, DEPTH, *WHERE) == pytest.approx(absolute, abs=1e-4)
    assert derived("density", told, DEPTH, *WHERE) == pytest.approx(density, abs=2e-3)
    assert derived("sound_speed", told, DEPTH, *WHERE) == pytest.approx(speed, abs=0.15)


def test_everything_is_what_the_library_says() -> None:
    practical = gsw.SP_from_C(TOLD["conductivity"], TOLD["temperature"], PRESSURE)
    absolute = gsw.SA_from_SP(practical, PRESSURE, 188.0, 4.0)
    conservative = gsw.CT_from_t(absolute, TOLD["temperature"], PRESSURE)
    expected = {
        "salinity": practical,
        "absolute_salinity": absolute,
        "density": gsw.rho(absolute, conservative, PRESSURE),
        "sound_speed": gsw.sound_speed(absolute, conservative, PRESSURE),
    }
    for key, values in expected.items():
        np.testing.assert_array_equal(derived(key, TOLD, DEPTH, *WHERE), values)
    squared = derived("buoyancy_frequency_squared", TOLD, DEPTH, *WHERE)
    assert np.isnan(squared[0])
    np.testing.assert_array_equal(
        squared[1:], gsw.Nsquared(absolute, conservative, PRESSURE, 4.0)[0]
    )


def test_depth_takes_the_place_of_a_pressure_that_nobody_tells() -> None:
    told = {key: TOLD[key] for key in ("conductivity", "temperature")}
    np.testing.assert_allclose(
        derived("density", told, DEPTH, *WHERE), derived("density", TOLD, DEPTH, *WHERE), atol=1e-6
    )


def test_samples_at_one_depth_say_nothing_of_the_layers() -> None:
    held = {**TOLD, "pressure": np.full(6, 10.0)}
    squared = derived("buoyancy_frequency_squared", held, np.full(6, 10.0), *WHERE)
    assert np.isnan(squared).all()


def test_a_lake_far_from_the_sea_has_a_density() -> None:
    told = {"salinity": np.array([0.2]), "temperature": np.array([15.0])}
    density = derived("density", told, np.array([3.0]), 42.73, -84.48)
    assert density == pytest.approx([999.3], abs=0.2)


def test_what_is_told_is_not_derived_and_what_lacks_is_named() -> None:
    assert not can_derive("salinity", {"salinity", "temperature"})
    assert not can_derive("density", {"temperature"})
    assert can_derive("density", {"temperature", "salinity"})
    assert can_derive("salinity", {"temperature", "conductivity"})
    with pytest.raises(ValueError, match="density cannot be computed from temperature"):
        derived("density", {"temperature": np.zeros(1)}, np.zeros(1), 0.0, 0.0)


def test_the_catalogue_says_which_channels_are_derived() -> None:
    always = {key for key, channel in CHANNELS.items() if channel.is_derived}
    assert always | {"salinity"} == set(DERIVED)
