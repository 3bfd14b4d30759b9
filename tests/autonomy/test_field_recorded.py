from pathlib import Path

import numpy as np
import pytest

from autonomy.arrays import FloatArray
from autonomy.channel import CHANNELS
from autonomy.field.config import KernelParameters
from autonomy.field.learning.noise import Part, cross_validated_noise, leave_one_out
from autonomy.field.learning.recorded import fit_recording, recorded_map
from autonomy.field.model.gaussian_process import GaussianProcess

DEPLOYMENT = Path(__file__).parents[3] / "shared" / "data" / "eva035_chl_temp.csv"


def yo_yo_recording(n: int) -> tuple[FloatArray, FloatArray]:
    along = np.linspace(0.0, 5000.0, n)
    depth = 60.0 * (1.0 - np.cos(2.0 * np.pi * along / 500.0))
    points = np.column_stack([along, 0.3 * along, depth])
    bloom = np.exp(-0.5 * ((depth - 40.0) / 15.0) ** 2) * (1.0 + 0.3 * np.sin(along / 800.0))
    return points, bloom + 0.05 * np.random.default_rng(5).standard_normal(n)


def test_a_recording_is_learned_scored_and_mapped() -> None:
    points, values = yo_yo_recording(800)
    fit = fit_recording(
        CHANNELS["chlorophyll"], points, values, np.random.default_rng(0), training=250
    )
    assert (fit.training, fit.test) == (250, 200)
    assert fit.scores.rmse < 0.25
    assert 0.8 <= fit.scores.coverage_90 <= 1.0
    assert fit.config.single.noise_variance == pytest.approx(0.05**2, rel=0.6)
    live_map = recorded_map(fit, points, values)
    assert live_map.grid.z_m[-1] == fit.box.depth_max_m == points[:, 2].max()
    assert live_map.mean.max() > 5.0 * abs(live_map.mean.min())


def test_a_recording_with_holes_or_hardly_any_samples_is_refused() -> None:
    points, values = yo_yo_recording(100)
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="at least 20 samples above 1 m"):
        fit_recording(CHANNELS["chlorophyll"], points, values, rng, depth_limit_m=1.0)
    values[3] = np.nan
    with pytest.raises(ValueError, match="finite"):
        fit_recording(CHANNELS["chlorophyll"], points, values, rng)


def test_a_recording_of_one_constant_at_one_place_is_mapped() -> None:
    points, values = np.ones((40, 3)), np.full(40, 3.0)
    fit = fit_recording(CHANNELS["chlorophyll"], points, values, np.random.default_rng(0))
    assert recorded_map(fit, points, values).mean == pytest.approx(3.0, abs=1e-3)


@pytest.mark.skipif(not DEPLOYMENT.exists(), reason=f"{DEPLOYMENT.name} is not on this machine")
def test_chlorophyll_of_a_real_glider_is_mapped_to_a_third_of_its_spread() -> None:
    points, rows = deployment()
    fit = fit_recording(
        CHANNELS["chlorophyll"], points, rows["chlorophyll"], np.random.default_rng(0)
    )
    assert (fit.training, fit.test) == (900, 400)
    assert fit.scores.rmse < 0.306
    assert fit.scores.nlpd <= 0.0
    assert 0.85 < fit.scores.coverage_90 < 0.98


@pytest.mark.skipif(not DEPLOYMENT.exists(), reason=f"{DEPLOYMENT.name} is not on this machine")
def test_temperature_of_a_real_glider_is_not_claimed_more_certain_than_it_is() -> None:
    points, rows = deployment()
    fit = fit_recording(
        CHANNELS["temperature"], points, rows["temperature"], np.random.default_rng(0)
    )
    assert fit.scores.rmse < 0.06
    assert fit.scores.nlpd < -1.5
    assert fit.scores.coverage_90 >= 0.80


def spiked_samples(count: int, seed: int) -> Part:
    rng = np.random.default_rng(seed)
    points = rng.uniform(size=(count, 3))
    values = np.sin(3.0 * points.sum(axis=1)) + 0.1 * rng.standard_normal(count)
    return Part(points, values)


def test_cross_validation_finds_the_noise_from_any_beginning() -> None:
    learned_from, left_over = spiked_samples(150, 1), spiked_samples(150, 2)
    for noise in (1e-6, 1.0):
        kernel = KernelParameters(
            signal_variance=1.0,
            length_x_m=1.0,
            length_y_m=1.0,
            length_z_m=1.0,
            noise_variance=noise,
        )
        found = cross_validated_noise(kernel, learned_from, left_over, floor=1e-6)
        assert found.noise_variance == pytest.approx(0.01, rel=0.5)
        assert found.length_x_m == kernel.length_x_m


def test_leaving_one_out_is_conditioning_on_all_the_others() -> None:
    part, kernel = spiked_samples(25, 3), KernelParameters()
    errors, variances = leave_one_out(kernel, part)
    for i in (0, 7, 24):
        others = np.arange(25) != i
        process = GaussianProcess(kernel, part.points[others], part.values[others])
        mean, variance = process.marginals(part.points[i : i + 1])
        assert errors[i] == pytest.approx(part.values[i] - mean[0], rel=1e-6)
        assert variances[i] == pytest.approx(variance[0] + kernel.noise_variance, rel=1e-6)


def deployment() -> tuple[FloatArray, np.ndarray]:
    rows = np.genfromtxt(DEPLOYMENT, delimiter=",", names=True)
    latitude, longitude = np.radians(rows["latitude"]), np.radians(rows["longitude"])
    north = (latitude - latitude[0]) * 6.371e6
    east = (longitude - longitude[0]) * 6.371e6 * np.cos(latitude[0])
    return np.column_stack([north, east, rows["depth"]]), rows
