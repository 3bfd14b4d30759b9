"""Speed of the live map, beside the peers' refits in the same process."""

import json
import statistics
import time
from collections.abc import Callable

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import FIELD_PRESETS, FieldConfig, GridShape
from autonomy.field.grid import Grid
from autonomy.field.live.live_map import LiveMap
from autonomy.field.samples import FieldSamples
from autonomy.field.synthetic import measure as sample_field
from autonomy.site import TANK
from benchmarks.calibration import COMPILED, calibrated, scaled_row
from benchmarks.field.field_peer import gpy_fit, scikit_learn_fit

SAMPLES = 1100
APPENDS = 60
ROUNDS, APPENDS_A_ROUND = 9, 12
PEERS = ("scikit-learn", "GPy")
PER_DIVE = 50
CONFIG = FIELD_PRESETS["blue_light"]
GRID = Grid.over(TANK.domain, GridShape(x=25, y=20, z=10))
WORST_LEVEL_STD_M, BEST_LEVEL_STD_M = 0.2, 0.0
APPEND_BAR_MS, GROWTH_BAR_S = 4.0, 4.0
"""Where the plain C step takes what ``calibration`` says of the reference machine."""
REFIT_BAR = 100.0


def measure() -> list[dict[str, object]]:
    """Time appends, a whole survey and refits; every figure but the survey's is a median.

    Appends and surveys are told in processor time, which a busy machine hardly changes.
    """
    what = "append a sample, refresh 5,000 points, n = 1,100"
    cases = (
        ("single", BEST_LEVEL_STD_M, "single model"),
        ("joint", BEST_LEVEL_STD_M, "joint model, best level"),
        ("joint", WORST_LEVEL_STD_M, "joint model, worst level"),
        ("position_noise", WORST_LEVEL_STD_M, "position-dependent noise"),
    )
    rows: list[dict[str, object]] = []
    for model, std_m, title in cases:
        with calibrated(COMPILED) as calibration:
            taken_ms = append_ms(model, std_m)
        name = f"{what}: {title}"
        rows.append(
            scaled_row("field", name, taken_ms, "ms", APPEND_BAR_MS, calibration, by="median")
        )
    for std_m, title in ((BEST_LEVEL_STD_M, "best level"), (WORST_LEVEL_STD_M, "worst level")):
        taken_ms = append_ms("recursive", std_m)
        rows.append(at_most("field", f"{what}: recursive, {title}", taken_ms, "ms", None))
    with calibrated(COMPILED) as calibration:
        growth = growth_s("single")
    name = "0 to 1,100 samples with a refresh of 5,000 points after each"
    rows.append(scaled_row("field", name, growth, "s", GROWTH_BAR_S, calibration, by="median"))
    return [*rows, *beside_refits()]


def beside_refits() -> list[dict[str, object]]:
    """Compare appends with the peers' refits of the same map, in turn and on one thread each.

    A refit that is interrupted by other programs takes longer by the clock, an append rarely is;
    so the ratio is also given by processor time, which a busy machine changes less.
    """
    clock, processor = raced_ms()
    rows = [
        at_most("field", f"{peer}'s refit of the same map", clock[peer], "ms", None)
        for peer in PEERS
    ]
    for name, taken, bar in (("", clock, REFIT_BAR), (", processor time", processor, None)):
        ratio = min(taken[peer] for peer in PEERS) / taken["append"]
        rows.append(at_least("field", f"the fastest peer's refit / append{name}", ratio, bar))
    return rows


def append_ms(model: str, position_std_m: float) -> float:
    """Median processor time to append one sample to 1,100 and read mean and std on 5,000 points."""
    live_map = LiveMap(settings(model), GRID)
    samples = tank_samples(SAMPLES + APPENDS, 0.1, position_std_m)
    live_map.append(samples[:SAMPLES])
    waiting = iter(range(SAMPLES, SAMPLES + APPENDS))

    def append_one() -> tuple[FloatArray, FloatArray]:
        i = next(waiting)
        live_map.append(samples[i : i + 1])
        return live_map.mean, live_map.std

    return median_ms(append_one, APPENDS)


