"""Learns the maps of a recorded deployment and scores them; runs in a process of its own."""

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.channel import Channel
from autonomy.field.grid import Grid
from autonomy.field.learning.recorded import RecordedFit, fit_recording, recorded_map

TASK = f"{__name__}:run"
"""Name of the task for ``server.base.worker``."""
_SEED = 20190718


@dataclass(frozen=True, slots=True)
class FitProblem:
    """A recording as the fit needs it."""

    points: FloatArray
    """NED, shape ``(n, 3)``, m."""
    values: dict[str, FloatArray]
    """By variable, each of shape ``(n,)``; NaN where a row does not tell."""
    channels: dict[str, Channel]
    """What they are."""


@dataclass(frozen=True, slots=True)
class FittedMap:
    """The map of one variable, ready to be kept."""

    variable: str
    samples: int
    document: dict[str, Any]
    """Configuration, box, axes and scores, as JSON."""
    grid: bytes
    """``mean`` and ``std`` as npz."""


@dataclass(frozen=True, slots=True)
class FitFailure:
    """A variable of which no map could be made."""

    variable: str
    reason: str


def run(
    problem: FitProblem,
    report: Callable[[tuple[float, str]], None],
    is_cancelled: Callable[[], bool],
) -> list[FittedMap | FitFailure]:
    """Fit a map for every variable; progress is a share of the work and what it is at."""
    outcomes: list[FittedMap | FitFailure] = []
    for index, (variable, values) in enumerate(problem.values.items()):
        if is_cancelled():
            break
        channel = problem.channels[variable]
        title = channel.title.lower()
        report((index / len(problem.values), f"Learning the map of {title}"))
        try:
            told = np.isfinite(values)
            outcomes.append(_fitted(channel, problem.points[told], values[told]))
        except ValueError as error:
            outcomes.append(FitFailure(variable, str(error)))
    return outcomes


def _fitted(channel: Channel, points: FloatArray, values: FloatArray) -> FittedMap:
    fit = fit_recording(channel, points, values, np.random.default_rng(_SEED))
    live_map = recorded_map(fit, points, values)
    packed = io.BytesIO()
    np.savez_compressed(
        packed, mean=live_map.mean.astype(np.float32), std=live_map.std.astype(np.float32)
    )
    grid = Grid.over(fit.box, fit.config.grid)
    axes = {"x_m": grid.x_m.tolist(), "y_m": grid.y_m.tolist(), "z_m": grid.z_m.tolist()}
    return FittedMap(
        variable=channel.key,
        samples=sum(live_map.samples_per_level),
        document={
            "config": fit.config.model_dump(mode="json"),
            "box": fit.box.model_dump(mode="json"),
            "axes": axes,
            "scores": scores_document(fit, channel),
        },
        grid=packed.getvalue(),
    )


def scores_document(fit: RecordedFit, channel: Channel) -> dict[str, Any]:
    """Return the hold-out scores of a fit as a document; the error also in the model's scale."""
    return {
        "model": fit.config.model,
        "title": f"{channel.title}, held out",
        "unit": f"log {channel.unit}" if channel.scale == "log" else channel.unit,
        "rmse": fit.scores.rmse * fit.value_std,
        "rmse_in_std": fit.scores.rmse,
        "nlpd": fit.scores.nlpd,
        "wmse": fit.scores.wmse,
        "coverage_90": fit.scores.coverage_90,
        "samples": fit.training,
        "held_out": fit.test,
        "message": fit.message,
    }
