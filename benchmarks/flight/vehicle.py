"""Speed of the vehicle's dynamics beside the same equations in plain C, and how exact they are."""

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from autonomy.vehicle.config import GRACE3, MINIGLIDER
from autonomy.vehicle.kernel import rk4_step
from autonomy.vehicle.polar import polar
from benchmarks.calibration import (
    COMPILED,
    DT_S,
    STEPS,
    best_of,
    calibrated,
    plain_c,
    scaled_row,
    start,
)
from benchmarks.flight import vehicle_accuracy

ROUNDS = 800
"""Short turns, less than a scheduler's slice, so that some of them run undisturbed."""
RATIO_BAR = 1.3
SIMULATED_BAR = 15_000.0
POLAR_BAR_S = 2.0
"""Both where the plain C step takes what ``calibration`` says of the reference machine."""
POLAR_ROUNDS = 5


def measure() -> list[dict[str, Any]]:
    """Measure exactness, the polar, and the 12-state Runge-Kutta step."""
    exact = [
        _row(name, value, unit, bar, at_most=True)
        for name, value, unit, bar in vehicle_accuracy.measure()
    ]
    return [*exact, _polar_row(), *_speed_rows()]


def _polar_row() -> dict[str, Any]:
    """Time one polar of 21 x 21 with the stability of every glide, best of several."""
    polar(MINIGLIDER)
    with calibrated(COMPILED) as calibration:
        best_s = best_of(lambda: polar(GRACE3), POLAR_ROUNDS)
    return scaled_row("vehicle", "Polar, 21 x 21 glides", best_s, "s", POLAR_BAR_S, calibration)


def _speed_rows() -> list[dict[str, Any]]:
    """Time the step in compiled loops, interleaved, best of several."""
    state, inputs, packed = start()
    rk4_step(state, inputs, packed, DT_S, 1)

    def compiled() -> np.ndarray:
        return rk4_step(state, inputs, packed, DT_S, STEPS)

    plain = plain_c(state, inputs, packed)
    with calibrated(COMPILED) as calibration:
        best = _best_of([compiled] + ([plain] if plain is not None else []))
    step_s = best[0] / STEPS
    name, rate = "Simulated time, open loop, dt 0.01", DT_S / step_s
    rows = [
        _row("RK4 step in a compiled loop", step_s * 1e6, "us"),
        scaled_row("vehicle", name, rate, "s/s", SIMULATED_BAR, calibration, at_least=True),
    ]
    if plain is None:
        return [*rows, _row("RK4 step against plain C", None, "skipped: no gcc", RATIO_BAR)]
    drift = float(np.max(np.abs(compiled() - plain())))
    if not drift < 1e-9:
        raise RuntimeError(f"plain C and the kernel differ by {drift} after {STEPS} steps")
    return [
        *rows,
        _row("RK4 step in plain C -O3 -march=native", best[1] / STEPS * 1e6, "us"),
        _row("RK4 step against plain C", best[0] / best[1], "x", RATIO_BAR, at_most=True),
    ]


def _best_of(runs: list[Callable[[], object]]) -> list[float]:
    """Best wall time of each run; they take turns so that a busy machine slows all alike."""
    best = [math.inf] * len(runs)
    for _ in range(ROUNDS):
        for index, run in enumerate(runs):
            begin = time.perf_counter()
            run()
            best[index] = min(best[index], time.perf_counter() - begin)
    return best


def _row(
    name: str, value: float | None, unit: str, bar: float | None = None, *, at_most: bool = False
) -> dict[str, Any]:
    met = None
    if bar is not None and value is not None:
        met = value <= bar if at_most else value >= bar
    return {"area": "vehicle", "name": name, "value": value, "unit": unit, "bar": bar, "met": met}


if __name__ == "__main__":
    for row in measure():
        print(row)
