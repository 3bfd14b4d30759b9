import math
from itertools import pairwise

import numpy as np
import pytest
from pydantic import ValidationError

from autonomy.estimation.config import ESTIMATOR_PRESETS, EstimatorConfig, estimator_preset
from autonomy.estimation.kernel import take_late_fix
from autonomy.estimation.position import (
    AxisCovariance,
    blind_time_s,
    drifted_variance,
    expected_position_std,
    surface_covariance,
)
from autonomy.estimation.position_filter import PositionFilter
from autonomy.estimation.velocity_observer import VelocityObserver
from autonomy.frames import rotation_ned_from_body
from autonomy.vehicle.config import VEHICLES
from autonomy.vehicle.extended_kernel import advance
from autonomy.vehicle.surroundings import Surroundings

CONFIG = EstimatorConfig(drift_m_sqrt_s=0.03, steady_current_m_s=0.0)
MINIGLIDER = VEHICLES["miniglider"]
WATERS = ("tank", "lake", "sea")


def test_uncertainty_under_water_grows_as_the_specification_computed() -> None:
    times = np.arange(1, 41) * 2.0
    std = expected_position_std(CONFIG, times, np.ones_like(times), 2.0)
    at = [std[round(t / 2.0) - 1] for t in (10, 20, 40, 80)]
    assert at == pytest.approx([0.059, 0.105, 0.170, 0.255], abs=0.0006)


def full_filter_std(config: EstimatorConfig, times, depths, interval):
    """The six-state covariance of thesis section 5.4.2, in matrices."""
    P = np.eye(6)

    def step(P, dt, has_fix):
        eye = np.eye(3)
        F = np.block([[eye, dt * eye], [np.zeros((3, 3)), eye]])
        q = config.acceleration_density
        Q = q * np.block([[dt**3 / 3 * eye, dt**2 / 2 * eye], [dt**2 / 2 * eye, dt * eye]])
        P = F @ P @ F.T + Q
        H = np.eye(6) if has_fix else np.eye(6)[2:]
        noise = [config.fix_std_m**2] * 2 + [config.depth_std_m**2]
        noise += [config.drift_m_sqrt_s**2 / dt] * 3
        R = np.diag(noise if has_fix else noise[2:])
        return P - P @ H.T @ np.linalg.solve(H @ P @ H.T + R, H @ P)

    for _ in range(2000):
        P = step(P, interval, has_fix=True)
    std = []
    for dt, depth in zip(np.diff([0.0, *times]), depths, strict=True):
        P = step(P, dt, has_fix=depth <= config.surface_depth_m)
        std.append(math.sqrt(np.linalg.eigvalsh(P[:2, :2])[-1]))
    return std


def test_one_axis_knows_what_the_six_state_filter_knows():
    config = EstimatorConfig(steady_current_m_s=0.0)
    times = np.append(np.arange(1, 31) * 2.0, 61.3)
    depths = np.maximum(0.0, 0.6 * np.sin(times / 8.0))
    expected = full_filter_std(config, times, depths, 2.0)
    np.testing.assert_allclose(
        expected_position_std(config, times, depths, 2.0), expected, rtol=0, atol=1e-12
    )


def test_six_states_have_the_covariance_of_three_separate_axes() -> None:
    dive_filter = PositionFilter(CONFIG, (0.0, 0.0, 0.0), 0.02, velocity_std_m_s=0.1)
    axis = AxisCovariance(0.02**2, 0.0, 0.1**2)
    for k in range(200):
        surfaced = k < 20 or k > 150
        depth = 0.0 if surfaced else 0.5
        dive_filter.step(0.5, (0.0, 0.0, 0.0), depth, (0.0, 0.0) if surfaced else None)
        axis = axis.step(CONFIG, 0.5, has_fix=surfaced)
        P = dive_filter.covariance
        assert [P[0, 0], P[0, 3], P[3, 3]] == pytest.approx(
            [axis.position, axis.cross, axis.velocity], rel=1e-9, abs=1e-16
        )
        assert dive_filter.position_std_m == pytest.approx(math.sqrt(axis.position), rel=1e-9)


def test_surface_covariance_is_where_fixes_hold_the_filter() -> None:
    settled = surface_covariance(CONFIG, 2.0)
    again = settled.step(CONFIG, 2.0, has_fix=True)
    assert again.position == pytest.approx(settled.position, rel=1e-9)
    assert settled.position < CONFIG.fix_std_m**2


def test_a_fix_ends_the_growth_of_uncertainty() -> None:
    depth = np.r_[np.zeros(2), np.full(30, 0.4), np.zeros(3)]
    std = expected_position_std(CONFIG, np.arange(1, len(depth) + 1) * 2.0, depth, 2.0)
    assert all(b > a for a, b in pairwise(std[1:32]))
    assert std[32] < CONFIG.fix_std_m < std[31]


