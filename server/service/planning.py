"""Making plans: a search in a worker process, or legs that an operator laid out."""

import asyncio
import logging
import math
from collections.abc import Mapping, Sequence
from typing import Any

from autonomy.field.config import FieldConfig
from autonomy.planner.approach import approach, approach_energy
from autonomy.planner.config import PlannerConfig
from autonomy.planner.outcome import least_energy
from autonomy.planner.plan import Candidate, ObjectivePoint, PlanResult, PlanStatus
from autonomy.site import Box
from db.fault import StoreUnavailableError
from db.query.plans import PlanRecord, PlanStateError
from db.query.samples import SampleColumns, sample_columns
from server.configuration import CurrentConfiguration
from server.foundation import Foundation
from server.problem import FieldError, Problem, conflict, unprocessable
from server.service.drafting import broken_limits, draft_of, outdated_by
from server.service.fleet import Fleet
from server.service.picture import Picture
from server.service.plan_document import Draft, draft_document, mission_of, search_document
from server.service.plan_ledger import PlanLedger
from server.service.primitive_legs import LegRequest, candidate_of, legs_from
from server.service.task.problem import PLAN_SURVEY, MapSamples, SurveyProblem
from server.service.turn import Work, until_stored
from server.service.view.plan import ProgressView, ViolationView
from server.service.worker import WORKER_FAILURES, WorkerPool

log = logging.getLogger(__name__)


