"""Quality of the default field model on simulated adaptive surveys, beside Emukit and the thesis's.

24 surveys at each drift: four scenarios, six trials. Every model sees the same samples. The single
model and ours are given the kernel of the true field; recursive and joint model learn from one
manual survey at each drift. Emukit runs twice: with the kernels that our learning found, and with
those that its own found from the same survey; the better one counts.
"""

import json
import math
import multiprocessing
import os
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field import synthetic
from autonomy.field.config import FieldConfig, KernelParameters
from autonomy.field.fidelity import fidelity_level
from autonomy.field.model.model import centred_values, condition
from autonomy.field.samples import FieldSamples
from autonomy.field.score import Scores, score
from autonomy.planner.search import kernel
from reproduction.adaptive.comparison import MODELS, mean_scores, scores_of, scoring_points
from reproduction.adaptive.manual import manual_survey
from reproduction.adaptive.scenario import SCENARIOS, VARIABLE, planner_config
from reproduction.adaptive.trial import TRIALS, Models, Trial, fly_trial, models_at, trials_at

DRIFTS = (0.01, 0.015, 0.02, 0.03)
SEED = 2
DEFAULT = "position_noise"
COVERAGE = (0.80, 0.97)
EMUKIT = ("Emukit's joint, our kernels", "Emukit's joint, its own kernels")
_EMUKIT_STEPS = 150
_GPY_JITTER = 1e-8
"""GPy adds this to every noise variance."""


@dataclass(frozen=True, slots=True)
class Judged:
    """One survey: every model's scores on its samples, and on the same samples smoothed."""

    drift: float
    filtered: dict[str, Scores]
    smoothed: dict[str, Scores]
    emukit_difference: float
    """Between Emukit's joint model and ours with the same kernels, mean or variance."""


def measure() -> list[dict[str, Any]]:
    """Fly and judge the surveys on every core; takes about two minutes on two."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    kernel.warm_up()
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(os.cpu_count() or 1, 4), mp_context=spawn) as processes:
        models = dict(zip(DRIFTS, processes.map(models_of, DRIFTS), strict=True))
        jobs = [
            (trial, *models[drift]) for drift in DRIFTS for trial in trials_at(drift, TRIALS, SEED)
        ]
        judged = list(processes.map(judge, jobs, chunksize=2))
    rows: list[dict[str, Any]] = []
    for drift in DRIFTS:
        rows += rows_of(drift, [each for each in judged if each.drift == drift])
    difference = max(each.emukit_difference for each in judged)
    rows.append(
        row("Emukit's joint model and ours, same kernels: difference", difference, "", 1e-6)
    )
    return rows


def models_of(drift: float) -> tuple[Models, tuple[KernelParameters, ...]]:
    """Return every model's kernels at a drift, and those that Emukit learns for its joint model."""
    models = models_at(drift, SEED)
    rng = np.random.default_rng([SEED, round(1e6 * drift)])
    survey = manual_survey(planner_config(SCENARIOS[0], drift), drift, rng)
    return models, emukit_kernels(models.filtered, survey.samples)


def judge(job: tuple[Trial, Models, tuple[KernelParameters, ...]]) -> Judged:
    """Fly one survey and score every model on it."""
    trial, models, own_kernels = job
    survey = fly_trial(trial, models)
    samples, smoothed = survey.samples, survey.smoothed()
    filtered = {model: scores_of(models.filtered, model, samples) for model in MODELS}
    points = scoring_points()
    truth = models.filtered.in_model_scale(synthetic.truth(VARIABLE, points))
    difference = math.nan
    for name, levels in zip(EMUKIT, (models.filtered.joint_levels, own_kernels), strict=True):
        mean, variance = emukit_prediction(models.filtered, levels, samples, points)
        filtered[name] = score(mean, np.diag(variance), truth)
        if levels is models.filtered.joint_levels:
            ours = condition(models.filtered.model_copy(update={"model": "joint"}), samples)
            our_mean, our_variance = ours.marginals(points)
            difference = float(
                max(np.abs(mean - our_mean).max(), np.abs(variance - our_variance).max())
            )
    return Judged(
        trial.drift_m_sqrt_s,
        filtered,
        {model: scores_of(models.smoothed, model, smoothed) for model in MODELS},
        difference,
    )