def test_errors_of_the_filter_are_as_large_as_it_says_when_its_model_holds() -> None:
    rng = np.random.default_rng(0)
    dt, q = 0.5, CONFIG.acceleration_density
    noise = np.linalg.cholesky(q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]))
    normalized: list[float] = []
    for _ in range(60):
        position, velocity = np.zeros(3), np.zeros(3)
        follower = PositionFilter(CONFIG, position, 0.01, velocity_std_m_s=0.01)
        velocity = 0.01 * rng.standard_normal(3)
        position = 0.01 * rng.standard_normal(3)
        for k in range(120):
            kick = noise @ rng.standard_normal((2, 3))
            position = position + dt * velocity + kick[0]
            velocity = velocity + kick[1]
            surfaced = k < 10 or 70 < k < 80
            fix = position[:2] + CONFIG.fix_std_m * rng.standard_normal(2)
            measured = velocity + CONFIG.drift_m_sqrt_s / math.sqrt(dt) * rng.standard_normal(3)
            # The true depth does not matter to the model; what is told decides about the fix.
            depth = position[2] + CONFIG.depth_std_m * rng.standard_normal()
            told = -abs(depth) if surfaced else depth
            if not surfaced:
                told = max(told, 2 * CONFIG.surface_depth_m)
            follower.step(dt, measured, told, (fix[0], fix[1]) if surfaced else None)
            if k >= 20:
                error = position[:2] - follower.position_ned[:2]
                normalized.append(float(error @ error) / follower.position_std_m**2 / 2)
    assert np.mean(normalized) == pytest.approx(1.0, abs=0.12)


def test_a_fix_reported_from_the_deep_is_not_believed() -> None:
    followers = [PositionFilter(CONFIG, (0.0, 0.0, 1.0), 0.01) for _ in range(2)]
    for fix, follower in zip((None, (9.0, 9.0)), followers, strict=True):
        follower.step(0.1, (0.0, 0.0, 0.0), 1.0, fix)
    assert followers[0].position_ned == followers[1].position_ned


def test_the_filter_follows_velocity_and_depth_under_water() -> None:
    follower = PositionFilter(ESTIMATOR_PRESETS["miniglider"], (0.0, 0.0, 0.0), 0.01)
    for k in range(1200):
        follower.step(0.1, (0.05, -0.02, 0.01), 0.01 * 0.1 * (k + 1) + 0.1, None)
    assert follower.position_ned == pytest.approx((6.0, -2.4, 1.3), abs=0.4)
    assert follower.position_ned[2] == pytest.approx(1.3, abs=0.005)
    assert follower.velocity_ned == pytest.approx((0.05, -0.02, 0.01), abs=0.002)


def test_the_covariance_stays_symmetric_and_positive_over_a_day() -> None:
    follower = PositionFilter(CONFIG, (0.0, 0.0, 0.0), 0.01)
    for k in range(8640):
        surfaced = k % 300 < 10
        fix = (0.0, 0.0) if surfaced else None
        follower.step(10.0, (0.0, 0.0, 0.0), 0.0 if surfaced else 1.0, fix)
    P = follower.covariance
    assert pytest.approx(P.T, abs=1e-15) == P
    assert np.linalg.eigvalsh(P)[0] > 0.0


@pytest.mark.parametrize(
    ("dt_s", "velocity", "depth", "fix"),
    [
        (0.0, (0.0, 0.0, 0.0), 0.0, None),
        (0.1, (math.nan, 0.0, 0.0), 0.0, None),
        (0.1, (0.0, 0.0, 0.0), math.inf, None),
        (0.1, (0.0, 0.0, 0.0), 0.0, (math.nan, 0.0)),
    ],
)
def test_a_measurement_that_is_not_finite_is_refused_and_changes_nothing(
    dt_s: float,
    velocity: tuple[float, float, float],
    depth: float,
    fix: tuple[float, float] | None,
) -> None:
    follower = PositionFilter(CONFIG, (1.0, 2.0, 0.0), 0.01)
    before = follower.covariance
    with pytest.raises(ValueError, match="finite"):
        follower.step(dt_s, velocity, depth, fix)
    assert follower.position_ned == (1.0, 2.0, 0.0)
    assert np.array_equal(follower.covariance, before)


def test_settings_outside_their_bounds_are_refused() -> None:
    with pytest.raises(ValidationError, match="fix_std_m"):
        EstimatorConfig(fix_std_m=0.0)


