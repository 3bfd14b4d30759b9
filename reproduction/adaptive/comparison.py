"""Every field model on the samples of one survey, scored against the true field."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field import synthetic
from autonomy.field.config import FieldConfig, FieldModelKey, GridShape
from autonomy.field.grid import Grid
from autonomy.field.model.model import condition
from autonomy.field.samples import FieldSamples
from autonomy.field.score import Scores, score
from autonomy.site import TANK
from reproduction.adaptive.scenario import VARIABLE

MODELS: tuple[FieldModelKey, ...] = ("single", "recursive", "joint", "position_noise")
SCORING_GRID = GridShape(x=12, y=7, z=5)
"""Points that stand for the domain in every score: the thesis's X*."""


def scoring_points() -> FloatArray:
    """Return where maps are scored, shape ``(420, 3)``, m."""
    return Grid.over(TANK.domain, SCORING_GRID).points


def scores_of(field: FieldConfig, model: FieldModelKey, samples: FieldSamples) -> Scores:
    """Return how well a model, given samples, agrees with the true field.

    Args:
        field: Every model's kernels.
        model: Which of them to score.
        samples: What it is conditioned on.
    """
    points = scoring_points()
    truth = field.in_model_scale(synthetic.truth(VARIABLE, points))
    given = condition(field.model_copy(update={"model": model}), samples)
    return score(given.mean(points), given.covariance(points), truth)


def mean_scores(scores: list[Scores]) -> Scores:
    """Return the mean of each score."""
    columns = np.array([(s.rmse, s.nlpd, s.wmse, s.coverage_90) for s in scores])
    rmse, nlpd, wmse, coverage = columns.mean(axis=0).tolist()
    return Scores(rmse, nlpd, wmse, coverage)
