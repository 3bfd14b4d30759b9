"""How near the maps of a simulated survey came to the field that it measured."""

from dataclasses import asdict

from autonomy.planner.config import PlannerConfig
from db.query.robots import get_robot
from server.base.foundation import Foundation
from server.base.worker import WorkerPool
from server.map.field_model import MODEL_TITLES
from server.map.group import field_config_of
from server.map.samples import site_samples
from server.map.task import COMPARE_MAPS, Compared, ComparisonProblem
from server.map.view import ScoresView


async def map_scores(
    foundation: Foundation, workers: WorkerPool, robot: str, variable: str, config: PlannerConfig
) -> list[ScoresView]:
    """Return the scores of every field model, each made of all samples of the robot's water.

    Raises:
        WorkerTaskError: The task raised.
        WorkerEndedError: The process died.
    """
    settings = await foundation.configurations.current("field", robot)
    samples = await foundation.store.query(lambda s: site_samples(s, robot, variable))
    record = await foundation.store.query(lambda s: get_robot(s, robot))
    problem = ComparisonProblem(
        field=field_config_of(settings, config),
        domain=config.domain,
        site=record.site,
        samples=samples,
        is_simulated=record.simulated,
        with_maps=False,
    )
    found: Compared = await workers.run(COMPARE_MAPS, problem)
    return [
        ScoresView(
            model=one.model,
            title=MODEL_TITLES[one.model],
            **asdict(one.scores),
            samples=len(samples),
        )
        for one in found.models
        if one.scores is not None
    ]