def rows_of(drift: float, judged: list[Judged]) -> Iterator[dict[str, Any]]:
    """Hold the default model against the others at one drift, and tell what smoothing brings."""
    count = f"{len(judged)} surveys, drift {drift:g}"
    filtered = {
        name: mean_scores([each.filtered[name] for each in judged]) for name in judged[0].filtered
    }
    smoothed = {
        name: mean_scores([each.smoothed[name] for each in judged]) for name in judged[0].smoothed
    }
    ours = filtered[DEFAULT]
    others = {name: scores for name, scores in filtered.items() if name != DEFAULT}
    for quantity, unit in (("nlpd", "nats"), ("rmse", "")):
        best = min(others, key=lambda name: getattr(others[name], quantity))
        bar = getattr(others[best], quantity)
        name = f"{count}: {quantity.upper()} of the default model; bar: {best}"
        yield row(name, getattr(ours, quantity), unit, bar)
    low, high = COVERAGE
    covered = low <= ours.coverage_90 <= high
    name = f"{count}: 90 % coverage of the default model, {low} to {high}"
    yield row(name, ours.coverage_90, "", low, covered)
    for name, scores in others.items():
        if name == EMUKIT[0]:
            continue  # the same numbers as our joint model's
        yield row(f"{count}: RMSE, {name}", scores.rmse, "", None)
        yield row(f"{count}: NLPD, {name}", scores.nlpd, "nats", None)
        yield row(f"{count}: 90 % coverage, {name}", scores.coverage_90, "", None)
    for name in MODELS:
        better, plain = smoothed[name], filtered[name]
        bar = 1.0 if name == DEFAULT else None
        yield row(f"{count}: RMSE smoothed / not, {name}", better.rmse / plain.rmse, "x", bar)
        yield row(f"{count}: NLPD smoothed, {name}", better.nlpd, "nats", None)


def emukit_model(
    config: FieldConfig, levels: tuple[KernelParameters, ...], samples: FieldSamples
) -> Any:
    """Make Emukit's auto-regressive model with given kernels and rho = 1."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import GPy
        from emukit.multi_fidelity.kernels import LinearMultiFidelityKernel
        from emukit.multi_fidelity.models import GPyLinearMultiFidelityModel

        fidelity = fidelity_level(samples.position_std_m, config.fidelity_thresholds_m)
        kernels = [
            GPy.kern.Matern32(3, level.signal_variance, level.length_scales_m(), ARD=True)
            for level in levels
        ]
        model = GPyLinearMultiFidelityModel(
            np.column_stack([samples.points, fidelity]),
            centred_values(config, samples)[:, None],
            LinearMultiFidelityKernel(kernels),
            n_fidelities=len(levels),
        )
        model.multifidelity.scale.fix(1.0)
        for level, parameters in enumerate(levels):
            noise(model, level)[:] = parameters.noise_variance - _GPY_JITTER
        return model


def noise(model: Any, level: int) -> Any:
    """Return the noise variance of one of Emukit's levels."""
    name = f"Gaussian_noise_{level}" if level else "Gaussian_noise"
    return model.mixed_noise[f".*{name}.variance"]


def emukit_prediction(
    config: FieldConfig,
    levels: tuple[KernelParameters, ...],
    samples: FieldSamples,
    points: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return Emukit's mean and variance of the field at points, best level."""
    model = emukit_model(config, levels, samples)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        at_top = np.column_stack([points, np.full(len(points), len(levels) - 1)])
        mean, variance = model.predict_noiseless(at_top)
    return mean[:, 0], variance[:, 0]


def emukit_kernels(config: FieldConfig, samples: FieldSamples) -> tuple[KernelParameters, ...]:
    """Let Emukit learn its kernels from samples, from the kernel of the true field on."""
    starts = tuple(
        config.single.model_copy(update={"signal_variance": variance, "noise_variance": 0.01})
        for variance in (1.0, 1.0, 0.1)
    )
    model = emukit_model(config, starts, samples)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.optimize(max_iters=_EMUKIT_STEPS)
    learned: list[KernelParameters] = []
    for level, kernel_ in enumerate(model.multifidelity.kernels):
        length_x, length_y, length_z = kernel_.lengthscale.values.tolist()
        learned.append(
            KernelParameters(
                signal_variance=min(max(float(kernel_.variance[0]), 1e-9), 1e6),
                length_x_m=min(length_x, 1e6),
                length_y_m=min(length_y, 1e6),
                length_z_m=min(length_z, 1e6),
                noise_variance=max(float(noise(model, level)[0]), 1e-6),
            )
        )
    return tuple(learned)


def row(
    name: str, value: float, unit: str, bar: float | None, met: bool | None = None
) -> dict[str, Any]:
    """Make one line of the report; without ``met`` the value must not exceed the bar."""
    if met is None and bar is not None:
        met = value <= bar
    return {
        "area": "field_quality",
        "name": name,
        "value": round(value, 9) if abs(value) < 1e-3 else round(value, 4),
        "unit": unit,
        "bar": bar if bar is None else round(bar, 6),
        "met": met,
    }


if __name__ == "__main__":
    print(json.dumps(measure(), indent=1))
