import subprocess
import sys

import numpy as np
import pytest
from pydantic import ValidationError

from autonomy.site import LAKE, TANK
from autonomy.vehicle import extended_kernel, extended_rates, kernel, steep_kernel, water_kernel
from autonomy.vehicle.config import (
    GRACE3,
    MINIGLIDER,
    VEHICLES,
    ActuatorLimits,
    SwimGait,
    VehicleParameters,
)
from autonomy.vehicle.energy import EnergyPrices
from autonomy.vehicle.hull import Hull
from autonomy.vehicle.surroundings import Surroundings


def test_kernel_indices_name_the_fields_in_their_order():
    names = [*VehicleParameters.model_fields, *ActuatorLimits.model_fields]
    units = ("_kg_m2", "_kg_m3", "_kg_s", "_kg", "_n_m_s2", "_n_s_m", "_n_m", "_per_s")
    units += ("_rad_s", "_m_s2", "_m_s", "_m2", "_rad", "_m")
    for index, name in enumerate(names):
        unit = next((unit for unit in units if name.endswith(unit)), "")
        constant = name.removesuffix(unit).upper()
        assert getattr(kernel, constant) == index, name
    assert len(names) == kernel.HULL_MASS


def test_packed_numbers_are_those_of_table_3_2():
    packed = MINIGLIDER.packed()
    assert packed[kernel.MASS_1] == 15.011
    assert packed[kernel.YAW_DELTA] == -0.210
    assert packed[kernel.M0_MIN] == -0.0279
    assert packed[kernel.DELTA_RATE] == 1.05


def test_packed_vehicle_ends_with_hull_and_energy():
    packed = GRACE3.packed()
    assert packed.shape == (kernel.ENERGY_DELTA + 1,)
    assert packed[kernel.HULL_MASS] == 33.0
    assert packed[kernel.HULL_COMPRESSIBILITY] == 0.0
    assert packed[kernel.ENERGY_0] == GRACE3.energy.electronics_w
    full_rate = GRACE3.limits.m0_rate_kg_s
    assert packed[kernel.ENERGY_M0] * full_rate**2 == pytest.approx(60.0)


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_hulls_and_their_tails_are_no_longer_than_the_robot(vehicle):
    hull = vehicle.hull
    assert hull.width_m < hull.wingspan_m
    assert hull.length_m < hull.tail_to_nose_m


def test_grace_3_says_that_it_is_scaled_and_keeps_proportions():
    assert GRACE3.note == "scaled, not identified"
    small, large = MINIGLIDER, GRACE3
    capacity_l = (large.limits.m0_max_kg - large.limits.m0_min_kg) / 0.998
    assert capacity_l == pytest.approx(0.42, rel=0.02)
    for vehicle in (small, large):
        p = vehicle.parameters
        reach = p.sliding_mass_kg * vehicle.limits.rp1_max_m
        assert reach / (p.offset_mass_kg * p.offset_mass_depth_m) == pytest.approx(1.4176, rel=1e-4)


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_swim_gait_is_within_the_servo(vehicle):
    rate = 2 * np.pi * vehicle.swim.frequency_hz * vehicle.swim.amplitude_rad
    assert rate < vehicle.limits.delta_rate_rad_s
    assert vehicle.limits.rp1_min_m < vehicle.swim.rp1_m < vehicle.limits.rp1_max_m


def test_clip_keeps_commands_at_the_end_stops():
    limits = MINIGLIDER.limits
    assert limits.clip(1.0, -1.0, -9.0) == (0.0225, -0.0555, -1.92)
    assert limits.clip(0.01, 0.02, 0.3) == (0.01, 0.02, 0.3)


@pytest.mark.parametrize(
    "wrong",
    [{"m0_min_kg": 0.0}, {"rp1_max_m": -0.01}, {"delta_rate_rad_s": 0.0}, {"unknown": 1.0}],
)
def test_impossible_limits_are_refused(wrong):
    with pytest.raises(ValidationError):
        ActuatorLimits(**wrong)


def test_every_parameter_tells_its_title_and_what_it_means():
    for model in (VehicleParameters, ActuatorLimits, SwimGait, Hull, EnergyPrices):
        for name, field in model.model_json_schema()["properties"].items():
            assert field["title"], name
            assert field["description"], name
            assert "unit" in field, name


def test_only_a_tank_has_walls():
    assert Surroundings.of_site(TANK).has_walls
    assert not Surroundings.of_site(LAKE).has_walls
    packed = Surroundings.of_site(TANK, (0.1, 0.2, 0.0)).packed()
    assert packed.tolist() == [0.1, 0.2, 0.0, -0.925, 3.675, -0.865, 2.235, 1.2, 1.0]


def test_configurations_do_not_load_the_compiler():
    program = (
        "import sys; import autonomy.vehicle.config, autonomy.vehicle.surroundings,"
        " autonomy.control.config; sys.exit('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", program], timeout=240).returncode == 0


@pytest.mark.parametrize(
    ("module", "entries"),
    [
        (kernel, ["state_derivative", "rk4_step"]),
        (extended_rates, ["extended_state_derivative"]),
        (extended_kernel, ["advance", "electrical_power"]),
        (water_kernel, ["water_flow", "net_mass_and_density", "surface"]),
        (steep_kernel, ["attitude_quaternion", "turn_attitude"]),
    ],
)
def test_warming_up_compiles_what_python_calls(module, entries):
    module.warm_up()
    for name in entries:
        assert len(getattr(module, name).signatures) == 1, name
