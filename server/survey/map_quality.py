"""How good the map of a survey is: its uncertainty after a round, its scores at the end."""

import logging
from dataclasses import asdict
from typing import Any

from autonomy.field.config import FieldConfig
from autonomy.planner.config import PlannerConfig
from db.query.fleet.robots import get_robot
from db.query.mission.missions import MissionRecord
from server.base.decision.decisions import Cause
from server.base.foundation import Foundation
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.fleet.fleet import Fleet
from server.map.decided import COMPARED_MODELS
from server.map.field_maps import FieldMaps
from server.map.field_model import MODEL_TITLES
from server.map.group import field_config_of
from server.map.task import Compared, ComparisonProblem
from server.map.view import ScoresView
from server.plan.search.decided import MAP_UNCERTAINTY
from server.plan.search.round_problem import RoundProblems
from server.survey.mission_ledger import MissionLedger

log = logging.getLogger(__name__)


async def map_scores(
    foundation: Foundation,
    problems: RoundProblems,
    workers: WorkerPool,
    robot: str,
    config: PlannerConfig,
    mission: str = "",
) -> list[ScoresView]:
    """Return the scores of every field model, each made of all samples of the robot's water.

    Raises:
        WorkerTaskError: The task raised.
        WorkerEndedError: The process died.
    """
    settings = await foundation.configurations.current("field", robot)
    field = field_config_of(settings, config, foundation.channels.catalogue)
    samples = await problems.samples(robot, config, field)
    record = await foundation.store.query(lambda s: get_robot(s, robot))
    problem = ComparisonProblem(
        field=field,
        domain=config.domain,
        site=record.site,
        samples=samples,
        is_simulated=record.simulated,
        with_maps=False,
    )
    cause = Cause(robot, mission, {"field": settings.id})
    found: Compared = await foundation.decisions.make(COMPARED_MODELS, problem, cause, workers)
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


class SurveyMaps:
    """Judges the maps of surveys. Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        missions: MissionLedger,
        problems: RoundProblems,
        maps: FieldMaps,
        workers: WorkerPool,
    ) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._missions = missions
        self._problems = problems
        self._maps = maps
        self._workers = workers

    async def settle(self, robot: str, quiet_s: float, at_most_s: float) -> None:
        """Wait for the last samples of a round, and bring them into the map."""
        await self._maps.quiet(robot, quiet_s, at_most_s)
        await self._maps.settle(robot)

    async def note_std(self, record: MissionRecord, after_plan: str) -> float | None:
        """Return the map's mean standard deviation after a plan was flown, worked out once.

        It is None where it could not be worked out, which holds up nothing.
        """
        if record.document.get("map_std_after") == after_plan:
            return record.document.get("map_std")
        config = PlannerConfig.model_validate(record.config)
        problem = await self._problems.map(record.robot, config)
        try:
            cause = Cause(record.robot, record.id)
            std: float = await self._foundation.decisions.make(
                MAP_UNCERTAINTY, problem, cause, self._workers
            )
        except WORKER_FAILURES as error:
            log.warning("the map after %s was not judged: %s", after_plan, error)
            return None
        await self._missions.note(record.id, {"map_std": std, "map_std_after": after_plan})
        return std

    async def end(self, record: MissionRecord, config: PlannerConfig, reason: str) -> None:
        """End a survey; where the truth of the field is known, score its maps first.

        Args:
            record: The mission.
            config: Its settings.
            reason: Why it ends, without a full stop.
        """
        status = self._fleet.status(record.robot)
        if not status.record.simulated:
            await self._missions.advance(record.id, "done", f"{reason}.")
            return
        await self._missions.advance(record.id, "scoring", f"{reason}; scoring the map.")
        field = await self._foundation.configurations.current("field", record.robot)
        variable = field.value_as(FieldConfig).variable
        try:
            views = await map_scores(
                self._foundation, self._problems, self._workers, record.robot, config, record.id
            )
        except WORKER_FAILURES as error:
            text = f"{reason}. The map was not scored: {error}"
            await self._missions.advance(record.id, "done", text)
            return
        self._maps.set_scores(record.robot, {(variable, view.model): view for view in views})
        scores: list[dict[str, Any]] = [asdict(view) for view in views]
        text = f"{reason}; the map is scored."
        await self._missions.advance(record.id, "done", text, scores=scores)
