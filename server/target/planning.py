"""Plans that follow a target: nothing is searched for, so each is a draft at once.

Plan and hash are written in one transaction: a station that is killed has the whole draft or none.
"""

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

from sqlalchemy.orm import Session

from autonomy.planner.config import PlannerConfig
from autonomy.tracking.config import TrackingConfig
from autonomy.vehicle.trim import TrimConfig, trim_flaw
from db.query.mission import plans as query
from db.query.mission.commands import newest_applied
from db.query.mission.plans import PlanRecord
from robot_link.messages import CommandKind
from robot_link.mission import Mission, MissionSettings
from robot_link.satellite.config import SatelliteConfig
from robot_link.target_settings import TargetSettings
from server.base.configuration import CurrentConfiguration
from server.base.foundation import Foundation
from server.fleet.capability import refuse_unless_able
from server.fleet.dependency import refuse_recording
from server.fleet.fleet import Fleet
from server.fleet.status import FOLLOW_TARGET, RobotStatus
from server.fleet.words import TEACHING
from server.plan.battery import PlanBattery, battery_violations
from server.plan.ledger import PlanLedger
from server.plan.settings import PlanSettings, with_told_fix_depth
from server.plan.state import PlanEvidence, apply
from server.plan.target_account import target_account
from server.plan.target_check import target_path, target_violations, target_warnings
from server.plan.view import ViolationView
from server.satellite.cost import mission_credits
from server.target.settings import Base, configure_target, unfit

_TARGETS = {"virtual": "a virtual target", "tag": "tag {address}", "beacon": "beacon {address}"}


