"""Scores the maps of a simulated robot against the field that it measured."""

from collections.abc import Callable

from autonomy.field.scale import to_model
from autonomy.field.score import Scores, score
from autonomy.field.synthetic import truth
from server.service.field_model import MODELS
from server.service.task.problem import ScoreProblem
from server.service.task.survey_map import SCORING, domain_points, map_of


def run(
    problem: ScoreProblem, report: Callable[[str], None], is_cancelled: Callable[[], bool]
) -> dict[str, Scores]:
    """Return the scores of both models, each made of all samples, by the model's key.

    The points of comparison depend on the domain alone, so scores of different runs compare.
    """
    points = domain_points(problem.domain, SCORING)
    exact = to_model(problem.field.resolved_scale(), truth(problem.field.variable, points))
    scores: dict[str, Scores] = {}
    for model in MODELS:
        if is_cancelled():
            break
        report(model)
        config = problem.field.model_copy(update={"model": model})
        prediction = map_of(config, problem.domain, problem.samples).predict(points)
        scores[model] = score(prediction.mean, prediction.covariance, exact)
    return scores
