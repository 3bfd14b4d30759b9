import numpy as np
import pytest

from autonomy.estimation.smoother import Dive, finished_dives, smooth_dive

DIFFUSION = 0.02
FIX_STD_M = 0.01


def dive_of(rng, seconds=60, dt_s=2.0, current=(0.0, 0.0)):
    """Return a dive and the fix after it: times, truth, belief, stated std."""
    n = int(seconds / dt_s)
    time = dt_s * np.arange(n + 1)
    truth = np.column_stack([0.05 * time, 0.02 * time, 0.3 * np.sin(np.pi * time / time[-1])])
    steps = DIFFUSION * np.sqrt(dt_s) * rng.standard_normal((n, 2)) + np.array(current) * dt_s
    error = np.vstack([FIX_STD_M * rng.standard_normal(2), np.zeros((n, 2))])
    error[1:] = error[0] + np.cumsum(steps, axis=0)
    belief = truth.copy()
    belief[:, :2] -= error
    std = np.sqrt(FIX_STD_M**2 + DIFFUSION**2 * time)
    belief[-1, :2] = truth[-1, :2] + FIX_STD_M * rng.standard_normal(2)
    std[-1] = FIX_STD_M
    return time, truth, belief, std


def test_a_dive_is_found_by_the_fall_of_its_stated_uncertainty():
    time, _, belief, std = dive_of(np.random.default_rng(0))
    (dive,) = finished_dives(time, belief, std)
    assert (dive.start_s, dive.end_s, dive.fix_time_s) == (0.0, 58.0, 60.0)
    assert dive.reckoned_std_m == std[-2]


def test_a_dive_without_a_fix_is_not_finished():
    time, _, belief, std = dive_of(np.random.default_rng(0))
    assert finished_dives(time[:-1], belief[:-1], std[:-1]) == ()


def test_the_closed_form_is_the_backward_recursion():
    time, _, belief, std = dive_of(np.random.default_rng(1))
    (dive,) = finished_dives(time, belief, std)
    smoothed = smooth_dive(dive, time[:-1], belief[:-1], std[:-1])

    variance = std[:-1] ** 2
    gain = variance[-1] / (variance[-1] + dive.fix_std_m**2)
    correction = gain * np.array(dive.drift_ne_m)
    after = (1.0 - gain) * variance[-1]
    for k in reversed(range(len(variance))):
        if k < len(variance) - 1:
            step = variance[k] / variance[k + 1]
            correction = step * correction
            after = variance[k] + step**2 * (after - variance[k + 1])
        np.testing.assert_allclose(smoothed.position_ned[k, :2], belief[k, :2] + correction)
        assert smoothed.position_std_m[k] == pytest.approx(np.sqrt(after))


def test_smoothing_brings_the_track_nearer_to_the_truth_and_is_honest_about_it():
    before, after, honest = [], [], []
    for seed in range(200):
        time, truth, belief, std = dive_of(np.random.default_rng(seed))
        (dive,) = finished_dives(time, belief, std)
        smoothed = smooth_dive(dive, time[:-1], belief[:-1], std[:-1])
        off = smoothed.position_ned[:, :2] - truth[:-1, :2]
        before.append(np.mean((belief[:-1, :2] - truth[:-1, :2]) ** 2))
        after.append(np.mean(off**2))
        honest.append(np.mean(off[1:] ** 2 / smoothed.position_std_m[1:, None] ** 2))
    assert np.mean(after) < 0.45 * np.mean(before)
    assert 0.8 < np.mean(honest) < 1.25


def test_a_steady_current_is_removed_and_told():
    current = (0.01, -0.005)
    time, truth, belief, std = dive_of(np.random.default_rng(3), current=current)
    (dive,) = finished_dives(time, belief, std)
    smoothed = smooth_dive(dive, time[:-1], belief[:-1], std[:-1])
    worst_before = np.abs(belief[:-1, :2] - truth[:-1, :2]).max()
    worst_after = np.abs(smoothed.position_ned[:, :2] - truth[:-1, :2]).max()
    assert worst_before > 0.5
    assert worst_after < 0.4 * worst_before
    np.testing.assert_allclose(dive.current_ne_m_s, current, atol=0.005)
    assert dive.surprise > 3.0


def test_depth_is_measured_and_stays_and_no_point_grows_less_certain():
    time, _, belief, std = dive_of(np.random.default_rng(4))
    (dive,) = finished_dives(time, belief, std)
    smoothed = smooth_dive(dive, time[:-1], belief[:-1], std[:-1])
    np.testing.assert_array_equal(smoothed.position_ned[:, 2], belief[:-1, 2])
    assert (smoothed.position_std_m <= std[:-1]).all()


def test_a_fix_long_after_the_last_known_point_changes_nothing():
    time, _, belief, std = dive_of(np.random.default_rng(5))
    time[-1] += 1000.0
    assert finished_dives(time, belief, std) == ()


def test_rest_at_the_surface_and_a_coarse_wire_do_not_shift_the_start():
    time, _, belief, std = dive_of(np.random.default_rng(6))
    waiting = 20
    time = np.concatenate([np.arange(-2.0 * waiting, 0.0, 2.0), time])
    belief = np.concatenate([np.repeat(belief[:1], waiting, axis=0), belief])
    std = np.concatenate([np.full(waiting, std[0]), std]).round(2)
    (dive,) = finished_dives(time, belief, std)
    assert 0.0 <= dive.start_s <= 4.0


def test_a_dive_in_an_unknown_current_is_smoothed_as_honestly_as_it_says():
    b, known = 0.01, (0.004, -0.003)
    honest, ends, before = [], [], []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        unknown = b * rng.standard_normal(2)
        time, truth, belief, std = dive_of(rng, seconds=120.0, current=tuple(unknown))
        std[:-1] = np.sqrt(std[:-1] ** 2 + (b * time[:-1]) ** 2)
        beliefs = np.array([[-5.0, 9.0, 9.0, 9.0], [-1.0, *known, b], [125.0, 9.0, 9.0, 9.0]])
        (dive,) = finished_dives(time, belief, std, beliefs)
        smoothed = smooth_dive(dive, time[:-1], belief[:-1], std[:-1])
        off = smoothed.position_ned[:, :2] - truth[:-1, :2]
        before.append(np.mean((belief[:-1, :2] - truth[:-1, :2]) ** 2))
        ends.append(np.mean(off**2))
        honest.append(np.mean(off[2:] ** 2 / smoothed.position_std_m[2:, None] ** 2))
    assert np.mean(ends) < 0.1 * np.mean(before)
    assert 0.8 < np.mean(honest) < 1.25
    assert dive.believed_ne_m_s == known
    drift = np.array(dive.drift_ne_m) - dive.jump_ne_m
    np.testing.assert_allclose(drift, 120.0 * np.array(known))
    assert dive.carried_std_m == pytest.approx(b * 118.0)
    assert dive.walk_std_m == pytest.approx(DIFFUSION * np.sqrt(118.0), rel=0.15)


def test_a_dive_of_a_single_point_is_smoothed_too() -> None:
    dive = Dive(
        start_s=5.0,
        end_s=5.0,
        fix_time_s=7.0,
        fix_ne_m=(0.1, 0.0),
        fix_std_m=0.01,
        reckoned_ne_m=(0.0, 0.0),
        reckoned_std_m=0.03,
        believed_std_m_s=0.01,
    )
    smoothed = smooth_dive(dive, np.array([5.0]), np.zeros((1, 3)), np.array([0.02]))
    assert 0.0 < smoothed.position_ned[0, 0] < 0.1
    assert 0.0 < smoothed.position_std_m[0] < 0.02
