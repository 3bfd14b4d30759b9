"""Target paths, the unicycle, and what is random in a scenario of the tracking chapter."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.tracking.config import TargetConfig, TrackingConfig
from autonomy.tracking.target_path import place
from reproduction.tracking import unicycle
from reproduction.tracking.scenario import FIT, draws, random_scenarios
from reproduction.tracking.target_path_kernel import pack_path, place_kernel

PATHS = ("static", "line", "sine", "circle")


def target(path, **settings):
    chosen = {"speed_m_s": 0.03, "heading_rad": 0.7, "width_m": 0.5, "period_s": 90.0}
    return TargetConfig(path=path, north_m=2.0, east_m=-1.0, **(chosen | settings))


@pytest.mark.parametrize("path", PATHS)
def test_a_path_begins_at_its_place_in_its_direction(path):
    start = place(target(path), 0.0)
    assert start[:2] == pytest.approx((2.0, -1.0))
    ahead = start.north_m_s * math.cos(0.7) + start.east_m_s * math.sin(0.7)
    assert ahead == pytest.approx(0.0 if path == "static" else 0.03)


@pytest.mark.parametrize("path", PATHS)
def test_the_velocity_of_a_path_is_how_its_place_changes(path):
    for t in (-20.0, 0.0, 33.0, 400.0):
        before, now, after = (place(target(path), t + dt) for dt in (-1e-3, 0.0, 1e-3))
        assert now.north_m_s == pytest.approx((after.north_m - before.north_m) / 2e-3, abs=1e-8)
        assert now.east_m_s == pytest.approx((after.east_m - before.east_m) / 2e-3, abs=1e-8)


@pytest.mark.parametrize("path", PATHS)
def test_the_compiled_path_is_the_readable_one(path):
    packed = pack_path(target(path))
    for t in np.linspace(-50.0, 500.0, 40):
        assert place_kernel(packed, t) == pytest.approx(place(target(path), t), abs=1e-13)


def test_a_circle_keeps_its_speed_and_its_distance_from_a_centre_to_starboard():
    circle = target("circle", heading_rad=0.0)
    for t in np.linspace(0.0, 300.0, 13):
        now = place(circle, t)
        assert math.hypot(now.north_m - 2.0, now.east_m + 0.5) == pytest.approx(0.5)
        assert math.hypot(now.north_m_s, now.east_m_s) == pytest.approx(0.03)
    assert place(circle, 10.0).east_m > -1.0


def test_a_sine_swings_by_its_width_across_its_course():
    sine = target("sine", heading_rad=0.0)
    swings = [place(sine, t).east_m + 1.0 for t in np.linspace(0.0, 90.0, 361)]
    assert max(swings) == pytest.approx(0.5, abs=1e-4)
    assert min(swings) == pytest.approx(-0.5, abs=1e-4)
    assert place(sine, 90.0).north_m == pytest.approx(2.0 + 0.03 * 90.0)


def test_a_beacon_stays_whatever_path_is_set():
    beacon = target("circle", kind="beacon")
    assert place(beacon, 100.0) == (2.0, -1.0, 0.0, 0.0)
    assert place_kernel(pack_path(beacon), 100.0) == (2.0, -1.0, 0.0, 0.0)


def test_a_unicycle_that_turns_goes_round_a_circle():
    pose = (0.0, 0.0, 0.0, 0.3)
    for _ in range(200):
        pose = unicycle.advance(pose, 0.5, 0.0, 0.1)
        assert math.hypot(pose[0], pose[1] - 0.6) == pytest.approx(0.6, abs=1e-6)
    assert pose[2] == pytest.approx(10.0)


def test_the_error_of_a_unicycle_falls_with_the_fourth_power_of_the_step():
    def end(steps):
        pose = (0.0, 0.0, 0.3, 0.1)
        for _ in range(steps):
            pose = unicycle.advance(pose, 0.7, 0.2, 4.0 / steps)
        return np.array(pose[:2])

    exact = end(4096)
    errors = [np.hypot(*(end(steps) - exact)) for steps in (4, 8, 16)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.2)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(4.0, abs=0.2)


def test_a_unicycle_may_swim_backwards_and_its_kernel_is_the_same():
    pose = (1.0, 2.0, 0.4, -0.2)
    moved = unicycle.advance(pose, 0.3, -0.01, 0.1)
    assert moved[0] < 1.0
    assert unicycle.advance_kernel(*pose, 0.3, -0.01, 0.1) == pytest.approx(moved, abs=1e-15)


def test_the_fit_starts_where_the_specification_says():
    assert FIT.start[:2] == pytest.approx((-0.392, -4.533), abs=1e-3)
    assert math.hypot(*FIT.start[:2]) == pytest.approx(4.55)
    assert FIT.steps == 3350
    after = place(FIT.config.target, 100.0)
    assert after[:2] == pytest.approx((2.35 * math.cos(3.474), 2.35 * math.sin(3.474)))


def test_the_first_estimate_s_error_is_drawn_before_the_noise():
    generator = np.random.default_rng(7)
    offset = generator.normal(0.0, math.sqrt(0.065), 2)
    noise = generator.normal(0.0, 1.0, (3350, 3)) * np.sqrt([0.1, 0.0175, 0.1])
    drawn = draws(FIT, 7)
    assert drawn.offset_m == pytest.approx(offset, abs=1e-15)
    assert drawn.noise == pytest.approx(noise, abs=1e-15)
    assert drawn.has_range.all()


def test_wrong_and_lost_ranges_change_no_other_number():
    clean = draws(FIT, 3)
    dirty = draws(replace(FIT, outlier_share=0.1, outlier_m=4.0, lost_share=0.2), 3)
    assert np.array_equal(dirty.offset_m, clean.offset_m)
    assert np.array_equal(dirty.noise[:, 1:], clean.noise[:, 1:])
    added = dirty.noise[:, 0] - clean.noise[:, 0]
    assert (added > 0.0).mean() == pytest.approx(0.1, abs=0.02)
    assert 3.5 < added.max() <= 4.0
    assert (dirty.has_range == 0.0).mean() == pytest.approx(0.2, abs=0.02)


def test_ranges_may_come_less_often_than_heading_and_speed():
    few = draws(replace(FIT, range_steps=5), 3)
    assert few.has_range[:11].tolist() == [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]


def test_random_scenarios_fill_their_ranges_and_depend_on_the_seed_alone():
    some = random_scenarios(5, 150, TrackingConfig())
    assert random_scenarios(5, 20, TrackingConfig()) == some[:20]
    assert random_scenarios(6, 20, TrackingConfig()) != some[:20]
    distances = [math.hypot(*each.start[:2]) for each in some]
    assert 2.0 <= min(distances) < 2.2
    assert 5.8 < max(distances) <= 6.0
    assert {each.config.target.path for each in some} == set(PATHS)
    fastest = max(
        math.hypot(*place(each.config.target, t)[2:]) for each in some for t in range(0, 335, 5)
    )
    assert fastest < 0.06


def test_settings_of_a_scenario_are_checked_when_they_are_changed():
    changed = FIT.with_barrier(slope=0.5).with_filter(hypotheses="two")
    assert changed.config.barrier.slope == 0.5
    assert changed.config.filter.hypotheses == "two"
    assert changed.config.target == FIT.config.target
    with pytest.raises(ValueError, match="slope"):
        FIT.with_barrier(slope=-1.0)