class Planning:
    """Plans that are being made. Belongs to one event loop."""

    def __init__(
        self, foundation: Foundation, fleet: Fleet, ledger: PlanLedger, workers: WorkerPool
    ) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._ledger = ledger
        self._workers = workers
        self._tasks: dict[str, asyncio.Task[None]] = {}

    async def resume(self) -> None:
        """Close the plans that were being made when the station stopped."""
        for picture in list(self._fleet.pictures):
            for plan in await self._ledger.of_robot(picture.record.id, ("planning",)):
                message = "The station stopped while it planned; plan again."
                await self._fail(plan.id, message, {"interrupted": True})

    async def stop(self) -> None:
        """Stop searching; the plans are closed when the station starts again."""
        tasks = list(self._tasks.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def configure(
        self, robot: str, patch: Mapping[str, Any], *, by: str
    ) -> tuple[str, PlannerConfig]:
        """Return the planner's settings for a robot with a patch on top, as a kept version.

        Settings that differ from the version that holds become the new one: a plan cites them.

        Raises:
            Problem: 404 for an unknown robot, 409 for one that flies no plans, 422 with the path
                of each wrong field below ``config``, 503 while storage fails.
        """
        picture = self._fleet.picture(robot)
        if picture.record.system_id is None:
            raise conflict(f"{robot} is a recording; it flies no plans.")
        self._refuse_while_storage_fails()
        book = self._foundation.configurations
        holds = await book.current("planner", robot)
        try:
            wanted = await book.merged("planner", robot, patch)
        except Problem as problem:
            raise _below_config(problem) from problem
        config = wanted.value_as(PlannerConfig)
        _check_domain(config.domain, picture)
        if holds.id is None or config != holds.value:
            holds = await book.patch("planner", robot, patch, by=by)
        if holds.id is None:
            raise TypeError("a kept version has an id")
        return holds.id, config

    def check_start(self, robot: str, config: PlannerConfig) -> tuple[float, float]:
        """Return where a plan would begin: the robot's place at the surface.

        Raises:
            Problem: 409 if the position is not known, or the swim to the domain is too long.
        """
        north_m, east_m, _ = self._position(robot)
        first = approach(config, (north_m, east_m))
        longest = config.mission.approach_share * config.round_budget
        if first is not None and approach_energy(config, first) > longest:
            away_m = math.dist(first.start_ned, first.end_ned)
            raise conflict(
                f"{robot} is {away_m:.2f} m outside the domain; "
                "bring it there, or choose a domain that it is in."
            )
        return north_m, east_m

    def least_energy(self, robot: str, config: PlannerConfig) -> float:
        """Return the least energy of a further round: back into the domain, and one primitive."""
        north_m, east_m, _ = self._position(robot)
        first = approach(config, (north_m, east_m))
        return least_energy(config) + approach_energy(config, first)

    async def plan_survey(
        self,
        robot: str,
        config: PlannerConfig,
        config_id: str,
        *,
        by: str,
        mission: str | None = None,
        round_number: int = 1,
        budget: float | None = None,
    ) -> PlanRecord:
        """Begin to plan one round of a survey; the plan becomes a draft or fails by itself.

        Raises:
            Problem: 409 if the robot's position is not known or outside of the domain, 503 while
                storage fails.
            StoreUnavailableError: Nothing was begun.
        """
        self._refuse_while_storage_fails()
        start_xy = self.check_start(robot, config)
        plan = await self._ledger.add(
            robot,
            "adaptive_survey",
            config=config.model_dump(mode="json"),
            config_id=config_id,
            by=by,
            mission=mission,
            round_number=round_number,
        )
        work = self._search(plan, config, start_xy, budget or config.round_budget)
        self._begin(plan.id, work)
        return plan

    async def plan_primitives(
        self,
        robot: str,
        config: PlannerConfig,
        config_id: str,
        legs: Sequence[LegRequest],
        *,
        by: str,
    ) -> PlanRecord:
        """Make a draft of legs that an operator laid out.

        Raises:
            Problem: 409 if the robot's position is not known, 422 if a leg cannot be a leg.
            StoreUnavailableError: Nothing was kept.
        """
        self._refuse_while_storage_fails()
        start = self._position(robot)
        flown = legs_from(config, (start[0], start[1]), legs)
        draft = await self._draft(robot, config, candidate_of(config, flown))
        plan = await self._ledger.add(
            robot, "primitives", config=config.model_dump(mode="json"), config_id=config_id, by=by
        )
        try:
            return await self._ledger.move(
                plan.id,
                "draft",
                f"{plan.id} for {robot} is a draft.",
                only_from=("planning",),
                sha256=draft.mission.sha256(),
                document=draft_document(draft),
            )
        except StoreUnavailableError:
            self._begin(plan.id, self._settle(plan.id, lambda: self._interrupted(plan.id)))
            raise

    async def cancel(self, plan: str) -> PlanRecord:
        """Stop planning, or throw a draft away.

        Raises:
            UnknownIdError: If there is no such plan.
            Problem: 409 once the plan has left the station.
        """
        record = await self._ledger.get(plan)
        try:
            cancelled = await self._ledger.move(
                plan,
                "cancelled",
                f"{plan} was cancelled.",
                only_from=("planning", "draft"),
                document={"message": "It was cancelled before it left the station."},
            )
        except PlanStateError as error:
            raise conflict(
                f"{error} Only a plan that has not left the station can be cancelled; "
                f"surface {record.robot} to end one that it flies."
            ) from error
        task = self._tasks.get(plan)
        if task is not None:
            task.cancel()
            await asyncio.wait([task])
        return cancelled

    async def check(self, plan: str) -> list[ViolationView]:
        """Check a draft again: against its limits, and whether it still fits the robot.

        Raises:
            UnknownIdError: If there is no such plan.
        """
        record = await self._ledger.get(plan)
        picture = self._fleet.picture(record.robot)
        config = PlannerConfig.model_validate(record.config)
        if "settings" not in record.document:
            return [ViolationView("legs", "The plan has no legs.")]
        mission, vehicle = mission_of(record), self._fleet.vehicle(record.robot)
        limits = broken_limits(picture, vehicle, config, mission.settings, mission.legs)
        return [*limits, *outdated_by(picture, record, self._foundation.clock.now())]

    def _begin(self, plan: str, work: Any) -> None:  # noqa: ANN401 - a coroutine
        task = self._foundation.background.start(f"planning {plan}", work)
        self._tasks[plan] = task
        task.add_done_callback(lambda _: self._tasks.pop(plan, None))

    async def _search(
        self, plan: PlanRecord, config: PlannerConfig, start_xy: tuple[float, float], budget: float
    ) -> None:
        """Search, then settle the plan as soon as storage takes it."""
        try:
            result = await self._result(plan, config, start_xy, budget)
        except WORKER_FAILURES as error:
            log.warning("%s was not planned: %s", plan.id, error)
            message = f"{error} Plan again."
            await self._settle(plan.id, lambda: self._fail(plan.id, message))
        except StoreUnavailableError as error:
            log.warning("%s was not planned: %s", plan.id, error)
            await self._settle(plan.id, lambda: self._interrupted(plan.id))
        else:
            await self._settle(plan.id, lambda: self._finish(plan, config, result))

    async def _result(
        self, plan: PlanRecord, config: PlannerConfig, start_xy: tuple[float, float], budget: float
    ) -> PlanResult:
        problem = SurveyProblem(
            planner=config,
            field=await self._field_config(plan.robot, config),
            samples=await self._samples(plan.robot),
            start_xy=start_xy,
            budget=budget,
            round_number=plan.round,
        )
        self._ledger.set_progress(plan, ProgressView(0.0, config.planning_time_s, None, 0))
        return await self._workers.run(
            PLAN_SURVEY,
            problem,
            on_progress=lambda point: self._ledger.set_progress(
                plan, _progress(point, config.planning_time_s)
            ),
        )

    async def _settle(self, plan: str, step: Work) -> None:
        """Take the last step of planning; someone else may have ended the plan meanwhile."""
        try:
            await until_stored(f"the end of planning {plan}", step)
        except PlanStateError as error:
            log.info("%s needs no end of planning: %s", plan, error)

    async def _finish(self, plan: PlanRecord, config: PlannerConfig, result: PlanResult) -> None:
        found = search_document(
            config.objective, result.message, result.best, result.runners_up, result.history
        )
        if result.best is None or result.status is PlanStatus.NOTHING_FEASIBLE:
            await self._fail(plan.id, result.message, found)
            return
        draft = await self._draft(plan.robot, config, result.best)
        await self._ledger.move(
            plan.id,
            "draft",
            f"{plan.id} for {plan.robot} is a draft: {result.message}",
            only_from=("planning",),
            sha256=draft.mission.sha256(),
            document=found | draft_document(draft),
        )

    async def _fail(
        self, plan: str, message: str, document: Mapping[str, Any] | None = None
    ) -> None:
        await self._ledger.move(
            plan,
            "failed",
            f"{plan} was not made: {message}",
            only_from=("planning",),
            document={**(document or {}), "message": message},
        )

    async def _interrupted(self, plan: str) -> None:
        message = "The station's storage failed while it planned; plan again."
        await self._fail(plan, message, {"interrupted": True})

    async def _draft(self, robot: str, config: PlannerConfig, best: Candidate) -> Draft:
        trim = await self._foundation.configurations.current("trim", robot)
        vehicle = self._fleet.vehicle(robot)
        return draft_of(self._fleet.picture(robot), vehicle, config, trim, best)

    async def _field_config(self, robot: str, planner: PlannerConfig) -> FieldConfig:
        found = await self._foundation.configurations.current("field", robot)
        return field_config_of(found, planner)

    async def _samples(self, robot: str) -> MapSamples:
        variable = self._fleet.picture(robot).record.site.variable
        columns = await self._foundation.store.query(
            lambda session: sample_columns(session, robot, variable)
        )
        return map_samples(columns)

    def _position(self, robot: str) -> tuple[float, float, float]:
        state = self._fleet.picture(robot).state
        if state is None:
            raise conflict(
                f"{robot} has not said where it is yet; plan when its first report has come."
            )
        return state.position_ned

    def _refuse_while_storage_fails(self) -> None:
        fault = self._foundation.store.fault
        if fault is not None:
            raise Problem(
                503,
                f"{fault} The station accepts no plans until its storage works again.",
                headers={"Retry-After": "5"},
            )


def field_config_of(found: CurrentConfiguration, planner: PlannerConfig) -> FieldConfig:
    """Return a field's settings with the planner's fidelity thresholds, where they fit."""
    value = found.value_as(FieldConfig)
    thresholds_m = planner.fidelity_thresholds_m
    if len(thresholds_m) != len(value.fidelity_thresholds_m):
        return value
    return value.with_thresholds(thresholds_m)


def map_samples(columns: SampleColumns) -> MapSamples:
    """Return stored samples as they cross to a worker."""
    return MapSamples(columns.position_ned, columns.value, columns.position_std_m)


def _check_domain(domain: Box, picture: Picture) -> None:
    site = picture.record.site
    if domain.is_inside(site.water):
        return
    water = site.water
    message = (
        f"the domain leaves the water of {site.name} ({water.x_min_m:g} to {water.x_max_m:g} m "
        f"north, {water.y_min_m:g} to {water.y_max_m:g} m east, {water.depth_max_m:g} m deep)"
    )
    raise unprocessable("1 field is wrong.", [FieldError(loc=["config", "domain"], msg=message)])


def _below_config(problem: Problem) -> Problem:
    """Return a refusal of settings with paths from the top of the request."""
    if problem.errors is None:
        return problem
    errors = [FieldError(loc=["config", *error.loc], msg=error.msg) for error in problem.errors]
    return Problem(problem.status, problem.detail, errors=errors, headers=problem.headers)


def _progress(point: ObjectivePoint, limit_s: float) -> ProgressView:
    return ProgressView(
        elapsed_s=point.elapsed_s,
        seconds_left=max(0.0, limit_s - point.elapsed_s),
        objective=point.objective,
        candidates=point.candidates,
    )
