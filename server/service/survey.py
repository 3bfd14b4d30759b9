"""The adaptive survey (thesis section 5.4.4): plan, fly, map, and again, until the budget is spent.

A survey is a state machine without a memory of its own: ``_advance`` looks at the mission and its
newest plan in the database and takes the one step that follows. It may be called any number of
times, and after the station was killed it goes on from what robot and database say.
"""

import asyncio
import logging
from collections.abc import Mapping
from dataclasses import asdict
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from autonomy.planner.config import PlannerConfig
from db.fault import StoreError
from db.query.events import add_event
from db.query.missions import MissionRecord, change_mission, get_mission, list_missions
from db.query.plans import PlanRecord
from server.foundation import Foundation
from server.problem import Problem, conflict
from server.service.drafting import outdated_by
from server.service.fleet import Fleet
from server.service.mapping import FieldMaps
from server.service.mission_ledger import ENDED, MissionLedger
from server.service.plan_ledger import ON_THE_WAY
from server.service.planning import Planning
from server.service.survey_score import map_scores
from server.service.upload import Uploads
from server.service.worker import WORKER_FAILURES, WorkerPool

log = logging.getLogger(__name__)

KIND = "adaptive_survey"
_UNDER_WAY = ("running", "replanning", "scoring")
_LOOK_S = 10.0
_QUIET_S = 1.5
_QUIET_LIMIT_S = 20.0
"""Wall time without a sample after which a round counts as received, and the longest wait."""


