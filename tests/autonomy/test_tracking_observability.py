"""How well a target can be known: closed forms against numpy, differences and simulations."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autonomy.tracking.control import control_kernel
from autonomy.tracking.reference.observability import (
    determinant,
    determinant_rates,
    empirical_gramian,
    inverse_condition,
    observability_matrix,
    position_observability_matrix,
    relative_velocity,
)
from reproduction.tracking.unicycle import advance

metres = st.floats(-50.0, 50.0)
speeds = st.floats(-2.0, 2.0)
angles = st.floats(-20.0, 20.0)


def random_states(count, seed=3):
    rng = np.random.default_rng(seed)
    low = np.array([-6.0, -6.0, -math.pi, -0.5, -0.1, -0.1])
    for row in rng.uniform(low, -low, (count, 6)):
        yield tuple(row[:4].tolist()), tuple(row[4:].tolist())


def test_inverse_condition_is_that_of_numpy_to_14_digits():
    compared = 0
    for z, velocity in random_states(5000):
        wanted = 1.0 / np.linalg.cond(position_observability_matrix(z, velocity))
        assert inverse_condition(z, velocity) == pytest.approx(wanted, abs=1e-14)
        assert control_kernel.inverse_condition(*z, *velocity) == pytest.approx(wanted, abs=1e-14)
        compared += 1
    assert compared == 5000


def test_inverse_condition_keeps_its_digits_where_both_singular_values_are_alike():
    for angle in np.linspace(0.0, 2.0 * math.pi, 50):
        z = (math.cos(angle), math.sin(angle), angle + math.pi / 2.0, 1.0 + 1e-9)
        wanted = 1.0 / np.linalg.cond(position_observability_matrix(z, (0.0, 0.0)))
        assert inverse_condition(z, (0.0, 0.0)) == pytest.approx(wanted, abs=1e-14)


@pytest.mark.parametrize(
    ("z", "velocity"),
    [
        ((0.0, 0.0, 0.3, 0.2), (0.0, 0.0)),  # on top of the target
        ((-2.0, 0.0, 0.0, 0.2), (0.0, 0.0)),  # straight at it
        ((1.0, 2.0, 0.0, 0.2), (0.2, 0.0)),  # beside it, as fast
        ((0.0, 0.0, 0.0, 0.0), (0.0, 0.0)),
    ],
)
def test_the_three_ways_to_lose_observability_have_no_determinant(z, velocity):
    assert determinant(z, velocity) == 0.0
    assert inverse_condition(z, velocity) == 0.0
    assert np.linalg.matrix_rank(observability_matrix(z, velocity)) < 4


@given(st.tuples(metres, metres, angles, speeds), st.tuples(speeds, speeds))
def test_inverse_condition_is_between_0_and_1(z, velocity):
    assert 0.0 <= inverse_condition(z, velocity) <= 1.0 + 1e-15


def test_determinant_is_that_of_the_position_part_and_squared_that_of_the_whole_gramian():
    for z, velocity in random_states(500):
        det = determinant(z, velocity)
        assert det == pytest.approx(
            np.linalg.det(position_observability_matrix(z, velocity)), abs=1e-12
        )
        whole = observability_matrix(z, velocity)
        assert det**2 == pytest.approx(np.linalg.det(whole.T @ whole), abs=1e-9)


def test_rows_of_the_whole_matrix_are_the_gradients_of_the_outputs_and_their_derivatives():
    def outputs(z, velocity):
        half_square = 0.5 * (z[0] ** 2 + z[1] ** 2)
        v_xr, v_yr = relative_velocity(z, velocity)
        return np.array([half_square, z[0] * v_xr + z[1] * v_yr, z[2], 0.0, z[3], 0.0])

    for z, velocity in random_states(200):
        gradient = np.empty((6, 4))
        for i in range(4):
            step = np.zeros(4)
            step[i] = 1e-5
            rise = outputs(np.add(z, step), velocity) - outputs(np.subtract(z, step), velocity)
            gradient[:, i] = rise / 2e-5
        assert np.allclose(observability_matrix(z, velocity), gradient, atol=1e-8)


def test_derivative_of_the_determinant_is_that_of_central_differences():
    rng = np.random.default_rng(5)
    worst = 0.0
    for z, velocity in random_states(2000):
        acceleration = rng.uniform(-0.05, 0.05, 2)
        u1, u2 = rng.uniform(-1.0, 1.0, 2) * [0.8, 0.05]

        def moved(t, z=z, velocity=velocity, acceleration=acceleration, u1=u1, u2=u2):
            north, east, psi, v = advance(z, u1, u2, t)
            gone = np.multiply(velocity, t) + acceleration * t * t / 2.0
            place = (north - gone[0], east - gone[1], psi, v)
            return determinant(place, velocity + acceleration * t)

        h = 1e-4
        drift, direction = determinant_rates(z, acceleration)
        rate = drift + direction[0] * u1 + direction[1] * u2
        difference = (moved(h) - moved(-h)) / (2.0 * h)
        worst = max(worst, abs(rate - difference) / max(1.0, abs(rate)))
    assert worst < 1e-8


def test_empirical_gramian_of_a_linear_system_is_the_closed_form():
    a = np.array([[0.9, 0.2], [-0.1, 0.95]])
    c = np.array([[1.0, 0.5]])
    found = empirical_gramian(lambda z: a @ z, lambda z: c @ z, [1.0, -2.0], steps=30, dt_s=0.5)
    wanted, power = np.zeros((2, 2)), np.eye(2)
    for _ in range(30):
        wanted += 0.5 * power.T @ c.T @ c @ power
        power = a @ power
    assert np.allclose(found, wanted, rtol=1e-9)


def gramian(z, turn_rate):
    return empirical_gramian(
        lambda state: np.array(advance(tuple(state), turn_rate, 0.0, 0.1)),
        lambda state: np.array([np.hypot(state[0], state[1]), state[2], state[3]]),
        z,
        steps=100,
        dt_s=0.1,
        perturbation=np.array([1e-4, 1e-4, 1e-5, 1e-5]),
    )


def test_empirical_gramian_knows_an_orbit_from_a_straight_approach():
    straight = np.linalg.eigvalsh(gramian((-3.0, 0.0, 0.0, 0.2), 0.0))
    orbit = np.linalg.eigvalsh(gramian((0.5, 0.0, math.pi / 2.0, 0.39), 0.78))
    assert straight[0] < 1e-9
    assert orbit[0] > 0.5


@pytest.mark.parametrize(
    "wrong", [{"steps": 0}, {"dt_s": 0.0}, {"dt_s": math.nan}, {"perturbation": 0.0}]
)
def test_empirical_gramian_refuses_what_cannot_be_simulated(wrong):
    settings = {"steps": 3, "dt_s": 0.1, **wrong}
    with pytest.raises(ValueError, match="must be positive"):
        empirical_gramian(lambda z: z, lambda z: z, [1.0], **settings)
