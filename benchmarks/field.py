"""Speed of the live map, beside scikit-learn's refit in the same process."""

import json
import statistics
import time
from collections.abc import Callable

import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from autonomy.arrays import FloatArray
from autonomy.field.config import FIELD_PRESETS, GridShape
from autonomy.field.grid import Grid
from autonomy.field.live_map import LiveMap
from autonomy.field.samples import FieldSamples
from autonomy.field.synthetic import measure as sample_field
from autonomy.site import TANK

SAMPLES = 1100
APPENDS = 60
REFITS = 7
CONFIG = FIELD_PRESETS["blue_light"]
GRID = Grid.over(TANK.domain, GridShape(x=25, y=20, z=10))
WORST_LEVEL_STD_M, BEST_LEVEL_STD_M = 0.2, 0.0


def measure() -> list[dict[str, object]]:
    """Time appends and refits; every figure is a median."""
    single_ms = append_ms("single", BEST_LEVEL_STD_M)
    best_ms = append_ms("recursive", BEST_LEVEL_STD_M)
    worst_ms = append_ms("recursive", WORST_LEVEL_STD_M)
    refit_ms = scikit_learn_refit_ms()
    what = "append a sample, refresh 5,000 points, n = 1,100"
    return [
        row(f"{what}: single model", single_ms, "ms", 10.0, single_ms <= 10.0),
        row(f"{what}: three levels, best level", best_ms, "ms", 10.0, best_ms <= 10.0),
        row(f"{what}: three levels, worst level", worst_ms, "ms", 10.0, worst_ms <= 10.0),
        row("scikit-learn's refit and prediction of the same map", refit_ms, "ms", None, None),
        row(
            "scikit-learn's refit / append",
            refit_ms / single_ms,
            "x",
            50.0,
            refit_ms / single_ms >= 50.0,
        ),
    ]


def append_ms(model: str, position_std_m: float) -> float:
    """Median time to append one sample to 1,100 and read mean and std on 5,000 points."""
    live_map = LiveMap(CONFIG.model_copy(update={"model": model}), GRID)
    points, values = tank_samples(SAMPLES + APPENDS)
    spread = np.random.default_rng(1).uniform(0.0, 0.2, SAMPLES)
    live_map.append(FieldSamples.of(points[:SAMPLES], values[:SAMPLES], spread))
    std = np.array([position_std_m])
    waiting = iter(range(SAMPLES, SAMPLES + APPENDS))

    def append_one() -> tuple[FloatArray, FloatArray]:
        i = next(waiting)
        live_map.append(FieldSamples.of(points[i : i + 1], values[i : i + 1], std))
        return live_map.mean, live_map.std

    return median_ms(append_one, APPENDS)


def scikit_learn_refit_ms() -> float:
    """Median time of scikit-learn to condition on 1,100 samples and predict 5,000 points."""
    points, values = tank_samples(SAMPLES)
    seen = np.log(values) - CONFIG.prior_mean
    kernel = ConstantKernel(CONFIG.single.signal_variance) * Matern(
        CONFIG.single.length_scales_m(), nu=1.5
    )

    def refit() -> object:
        model = GaussianProcessRegressor(kernel, alpha=CONFIG.single.noise_variance, optimizer=None)
        return model.fit(points, seen).predict(GRID.points, return_std=True)

    return median_ms(refit, REFITS)


def tank_samples(count: int) -> tuple[FloatArray, FloatArray]:
    """Draw positions in the tank's domain and what the light sensor says there."""
    rng = np.random.default_rng(0)
    points = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], size=(count, 3))
    return points, sample_field("blue_light", points, rng)


def median_ms(action: Callable[[], object], times: int) -> float:
    """Median wall time of an action."""
    taken: list[float] = []
    for _ in range(times):
        start = time.perf_counter()
        action()
        taken.append(1e3 * (time.perf_counter() - start))
    return statistics.median(taken)


def row(
    name: str, value: float, unit: str, bar: float | None, met: bool | None
) -> dict[str, object]:
    """Make one line of the benchmark's report."""
    return {
        "area": "field",
        "name": name,
        "value": round(value, 3),
        "unit": unit,
        "bar": bar,
        "met": met,
    }


if __name__ == "__main__":
    print(json.dumps(measure(), indent=1))
