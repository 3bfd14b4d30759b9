"""Exact field models beside scikit-learn, GPy and Emukit: agreement, and time to fit and predict.

Both sides run on one thread, in turn, each on the same problem in the same process.
"""

import json
import statistics
import time
from collections.abc import Callable

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import KernelParameters
from autonomy.field.model.gaussian_process import GaussianProcess
from autonomy.field.model.joint import JointGaussianProcess
from benchmarks.field.field import at_least, at_most
from benchmarks.field.field_peer import EmukitJoint, gpy_fit, scikit_learn_fit

AREA = "field_speed"
KERNEL = KernelParameters()
LEVELS = (
    KERNEL.model_copy(update={"noise_variance": 0.02}),
    KERNEL.model_copy(update={"signal_variance": 0.4, "length_x_m": 0.8, "noise_variance": 0.01}),
    KERNEL.model_copy(update={"signal_variance": 0.1, "length_z_m": 0.4}),
)
SIZES = ((100, 9), (500, 7), (1100, 5), (3000, 3))
"""Samples, and times that each is measured."""
TARGETS = (5_000, 20_000)
AGREEMENT_BAR = 1e-7
LARGEST = (3000, 20_000)
LARGEST_BAR, OTHER_BAR = 2.0, 1.0
GPY_MOST_SAMPLES = 1100
"""GPy takes too long for a bench beyond."""

Action = Callable[[], object]


def measure() -> list[dict[str, object]]:
    """Compare values, then times; every time is a median."""
    return [*agreement(), *speed()]


def agreement() -> list[dict[str, object]]:
    """Largest differences of mean and variance at fixed hyperparameters."""
    points, values, targets = problem(500, 2000)
    ours = GaussianProcess(KERNEL, points, values).marginals(targets)
    mean, std = scikit_learn_fit(KERNEL, points, values).predict(targets, return_std=True)
    rows = differences("single model and scikit-learn", ours, (mean, std**2))
    levels = np.arange(len(points)) % 3
    joint = JointGaussianProcess(LEVELS, points, values, levels).marginals(targets)
    emukit = EmukitJoint(LEVELS, points, values, levels).marginals(targets)
    return [*rows, *differences("joint model and Emukit", joint, emukit)]


def differences(
    name: str, ours: tuple[FloatArray, FloatArray], theirs: tuple[FloatArray, FloatArray]
) -> list[dict[str, object]]:
    """Make the lines of one comparison."""
    return [
        at_most(
            AREA,
            f"largest difference of the {what}: {name}",
            float(np.abs(a - b).max()),
            "",
            AGREEMENT_BAR,
        )
        for what, a, b in zip(("mean", "variance"), ours, theirs, strict=True)
    ]


def speed() -> list[dict[str, object]]:
    """Time to fit and to predict mean and variance, in ratios to the peers."""
    rows: list[dict[str, object]] = []
    for samples, times in SIZES:
        for count in TARGETS:
            points, values, targets = problem(samples, count)
            actions = actions_of(points, values, targets)
            if samples > GPY_MOST_SAMPLES:
                del actions["GPy"]
            taken = alternating_s(actions, times)
            what = f"n = {samples:,}, q = {count:,}"
            bar = LARGEST_BAR if (samples, count) == LARGEST else OTHER_BAR
            own = taken.pop("ours")
            rows.append(at_most(AREA, f"fit, mean and variance, {what}", own, "s", None))
            for peer, seconds in taken.items():
                ratio_bar = bar if peer == "scikit-learn" else None
                rows.append(at_least(AREA, f"{peer} / ours, {what}", seconds / own, ratio_bar))
    return rows


def actions_of(points: FloatArray, values: FloatArray, targets: FloatArray) -> dict[str, Action]:
    """Return what is timed: fit, mean and variance."""
    return {
        "ours": lambda: GaussianProcess(KERNEL, points, values).marginals(targets),
        "scikit-learn": lambda: scikit_learn_fit(KERNEL, points, values).predict(
            targets, return_std=True
        ),
        "GPy": lambda: gpy_fit(KERNEL, points, values).predict_noiseless(targets),
    }


def alternating_s(actions: dict[str, Action], times: int) -> dict[str, float]:
    """Median time of each action, all of them in turn again and again."""
    taken: dict[str, list[float]] = {name: [] for name in actions}
    for _ in range(times):
        for name, action in actions.items():
            start = time.perf_counter()
            action()
            taken[name].append(time.perf_counter() - start)
    return {name: statistics.median(seconds) for name, seconds in taken.items()}


def problem(samples: int, targets: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Draw a smooth field with noise in the tank's domain."""
    rng = np.random.default_rng(0)
    high = [2.75, 1.37, 0.65]
    points = rng.uniform([0.0, 0.0, 0.0], high, size=(samples, 3))
    values = np.sin(2.0 * points.sum(axis=1)) + 0.05 * rng.standard_normal(samples)
    return points, values, rng.uniform([0.0, 0.0, 0.0], high, size=(targets, 3))


if __name__ == "__main__":
    print(json.dumps(measure(), indent=1))
