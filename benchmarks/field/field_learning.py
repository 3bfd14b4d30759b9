"""Learning kernels beside GPy and Emukit, and how near inducing points come to the exact map."""

import json
import time

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field import synthetic
from autonomy.field.config import FIELD_PRESETS, FieldConfig, KernelParameters
from autonomy.field.learning.level import learn, learn_levels
from autonomy.field.live.inducing_model import InducingGaussianProcess
from autonomy.field.model.model import FieldAboutMean, FieldModel, centred_values, condition
from autonomy.field.model.model_prior import JointPrior, Places
from autonomy.field.samples import FieldSamples
from benchmarks.field.field import at_least, at_most
from benchmarks.field.field_peer import EmukitJoint, gpy_fit
from benchmarks.field.field_speed import alternating_s

AREA = "field_learning"
SAMPLES = 500
REPEATS = 5
START = KernelParameters(
    signal_variance=1.0, length_x_m=1.0, length_y_m=1.0, length_z_m=1.0, noise_variance=0.1
)
TRUE_LEVELS = (
    KernelParameters(
        signal_variance=1.0, length_x_m=0.9, length_y_m=0.9, length_z_m=0.9, noise_variance=0.05
    ),
    KernelParameters(
        signal_variance=0.3, length_x_m=0.5, length_y_m=0.5, length_z_m=0.5, noise_variance=0.02
    ),
    KernelParameters(
        signal_variance=0.1, length_x_m=0.4, length_y_m=0.4, length_z_m=0.4, noise_variance=0.005
    ),
)
NOISE_FLOOR = 1e-9
ITERATIONS = 1000
SAME_NATS = 1e-3
"""Likelihoods that differ by less end in the same optimum."""
GPY_BAR, EMUKIT_BAR = 1.0, 20.0
EXACT_SAMPLES, MANY_SAMPLES = 3000, 100_000


def measure() -> list[dict[str, object]]:
    """Learn one kernel and three levels with the peers, then sum samples up."""
    return [*one_kernel(), *three_levels(), *inducing()]


def one_kernel() -> list[dict[str, object]]:
    """Learn one kernel from the same start as GPy; medians, in turn."""
    rng = np.random.default_rng(0)
    points = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], size=(SAMPLES, 3))
    values = np.log(synthetic.measure("blue_light", points, rng)) - 5.06
    ends: dict[str, float] = {}

    def ours() -> None:
        found = learn(points, values, [START], noise_floor=NOISE_FLOOR, max_iterations=ITERATIONS)
        ends["ours"] = -found.log_likelihood

    def gpy() -> None:
        model = gpy_fit(START, points, values)
        model.optimize(max_iters=ITERATIONS)
        ends["GPy"] = -float(model.log_likelihood())

    ours()  # loads the compiled kernels
    taken = alternating_s({"ours": ours, "GPy": gpy}, REPEATS)
    what = f"learning one kernel, n = {SAMPLES}"
    return [
        at_most(AREA, what, taken["ours"], "s", None),
        at_least(AREA, f"GPy / ours, {what}", taken["GPy"] / taken["ours"], GPY_BAR),
        at_most(
            AREA,
            f"negative log likelihood, ours less GPy's, {what}",
            ends["ours"] - ends["GPy"],
            "nats",
            SAME_NATS,
        ),
    ]


def three_levels() -> list[dict[str, object]]:
    """Learn three levels from the same start as Emukit.

    Emukit of its own accord learns a scale factor at each of the two steps between levels: 17
    hyperparameters, as ours. Then both scale factors are held at 1, and 15 are learned.
    """
    rows: list[dict[str, object]] = []
    for learns_rho, bar in ((True, EMUKIT_BAR), (False, None)):
        taken, ends = raced_on_levels(learns_rho)
        kind = "scale learned" if learns_rho else "scale held"
        what = f"learning three levels, {kind}, n = {SAMPLES}"
        name = f"negative log likelihood, ours less Emukit's, {what}"
        rows += [
            at_most(AREA, what, taken["ours"], "s", None),
            at_least(AREA, f"Emukit / ours, {what}", taken["Emukit"] / taken["ours"], bar),
            at_most(AREA, name, ends["ours"] - ends["Emukit"], "nats", SAME_NATS),
        ]
    return rows


