from pathlib import Path

import numpy as np
import pytest

from autonomy.arrays import FloatArray
from autonomy.field.recorded import fit_recording, recorded_map

DEPLOYMENT = Path(__file__).parents[3] / "shared" / "data" / "eva035_chl_temp.csv"


def yo_yo_recording(n: int) -> tuple[FloatArray, FloatArray]:
    along = np.linspace(0.0, 5000.0, n)
    depth = 60.0 * (1.0 - np.cos(2.0 * np.pi * along / 500.0))
    points = np.column_stack([along, 0.3 * along, depth])
    bloom = np.exp(-0.5 * ((depth - 40.0) / 15.0) ** 2) * (1.0 + 0.3 * np.sin(along / 800.0))
    return points, bloom + 0.05 * np.random.default_rng(5).standard_normal(n)


def test_a_recording_is_learned_scored_and_mapped() -> None:
    points, values = yo_yo_recording(800)
    fit = fit_recording("chlorophyll", points, values, np.random.default_rng(0), training=250)
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
        fit_recording("chlorophyll", points, values, rng, depth_limit_m=1.0)
    values[3] = np.nan
    with pytest.raises(ValueError, match="finite"):
        fit_recording("chlorophyll", points, values, rng)


def test_a_recording_of_one_constant_at_one_place_is_mapped() -> None:
    points, values = np.ones((40, 3)), np.full(40, 3.0)
    fit = fit_recording("chlorophyll", points, values, np.random.default_rng(0))
    assert recorded_map(fit, points, values).mean == pytest.approx(3.0, abs=1e-3)


@pytest.mark.skipif(not DEPLOYMENT.exists(), reason=f"{DEPLOYMENT.name} is not on this machine")
def test_chlorophyll_of_a_real_glider_is_mapped_to_a_third_of_its_spread() -> None:
    rows = np.genfromtxt(DEPLOYMENT, delimiter=",", names=True)
    latitude, longitude = np.radians(rows["latitude"]), np.radians(rows["longitude"])
    north = (latitude - latitude[0]) * 6.371e6
    east = (longitude - longitude[0]) * 6.371e6 * np.cos(latitude[0])
    points = np.column_stack([north, east, rows["depth"]])
    fit = fit_recording("chlorophyll", points, rows["chlorophyll"], np.random.default_rng(0))
    assert (fit.training, fit.test) == (900, 400)
    assert fit.scores.rmse < 0.306
    assert fit.scores.nlpd < 0.1
    assert fit.scores.coverage_90 > 0.85
