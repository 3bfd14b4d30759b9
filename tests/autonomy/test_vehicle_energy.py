"""Electrical energy of a robot: its prices, and what a run of the model adds up."""

import dataclasses
import math

import numpy as np
import pytest
from pydantic import ValidationError

from autonomy.vehicle.config import MINIGLIDER, VEHICLES
from autonomy.vehicle.energy import EnergyPrices
from autonomy.vehicle.extended_kernel import advance, electrical_power
from autonomy.vehicle.reference import dynamics
from autonomy.vehicle.surroundings import Surroundings

DEEP = Surroundings(floor_m=100.0).packed()


def run(vehicle, state, command, seconds, start_s=0.0, dt=0.02):
    steps = round(seconds / dt)
    return advance(state, np.array(command), vehicle.packed(), DEEP, start_s, dt, steps)


def metered(**values):
    state = np.zeros(16)
    state[2] = 20.0
    for name, value in values.items():
        state[["m0", "rp1", "delta", "energy"].index(name) + 12] = value
    return state


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_a_robot_that_holds_still_pays_for_its_electronics(vehicle):
    later = run(vehicle, metered(energy=7.0), [0.0] * 5, 100.0)
    assert later[15] == pytest.approx(7.0 + 100.0 * vehicle.energy.electronics_w, rel=1e-12)


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_an_actuator_at_its_greatest_rate_takes_its_full_power(vehicle):
    limits, prices = vehicle.limits, vehicle.energy
    rates = (limits.m0_rate_kg_s, limits.rp1_rate_m_s, limits.delta_rate_rad_s)
    full = (prices.pump_full_w, prices.mass_full_w, prices.tail_full_w)
    for i in range(3):
        one = [rate * (k == i) for k, rate in enumerate(rates)]
        expected = prices.electronics_w + full[i]
        assert prices.power_w(limits, *one) == pytest.approx(expected, rel=1e-12)


def test_moving_pump_and_mass_costs_while_they_move():
    prices, limits = MINIGLIDER.energy, MINIGLIDER.limits
    m0, rp1 = 4.0 * limits.m0_rate_kg_s, 2.0 * limits.rp1_rate_m_s
    later = run(MINIGLIDER, metered(), [m0, rp1, 0.0, 0.0, 0.0], 10.0)
    expected = 10.0 * prices.electronics_w + 4.0 * prices.pump_full_w + 2.0 * prices.mass_full_w
    assert later[15] == pytest.approx(expected, rel=1e-9)


def test_swimming_costs_what_the_closed_form_of_the_flap_says():
    swim, prices, limits = MINIGLIDER.swim, MINIGLIDER.energy, MINIGLIDER.limits
    command = [0.0, 0.0, 0.0, swim.amplitude_rad, swim.frequency_hz]
    settled = run(MINIGLIDER, metered(), command, 10.0)
    beats = 20
    seconds = beats / swim.frequency_hz
    used = run(MINIGLIDER, settled, command, seconds, 10.0)[15] - settled[15]
    w = 2.0 * math.pi * swim.frequency_hz
    k = MINIGLIDER.parameters.tail_response_per_s
    amplitude = swim.amplitude_rad * k / math.hypot(k, w)
    # the integral of the squared rate over whole beats (thesis section 5.4.2)
    squared = math.pi * swim.frequency_hz * amplitude**2 * w * seconds
    price = prices.tail_full_w / limits.delta_rate_rad_s**2
    assert used == pytest.approx(seconds * prices.electronics_w + price * squared, rel=1e-5)


def test_energy_is_the_integral_of_the_power_along_the_way():
    rng = np.random.default_rng(21)
    state, expected, dt = metered(), 0.0, 0.002
    for i in range(200):
        command = rng.uniform(-1, 1, 5) * [0.02, 0.04, 1.5, 0.5, 1.0]
        before = state
        state = run(MINIGLIDER, before, command, dt, i * dt, dt)
        rates = (state[12:15] - before[12:15]) / dt
        expected += dt * MINIGLIDER.energy.power_w(MINIGLIDER.limits, *rates)
    assert state[15] == pytest.approx(expected, rel=1e-4)


def test_counting_energy_does_not_change_the_motion():
    command = [0.01, 0.02, 0.3, 0.3, 0.5]
    counted = run(MINIGLIDER, metered(), command, 20.0)
    plain = run(MINIGLIDER, metered()[:15], command, 20.0)
    assert plain.shape == (15,)
    assert np.array_equal(counted[:15], plain)


def test_compiled_power_is_the_readable_one():
    rng = np.random.default_rng(22)
    for vehicle in VEHICLES.values():
        packed = vehicle.packed()
        for m0, rp1, tail in rng.uniform(-1, 1, (1000, 3)) * [0.01, 0.05, 1.05]:
            readable = dynamics.electrical_power(np.array([m0, rp1, tail]), vehicle)
            compiled = electrical_power(m0**2, rp1**2, tail**2, packed)
            assert compiled == pytest.approx(readable, rel=1e-13)


def test_energy_of_a_vehicle_without_prices_is_refused():
    p = np.concatenate([MINIGLIDER.parameters.packed(), MINIGLIDER.limits.packed()])
    with pytest.raises(ValueError, match="packed with its prices"):
        advance(metered(), np.zeros(5), p, DEEP, 0.0, 0.02, 1)
    assert advance(metered()[:15], np.zeros(5), p, DEEP, 0.0, 0.02, 1).shape == (15,)


def test_prices_can_be_replaced_by_measured_ones():
    free = EnergyPrices(electronics_w=0.0, pump_full_w=0.0, mass_full_w=0.0, tail_full_w=0.0)
    vehicle = dataclasses.replace(MINIGLIDER, energy=free)
    assert run(vehicle, metered(), [0.02, 0.04, 1.0, 0.3, 0.5], 30.0)[15] == 0.0
    with pytest.raises(ValidationError):
        EnergyPrices(electronics_w=-1.0)
