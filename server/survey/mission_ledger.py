"""Every change of a mission, and what it looks like: its rounds are its plans."""

import asyncio
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy.orm import Session

from autonomy.planner.config import PlannerConfig, exploitation_at
from db.fault import StoreError
from db.query.mission import missions as query
from db.query.mission.missions import MissionRecord
from db.query.mission.plans import PlanRecord, list_plans
from db.query.station.events import add_event
from server.base.foundation import Foundation
from server.base.retry_queue import until_stored
from server.command.state import SurfaceOrdered
from server.fleet.fleet import Fleet
from server.map.view import ScoresView
from server.plan.document import account_of, onboard_view
from server.plan.drafting import outdated_by
from server.plan.search.survey_round import counted, planned_energy, survey_status
from server.plan.state import PlanChanged
from server.survey.view import (
    BudgetView,
    LiveMissionView,
    MissionView,
    RoundView,
)

GIVEN_UP = "survey stopped"
"""Cause of the alarm that a survey waits for a person."""
ENDED = ("done", "failed", "stopped")
"""States that only a person's word leads out of."""
_LEVELS = {"failed": "warning", "stopped": "watch"}
log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class MissionChanged:
    """More is known of a mission: of itself, its plans or what they took; told after the commit."""

    mission: str
    robot: str