def growth_s(model: str) -> float:
    """Processor time of a survey of 1,100 samples with the map read after each."""
    samples, live_map = tank_samples(SAMPLES, 0.1, BEST_LEVEL_STD_M), LiveMap(settings(model), GRID)
    start = time.process_time()
    for i in range(SAMPLES):
        live_map.append(samples[i : i + 1])
        assert live_map.mean.shape == live_map.std.shape  # noqa: S101 - both are read
    return time.process_time() - start


def raced_ms() -> tuple[dict[str, float], dict[str, float]]:
    """Median times, by the clock and of the processor, of an append and of each peer's refit.

    A refit conditions on 1,100 samples and predicts 5,000 points; after one of each peer come
    some appends of the single model, each read as a whole.
    """
    from threadpoolctl import threadpool_limits  # comes with scikit-learn

    samples = tank_samples(SAMPLES + ROUNDS * APPENDS_A_ROUND, 0.1, BEST_LEVEL_STD_M)
    live_map = LiveMap(settings("single"), GRID)
    live_map.append(samples[:SAMPLES])
    waiting = iter(range(SAMPLES, len(samples)))
    points = samples.points[:SAMPLES]
    seen = np.log(samples.values[:SAMPLES]) - CONFIG.prior_mean

    def append_one() -> tuple[FloatArray, FloatArray]:
        i = next(waiting)
        live_map.append(samples[i : i + 1])
        return live_map.mean, live_map.std

    actions: dict[str, Callable[[], object]] = {
        "scikit-learn": lambda: scikit_learn_fit(CONFIG.single, points, seen).predict(
            GRID.points, return_std=True
        ),
        "GPy": lambda: gpy_fit(CONFIG.single, points, seen).predict_noiseless(GRID.points),
        "append": append_one,
    }
    clock: dict[str, list[float]] = {name: [] for name in actions}
    processor: dict[str, list[float]] = {name: [] for name in actions}
    with threadpool_limits(limits=1):
        for _ in range(ROUNDS):
            for name, action in actions.items():
                for _ in range(APPENDS_A_ROUND if name == "append" else 1):
                    start, busy = time.perf_counter(), time.process_time()
                    action()
                    processor[name].append(1e3 * (time.process_time() - busy))
                    clock[name].append(1e3 * (time.perf_counter() - start))
    return (
        {name: statistics.median(taken) for name, taken in clock.items()},
        {name: statistics.median(taken) for name, taken in processor.items()},
    )


def settings(model: str) -> FieldConfig:
    """Return the tank's preset with a model."""
    return CONFIG.model_copy(update={"model": model})


def tank_samples(count: int, most_std_m: float, last_std_m: float) -> FieldSamples:
    """Draw samples in the tank, dives of 50, the last 60 of which are located equally well."""
    rng = np.random.default_rng(0)
    points = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], size=(count, 3))
    std = np.linspace(0.0, most_std_m, PER_DIVE)[np.arange(count) % PER_DIVE]
    std[SAMPLES:] = last_std_m
    return FieldSamples.of(
        points, sample_field("blue_light", points, rng), std, dive=np.arange(count) // PER_DIVE
    )


def median_ms(action: Callable[[], object], times: int) -> float:
    """Median processor time of an action."""
    taken: list[float] = []
    for _ in range(times):
        start = time.process_time()
        action()
        taken.append(1e3 * (time.process_time() - start))
    return statistics.median(taken)


def at_most(area: str, name: str, value: float, unit: str, bar: float | None) -> dict[str, object]:
    """Make a line of the report that is met at or below its bar."""
    return row(area, name, value, unit, bar, None if bar is None else value <= bar)


def at_least(area: str, name: str, ratio: float, bar: float | None) -> dict[str, object]:
    """Make a line of the report for a ratio that is met at or above its bar."""
    return row(area, name, ratio, "x", bar, None if bar is None else ratio >= bar)


def row(
    area: str, name: str, value: float | None, unit: str, bar: float | None, met: bool | None
) -> dict[str, object]:
    """Make one line of the benchmark's report; without a value where it was not measured."""
    return {
        "area": area,
        "name": name,
        "value": None if value is None else float(f"{value:.4g}"),
        "unit": unit,
        "bar": bar,
        "met": met,
    }


if __name__ == "__main__":
    print(json.dumps(measure(), indent=1))