class TargetPlanning:
    """Makes plans that follow a target. Belongs to one event loop."""

    def __init__(
        self, foundation: Foundation, fleet: Fleet, ledger: PlanLedger, settings: PlanSettings
    ) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._ledger = ledger
        self._settings = settings
        self._battery = foundation.services.get(PlanBattery)

    async def plan(
        self, robot: str, patch: Mapping[str, Any], *, by: str, base: Base = "kept"
    ) -> PlanRecord:
        """Make a draft of the robot's settings with a patch on top, which become its new version.

        With ``base`` "preset" nothing of what plans before left is kept.

        Raises:
            Problem: 404 for an unknown robot, 409 for one that flies no plans or has not said where
                it is, 422 with the path of each wrong field below ``config``, 503 while storage
                fails.
            StoreUnavailableError: Nothing was kept.
        """
        status = self._fleet.status(robot)
        refuse_recording(status, "follows no target")
        refuse_unless_able(status, "target_tracking")
        self._settings.refuse_while_storage_fails()
        position = self._settings.position(robot)
        book = self._foundation.configurations
        settings = await configure_target(book, robot, patch, base, by=by)
        config = settings.order.config()  # as both ends compute with it
        planner = (await book.current("planner", robot)).value_as(PlannerConfig)
        planner, of_fixes = await with_told_fix_depth(self._foundation.store, robot, planner)
        trim = await book.current("trim", robot)
        try:
            mission = _mission(settings.order, planner, trim.value_as(TrimConfig), position)
        except ValueError as error:
            raise unfit(error) from error
        document = {
            **await self._judgement(robot, config, planner, mission, self._trim_flaws(robot, trim)),
            "config_id": settings.config_id,
            "inherited": [asdict(one) for one in settings.inherited],
            "message": " ".join(filter(None, (_message(config), of_fixes))),
            "trim_id": trim.id,
            "trim_at": None if trim.changed_at is None else trim.changed_at.isoformat(),
            "points": [],
            "legs": [],
            "target_path": target_path(config),
            "draft_age_s": planner.mission.draft_age_s,
        }
        return await self._keep(robot, config, mission, document, by)

    async def _judgement(
        self,
        robot: str,
        config: TrackingConfig,
        planner: PlannerConfig,
        mission: Mission,
        flaws: list[ViolationView],
    ) -> dict[str, Any]:
        """Return the part of a plan's document that an operator decides by."""
        book, status = self._foundation.configurations, self._fleet.status(robot)
        tariff = (await book.current("satellite", robot)).value_as(SatelliteConfig).tariff
        battery = await self._battery.of_target(robot, config)
        account = target_account(
            config,
            planner,
            self._fleet.vehicle(robot),
            status.state,
            size=len(mission.canonical_bytes()),
            credits=mission_credits(mission, tariff),
            battery=battery,
        )
        limits = [*target_violations(status, config), *battery_violations(robot, battery), *flaws]
        warnings = target_warnings(status, config, is_quiet=await self._is_quiet(status))
        return {
            "account": asdict(account),
            "violations": [asdict(one) for one in limits],
            "warnings": [asdict(one) for one in warnings],
        }

    async def _is_quiet(self, status: RobotStatus) -> bool:
        """Tell whether the robot was told not to ping, by what it said last of that."""
        robot, report = status.record.id, status.target_report
        told = await self._foundation.store.query(
            lambda session: newest_applied(session, robot, (CommandKind.QUIET, CommandKind.PING))
        )
        if told is None or (report is not None and report.measured_at > told[1]):
            return report is not None and report.is_quiet
        return told[0] is CommandKind.QUIET

    def _trim_flaws(self, robot: str, trim: CurrentConfiguration) -> list[ViolationView]:
        vehicle, offsets = self._fleet.vehicle(robot), trim.value_as(TrimConfig)
        if vehicle is None:
            return []
        flaw = trim_flaw(
            offsets.net_buoyancy_offset_kg, offsets.mass_position_offset_m, vehicle.limits
        )
        return [ViolationView("trim", f"{flaw[0].upper()}{flaw[1:]}.")] if flaw else []

    async def _keep(
        self,
        robot: str,
        config: TrackingConfig,
        mission: Mission,
        document: Mapping[str, Any],
        by: str,
    ) -> PlanRecord:
        at = self._foundation.clock.now()

        def write(session: Session) -> PlanRecord:
            value = config.model_dump(mode="json")
            plan = query.add_plan(session, robot, FOLLOW_TARGET, config=value, at=at, by=by)
            named = _named(session, robot, mission)
            return apply(
                session,
                plan,
                PlanEvidence.MADE,
                f"{plan} for {robot} is a draft: {_message(config)}",
                at,
                sha256=named.sha256(),
                document={**document, **mission_document(named)},
            )

        return await self._foundation.store.write(write)


def mission_document(mission: Mission) -> dict[str, Any]:
    """Return the part of a plan's document that the mission is built from again."""
    order = mission.tracking
    return {
        "format": mission.format,
        "settings": asdict(mission.settings),
        "tracking": None if order is None else list(order.integers()),
    }


def _mission(
    order: TargetSettings,
    planner: PlannerConfig,
    trim: TrimConfig,
    position: tuple[float, float, float],
) -> Mission:
    duration_s = order.config().motion.duration_s
    settings = MissionSettings.of(planner, trim, position, duration_s)
    return Mission.for_target(settings, order)


def _named(session: Session, robot: str, mission: Mission) -> Mission:
    """Return the mission under a name that no other plan of the robot has: it waits longer."""
    while query.plan_by_hash(session, robot, mission.sha256()) is not None:
        settings = replace(mission.settings, timeout_s=mission.settings.timeout_s + 1.0)
        if mission.tracking is None:
            raise TypeError("a mission that follows a target has an order")
        mission = Mission.for_target(settings, mission.tracking)
    return mission


def _message(config: TrackingConfig) -> str:
    target, motion = config.target, config.motion
    what = _TARGETS[target.kind].format(address=target.address)
    depth = "at the surface" if motion.depth_m == 0.0 else f"{motion.depth_m:g} m deep"
    mark = f" ({TEACHING})" if config.barrier.is_teaching else ""
    return f"It follows {what} for {motion.duration_s:g} s, {depth}{mark}."
