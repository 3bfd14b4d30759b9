"""Making plans: a search in a worker process, or legs that an operator laid out.

Whatever is found is flown ahead by a model of the robot before it is offered, and only then a draft
(``draft_keeper``).
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Coroutine, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, Final

from autonomy.planner.config import PlannerConfig
from autonomy.planner.plan import Candidate, Leg, ObjectivePoint, PlanResult, PlanStatus
from autonomy.tracking.config import TrackingConfig
from autonomy.warm_up import search_step
from db.fault import StoreUnavailableError
from db.query.mission.plans import PlanRecord, PlanStateError
from robot_link.surfacing_order import SurfacingOrder
from server.base.decision.decisions import Cause
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, conflict, unprocessable
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.fleet.fleet import Fleet
from server.fleet.status import FOLLOW_TARGET
from server.plan.ahead import remaining_s
from server.plan.battery import PlanBattery, battery_violations
from server.plan.chance import with_margin
from server.plan.document import (
    dry_run_view,
    mission_of,
    search_document,
)
from server.plan.draft_keeper import DraftKeeper
from server.plan.drafting import (
    broken_limits,
    broken_off,
    outdated_by,
)
from server.plan.dry_run import DryRuns
from server.plan.flow import PlanFlows, PlannedCurrent
from server.plan.ledger import PlanLedger
from server.plan.machine_code import MachineCode
from server.plan.margin_search import Tried, safest
from server.plan.primitive_legs import LegRequest, candidate_of, legs_from
from server.plan.search.decided import SURVEY_ROUND
from server.plan.search.request import SearchRequest, request_of_plan
from server.plan.search.round_problem import RoundProblems
from server.plan.search.survey_round import NOTHING_FEASIBLE
from server.plan.settings import PlanSettings
from server.plan.state import PlanChanged, PlanEvidence
from server.plan.target_check import target_violations
from server.plan.view import DryRunView, ProgressView, ViolationView

log = logging.getLogger(__name__)

TAKEN_UP_MAX: Final = 2
"""So often a plan is taken up again; one that is interrupted more may be what ends the station."""
INTERRUPTIONS: Final = "interruptions"
"""Where a plan's document has how often the station ended while it was made."""

_LAST_TRY = " Last try: "
"""Between what a dry run found and why a later one found nothing."""


