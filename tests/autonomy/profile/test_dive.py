"""Dives in drawn series of depths: noise, silences, yo-yos, swimming at the surface, spikes."""

import numpy as np
import pytest

from autonomy.profile.dive import dive_scale, find_dives, leg_at, legs_of


def drawn(*points, step_s=1.0, noise_m=0.0, seed=3):
    """Return times and depths along straight lines between (time, depth) pairs."""
    at, depth = np.array(points, dtype=np.float64).T
    times = np.arange(at[0], at[-1] + 0.5 * step_s, step_s)
    noise = noise_m * np.random.default_rng(seed).standard_normal(times.size)
    return times, np.interp(times, at, depth) + noise


def triangle(depth_m, count, half_s=100.0, rest_s=50.0):
    points = [(0.0, 0.0)]
    for _ in range(count):
        begin = points[-1][0] + rest_s
        points += [(begin, 0.0), (begin + half_s, depth_m), (begin + 2 * half_s, 0.0)]
    return [*points, (points[-1][0] + rest_s, 0.0)]


def directions(times, depth):
    dives = find_dives(depth, times)
    return dives, legs_of(dives, depth, times)


@pytest.mark.parametrize("depth_m", [0.5, 5.0, 20.0, 900.0])
@pytest.mark.parametrize("share", [0.0, 0.004])
def test_each_triangle_is_a_dive_with_one_half_down_and_one_up(depth_m, share):
    times, depth = drawn(*triangle(depth_m, 4), noise_m=share * depth_m)
    dives, legs = directions(times, depth)
    assert len(dives) == 4
    assert legs.direction.tolist() == [1, -1] * 4
    assert legs.dive.tolist() == [1, 1, 2, 2, 3, 3, 4, 4]
    for number, dive in enumerate(dives):
        begin = 50.0 + 250.0 * number
        assert times[dive.first] == pytest.approx(begin, abs=12.0)
        assert times[dive.deepest] == pytest.approx(begin + 100.0, abs=4.0)
        assert times[dive.last] == pytest.approx(begin + 200.0, abs=12.0)


def test_a_dive_begins_where_the_robot_began_to_sink():
    times, depth = drawn(*triangle(20.0, 1))
    (dive,) = find_dives(depth, times)
    assert (times[dive.first], times[dive.last]) == (50.0, 250.0)
    assert depth[dive.deepest] == 20.0
    assert depth[dive.turns[1]] == pytest.approx(20.0, abs=0.21)


def test_a_yo_yo_is_one_dive_with_several_halves():
    times, depth = drawn(
        *((0, 0), (20, 0), (120, 20), (180, 8), (240, 20), (300, 8), (360, 19), (460, 0), (490, 0)),
        noise_m=0.05,
    )
    dives, legs = directions(times, depth)
    assert len(dives) == 1
    assert legs.direction.tolist() == [1, -1, 1, -1, 1, -1]
    assert times[list(dives[0].turns)] == pytest.approx([20, 120, 180, 240, 300, 360, 460], abs=5)


def test_swimming_at_the_surface_is_no_dive():
    times = np.arange(0.0, 3600.0)
    depth = 0.05 + 0.04 * np.sin(times / 7.0)
    assert find_dives(depth, times) == []
    ends = triangle(10.0, 1)
    waves = [(at + 400.0, 0.3 + 0.2 * (number % 2)) for number, at in enumerate(range(0, 300, 5))]
    times, depth = drawn(*ends, *waves)
    assert len(find_dives(depth, times)) == 1


def test_one_wrong_depth_is_no_dive_and_no_turn():
    times, depth = drawn(*triangle(20.0, 2))
    depth[[5, 100, 160]] = (60.0, 0.0, 0.0)
    dives, legs = directions(times, depth)
    assert len(dives) == 2
    assert legs.direction.tolist() == [1, -1, 1, -1]
    assert [times[one.deepest] for one in dives] == [150.0, 400.0]


def test_a_short_silence_is_bridged_and_a_long_one_ends_the_dive():
    times, depth = drawn(*triangle(100.0, 1, half_s=2000.0))
    short = (times < 900) | (times > 1100)
    assert len(find_dives(depth[short], times[short])) == 1
    long = (times < 900) | (times > 2900)
    dives = find_dives(depth[long], times[long])
    legs = legs_of(dives, depth[long], times[long])
    assert times[long][dives[0].last] == 899.0
    assert legs.direction.tolist() == [1, -1]
    assert legs.dive.tolist() == [1, 2]


def test_missing_depths_are_left_out():
    times, depth = drawn(*triangle(20.0, 3))
    depth[::3] = np.nan
    dives = find_dives(depth, times)
    assert len(dives) == 3
    assert all(np.isfinite(depth[list(one.turns)]).all() for one in dives)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_nothing_is_found_in_nothing(count):
    times = np.arange(float(count))
    assert find_dives(np.full(count, np.nan), times) == []
    assert find_dives(np.zeros(count), times) == []
    assert all(part.size == count for part in leg_at(legs_of([], times, times), times))


def test_a_recording_that_begins_and_ends_under_water_has_its_dives():
    times, depth = drawn((0, 12), (80, 20), (180, 0), (200, 0), (300, 20))
    dives, legs = directions(times, depth)
    assert legs.direction.tolist() == [1, -1, 1]
    assert [(one.first, one.last) for one in dives] == [(0, 180), (200, 300)]


def test_moments_have_the_leg_that_they_are_in():
    times, depth = drawn(*triangle(20.0, 2))
    _, legs = directions(times, depth)
    dive, leg, direction = leg_at(legs, np.array([10.0, 60.0, 150.0, 240.0, 260.0, 310.0, 999.0]))
    assert dive.tolist() == [0, 1, 1, 1, 0, 2, 0]
    assert leg.tolist() == [0, 1, 2, 2, 0, 3, 0]
    assert direction.tolist() == [0, 1, -1, -1, 0, 1, 0]


def test_the_scale_goes_with_the_depth_and_the_noise():
    times, depth = drawn(*triangle(20.0, 2))
    assert dive_scale(depth, times).turn_m == pytest.approx(2.0, rel=0.05)
    times, depth = drawn(*triangle(900.0, 2))
    assert dive_scale(depth, times).turn_m == pytest.approx(3.0)
    times, depth = drawn(*triangle(0.5, 2), noise_m=0.02)
    assert dive_scale(depth, times).turn_m == pytest.approx(0.12, rel=0.25)


def test_a_million_depths_take_no_longer_than_people_wait():
    times, depth = drawn(*triangle(50.0, 400, half_s=1200.0, rest_s=100.0), noise_m=0.05)
    assert times.size > 1_000_000
    assert len(find_dives(depth, times)) == 400