class Dive:
    """A robot that dives, rises and turns in still water, ten times a second."""

    def __init__(self, seed: int = 0) -> None:
        self.rng = np.random.default_rng(seed)
        self.state = np.zeros(15)
        self.state[2] = 2.0
        self.state[6:9] = [0.05, 0.02, -0.03]
        self.command = np.zeros(5)
        self.time_s = 0.0
        self.packed = MINIGLIDER.packed()
        self.water = Surroundings().packed()

    def fly(self, dt_s: float = 0.1) -> None:
        if round(self.time_s / dt_s) % 200 == 0:
            down = self.rng.choice([-1.0, 1.0])
            tail = self.rng.choice([-0.6, 0.0, 0.6])
            self.command = np.array([0.01 * down, 0.025 * down, tail, 0.0, 0.0])
        self.state = advance(
            self.state, self.command, self.packed, self.water, self.time_s, 0.02, 5
        )
        self.time_s += dt_s

    def observe(self, observer: VelocityObserver, noise: float = 0.0, bias_kg: float = 0.0) -> None:
        x, n = self.state, self.rng.standard_normal
        observer.step(
            0.1,
            self.command,
            self.time_s - 0.1,
            attitude_rad=x[3:6] + noise * 0.009 * n(3),
            angular_velocity_rad_s=x[9:12] + noise * 0.005 * n(3),
            actuators=(x[12] + bias_kg, x[13], x[14]),
            depth_m=x[2] + noise * 0.003 * n(),
        )


def test_observed_velocity_converges_to_the_true_one_from_a_wrong_start() -> None:
    dive = Dive()
    observer = VelocityObserver(EstimatorConfig(), MINIGLIDER, depth_m=2.1)
    errors: list[float] = []
    for _ in range(1200):
        dive.fly()
        dive.observe(observer)
        errors.append(float(np.linalg.norm(dive.state[6:9] - observer.velocity_body)))
    assert errors[0] > 0.03
    assert errors[300] < 0.004
    assert errors[-1] < 1e-6
    rotation = rotation_ned_from_body(*dive.state[3:6])
    assert observer.velocity_ned == pytest.approx(tuple(rotation @ dive.state[6:9]), abs=1e-6)
    assert observer.depth_m == pytest.approx(dive.state[2], abs=1e-6)


def test_depth_injection_brings_the_observer_down_faster_than_drag_alone() -> None:
    ends: dict[float, float] = {}
    for gain in (0.0, 1.0):
        dive = Dive()
        config = EstimatorConfig(observer_velocity_gain=0.25 * gain, observer_depth_gain=gain)
        observer = VelocityObserver(config, MINIGLIDER, depth_m=2.1)
        for _ in range(300):
            dive.fly()
            dive.observe(observer)
        ends[gain] = float(np.linalg.norm(dive.state[6:9] - observer.velocity_body))
    assert ends[1.0] < 0.5 * ends[0.0]


def test_observed_velocity_stays_within_millimetres_with_noise_and_wrong_ballast() -> None:
    dive = Dive(seed=1)
    observer = VelocityObserver(EstimatorConfig(), MINIGLIDER, depth_m=2.0)
    errors = np.empty((2400, 3))
    for k in range(2400):
        dive.fly()
        dive.observe(observer, noise=1.0, bias_kg=0.002)
        errors[k] = dive.state[6:9] - observer.velocity_body
    rms = np.sqrt(np.mean(errors[-600:] ** 2, axis=0))
    assert rms == pytest.approx([0.0, 0.0, 0.0], abs=0.004)


def test_the_observer_knows_the_speed_of_a_swimming_robot() -> None:
    dive = Dive()
    swim = MINIGLIDER.swim
    observer = VelocityObserver(EstimatorConfig(), MINIGLIDER, depth_m=2.0)
    gait = np.array([0.0, swim.rp1_m, 0.0, swim.amplitude_rad, swim.frequency_hz])
    for _ in range(600):
        dive.state = advance(dive.state, gait, dive.packed, dive.water, dive.time_s, 0.02, 5)
        dive.time_s += 0.1
        dive.command = gait
        dive.observe(observer)
    assert dive.state[6] > 0.05
    assert observer.velocity_body[0] == pytest.approx(dive.state[6], abs=0.001)


def test_the_observer_refuses_what_is_not_finite() -> None:
    observer = VelocityObserver(EstimatorConfig(), MINIGLIDER, depth_m=0.0)
    with pytest.raises(ValueError, match="finite"):
        observer.step(
            0.1,
            np.zeros(5),
            0.0,
            attitude_rad=(0.0, math.nan, 0.0),
            angular_velocity_rad_s=(0.0, 0.0, 0.0),
            actuators=(0.0, 0.0, 0.0),
            depth_m=0.0,
        )


