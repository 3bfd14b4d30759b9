"""Conditions all field models on the same samples, and scores them against what is known.

A simulated field is known everywhere. Else every dive is held out once, whole, and the models made
of the others are scored at its samples: neighbours of a sample on the same dive know it too well.
Where cameras saw the robot, it is scored at the places that they tell: the robot's own may be wrong
by what the map is wrong by.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.field.config import FieldConfig
from autonomy.field.fidelity import fidelity_level
from autonomy.field.grid import grid_of
from autonomy.field.live.live_map import LiveMap
from autonomy.field.mask import water_mask
from autonomy.field.model.model import FieldModel
from autonomy.field.samples import FieldSamples
from autonomy.field.score import Scores, score
from autonomy.field.synthetic import truth
from server.map.field_model import MODEL_TITLES, MODELS
from server.map.task import PLACED_BY_CAMERAS, Against, Compared, ComparedModel, ComparisonProblem
from server.map.task_model import SCORING, domain_points, map_of

FOLDS = 4
"""Parts into which dives are dealt; each is held out once."""
LEAST_DIVE = 3
"""A dive with fewer samples than this is never held out."""
SCORED_MAX = 400
"""Most held-out samples of a part that are scored, evenly spread."""

CARRIED = (
    "Samples were carried along with the water; how unsure that is, "
    f"{MODEL_TITLES['position_noise']} alone counts."
)
"""What a comparison says of a map in moving water."""

Report = Callable[[tuple[float, str]], None]


@dataclass(frozen=True, slots=True, eq=False)
class _Truth:
    """A field that is known."""

    points: FloatArray
    values: FloatArray
    """In the model's scale."""


def run(problem: ComparisonProblem, report: Report, is_cancelled: Callable[[], bool]) -> Compared:
    """Return every model conditioned on all samples, with its scores."""
    against, known, folds, message = _yardstick(problem)
    scored = problem.samples
    if against == PLACED_BY_CAMERAS and problem.places_seen is not None:
        scored = replace(scored, points=problem.places_seen)
    models: list[ComparedModel] = []
    notes = [message] if message else []
    if problem.field.carriage == "water":
        notes.append(CARRIED)
    for number, key in enumerate(MODELS):
        if is_cancelled():
            break
        report((number / len(MODELS), MODEL_TITLES[key]))
        config = problem.field.model_copy(update={"model": key})
        try:
            model = map_of(config, problem.domain, problem.samples).conditioned()
            if known is not None:
                covariance = model.covariance(known.points)
                scores = score(model.mean(known.points), covariance, known.values)
            else:
                scores = _held_out(problem, config, folds, scored, is_cancelled)
        except ValueError as error:
            # Not every model can use every kernel.
            notes.append(f"{MODEL_TITLES[key]} is left out: {error}.")
            continue
        mean, std = _on_grid(problem, model) if problem.with_maps else (None, None)
        models.append(ComparedModel(key, scores, model.log_marginal_likelihood(), mean, std))
    return Compared(tuple(models), against, " ".join(notes), _per_level(problem))


def _yardstick(
    problem: ComparisonProblem,
) -> tuple[Against | None, _Truth | None, list[BoolArray], str]:
    """Return what the models are scored against: the truth, or parts that are held out."""
    known = _truth(problem) if problem.is_simulated else None
    if known is not None:
        return "truth", known, [], ""
    if problem.places_seen is not None:
        is_seen = ~np.isnan(problem.places_seen[:, 0])
        folds = held_out_parts(problem.samples, is_seen)
        if folds:
            return PLACED_BY_CAMERAS, None, folds, ""
    folds = held_out_parts(problem.samples)
    if folds:
        return "held-out samples", None, folds, ""
    message = "There is one dive only; models are scored when there are two to hold apart."
    return None, None, [], message


def _truth(problem: ComparisonProblem) -> _Truth | None:
    """Return the simulated field at the water of the domain, which depends on the site alone."""
    points = domain_points(problem.domain, SCORING)
    points = points[water_mask(problem.site, points)]
    try:
        values = truth(problem.field.variable, points)
    except ValueError:
        return None
    return _Truth(points, problem.field.in_model_scale(values)) if len(points) else None


def held_out_parts(samples: FieldSamples, among: BoolArray | None = None) -> list[BoolArray]:
    """Deal the dives of samples into parts, and mark the samples of each.

    Args:
        samples: All of them.
        among: Samples that can be scored, shape ``(n,)``; without it all can.

    Returns:
        Masks of shape ``(n,)``, at most ``FOLDS``; none where there are not two dives.
    """
    scored = samples.dive if among is None else samples.dive[among]
    numbers, counts = np.unique(scored, return_counts=True)
    dives = numbers[counts >= LEAST_DIVE]
    parts = min(FOLDS, len(dives))
    if parts < 2:
        return []
    return [np.isin(samples.dive, dives[part::parts]) for part in range(parts)]


def _held_out(
    problem: ComparisonProblem,
    config: FieldConfig,
    folds: list[BoolArray],
    scored: FieldSamples,
    is_cancelled: Callable[[], bool],
) -> Scores | None:
    """Return the mean of the scores of all parts, each weighed by its samples.

    ``scored`` are all samples where they are believed to be; those without a place do not count.
    """
    has_place = np.isfinite(scored.points).all(axis=1)
    found: list[tuple[int, Scores]] = []
    for out in folds:
        if is_cancelled():
            return None
        live = map_of(config, problem.domain, problem.samples[~out])
        tested = scored[out & has_place]
        spread = np.linspace(0, len(tested) - 1, min(len(tested), SCORED_MAX)).astype(np.int64)
        found.append((len(spread), _scored(config, live, tested[spread])))
    if not found:
        return None
    weights = np.array([count for count, _ in found], dtype=np.float64)
    weights /= weights.sum()
    parts = [one for _, one in found]
    return Scores(
        rmse=float(np.sqrt(weights @ np.array([one.rmse**2 for one in parts]))),
        nlpd=float(weights @ np.array([one.nlpd for one in parts])),
        wmse=float(weights @ np.array([one.wmse for one in parts])),
        coverage_90=float(weights @ np.array([one.coverage_90 for one in parts])),
    )


def _scored(config: FieldConfig, live: LiveMap, tested: FieldSamples) -> Scores:
    """Score a map at measurements, whose own noise the prediction includes."""
    noise = {
        "recursive": config.levels[-1].noise_variance,
        "joint": config.joint_levels[-1].noise_variance,
    }.get(config.model, config.single.noise_variance)
    prediction = live.predict(tested.points)
    covariance = prediction.covariance + noise * np.eye(len(tested))
    return score(prediction.mean, covariance, config.in_model_scale(tested.values))


def _on_grid(problem: ComparisonProblem, model: FieldModel) -> tuple[FloatArray, FloatArray]:
    grid = grid_of(problem.field, problem.domain, problem.site)
    mean, variance = model.marginals(grid.points)
    return mean, np.sqrt(np.maximum(variance, 0.0))


def _per_level(problem: ComparisonProblem) -> tuple[int, ...]:
    thresholds_m = problem.field.fidelity_thresholds_m
    levels = fidelity_level(problem.samples.position_std_m, thresholds_m)
    return tuple(np.bincount(levels, minlength=len(thresholds_m) + 1).tolist())