class Planning:
    """Plans that are being made. Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        ledger: PlanLedger,
        workers: WorkerPool,
        machine_code: MachineCode,
    ) -> None:
        self.settings = PlanSettings(foundation, fleet)
        self.problems = RoundProblems(foundation, fleet)
        self._flows = PlanFlows(foundation)
        self._battery = foundation.services.get(PlanBattery)
        self._foundation = foundation
        self._fleet = fleet
        self._ledger = ledger
        self._workers = workers
        self._machine_code = machine_code
        self._dry_runs = DryRuns(fleet, workers)
        self._drafts = DraftKeeper(foundation, fleet, ledger, self._flows, self._dry_runs)
        self._dry_runs_again = DryRuns(fleet, foundation.study_workers)
        """They may take as long as they like, and keep no plan waiting."""
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._rehearsed_again: dict[str, asyncio.Task[None]] = {}
        self._turns: dict[str, asyncio.Lock] = {}
        """By site: robots of one fleet survey are planned for one after the other."""

    async def resume(self) -> None:
        """Take up the plans that were being made when the station ended, in whatever way."""
        for status in list(self._fleet.statuses):
            for plan in await self._ledger.of_robot(status.record.id, ("planning",)):
                await self._take_up(plan)

    async def _take_up(self, plan: PlanRecord) -> None:
        """Go on with a plan that the station's end interrupted; one that did so often is ended."""
        counted = await self._interrupted(plan, "the station restarted")
        if counted is None:
            return
        plan = counted
        if "settings" in plan.document:
            config = PlannerConfig.model_validate(plan.config)
            self._begin(plan.id, self._drafts.fly_ahead(plan, config))
            return
        request = request_of_plan(plan)
        try:
            start_xy = request.start_xy or self.settings.check_start(plan.robot, request.config)
        except Problem as problem:
            await self._drafts.fail(plan.id, problem.detail, {"interrupted": True})
            return
        self._begin(plan.id, self._search(plan, request, start_xy))

    async def _interrupted(self, plan: PlanRecord, what: str) -> PlanRecord | None:
        """Count an interruption of a plan in the making; None if it is ended, for it was too many.

        Raises:
            PlanStateError: If somebody ended the plan meanwhile.
            StoreUnavailableError: Nothing was counted.
        """
        times = plan.document.get(INTERRUPTIONS, 0) + 1
        if times > TAKEN_UP_MAX:
            message = f"Its making was interrupted {times} times; plan again."
            await self._drafts.fail(plan.id, message)
            return None
        at = self._foundation.clock.now()
        text = f"Taken up again after {what} at {at:%Y-%m-%d %H:%M:%S} UTC."
        document = {INTERRUPTIONS: times, "message": text}
        counted = await self._ledger.note(plan.id, document, only_from=("planning",))
        await self._ledger.log_event(plan, "plan.planning", f"{plan.id} for {plan.robot}: {text}")
        return counted

    async def stop(self) -> None:
        """Stop searching; the plans are taken up again when the station starts."""
        tasks = list(self._tasks.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def is_under_way(self, plan: str) -> bool:
        """Tell whether a plan is being searched for or flown ahead."""
        return plan in self._tasks

    async def configure(
        self, robot: str, patch: Mapping[str, Any], *, by: str
    ) -> tuple[str, PlannerConfig]:
        """Return the planner's settings for a robot with a patch on top, as a kept version.

        Raises:
            Problem: As of ``PlanSettings.configure``.
        """
        return await self.settings.configure(robot, patch, by=by)

    async def plan_survey(self, request: SearchRequest) -> PlanRecord:
        """Begin to plan one round of a survey; the plan becomes a draft or fails by itself.

        Raises:
            Problem: 409 if the robot's position is not known or outside of the domain, 422 if it
                is inside a keep-out, 503 while storage fails.
            StoreUnavailableError: Nothing was begun.
        """
        self.settings.refuse_while_storage_fails()
        config = self.settings.known_current(request.robot, request.config)
        ahead_s = config.planning_time_s + await self._rest_s(request, config)
        current = await self._flows.planned(request.robot, config, ahead_s)
        request = replace(
            request,
            config=current.config,
            settings_filter=request.config.position_filter,
            current_text=current.text,
        )
        start_xy = request.start_xy or self.settings.check_start(request.robot, request.config)
        plan = await self._add(request)
        self._begin(plan.id, self._search(plan, request, start_xy))
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
        """Begin a draft of legs that an operator laid out.

        Raises:
            Problem: 409 if the robot's position is not known, 422 if a leg cannot be a leg, or is
                too large for the wire.
            StoreUnavailableError: Nothing was kept.
        """
        self.settings.refuse_while_storage_fails()
        start = self.settings.position(robot)
        current = await self.in_water(robot, config)
        laid = legs_from(current.config, (start[0], start[1]), legs)
        return await self.plan_legs(robot, "primitives", current, config_id, laid, by=by)

    async def in_water(
        self, robot: str, config: PlannerConfig, ahead_s: float = 0.0
    ) -> PlannedCurrent:
        """Return settings with the current that a plan reckons with, as well as it is known.

        Args:
            robot: Who is to fly it.
            config: What was asked for.
            ahead_s: In how long it begins.

        Raises:
            UnknownIdError: If there is no such robot.
        """
        return await self._flows.planned(robot, self.settings.known_current(robot, config), ahead_s)

    async def plan_legs(
        self,
        robot: str,
        kind: str,
        current: PlannedCurrent,
        config_id: str | None,
        legs: Sequence[Leg],
        *,
        by: str,
        document: Mapping[str, Any] | None = None,
        rules: SurfacingOrder | None = None,
    ) -> PlanRecord:
        """Begin a draft of legs that are whole, whoever laid them.

        Args:
            robot: Who is to fly it.
            kind: Of the plan.
            current: Settings that it is judged by and travels with, in the water of now.
            config_id: Their version, where they are one.
            legs: From the first to the last surfacing.
            by: Who asked.
            document: What else is known of the plan.
            rules: By what the robot comes up by itself.

        Raises:
            Problem: 422 if the legs are too large for the wire, 503 while storage fails.
            StoreUnavailableError: Nothing was kept.
        """
        self.settings.refuse_while_storage_fails()
        config = current.config
        flown = await asyncio.to_thread(candidate_of, config, legs)
        try:
            draft = await self._drafts.draft(robot, config, flown, rules)
        except ValueError as error:
            wrong = [FieldError(loc=["legs"], msg=str(error))]
            raise unprocessable("The plan cannot travel to the robot.", wrong) from error
        plan = await self._ledger.add(
            robot,
            kind,
            config=config.model_dump(mode="json"),
            config_id=config_id,
            by=by,
            document={**(document or {}), "current_text": current.text},
        )
        text = f"{plan.id} for {robot} is a draft."
        try:
            kept = await self._drafts.keep(plan, config, draft, text)
        except StoreUnavailableError:
            self._begin(
                plan.id, self._drafts.settle(plan.id, lambda: self._drafts.interrupted(plan.id))
            )
            raise
        if kept.state == "planning":
            self._begin(plan.id, self._drafts.fly_ahead(kept, config))
        return kept

    async def take_candidate(
        self,
        request: SearchRequest,
        candidate: Candidate,
        found: Mapping[str, Any],
    ) -> PlanRecord:
        """Begin a draft of a trajectory that a search found; ``found`` is what is known of that.

        Raises:
            Problem: 503 while storage fails.
            StoreUnavailableError: Nothing was begun.
        """
        self.settings.refuse_while_storage_fails()
        plan = await self._add(request)
        self._begin(plan.id, self._take(plan, request.config, candidate, found))
        return plan

    async def cancel(self, plan: str, reason: str = "") -> PlanRecord:
        """Stop planning, or throw a draft away.

        Args:
            plan: Id of the plan.
            reason: Why, sentences; "" where a person wants it.

        Raises:
            UnknownIdError: If there is no such plan.
            Problem: 409 once the plan has left the station.
        """
        record = await self._ledger.get(plan)
        why = f": {reason[0].lower()}{reason[1:]}" if reason else "."
        try:
            cancelled = await self._ledger.move(
                plan,
                PlanEvidence.CANCELLED,
                f"{plan} was cancelled{why}",
                {"message": f"It was cancelled before it left the station{why}"},
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

    async def rehearse(self, plan: str) -> PlanRecord:
        """Fly a draft ahead once more, however long that takes; it stays a draft meanwhile.

        Raises:
            UnknownIdError: If there is no such plan.
            Problem: 409 for a plan that is no draft, has no legs, is being flown ahead already, or
                whose vehicle is not known.
            StoreUnavailableError: If storage fails.
        """
        record = await self._ledger.get(plan)
        has_legs = record.kind != FOLLOW_TARGET and "settings" in record.document
        if record.state != "draft" or not has_legs:
            raise conflict(f"{plan} is no draft with legs; only such a one can be rehearsed.")
        if plan in self._tasks:
            raise conflict(f"{plan} is being rehearsed already.")
        if self._fleet.vehicle(record.robot) is None:
            raise conflict(f"It is not known what vehicle {record.robot} is; say so first.")
        config = PlannerConfig.model_validate(record.config)
        self._ledger.set_rehearsing(record, is_on=True)
        again = self._begin(plan, self._rehearse_again(record, config))
        again.add_done_callback(lambda _: self._ledger.set_rehearsing(record, is_on=False))
        self._rehearsed_again[plan] = again
        again.add_done_callback(lambda _: self._rehearsed_again.pop(plan))
        # It may have left before anyone knew of this rehearsal.
        newest = await self._ledger.get(plan)
        self.take(PlanChanged(newest))
        if newest.state != "draft":
            raise conflict(f"{plan} is no draft any more; it is not rehearsed.")
        return newest

    def take(self, event: PlanChanged) -> None:
        """Take that a plan changed: one that is no draft any more is not flown ahead once more."""
        plan = event.plan
        again = self._rehearsed_again.get(plan.id)
        if again is not None and plan.state != "draft":
            self._ledger.set_rehearsing(plan, is_on=False)
            again.cancel()

    async def _rehearse_again(self, plan: PlanRecord, config: PlannerConfig) -> None:
        """Fly a draft ahead beside all else; what its last dry run found stands until the end."""
        found = await self._dry_runs_again.fly(plan, config, is_limited=False)
        document = {"rehearsal": asdict(_standing(plan, found))}

        async def keep() -> None:
            kept = await self._ledger.note(plan.id, document, only_from=("draft",))
            self._ledger.set_rehearsing(kept, is_on=False)

        await self._drafts.settle(plan.id, keep)

    async def check(self, plan: str) -> list[ViolationView]:
        """Check a draft again: its limits, its dry run, and whether it still fits the robot.

        Raises:
            UnknownIdError: If there is no such plan.
        """
        record = await self._ledger.get(plan)
        status = self._fleet.status(record.robot)
        if record.kind == FOLLOW_TARGET:
            tracking = TrackingConfig.model_validate(record.config)
            battery = await self._battery.of_target(record.robot, tracking)
            found = [
                *target_violations(status, tracking),
                *battery_violations(record.robot, battery),
            ]
            outdated = outdated_by(status, record, self._foundation.clock.now())
            return [*found, *(one for one in outdated if one not in found)]
        config = PlannerConfig.model_validate(record.config)
        if "settings" not in record.document:
            return [ViolationView("legs", "The plan has no legs.")]
        mission, vehicle = mission_of(record), self._fleet.vehicle(record.robot)
        limits = broken_limits(status, vehicle, config, mission.settings, mission.legs)
        outdated = outdated_by(status, record, self._foundation.clock.now())
        duration_s = record.document["account"]["duration_s"]
        battery = await self._battery.of_legs(record.robot, config, mission.legs, duration_s)
        lasts = battery_violations(record.robot, battery)
        return [*limits, *lasts, *broken_off(record), *outdated]

    async def _rest_s(self, request: SearchRequest, config: PlannerConfig) -> float:
        """Return how long the robot still flies what it flies before a round, s of its clock."""
        if request.ahead_of is None:
            return 0.0
        plan = await self._ledger.get(request.ahead_of)
        report = self._fleet.status(request.robot).plan_report
        return remaining_s(plan, config, report, self._foundation.clock.now())

    async def _add(self, request: SearchRequest) -> PlanRecord:
        return await self._ledger.add(
            request.robot,
            "adaptive_survey",
            config=request.config.model_dump(mode="json"),
            config_id=request.config_id,
            by=request.by,
            mission=request.mission,
            round_number=request.round_number,
            document=request.document(),
        )

    def _begin(self, plan: str, work: Coroutine[Any, Any, object]) -> asyncio.Task[None]:
        task = self._foundation.background.start(f"planning {plan}", _done(work))
        self._tasks[plan] = task
        task.add_done_callback(lambda _: self._tasks.pop(plan, None))
        return task

    async def _search(
        self, plan: PlanRecord, request: SearchRequest, start_xy: tuple[float, float]
    ) -> None:
        """Search, then settle the plan as soon as storage takes it."""
        if request.in_turn:
            site = self._fleet.status(plan.robot).record.site.name
            async with self._turns.setdefault(site, asyncio.Lock()):
                await self._search_now(plan, request, start_xy)
        else:
            await self._search_now(plan, request, start_xy)

    async def _search_now(
        self, plan: PlanRecord, request: SearchRequest, start_xy: tuple[float, float]
    ) -> None:
        config = request.config
        try:
            result = await self._result(plan, request, start_xy)
        except WORKER_FAILURES as error:
            log.warning("%s was not planned: %s", plan.id, error)
            message = f"{error} Plan again."
            await self._drafts.settle(plan.id, lambda: self._drafts.fail(plan.id, message))
            return
        except StoreUnavailableError as error:
            log.warning("%s is searched for anew once storage works: %s", plan.id, error)
            await self._search_anew(plan, request, start_xy)
            return
        found = search_document(
            config.objective, result.message, result.best, result.runners_up, result.history
        )
        best = result.best
        if best is None or result.status is PlanStatus.NOTHING_FEASIBLE:
            found[NOTHING_FEASIBLE] = True
            await self._drafts.settle(
                plan.id, lambda: self._drafts.fail(plan.id, result.message, found)
            )
        else:

            async def wider(added_m: float) -> Tried | None:
                return await self._search_wider(plan, request, start_xy, added_m)

            await self._take(plan, config, best, found, wider)

    async def _search_anew(
        self, plan: PlanRecord, request: SearchRequest, start_xy: tuple[float, float]
    ) -> None:
        """Search once more as soon as storage works, unless it let this plan down too often."""
        counted: list[PlanRecord | None] = []

        async def count() -> None:
            counted.append(await self._interrupted(plan, "a failure of the storage"))

        await self._drafts.settle(plan.id, count)
        again = counted[-1] if counted else None
        if again is not None:
            await self._search_now(again, request, start_xy)

    async def _search_wider(
        self,
        plan: PlanRecord,
        request: SearchRequest,
        start_xy: tuple[float, float],
        added_m: float,
    ) -> Tried | None:
        """Search with more margin, and fly ahead what that finds; None if that is nothing."""
        config, site = request.config, self._fleet.status(plan.robot).record.site
        wide = replace(request, config=with_margin(config, site, added_m))
        try:
            result = await self._result(plan, wide, start_xy)
        except (*WORKER_FAILURES, StoreUnavailableError) as error:
            log.warning("%s was not planned with more margin: %s", plan.id, error)
            return None
        best = result.best
        if best is None or result.status is PlanStatus.NOTHING_FEASIBLE:
            return None
        message = f"{result.message} With {added_m:.2g} m more margin, to leave the water rarely."
        found = search_document(config.objective, message, best, result.runners_up, result.history)
        return await self._try(plan, config, best, found)

    async def _result(
        self, plan: PlanRecord, request: SearchRequest, start_xy: tuple[float, float]
    ) -> PlanResult:
        config = request.config
        problem = await self.problems.survey(
            plan, config, start_xy, request.energy, warm=request.warm, attempt=request.attempt
        )
        start = ProgressView(0.0, config.planning_time_s, None, 0)
        await self._machine_code.wait_for(
            search_step(config.objective),
            lambda sentence: self._ledger.set_progress(plan, replace(start, waiting=sentence)),
        )
        self._ledger.set_progress(plan, start)
        field = await self._foundation.configurations.current("field", plan.robot)
        return await self._foundation.decisions.make(
            SURVEY_ROUND,
            problem,
            Cause(plan.robot, plan.id, {"planner": request.config_id, "field": field.id}),
            self._workers,
            on_progress=lambda point: self._ledger.set_progress(
                plan, _progress(point, config.planning_time_s)
            ),
        )

    async def _take(
        self,
        plan: PlanRecord,
        config: PlannerConfig,
        best: Candidate,
        found: Mapping[str, Any],
        wider: Callable[[float], Awaitable[Tried | None]] | None = None,
    ) -> None:
        """Make a draft of a trajectory, after a dry run if that is wanted.

        ``wider`` searches with more margin, where the dry run leaves the water too often.
        """
        one = await self._try(plan, config, best, found)
        if one is not None and wider is not None:
            one, last = await safest(one, config, wider)
            if one is not last:
                kept = await self._drafts.keep_found(plan, config, one.best, one.found)
                one = None if kept is None else replace(one, kept=kept)
        if one is not None and one.dry_run is not None:
            kept, dry_run = one.kept, one.dry_run
            await self._drafts.settle(plan.id, lambda: self._drafts.offer(kept, dry_run))

    async def _try(
        self, plan: PlanRecord, config: PlannerConfig, best: Candidate, found: Mapping[str, Any]
    ) -> Tried | None:
        """Keep a trajectory, and fly it ahead if that is wanted; None if the plan was ended."""
        kept = await self._drafts.keep_found(plan, config, best, found)
        if kept is None:
            return None
        is_flown = kept.state == "planning"
        dry_run = await self._dry_runs.fly(kept, config) if is_flown else None
        return Tried(best, found, kept, dry_run)


async def _done(work: Coroutine[Any, Any, object]) -> None:
    await work


def _standing(plan: PlanRecord, found: DryRunView) -> DryRunView:
    """Return what holds of a draft after another dry run.

    One that found nothing leaves the figures of one that did, by which the draft is kept back.
    """
    before = plan.document.get("rehearsal")
    if found.state == "done" or before is None or before["state"] != "done":
        return found
    message = before["message"].partition(_LAST_TRY)[0]
    return replace(dry_run_view(before), message=f"{message}{_LAST_TRY}{found.message}")


def _progress(point: ObjectivePoint, limit_s: float) -> ProgressView:
    return ProgressView(
        elapsed_s=point.elapsed_s,
        seconds_left=max(0.0, limit_s - point.elapsed_s),
        objective=point.objective,
        candidates=point.candidates,
    )