def glide_in_a_current(seed: int) -> list[float]:
    """Fly in a random current; return normalized squared position errors under water."""
    config = ESTIMATOR_PRESETS["miniglider"].model_copy(update={"steady_current_m_s": 0.0})
    rng = np.random.default_rng(seed)
    correlation_s = 10.0
    current_std = config.drift_m_sqrt_s / math.sqrt(2.0 * correlation_s)
    kept = math.exp(-0.1 / correlation_s)
    current = current_std * rng.standard_normal(2)
    x, water, packed = np.zeros(15), Surroundings().packed(), MINIGLIDER.packed()
    x[5] = rng.uniform(-3.0, 3.0)
    observer = VelocityObserver(config, MINIGLIDER, depth_m=0.0)
    follower = PositionFilter(config, x[:3], config.fix_std_m)
    normalized: list[float] = []
    for k in range(1500):
        down = 1.0 if k % 700 < 300 else -1.0
        command = np.array([0.0125 * down, 0.03 * down, 0.4 * math.sin(k / 150.0), 0.0, 0.0])
        water[:2] = current
        x = advance(x, command, packed, water, 0.1 * k, 0.02, 5)
        current = kept * current + current_std * math.sqrt(1 - kept**2) * rng.standard_normal(2)
        depth = x[2] + 0.003 * rng.standard_normal()
        observer.step(
            0.1,
            command,
            0.1 * k,
            attitude_rad=x[3:6] + 0.01 * rng.standard_normal(3),
            angular_velocity_rad_s=x[9:12] + 0.005 * rng.standard_normal(3),
            actuators=x[12:15],
            depth_m=depth,
        )
        fix = x[:2] + config.fix_std_m * rng.standard_normal(2)
        at_surface = x[2] < config.surface_depth_m and k % 10 == 0
        follower.step(0.1, observer.velocity_ned, depth, tuple(fix) if at_surface else None)
        if x[2] > 0.1:
            error = x[:2] - follower.position_ned[:2]
            normalized.append(float(error @ error) / follower.position_std_m**2 / 2)
    return normalized


def test_a_gliding_robot_in_an_unseen_current_is_where_its_uncertainty_says() -> None:
    mean = np.mean([np.mean(glide_in_a_current(seed)) for seed in range(12)])
    assert 0.3 < mean < 1.5


def test_a_current_that_nobody_knows_adds_its_way_since_the_last_fix():
    times = np.arange(1, 41) * 2.0
    depth = np.where(times <= 40.0, 0.5, np.where(times <= 44.0, 0.0, 0.5))
    still, moving, doubted = (
        expected_position_std(CONFIG.model_copy(update=change), times, depth, 2.0)
        for change in (
            {"steady_current_m_s": 0.0},
            {"steady_current_m_s": 0.02},
            {"steady_current_m_s": 0.02, "doubt": 1.5},
        )
    )
    blind_s = np.where(times <= 40.0, times, np.where(times <= 44.0, 0.0, times - 44.0))
    np.testing.assert_allclose(moving**2, still**2 + (0.02 * blind_s) ** 2, rtol=1e-12)
    np.testing.assert_allclose(doubted, 1.5 * moving, rtol=1e-12)


@pytest.mark.parametrize("steady_m_s", [0.0, 0.01, 2.0])
def test_the_time_without_a_fix_is_that_after_which_the_position_is_lost(steady_m_s):
    config = CONFIG.model_copy(update={"steady_current_m_s": steady_m_s, "doubt": 1.3})
    assert drifted_variance(config, blind_time_s(config, 0.25**2)) == pytest.approx(0.25**2)


def test_every_water_has_its_own_current_and_what_was_learned_is_forgotten_slowly():
    stds = [estimator_preset("miniglider", kind).steady_current_m_s for kind in WATERS]
    assert stds == [0.01, 0.05, 0.2]
    assert estimator_preset("stranger", "sea").steady_current_m_s == 0.2
    lake = estimator_preset("grace3", "lake")
    assert lake.fix_std_m == 1.5
    assert lake.current_std_after(0.002, 0.0) == 0.002
    assert 0.005 < lake.current_std_after(0.002, 600.0) < 0.012
    assert lake.current_std_after(0.002, 1e9) == pytest.approx(0.05)


def test_compiled_late_fix_is_the_readable_one_and_makes_nothing_surer_than_itself() -> None:
    generator = np.random.default_rng(11)
    for _ in range(100):
        position, velocity = generator.uniform(1e-6, 1e-2, 2)
        cross = generator.uniform(-0.9, 0.9) * math.sqrt(position * velocity)
        variance = 10.0 ** generator.uniform(-6.0, 0.0)
        axes = np.tile([0.3, -0.1, position, cross, velocity], (3, 1))
        take_late_fix(axes, np.array([0.4, 0.2]), variance)
        after = AxisCovariance(position, cross, velocity).take_late_fix(variance)
        assert axes[0, 2:] == pytest.approx([after.position, after.cross, after.velocity])
        assert axes[1, 2] >= min(variance, position)
        assert axes[2, 2] == position
        assert np.linalg.det([[axes[0, 2], axes[0, 3]], [axes[0, 3], axes[0, 4]]]) > 0.0