class MissionLedger:
    """Changes missions and keeps what is known of them. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._store = foundation.store
        self._alarms = foundation.alarms
        self._clock = foundation.clock
        self._bus = foundation.bus
        self._fleet = fleet
        self._known: dict[str, tuple[MissionRecord, list[PlanRecord]]] = {}
        """The missions that robots show, and the one that was read last."""
        self._changed: dict[str, None] = {}
        """Missions that were changed with something else, in order."""
        self._has_changed = asyncio.Event()
        self._reading = asyncio.Lock()
        """Whoever reads a mission later takes it up later, so that the newest record stays."""

    async def run(self) -> None:
        """Read again what was changed with something else, until cancelled."""
        while True:
            await self._has_changed.wait()
            self._has_changed.clear()
            changed, self._changed = self._changed, {}
            for mission in changed:
                await self._read_again(mission)

    def plan_changed(self, event: PlanChanged) -> None:
        """Take that a plan was changed, which may be a round of a mission."""
        if event.plan.mission is not None:
            self._note_change(event.plan.mission)

    def surface_ordered(self, event: SurfaceOrdered) -> None:
        """Take that a robot's missions were stopped."""
        mission = self._fleet.status(event.robot).mission_id
        if mission is not None:
            self._note_change(mission)

    async def load(self) -> None:
        """Take up the newest mission of each robot."""
        for status in list(self._fleet.statuses):
            robot = status.record.id
            missions = await self._store.query(
                lambda session, robot=robot: query.list_missions(session, robot=robot, limit=1)
            )
            for mission in missions:
                await self._read(mission.id)

    async def add(
        self,
        robot: str,
        kind: str,
        *,
        config: Mapping[str, Any],
        config_id: str,
        by: str,
        automation: bool = False,
    ) -> str:
        """Add a mission whose first plan is about to be made."""
        at = self._clock.now()

        def write(session: Session) -> str:
            mission = query.add_mission(
                session,
                robot,
                kind,
                state="planning",
                automation=automation,
                config=config,
                document={"config_id": config_id, "message": "", "scores": None},
                at=at,
                by=by,
            )
            text = f"{by} asked {robot} for {mission}."
            add_event(session, at, "mission.planning", text, robot=robot, data={"mission": mission})
            return mission

        mission = await self._store.write(write)
        await self._read(mission)
        await self._alarms.clear(GIVEN_UP, robot=robot)
        return mission

    async def move(
        self,
        mission: str,
        state: str,
        message: str,
        *,
        automation: bool | None = None,
        scores: list[dict[str, Any]] | None = None,
    ) -> None:
        """Bring a mission into a state, as a person asked."""
        document = {"message": message} | ({} if scores is None else {"scores": scores})
        await self._change(mission, state, (), automation, document)

    async def advance(
        self,
        mission: str,
        state: str,
        message: str,
        *,
        automation: bool | None = None,
        scores: list[dict[str, Any]] | None = None,
    ) -> None:
        """Bring a mission into a state by itself, unless someone has ended it meanwhile."""
        document = {"message": message} | ({} if scores is None else {"scores": scores})
        await self._change(mission, state, ENDED, automation, document)

    async def give_up(self, mission: str, state: str, message: str) -> None:
        """End a mission that cannot go on by itself, with an alarm, unless someone has ended it.

        The alarm stands until the robot's mission goes on, or it has another.
        """
        document = {"message": message}
        if not await self._change(mission, state, ENDED, False, document, level="warning"):
            return
        robot = (await self.get(mission)).robot
        await self._alarms.raise_(GIVEN_UP, f"{mission} of {robot} {state}: {message}", robot=robot)

    async def note(self, mission: str, document: Mapping[str, Any]) -> None:
        """Keep more about a mission, whatever its state."""
        await self._store.write(
            lambda session: query.change_mission(session, mission, document=document)
        )
        await self._read(mission)

    async def get(self, mission: str) -> MissionRecord:
        """Return a mission.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        return await self._store.query(lambda session: query.get_mission(session, mission))

    async def plans(self, mission: str) -> list[PlanRecord]:
        """Return the plans of a mission, the newest first."""
        return await self._store.query(
            lambda session: list_plans(session, mission=mission, limit=1000)
        )

    async def open(self, robot: str | None = None) -> list[MissionRecord]:
        """Return the missions that have something to do, the newest first."""
        return await self._store.query(
            lambda session: query.list_missions(session, robot=robot, states=query.OPEN_STATES)
        )

    async def view(self, mission: str) -> MissionView:
        """Return a mission as REST says it.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        return self._view(await self.get(mission), await self.plans(mission))

    async def views(self, robot: str, before: str | None, limit: int) -> list[MissionView]:
        """Return missions of a robot, the newest first."""
        missions = await self._store.query(
            lambda session: query.list_missions(session, robot=robot, before=before, limit=limit)
        )
        return [self._view(mission, await self.plans(mission.id)) for mission in missions]

    def live_view(self, mission: str) -> LiveMissionView:
        """Return what the live stream says of a mission that is in memory."""
        record, plans = self._known[mission]
        plan_id, ahead = _plan_ids(plans)
        return LiveMissionView(
            state=record.state,
            automation=record.automation,
            budget=self._budget(record, plans),
            plan_id=plan_id,
            map_std=record.document.get("map_std"),
            ahead=ahead,
            message=self._message(record, plans),
        )

    def _note_change(self, mission: str) -> None:
        self._changed[mission] = None
        self._has_changed.set()

    async def _read_again(self, mission: str) -> None:
        try:
            await until_stored(mission, lambda: self._read(mission))
        except StoreError as error:
            log.warning("%s is not read again: %s", mission, error)

    async def _read(self, mission: str) -> None:
        """Read a mission and its plans after a change, and tell of it."""
        async with self._reading:
            record, plans = await self.get(mission), await self.plans(mission)
            self._known[mission] = (record, plans)
            shown = self._fleet.status(record.robot).mission_id
            if shown is None or shown == mission or not self._is_newer(shown, record):
                self._fleet.set_mission(record.robot, mission)
            kept = {mission, *(status.mission_id for status in self._fleet.statuses)}
            self._known = {key: known for key, known in self._known.items() if key in kept}
        self._bus.publish(MissionChanged(mission, record.robot))

    def robot_said_more(self, robot: str) -> None:
        """Take that a robot spent more of its mission's budget, or left where that begins."""
        mission = self._fleet.status(robot).mission_id
        if mission is not None and mission in self._known:
            self._bus.publish(MissionChanged(mission, robot))

    def spent(self, robot: str, plans: list[PlanRecord]) -> float:
        """Return the energy that a robot reported for a mission's plans."""
        report = self._fleet.status(robot).plan_report
        views = [onboard_view(plan, report) for plan in plans if plan.running_at is not None]
        return sum(view.energy_used for view in views if view is not None)

    async def _change(
        self,
        mission: str,
        state: str,
        not_from: tuple[str, ...],
        automation: bool | None,
        document: Mapping[str, Any],
        *,
        level: str | None = None,
    ) -> bool:
        """Change a mission and tell everyone; return whether it was not ended before."""
        at, message = self._clock.now(), document["message"]

        def write(session: Session) -> bool:
            before = query.get_mission(session, mission)
            if before.state in not_from:
                return False
            query.change_mission(
                session, mission, state=state, automation=automation, document=document
            )
            if (before.state, before.document["message"]) != (state, message):
                add_event(
                    session,
                    at,
                    f"mission.{state}",
                    f"{mission} of {before.robot}: {message or state}",
                    level=level or _LEVELS.get(state, "info"),
                    robot=before.robot,
                    data={"mission": mission},
                )
            return True

        is_changed = await self._store.write(write)
        await self._read(mission)
        if is_changed and level is None:
            robot = self._known[mission][0].robot
            await self._alarms.clear(GIVEN_UP, robot=robot)
        return is_changed

    def _is_newer(self, shown: str, record: MissionRecord) -> bool:
        known = self._known.get(shown)
        return known is not None and known[0].created_at > record.created_at

    def _budget(self, record: MissionRecord, plans: list[PlanRecord]) -> BudgetView:
        config, spent = record.config, self.spent(record.robot, plans)
        accounts = [account_of(plan.document) for plan in plans if plan.running_at]
        begun = [account for account in accounts if account is not None]
        return BudgetView(
            total=config["total_budget"],
            spent=spent,
            round=config["round_budget"],
            remaining=max(0.0, config["total_budget"] - spent),
            round_time_s=config.get("time_budget_s") or None,
            round_satellite_bytes=config.get("satellite_bytes") or None,
            planned_s=sum(account.duration_s for account in begun),
            satellite_bytes=sum(account.satellite_bytes for account in begun),
        )

    def _view(self, record: MissionRecord, plans: list[PlanRecord]) -> MissionView:
        document = record.document
        scores = document["scores"]
        plan_id, ahead = _plan_ids(plans)
        return MissionView(
            id=record.id,
            robot=record.robot,
            kind=record.kind,
            state=record.state,
            automation=record.automation,
            config=dict(record.config),
            config_id=document["config_id"],
            rounds=self._rounds(record.robot, plans),
            budget=self._budget(record, plans),
            plan_id=plan_id,
            scores=None if scores is None else [ScoresView(**one) for one in scores],
            map_std=document.get("map_std"),
            target_std=record.config.get("target_std", 0.0),
            exploitation=self._exploitation(record, plans),
            ahead=ahead,
            fleet=document.get("fleet") or [record.id],
            message=self._message(record, plans),
            created_at=record.created_at,
        )

    def _message(self, record: MissionRecord, plans: list[PlanRecord]) -> str:
        """Return what a mission says; a draft that waits may have become stale meanwhile."""
        survey = survey_status(plans) if record.state == "ready" else None
        if survey is None:
            return record.document["message"]
        plan, status = survey.plan, self._fleet.status(record.robot)
        found = outdated_by(status, plan, self._clock.now())
        if not found:
            return record.document["message"]
        reasons = " ".join(one.message for one in found)
        return f"{plan.id} no longer fits: {reasons} Plan again, or send it all the same."

    def _exploitation(self, record: MissionRecord, plans: list[PlanRecord]) -> float:
        """Return what the present round was planned with, else what its schedule says now."""
        survey = survey_status(plans)
        held = None if survey is None else survey.plan.document.get("exploitation")
        if held is not None:
            return held
        config = PlannerConfig.model_validate(record.config)
        share = self.spent(record.robot, plans) / config.total_budget
        return exploitation_at(config, min(share, 1.0))

    def _rounds(self, robot: str, plans: list[PlanRecord]) -> list[RoundView]:
        """Return one entry a round: the newest plan of it, and the energy of all that were flown.

        Several plans of a round may have been flown, and others drawn up that never were: these
        spent nothing. So the rounds that were flown add up to what the budget says is spent.
        """
        report = self._fleet.status(robot).plan_report
        rounds: dict[int, RoundView] = {}
        flown: dict[int, float] = {}
        for plan in reversed(counted(plans)):
            onboard = onboard_view(plan, report) if plan.running_at is not None else None
            if onboard is not None:
                flown[plan.round] = flown.get(plan.round, 0.0) + onboard.energy_used
            rounds[plan.round] = RoundView(
                round=plan.round,
                plan_id=plan.id,
                state=plan.state,
                energy=flown.get(plan.round, planned_energy(plan)),
                objective=plan.document.get("objective"),
            )
        return [rounds[number] for number in sorted(rounds)]


def _plan_ids(plans: list[PlanRecord]) -> tuple[str | None, str | None]:
    """Return the plan of the present round, and the one that was made ahead for the next."""
    survey = survey_status(plans)
    if survey is None:
        return None, None
    ahead = survey.open_ahead
    return survey.plan.id, None if ahead is None else ahead.id
