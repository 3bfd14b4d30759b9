"""Adaptive surveys (thesis section 5.4.4): asked for, started, stopped, and kept going.

A survey is a state machine without a memory of its own: ``SurveySteps`` looks at the mission and
its plans in the database and takes the one step that follows. After the station was killed it goes
on from what robot and database say.
"""

import asyncio
import logging
from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy.orm import Session

from db.fault import StoreError
from db.query.mission.missions import change_mission, list_missions
from db.query.mission.plans import PlanRecord
from db.query.station.events import add_event
from server.base.foundation import Foundation
from server.base.problem import Problem, conflict
from server.base.retry_queue import until_stored
from server.base.wakeups import Wakeups
from server.checklist.gate import Overrule, StartGate
from server.command.state import SurfaceOrdered
from server.lease.hold import AutomationHold, HoldChanged
from server.plan.planning import Planning
from server.plan.search.request import SearchRequest
from server.plan.search.survey_round import ENDED_BADLY, config_of_round, survey_status
from server.plan.state import ON_THE_WAY, PlanChanged
from server.survey.mission_ledger import MissionLedger
from server.survey.step import SurveySteps, request_of
from server.transfer.state import TransferFailed
from server.transfer.transfers import Transfers

log = logging.getLogger(__name__)

KIND = "adaptive_survey"
_UNDER_WAY = ("running", "replanning", "scoring")
_RETRY_S = 1.5
"""Wall time after which a step that met failing storage is taken again."""
_FAILED_S = 10.0
"""The same of one that failed otherwise."""


