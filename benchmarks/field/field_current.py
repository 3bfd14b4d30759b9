"""Is the default map honest, and the best, in water that moves as nobody was told?

Fields, currents, eddies and seeds are drawn when this runs (``benchmarks.drawn.field`` has the
distributions). Kernels come from a campaign in another field of the same family and in the same
water: single and default model get the kernel of that field, recursive and joint model learn from
its samples. Every model then sees the same samples of the new survey: finished dives smoothed, as
the station keeps them, and besides as the robot located them.
"""

import json
import math
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import FieldConfig, KernelParameters
from autonomy.field.learning.level import learn
from autonomy.field.learning.model import learn_config
from autonomy.field.model.model import condition
from autonomy.field.samples import FieldSamples
from autonomy.field.score import Scores, score
from autonomy.planner.search import kernel
from benchmarks.drawn.field import (
    NOISE,
    WATERS,
    Family,
    Reckoning,
    Water,
    World,
    drawn_world,
    flown_by_hand,
    flown_by_plan,
    with_fixes,
)
from reproduction.adaptive.comparison import MODELS, scoring_points
from reproduction.adaptive.scenario import SCENARIOS, THRESHOLDS_M, VARIABLE

CAMPAIGNS = 3
"""Of each water, family and way of reckoning."""
SURVEYS = 2
"""Of each campaign."""
DEFAULT = "position_noise"
LEAST_SHARE = 0.9
COVERAGE = (0.82, 0.96)
WMSE = (0.6, 1.6)
MEAN = 5.06
"""Prior mean in log counts: that of the tank's preset."""
_EXACT = 300
_RESAMPLED = 2000
_TIE = 0.02
_FAMILIES: tuple[Family, ...] = ("lamps", "patches")
_RECKONINGS: tuple[Reckoning, ...] = ("model", "dead reckoning")


@dataclass(frozen=True, slots=True)
class Campaign:
    """Which surveys to fly, of kernels learned in one other field."""

    water: Water
    family: Family
    reckoning: Reckoning
    seed: np.random.SeedSequence


@dataclass(frozen=True, slots=True)
class Judged:
    """Every model's scores on one survey."""

    water: str
    family: Family
    reckoning: Reckoning
    smoothed: dict[str, Scores]
    filtered: dict[str, Scores]


def measure() -> list[dict[str, Any]]:
    """Fly and judge; takes about five minutes of a core."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    kernel.warm_up()
    seeds = np.random.SeedSequence()
    print(f"field_current: seed {seeds.entropy}", flush=True)
    kinds: list[tuple[Water, Family, Reckoning]] = [
        (water, family, reckoning)
        for water in WATERS
        for family in _FAMILIES
        for reckoning in _RECKONINGS
    ]
    own = iter(seeds.spawn(len(kinds) * CAMPAIGNS))
    jobs = [Campaign(*kind, next(own)) for kind in kinds for _ in range(CAMPAIGNS)]
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(os.cpu_count() or 1, 4), mp_context=spawn) as processes:
        judged = [one for each in processes.map(judge, jobs) for one in each]
    rng = np.random.default_rng(seeds)
    return [
        row
        for water in WATERS
        for row in rows_of(water.name, [one for one in judged if one.water == water.name], rng)
    ]


def judge(campaign: Campaign) -> list[Judged]:
    """Learn in one field, then fly and score surveys in others."""
    rng = np.random.default_rng(campaign.seed)

    def world() -> World:
        return drawn_world(campaign.family, campaign.water, campaign.reckoning, rng)

    filtered, smoothed = kernels_of(world(), rng)
    return [judged_survey(campaign, world(), filtered, smoothed, rng) for _ in range(SURVEYS)]


def judged_survey(
    campaign: Campaign,
    world: World,
    filtered: FieldConfig,
    smoothed: FieldConfig,
    rng: np.random.Generator,
) -> Judged:
    """Fly one survey by one of the thesis's scenarios, drawn too, and score every model."""
    scenario = SCENARIOS[int(rng.integers(len(SCENARIOS)))]
    planned_with = filtered.model_copy(update={"model": scenario.model})
    survey = flown_by_plan(world, planned_with, scenario, rng)
    return Judged(
        campaign.water.name,
        campaign.family,
        campaign.reckoning,
        scored(smoothed, survey.smoothed(), world),
        scored(filtered, with_fixes(survey), world),
    )


def scored(config: FieldConfig, samples: FieldSamples, world: World) -> dict[str, Scores]:
    """Score every model on the same samples."""
    points = scoring_points()
    truth = world.field(points)
    found: dict[str, Scores] = {}
    for model in MODELS:
        given = condition(config.model_copy(update={"model": model}), samples)
        found[model] = score(given.mean(points), given.covariance(points), truth)
    return found


