"""Is the chance of being above a value the share of places that are?

Fields, water, kernels and surveys are drawn when this runs (``benchmarks.drawn.field`` has the
distributions): both families of fields in each of the four waters, the kernel of another field of
the same family. Places are drawn too, and held against values that the true field exceeds in 10 to
50 % of the water. The sentence of the Map page is judged beside it: how often the true share of the
water lies between the shares that it names.
"""

import math
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtr

from autonomy.arrays import FloatArray
from autonomy.field.config import FieldConfig, KernelParameters
from autonomy.field.learning.level import learn
from autonomy.field.model.model import condition
from autonomy.field.threshold import drawn_fields, share_above
from autonomy.planner.preset import MINIGLIDER
from benchmarks.drawn.field import NOISE, WATERS, Family, Water, World, drawn_world, flown_by_hand
from reproduction.adaptive.scenario import THRESHOLDS_M, VARIABLE
from server.map.task_model import SCORING, domain_points
from server.map.threshold import DRAWS

BAR = 0.1
BINS = 5
PLACES = 1000
EXCEEDED = (0.1, 0.2, 0.3, 0.4, 0.5)
"""Shares of the water in which the true field exceeds the values that are tried."""
_EXACT = 300
_RESAMPLED = 2000
_MEAN = 5.06
_FAMILIES: tuple[Family, ...] = ("lamps", "patches")


@dataclass(frozen=True, slots=True)
class Judged:
    """One survey: of each value and place, the chance and the truth; of each value, the share."""

    chance: FloatArray
    """Shape ``(values, places)``."""
    is_above: FloatArray
    holds: list[bool]
    """Whether the true share lies between those that are told."""


def probability_above(level: float, mean: FloatArray, std: FloatArray) -> FloatArray:
    """Return the probability that a field is above a level, of the shape of ``mean``.

    Args:
        level: In the scale of the model.
        mean: Of the field there.
        std: Above zero.
    """
    return ndtr((mean - level) / std)


def measure() -> list[dict[str, Any]]:
    """Fly and judge eight surveys; takes about a minute of a core."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    seeds = np.random.SeedSequence()
    print(f"field_threshold: seed {seeds.entropy}", flush=True)
    kinds = [(water, family) for water in WATERS for family in _FAMILIES]
    jobs = [(*kind, seed) for kind, seed in zip(kinds, seeds.spawn(len(kinds)), strict=True)]
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(os.cpu_count() or 1, 4), mp_context=spawn) as processes:
        judged = list(processes.map(judge, jobs))
    return rows_of(judged, np.random.default_rng(seeds))


def judge(job: tuple[Water, Family, np.random.SeedSequence]) -> Judged:
    """Learn a kernel in one field, fly a survey in another, and hold its map against the truth."""
    water, family, seed = job
    rng = np.random.default_rng(seed)

    def world() -> World:
        return drawn_world(family, water, "model", rng)

    config = config_of(world(), rng)
    flown = world()
    survey = flown_by_hand(flown, rng)
    model = condition(config, survey.smoothed())
    places = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], (PLACES, 3))
    truth = flown.field(places)
    values = np.quantile(truth, 1.0 - np.array(EXCEEDED))
    mean, variance = model.marginals(places)
    std = np.sqrt(np.maximum(variance, 1e-12))
    coarse = domain_points(MINIGLIDER.domain, SCORING)
    fields = drawn_fields(model.mean(coarse), model.covariance(coarse), DRAWS, rng)
    exact = flown.field(coarse)
    told = [share_above(value, fields) for value in values.tolist()]
    return Judged(
        np.array([probability_above(value, mean, std) for value in values.tolist()]),
        np.array([truth > value for value in values]).astype(float),
        [
            low <= float((exact > value).mean()) <= high
            for (low, high), value in zip(told, values.tolist(), strict=True)
        ],
    )


def config_of(world: World, rng: np.random.Generator) -> FieldConfig:
    """Return the default model with the kernel of a field that is known at random places."""
    points = rng.uniform([0.0, 0.0, 0.0], [2.75, 1.37, 0.65], (_EXACT, 3))
    values = world.field(points) + NOISE * rng.standard_normal(_EXACT) - _MEAN
    near = KernelParameters(signal_variance=0.6, length_x_m=0.8, length_y_m=0.8, length_z_m=0.8)
    known = learn(points, values, (KernelParameters(), near), noise_floor=1e-4).parameters
    return FieldConfig(
        variable=VARIABLE,
        model="position_noise",
        prior_mean=_MEAN,
        single=known,
        fidelity_thresholds_m=THRESHOLDS_M,
    )


def reliability(judged: list[Judged]) -> FloatArray:
    """Return by how much the share of places above exceeds the chance, in each bin of it."""
    chance = np.concatenate([one.chance.ravel() for one in judged])
    above = np.concatenate([one.is_above.ravel() for one in judged])
    into = np.minimum((chance * BINS).astype(int), BINS - 1)
    found = np.full(BINS, math.nan)
    for each in range(BINS):
        mine = into == each
        if mine.any():
            found[each] = above[mine].mean() - chance[mine].mean()
    return found


def rows_of(judged: list[Judged], rng: np.random.Generator) -> list[dict[str, Any]]:
    """Return a row for each bin, and one for the sentence."""
    count = len(judged)
    again = np.array(
        [
            reliability([judged[i] for i in rng.integers(count, size=count)])
            for _ in range(_RESAMPLED)
        ]
    )
    low, high = np.nanquantile(again, (0.025, 0.975), axis=0)
    rows: list[dict[str, Any]] = []
    for each, off in enumerate(reliability(judged).tolist()):
        names = f"chance {each / BINS:.0%} to {(each + 1) / BINS:.0%}"
        between = f"{count} surveys, 95 % interval {low[each]:+.3f} to {high[each]:+.3f}"
        rows.append(row(f"above a value, {names}: share that is, less it", off, between, BAR))
    holds = float(np.mean([one for each in judged for one in each.holds]))
    rows.append(row("true share of the water between those told", holds, "of 90 %", None))
    return rows


def row(name: str, value: float, unit: str, bar: float | None) -> dict[str, Any]:
    met = None if bar is None else bool(abs(value) <= bar)
    return {
        "area": "field_threshold",
        "name": name,
        "value": round(value, 4),
        "unit": unit,
        "bar": bar,
        "met": met,
    }
