"""The filter of a target by its range: compiled against readable, and its laws."""

import math

import numpy as np
import pytest

from autonomy.tracking.config import THESIS_TRACKING
from autonomy.tracking.filter import filter_kernel
from autonomy.tracking.reference.filter import predict, start_estimate, update
from autonomy.tracking.reference.velocity_filter import start_motion, step_motion

Q = filter_kernel.pack_filter(THESIS_TRACKING)


def test_compiled_filter_is_the_readable_one_over_a_whole_run():
    rng = np.random.default_rng(3)
    readable = start_estimate((-1.3, 2.1), 3.0, 0.2, 0.165, THESIS_TRACKING)
    x, P = readable.x.copy(), filter_kernel.packed_covariance(readable.P)
    motion, k = None, np.zeros(filter_kernel.VELOCITY_SIZE)
    reckoned = np.zeros(2)
    for n in range(300):
        psi, v, r = rng.uniform(-4, 4), rng.normal(0.2, 0.3), abs(rng.normal(2, 0.5))
        heard = n % 3 != 1
        readable, likelihood = update(readable, psi, v, r if heard else None, THESIS_TRACKING)
        assert filter_kernel.update(x, P, psi, v, r, heard, Q) == pytest.approx(
            likelihood, rel=1e-12, abs=1e-12
        )
        place = tuple((reckoned - readable.x[:2]).tolist())
        motion = (
            step_motion(motion, place, 0.1, THESIS_TRACKING.filter)
            if motion
            else start_motion(place, THESIS_TRACKING.filter)
        )
        filter_kernel.velocity_step(k, *place, 0.1, Q)
        u1, u2 = rng.uniform(-0.8, 0.8), rng.uniform(-0.01, 0.01)
        vt = tuple(motion.mean[1].tolist())
        before = readable.x[:2]
        readable = predict(readable, (u1, u2), 0.1, vt, THESIS_TRACKING)
        own = filter_kernel.predict(x, P, u1, u2, 0.1, *vt, Q)
        assert np.allclose(own, readable.x[:2] - before + 0.1 * motion.mean[1], atol=1e-12, rtol=0)
        reckoned += own
        assert np.allclose(x, readable.x, atol=1e-12, rtol=1e-12)
        assert np.allclose(filter_kernel.full_covariance(P), readable.P, atol=1e-12, rtol=1e-12)
        assert np.allclose(k[:4], motion.mean.ravel(), atol=1e-12, rtol=1e-12)
        assert np.allclose(k[4:7], motion.P.ravel()[[0, 1, 3]], atol=1e-12, rtol=1e-12)


def test_covariance_stays_positive_definite_through_a_long_run():
    rng = np.random.default_rng(11)
    x = np.array([-3.0, 1.0, 0.4, 0.2])
    P = filter_kernel.start_covariance(0.5, Q)
    for _ in range(20_000):
        filter_kernel.update(x, P, rng.normal(x[2], 0.13), rng.normal(0.2, 0.3), 2.0, True, Q)
        filter_kernel.predict(x, P, rng.uniform(-0.8, 0.8), 0.0, 0.1, 0.0, 0.0, Q)
    assert np.linalg.eigvalsh(filter_kernel.full_covariance(P))[0] > 0.0


def test_a_target_on_top_of_the_robot_has_no_bearing_and_changes_nothing():
    x, P = np.array([0.0, 0.0, 0.3, 0.1]), filter_kernel.start_covariance(0.2, Q)
    filter_kernel.update(x, P, 0.3, 0.1, 0.0, False, Q)
    beside = P.copy()
    filter_kernel.update(x, P, 0.3, 0.1, 5.0, True, Q)
    assert x[:2].tolist() == [0.0, 0.0]
    assert P[[0, 1, 4]].tolist() == beside[[0, 1, 4]].tolist()


def test_heading_is_taken_in_across_south_the_short_way():
    x, P = np.array([1.0, 0.0, math.pi - 0.1, 0.1]), filter_kernel.start_covariance(0.2, Q)
    filter_kernel.update(x, P, -math.pi + 0.1, 0.1, 1.0, False, Q)
    assert x[2] == pytest.approx(math.pi, abs=1e-12)


def test_a_range_narrows_along_the_line_of_sight_only():
    x, P = np.array([3.0, 0.0, 0.0, 0.1]), filter_kernel.start_covariance(0.2, Q)
    filter_kernel.update(x, P, 0.0, 0.1, 3.0, True, Q)
    assert P[0] == pytest.approx(0.2 * 0.1 / 0.3)
    assert P[4] == 0.2


def test_no_variance_falls_below_zero_where_a_range_has_more_digits_than_the_guess():
    exact = Q.copy()
    exact[filter_kernel.R_RANGE] = 1e-8
    rng = np.random.default_rng(1)
    for _ in range(200):
        bearing = rng.uniform(-math.pi, math.pi)
        x = np.array([3.0 * math.cos(bearing), 3.0 * math.sin(bearing), 0.3, 0.2])
        P = filter_kernel.start_covariance(1e8, exact)
        for _ in range(4):
            filter_kernel.update(x, P, 0.3, 0.2, math.hypot(*x[:2]), True, exact)
            assert filter_kernel.expected_range(x, P, exact)[1] >= 1e-8
            assert P[[0, 4, 7, 9]].min() >= 0.0
        assert np.isfinite([*x, *P]).all()


def test_velocity_of_a_steady_target_is_found():
    rng = np.random.default_rng(5)
    k = np.zeros(filter_kernel.VELOCITY_SIZE)
    for n in range(4000):
        north, east = np.array([0.02, -0.01]) * 0.1 * n + rng.normal(0.0, 0.1, 2)
        filter_kernel.velocity_step(k, north, east, 0.1, Q)
    assert k[2:4] == pytest.approx([0.02, -0.01], abs=2e-3)