def kernels_of(world: World, rng: np.random.Generator) -> tuple[FieldConfig, FieldConfig]:
    """Return every model's kernels for samples as located, and for samples of smoothed dives."""
    points = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], (_EXACT, 3))
    values = world.field(points) + NOISE * rng.standard_normal(_EXACT) - MEAN
    near = KernelParameters(signal_variance=0.6, length_x_m=0.8, length_y_m=0.8, length_z_m=0.8)
    known = learn(points, values, (KernelParameters(), near), noise_floor=1e-4).parameters
    rare = known.model_copy(update={"signal_variance": 0.05})
    levels = (rare,) * (len(THRESHOLDS_M) + 1)
    told = FieldConfig(
        variable=VARIABLE,
        prior_mean=MEAN,
        single=known,
        levels=levels,
        joint_levels=levels,
        fidelity_thresholds_m=THRESHOLDS_M,
    )
    survey = flown_by_hand(world, rng)

    def learned(samples: FieldSamples) -> FieldConfig:
        config = told
        for model in ("recursive", "joint"):
            tried = config.model_copy(update={"model": model})
            config = learn_config(tried, samples, rng=rng, starts=2).config
        return config

    return learned(survey.samples), learned(survey.smoothed())


def rows_of(
    water: str, judged: Sequence[Judged], rng: np.random.Generator
) -> Iterator[dict[str, Any]]:
    """Judge the default model in one water, and tell how the others did."""
    smoothed = [one.smoothed for one in judged]
    yield from bars(water, smoothed, rng, judged_by_bars=True)
    yield from bars(f"{water}, nothing smoothed", [one.filtered for one in judged], rng)
    for family in _FAMILIES:
        mine = [one.smoothed for one in judged if one.family == family]
        for quantity in ("wmse", "coverage_90"):
            value, low, high = interval(column(mine, DEFAULT, quantity), np.mean, rng)
            yield row(f"{water}, {family}: {quantity} {low:.2f} to {high:.2f}", value, "")
    for reckoning in _RECKONINGS:
        mine = [one.smoothed for one in judged if one.reckoning == reckoning]
        for quantity in ("rmse", "nlpd", "wmse", "coverage_90"):
            means = ", ".join(
                f"{model} {float(np.mean(column(mine, model, quantity))):.3f}" for model in MODELS
            )
            value = float(np.mean(column(mine, DEFAULT, quantity)))
            yield row(f"{water}, by {reckoning}: {quantity} ({means})", value, "")


def bars(
    name: str,
    scores: Sequence[dict[str, Scores]],
    rng: np.random.Generator,
    *,
    judged_by_bars: bool = False,
) -> Iterator[dict[str, Any]]:
    """Yield how often the default model is best, and whether its deviations are right."""
    count = f"{name}, {len(scores)} surveys"
    for quantity, unit in (("rmse", "relative"), ("nlpd", "nats")):
        behind = np.array([behind_best(one, quantity) for one in scores])
        value, low, high = interval(behind <= 0.0, np.mean, rng)
        ties = float(np.mean(behind <= _TIE))
        what = (
            f"{count}: {quantity.upper()} at or below the best other, share {low:.2f} to "
            f"{high:.2f}; within {_TIE:g} {unit} {ties:.2f}"
        )
        met = value >= LEAST_SHARE if judged_by_bars else None
        yield row(what, value, "", LEAST_SHARE if judged_by_bars else None, met)
    for quantity, (least, most) in (("coverage_90", COVERAGE), ("wmse", WMSE)):
        value, low, high = interval(column(scores, DEFAULT, quantity), np.mean, rng)
        what = f"{count}: {quantity}, {low:.2f} to {high:.2f}; bar {least} to {most}"
        met = least <= value <= most if judged_by_bars else None
        yield row(what, value, "", least if judged_by_bars else None, met)


def behind_best(scores: dict[str, Scores], quantity: str) -> float:
    """Return by how much the default is worse than the best other model; RMSE as a share of it."""
    best = min(getattr(one, quantity) for model, one in scores.items() if model != DEFAULT)
    own = getattr(scores[DEFAULT], quantity)
    return own - best if quantity == "nlpd" else own / best - 1.0


def column(scores: Sequence[dict[str, Scores]], model: str, quantity: str) -> FloatArray:
    """Return one number of each survey, shape ``(n,)``."""
    return np.array([getattr(one[model], quantity) for one in scores])


def interval(
    values: Any, statistic: Callable[[Any], Any], rng: np.random.Generator
) -> tuple[float, float, float]:
    """Return a statistic of surveys and its 95 % interval by resampling them."""
    values = np.asarray(values, dtype=np.float64)
    drawn = rng.integers(len(values), size=(_RESAMPLED, len(values)))
    low, high = np.quantile([float(statistic(values[one])) for one in drawn], (0.025, 0.975))
    return float(statistic(values)), float(low), float(high)


def row(
    name: str, value: float, unit: str, bar: float | None = None, met: bool | None = None
) -> dict[str, Any]:
    """Make one line of the report."""
    return {
        "area": "field_current",
        "name": name,
        "value": round(value, 4) if math.isfinite(value) else None,
        "unit": unit,
        "bar": bar,
        "met": met,
    }


if __name__ == "__main__":
    print(json.dumps(measure(), indent=1))