class Surveys:
    """Adaptive surveys. Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        missions: MissionLedger,
        planning: Planning,
        uploads: Uploads,
        maps: FieldMaps,
        workers: WorkerPool,
    ) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._missions = missions
        self._planning = planning
        self._uploads = uploads
        self._maps = maps
        self._workers = workers
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._again: set[str] = set()
        self._is_stopping = False

    async def resume(self) -> None:
        """Go on with every survey that had something to do when the station stopped."""
        for mission in await self._missions.open():
            self._kick(mission.id)

    async def run(self) -> None:
        """Look at every survey under way now and then, until cancelled.

        What robots and plans do leads to the next step at once; this is for a step that failed.
        """
        while True:
            await asyncio.sleep(_LOOK_S)
            try:
                missions = await self._missions.open()
            except StoreError as error:
                log.warning("surveys wait until storage works: %s", error)
                continue
            for mission in missions:
                if mission.state in _UNDER_WAY:
                    self._kick(mission.id)

    async def stop_all(self) -> None:
        """Let go of every survey; they go on when the station starts again."""
        self._is_stopping = True
        tasks = list(self._tasks.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def create(
        self, robot: str, patch: Mapping[str, Any], *, automation: bool, by: str
    ) -> str:
        """Ask a robot for a survey and begin to plan its first round; return the mission's id.

        A survey that only waits to be started makes room for the new one.

        Raises:
            Problem: 404 unknown robot, 409 if it is on a survey, 422 for wrong settings, 503
                while storage fails.
        """
        config_id, config = await self._planning.configure(robot, patch, by=by)
        self._planning.check_start(robot, config)
        for other in await self._missions.open(robot):
            if other.state in _UNDER_WAY:
                raise conflict(
                    f"{robot} is on {other.id}; stop it first, or wait until it is done."
                )
            await self._missions.move(
                other.id, "stopped", "A new survey took its place.", automation=False
            )
        mission = await self._missions.add(
            robot, KIND, config=config.model_dump(mode="json"), config_id=config_id, by=by
        )
        if automation:
            await self._missions.move(mission, "planning", "", automation=True)
        await self._plan(await self._missions.get(mission), 1, config.round_budget, by)
        return mission

    async def plan_again(
        self, robot: str, mission: str, patch: Mapping[str, Any], *, by: str
    ) -> PlanRecord:
        """Plan the round of a survey that waits to be started once more, with other settings.

        The new plan takes the place of the draft; later rounds keep the survey's own settings.

        Raises:
            UnknownIdError: If there is no such mission.
            Problem: 409 if it is another robot's, or does not wait; 422 for wrong settings.
        """
        record, plans = await self._missions.get(mission), await self._missions.plans(mission)
        if record.robot != robot:
            raise conflict(f"{mission} is {record.robot}'s.")
        if record.state not in {"ready", "stopped", "failed"}:
            raise conflict(f"{mission} is {record.state}; stop it before you plan again.")
        if plans and plans[0].state in ON_THE_WAY:
            raise conflict(f"{robot} has {plans[0].id}; wait until it has ended.")
        config_id, config = await self._planning.configure(robot, patch, by=by)
        self._planning.check_start(robot, config)
        remaining = config.total_budget - self._missions.spent(robot, plans)
        await self._missions.move(mission, "planning", f"{by} plans again.", automation=False)
        plan = await self._planning.plan_survey(
            robot,
            config,
            config_id,
            by=by,
            mission=mission,
            round_number=plans[0].round if plans else 1,
            budget=min(config.round_budget, remaining),
        )
        if plans and plans[0].state == "draft":
            await self._planning.cancel(plans[0].id)
        return plan

    async def start(self, mission: str, *, by: str) -> None:
        """Let the station fly the rest of a survey by itself.

        Raises:
            UnknownIdError: If there is no such mission.
            Problem: 409 if it is done, or has nothing that could be flown.
        """
        record = await self._missions.get(mission)
        if record.state == "done":
            raise conflict(f"{mission} is done; plan a new survey.")
        if record.automation and record.state in _UNDER_WAY:
            return
        for other in await self._missions.open(record.robot):
            if other.id != mission and other.state in _UNDER_WAY:
                raise conflict(f"{record.robot} is on {other.id}; stop it first.")
        plans = await self._missions.plans(mission)
        state = "planning" if plans and plans[0].state == "planning" else "running"
        await self._missions.move(mission, state, f"Started by {by}.", automation=True)
        if not plans or plans[0].state in {"failed", "cancelled", "superseded"}:
            round_number = plans[0].round if plans else 1
            await self._next_round(await self._missions.get(mission), plans, round_number)
        self._kick(mission)

    async def stop(self, mission: str, *, by: str) -> None:
        """End the automation of a survey; drafts stay, and what the robot flies it flies on.

        Raises:
            UnknownIdError: If there is no such mission.
            Problem: 409 if it has ended already.
        """
        record = await self._missions.get(mission)
        if record.state in {"done", "stopped"}:
            raise conflict(f"{mission} is {record.state} already.")
        flies = any(plan.state == "running" for plan in await self._missions.plans(mission))
        message = f"Stopped by {by}."
        if flies:
            message += f" {record.robot} finishes the plan that it flies; surface it to end that."
        await self._missions.move(mission, "stopped", message, automation=False)
        await self._uploads.withdraw(record.robot, f"{by} stopped {mission}.")

    def plan_changed(self, plan: PlanRecord) -> None:
        """Take a change of any plan."""
        if plan.mission is not None:
            self._kick(plan.mission)

    def upload_failed(self, plan: str, reason: str) -> None:
        """Take that a plan did not get on board or did not start."""
        self._foundation.background.start(f"stop for {plan}", self._stop_for_plan(plan, reason))

    async def _stop_for_plan(self, plan: str, reason: str) -> None:
        try:
            for mission in await self._missions.open():
                plans = await self._missions.plans(mission.id)
                if plans and plans[0].id == plan:
                    await self._missions.advance(mission.id, "stopped", reason, automation=False)
        except StoreError as error:
            # The look that ``run`` takes now and then finds the plan where it stands.
            log.warning("the survey of %s was not stopped: %s", plan, error)

    def _kick(self, mission: str) -> None:
        """Let a survey take its next step, once more if it is taking one now."""
        if mission in self._tasks:
            self._again.add(mission)
            return
        task = self._foundation.background.start(f"advance {mission}", self._advance_all(mission))
        self._tasks[mission] = task
        task.add_done_callback(lambda _: self._step_ended(mission))

    def _step_ended(self, mission: str) -> None:
        self._tasks.pop(mission, None)
        if mission in self._again and not self._is_stopping:
            self._kick(mission)

    async def _advance_all(self, mission: str) -> None:
        while True:
            self._again.discard(mission)
            try:
                await self._advance(mission)
            except Problem as problem:
                await self._missions.advance(mission, "stopped", problem.detail, automation=False)
            except StoreError as error:
                log.warning("%s waits: %s", mission, error)
                await asyncio.sleep(_QUIET_S)
                self._again.add(mission)
            if mission not in self._again:
                return

    async def _advance(self, mission: str) -> None:
        record, plans = await self._missions.get(mission), await self._missions.plans(mission)
        await self._missions.show(mission)
        if record.state in ENDED or not plans:
            return
        plan = plans[0]
        match plan.state:
            case "planning":
                return
            case "draft" if not record.automation:
                await self._missions.advance(mission, "ready", f"{plan.id} is ready to be sent.")
            case "draft" if self._is_outdated(plan):
                await self._next_round(record, plans, plan.round)
                await self._planning.cancel(plan.id)
            case "draft" | "sent" | "on_board":
                if record.automation:
                    await self._send(record, plan)
            case "running":
                await self._missions.advance(mission, "running", self._round_text(plan, record))
            case "done":
                await self._round_ended(record, plans)
            case _:
                await self._plan_ended_badly(record, plans)

    def _is_outdated(self, plan: PlanRecord) -> bool:
        """Tell whether a draft that nobody sends yet was made for another place or time."""
        picture = self._fleet.picture(plan.robot)
        is_waiting = not self._uploads.is_under_way(plan.robot)
        return is_waiting and bool(outdated_by(picture, plan, self._foundation.clock.now()))

    async def _send(self, record: MissionRecord, plan: PlanRecord) -> None:
        try:
            await self._uploads.upload(
                plan.id, start=True, check=lambda session: _check_on(session, record.id)
            )
        except Problem:
            if (await self._missions.plans(record.id))[0].state == plan.state:
                raise
            # The robot was faster than this look at the plan: look again.
            self._again.add(record.id)
        else:
            await self._missions.advance(record.id, "running", self._round_text(plan, record))

    async def _round_ended(self, record: MissionRecord, plans: list[PlanRecord]) -> None:
        # The last samples of the round may still be on their way.
        await self._maps.quiet(record.robot, _QUIET_S, _QUIET_LIMIT_S)
        await self._maps.settle(record.robot)
        config = PlannerConfig.model_validate(record.config)
        remaining = config.total_budget - self._missions.spent(record.robot, plans)
        if remaining < self._planning.least_energy(record.robot, config):
            await self._score(record, config)
        else:
            await self._next_round(record, plans, plans[0].round + 1)

    async def _next_round(
        self, record: MissionRecord, plans: list[PlanRecord], round_number: int
    ) -> None:
        config = PlannerConfig.model_validate(record.config)
        remaining = config.total_budget - self._missions.spent(record.robot, plans)
        await self._missions.advance(record.id, "replanning", f"Planning round {round_number}.")
        await self._plan(record, round_number, min(config.round_budget, remaining), "the station")

    async def _plan(self, record: MissionRecord, round_number: int, budget: float, by: str) -> None:
        await self._planning.plan_survey(
            record.robot,
            PlannerConfig.model_validate(record.config),
            record.document["config_id"],
            by=by,
            mission=record.id,
            round_number=round_number,
            budget=budget,
        )

    async def _plan_ended_badly(self, record: MissionRecord, plans: list[PlanRecord]) -> None:
        plan = plans[0]
        message = plan.document["message"]
        if plan.document.get("interrupted"):
            await self._next_round(record, plans, plan.round)
        elif plan.state == "failed" and plan.running_at is None:
            await self._missions.advance(record.id, "failed", message, automation=False)
        else:
            await self._missions.advance(record.id, "stopped", message, automation=False)

    async def _score(self, record: MissionRecord, config: PlannerConfig) -> None:
        picture = self._fleet.picture(record.robot)
        if not picture.record.simulated:
            await self._missions.advance(
                record.id, "done", "The budget is spent; the map is as good as it gets."
            )
            return
        await self._missions.advance(record.id, "scoring", "The budget is spent; scoring the map.")
        variable = picture.record.site.variable
        try:
            views = await map_scores(
                self._foundation, self._workers, record.robot, variable, config
            )
        except WORKER_FAILURES as error:
            await self._missions.advance(record.id, "done", f"The map was not scored: {error}")
            return
        self._maps.set_scores(record.robot, {(variable, view.model): view for view in views})
        await self._missions.advance(
            record.id,
            "done",
            "The budget is spent and the map is scored.",
            scores=[asdict(view) for view in views],
        )

    @staticmethod
    def _round_text(plan: PlanRecord, record: MissionRecord) -> str:
        return f"Round {plan.round} of {record.robot} is {plan.id}."


def _check_on(session: Session, mission: str) -> None:
    if not get_mission(session, mission).automation:
        raise conflict(f"{mission} was stopped.")


def purge_in(session: Session, robot: str, at: datetime, reason: str) -> None:
    """End the automation of a robot's missions, in the transaction of a surface order."""
    for mission in list_missions(session, robot=robot):
        if mission.automation or mission.state in _UNDER_WAY:
            change_mission(
                session,
                mission.id,
                state="stopped",
                automation=False,
                document={"message": reason},
            )
            add_event(
                session,
                at,
                "mission.stopped",
                f"{mission.id} of {robot}: {reason}",
                level="watch",
                robot=robot,
                data={"mission": mission.id},
            )