class Surveys:
    """Adaptive surveys. Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        missions: MissionLedger,
        planning: Planning,
        transfers: Transfers,
        steps: SurveySteps,
        gate: StartGate,
        hold: AutomationHold,
    ) -> None:
        self._gate = gate
        self._foundation = foundation
        self._hold = hold
        self._missions = missions
        self._planning = planning
        self._transfers = transfers
        self._steps = steps
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._again: set[str] = set()
        self._asked_ahead: dict[str, str] = {}
        """By robot, the plan during which the next round was looked at; saves looking often."""
        self._ahead = Wakeups(foundation.clock)
        """Robots whose next round may be due."""
        self._is_stopping = False
        foundation.bus.subscribe(PlanChanged, self._plan_changed)
        foundation.bus.subscribe(TransferFailed, self._transfer_failed)

    async def resume(self) -> None:
        """Go on with every survey that had something to do when the station stopped."""
        for mission in await self._missions.open():
            self._kick(mission.id)
            self._ahead.wake(mission.robot)

    def take_hold(self, event: HoldChanged) -> None:
        """Take that automation is held, which a look finds, or goes on."""
        if not event.hold.is_held:
            self._foundation.background.start("surveys that were held", self.resume())

    async def run(self) -> None:
        """Plan rounds ahead of robots that say nothing under water, until cancelled."""
        while True:
            for robot in await self._ahead.next():
                self._look_ahead(robot)

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
        return (await self.create_all([robot], patch, automation=automation, by=by))[0]

    async def create_all(
        self, robots: Sequence[str], patch: Mapping[str, Any], *, automation: bool, by: str
    ) -> list[str]:
        """Ask robots for a survey each, planned one after the other; return the missions' ids.

        Every plan counts what the others will sample, so robots of one site share the work.

        Raises:
            Problem: As of ``create``, for the first robot that cannot; then nothing is begun.
        """
        for robot in robots:
            self._planning.settings.check_start(
                robot, await self._planning.settings.merged(robot, patch)
            )
            for other in await self._missions.open(robot):
                if other.state in _UNDER_WAY:
                    raise conflict(
                        f"{robot} is on {other.id}; stop it first, or wait until it is done."
                    )
        missions: list[str] = []
        for robot in robots:
            config_id, config = await self._planning.configure(robot, patch, by=by)
            for other in await self._missions.open(robot):
                await self._missions.move(
                    other.id, "stopped", "A new survey took its place.", automation=False
                )
                await self._cancel(await self._missions.plans(other.id), "planning")
            missions.append(
                await self._missions.add(
                    robot,
                    KIND,
                    config=config.model_dump(mode="json"),
                    config_id=config_id,
                    by=by,
                    automation=automation,
                )
            )
        for mission in missions:
            if len(missions) > 1:
                await self._missions.note(mission, {"fleet": missions})
            record = await self._missions.get(mission)
            await self._planning.plan_survey(request_of(record, 1, spent=0.0))
        return missions

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
        survey = survey_status(plans)
        if survey is not None and survey.plan.state in ON_THE_WAY:
            raise conflict(f"{robot} has {survey.plan.id}; wait until it has ended.")
        config_id, config = await self._planning.configure(robot, patch, by=by)
        self._planning.settings.check_start(robot, config)
        spent = self._missions.spent(robot, plans)
        await self._missions.move(mission, "planning", f"{by} plans again.", automation=False)
        plan = await self._planning.plan_survey(
            SearchRequest(
                robot=robot,
                config=config_of_round(config, spent / config.total_budget),
                config_id=config_id,
                by=by,
                mission=mission,
                round_number=1 if survey is None else survey.next_round,
                budget=min(config.round_budget, config.total_budget - spent),
            )
        )
        await self._cancel(plans, "draft", "planning")
        return plan

    async def _cancel(self, plans: Sequence[PlanRecord], *states: str) -> None:
        for plan in plans:
            if plan.state in states:
                await self._planning.cancel(plan.id)

    async def start(self, mission: str, *, by: str, overrule: Overrule | None = None) -> None:
        """Let the station fly the rest of a survey by itself.

        Args:
            mission: Which.
            by: Who starts it.
            overrule: A person's word that it shall start although a checklist is not complete.

        Raises:
            UnknownIdError: If there is no such mission.
            Problem: 409 if it is done, or has nothing that could be flown, or a checklist that its
                robot's settings require is not complete.
        """
        record = await self._missions.get(mission)
        if record.state == "done":
            raise conflict(f"{mission} is done; plan a new survey.")
        if record.automation and record.state in _UNDER_WAY:
            return
        for other in await self._missions.open(record.robot):
            if other.id != mission and other.state in _UNDER_WAY:
                raise conflict(f"{record.robot} is on {other.id}; stop it first.")
        passes = await self._gate.look(record.robot, overrule)
        await self._foundation.store.write(passes)
        plans = await self._missions.plans(mission)
        survey = survey_status(plans)
        is_planned = survey is not None and survey.plan.state == "planning"
        state = "planning" if is_planned else "running"
        await self._missions.move(mission, state, f"Started by {by}.", automation=True)
        if survey is None or survey.plan.state in ENDED_BADLY:
            round_number = 1 if survey is None else survey.next_round
            await self._steps.next_round(await self._missions.get(mission), plans, round_number)
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
        await self._transfers.withdraw(record.robot, f"{by} stopped {mission}.")

    def _plan_changed(self, event: PlanChanged) -> None:
        if event.plan.mission is not None:
            self._kick(event.plan.mission)
            self._ahead.wake(event.plan.robot)

    def robot_said_more(self, robot: str) -> None:
        """Take that a robot got further with its plan: the next round may be due."""
        self._ahead.wake(robot)

    def _look_ahead(self, robot: str) -> None:
        """Let a survey plan its next round once that is due, by the robot's word or by time."""
        plan = self._steps.flown_in_survey(robot)
        if plan is None or plan.mission is None or self._asked_ahead.get(robot) == plan.id:
            return
        if self._steps.is_ahead_due(plan):
            self._asked_ahead[robot] = plan.id
            self._kick(plan.mission)
        else:
            self._ahead.set_due(robot, self._steps.ahead_due_at(plan))

    def _transfer_failed(self, event: TransferFailed) -> None:
        plan = event.plan
        stop = until_stored(f"stop for {plan}", lambda: self._stop_for_plan(plan, event.reason))
        self._foundation.background.start(f"stop for {plan}", stop)

    async def _stop_for_plan(self, plan: str, reason: str) -> None:
        for mission in await self._missions.open():
            survey = survey_status(await self._missions.plans(mission.id))
            if survey is not None and survey.plan.id == plan:
                await self._missions.give_up(mission.id, "stopped", reason)

    def _kick(self, mission: str) -> None:
        """Let a survey take its next step, once more if it is taking one now."""
        if self._is_stopping:
            return
        if mission in self._tasks:
            self._again.add(mission)
            return
        task = self._foundation.background.start(f"advance {mission}", self._advance_all(mission))
        self._tasks[mission] = task
        task.add_done_callback(lambda task: self._step_ended(mission, task))

    def _step_ended(self, mission: str, task: asyncio.Task[None]) -> None:
        self._tasks.pop(mission, None)
        if self._is_stopping or task.cancelled():
            return
        if task.exception() is not None:
            asyncio.get_running_loop().call_later(_FAILED_S, self._kick, mission)
        elif mission in self._again:
            self._kick(mission)

    async def _advance_all(self, mission: str) -> None:
        while True:
            self._again.discard(mission)
            try:
                await self._advance(mission)
            except StoreError as error:
                log.warning("%s waits: %s", mission, error)
                await asyncio.sleep(_RETRY_S)
                self._again.add(mission)
            if mission not in self._again:
                return

    async def _advance(self, mission: str) -> None:
        if self._hold.is_held and (await self._missions.get(mission)).automation:
            return  # every survey is looked at again once automation goes on
        try:
            if await self._steps.take(mission):
                self._again.add(mission)
        except Problem as problem:
            await self._missions.give_up(mission, "stopped", problem.detail)


def stop_for(session: Session, event: SurfaceOrdered) -> None:
    """End the automation of a robot's missions, in the transaction of a command to surface."""
    robot, reason = event.robot, event.reason
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
                event.at,
                "mission.stopped",
                f"{mission.id} of {robot}: {reason}",
                level="watch",
                robot=robot,
                data={"mission": mission.id},
            )
