"""How near the maps of a simulated survey came to the field that it measured."""

from dataclasses import asdict

from autonomy.field.score import Scores
from autonomy.planner.config import PlannerConfig
from server.foundation import Foundation
from server.service.field_model import MODEL_TITLES
from server.service.map_samples import site_samples
from server.service.round_problem import field_config_of
from server.service.task.problem import SCORE_SURVEY, ScoreProblem
from server.service.view.mission import ScoresView
from server.service.worker import WorkerPool


async def map_scores(
    foundation: Foundation, workers: WorkerPool, robot: str, variable: str, config: PlannerConfig
) -> list[ScoresView]:
    """Return the scores of the maps of both models, each made of every sample of the robot.

    Raises:
        WorkerTaskError: The task raised.
        WorkerEndedError: The process died.
    """
    found = await foundation.configurations.current("field", robot)
    samples = await foundation.store.query(lambda s: site_samples(s, robot, variable))
    problem = ScoreProblem(field_config_of(found, config), config.domain, samples)
    scores: dict[str, Scores] = await workers.run(SCORE_SURVEY, problem)
    return [
        ScoresView(model=model, title=MODEL_TITLES[model], **asdict(one), samples=len(samples))
        for model, one in scores.items()
    ]