def raced_on_levels(learns_rho: bool) -> tuple[dict[str, float], dict[str, float]]:
    """Return seconds and negative log likelihood of ours and of Emukit's learning."""
    rng = np.random.default_rng(0)
    points = rng.uniform(0.0, 3.0, size=(SAMPLES, 3))
    levels = rng.permutation(np.arange(SAMPLES) % 3)
    prior, places = JointPrior(TRUE_LEVELS), Places.of(points, level=levels)
    K = prior.covariance(places, places) + np.diag(prior.noise(places))
    values = np.linalg.cholesky(K) @ rng.standard_normal(SAMPLES)
    ends: dict[str, float] = {}

    def ours() -> None:
        found = learn_levels(
            points,
            values,
            levels,
            [(START,) * 3],
            noise_floor=NOISE_FLOOR,
            learns_rho=learns_rho,
            max_iterations=ITERATIONS,
        )
        ends["ours"] = -found.log_likelihood

    def emukit() -> None:
        peer = EmukitJoint((START,) * 3, points, values, levels)
        if learns_rho:
            peer.model.multifidelity.scale.unfix()
        peer.model.optimize(max_iters=ITERATIONS)
        ends["Emukit"] = -float(peer.model.log_likelihood())

    before = alternating_s({"ours": ours}, REPEATS)["ours"]
    peer_s = alternating_s({"Emukit": emukit}, 1)["Emukit"]
    after = alternating_s({"ours": ours}, REPEATS)["ours"]
    return {"ours": 0.5 * (before + after), "Emukit": peer_s}, ends


def inducing() -> list[dict[str, object]]:
    """Measure the error of inducing points: to the exact map, and to the truth at 100,000."""
    config = FIELD_PRESETS["blue_light"].model_copy(update={"model": "single"})
    rng = np.random.default_rng(1)
    targets = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], size=(2000, 3))
    few = drawn(EXACT_SAMPLES, rng)
    exact_mean, exact_variance = condition(config, few).marginals(targets)
    mean, variance = summed(config, few).marginals(targets)
    what = f"{config.inducing_points} inducing points"
    apart = float(np.sqrt(np.mean((mean - exact_mean) ** 2 / exact_variance)))
    wider = float(np.sqrt(np.mean(variance / exact_variance)))
    at = f"n = {EXACT_SAMPLES:,}, {what}"
    many = drawn(MANY_SAMPLES, rng)
    start = time.perf_counter()
    model = summed(config, many)
    taken = time.perf_counter() - start
    error = np.log(synthetic.truth("blue_light", targets)) - model.mean(targets)
    rmse = float(np.sqrt(np.mean(error**2)))
    exact_rmse = truth_rmse(targets, exact_mean)
    return [
        at_most(AREA, f"root mean square distance to the exact map, {at}", apart, "sd", None),
        at_most(AREA, f"standard deviation to the exact one's, {at}", wider, "x", None),
        at_most(AREA, f"exact map's error, n = {EXACT_SAMPLES:,}", exact_rmse, "log", None),
        at_most(AREA, f"error, {at}", truth_rmse(targets, mean), "log", None),
        at_most(AREA, f"error, n = {MANY_SAMPLES:,}, {what}", rmse, "log", exact_rmse),
        at_most(AREA, f"time to sum up {MANY_SAMPLES:,} samples", taken, "s", None),
    ]


def summed(config: FieldConfig, samples: FieldSamples) -> FieldModel:
    """Sum samples up at inducing points."""
    model = InducingGaussianProcess(config, samples, centred_values(config, samples))
    return FieldAboutMean(config, model)


def drawn(count: int, rng: np.random.Generator) -> FieldSamples:
    """Draw exactly located samples in the tank."""
    points = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], size=(count, 3))
    return FieldSamples.of(points, synthetic.measure("blue_light", points, rng), np.zeros(count))


def truth_rmse(targets: FloatArray, mean: FloatArray) -> float:
    """Root mean square error against the true field, in the logarithmic scale."""
    error = np.log(synthetic.truth("blue_light", targets)) - mean
    return float(np.sqrt(np.mean(error**2)))


if __name__ == "__main__":
    print(json.dumps(measure(), indent=1))
