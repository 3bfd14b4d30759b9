"""How a trajectory becomes a draft: kept under a name of its own, flown ahead, then offered.

Each step is taken as soon as storage takes it, and none where somebody ended the plan meanwhile.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import asdict, replace
from typing import Any

from autonomy.field.config import FieldConfig
from autonomy.planner.config import PlannerConfig
from autonomy.planner.plan import Candidate
from db.query.mission.plans import PlanRecord, PlanStateError
from robot_link.satellite.config import SatelliteConfig
from robot_link.surfacing_order import SurfacingOrder
from server.base.configuration_kind import ONBOARD_CONTROLLER
from server.base.foundation import Foundation
from server.base.retry_queue import until_stored
from server.fleet.fleet import Fleet
from server.plan.battery import PlanBattery, battery_violations, way_there
from server.plan.document import Draft, draft_document
from server.plan.drafting import draft_of
from server.plan.dry_run import DryRuns
from server.plan.flow import PlanFlows
from server.plan.ledger import PlanLedger
from server.plan.search.survey_round import REPLACES
from server.plan.state import PlanEvidence
from server.plan.view import DryRunView

log = logging.getLogger(__name__)


class DraftKeeper:
    """Keeps what planning found. Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        ledger: PlanLedger,
        flows: PlanFlows,
        dry_runs: DryRuns,
    ) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._ledger = ledger
        self._flows = flows
        self._dry_runs = dry_runs
        self._battery = foundation.services.get(PlanBattery)
        self._naming = asyncio.Lock()

    async def keep_found(
        self, plan: PlanRecord, config: PlannerConfig, best: Candidate, found: Mapping[str, Any]
    ) -> PlanRecord | None:
        """Keep a trajectory as soon as storage takes it; None if the plan was ended meanwhile."""
        text = f"{plan.id} for {plan.robot} is a draft: {found['message']}"
        kept: list[PlanRecord] = []

        async def keep() -> None:
            draft = await self.draft(plan.robot, config, best)
            kept.append(await self.keep(plan, config, draft, text, found))

        await self.settle(plan.id, keep)
        return kept[-1] if kept else None

    async def keep(
        self,
        plan: PlanRecord,
        config: PlannerConfig,
        draft: Draft,
        text: str,
        found: Mapping[str, Any] | None = None,
    ) -> PlanRecord:
        """Keep a trajectory: as a draft, or, before its dry run, in planning.

        Args:
            plan: Being made.
            config: What it is judged by.
            draft: The mission that it is.
            text: What the log says once it is a draft.
            found: What else is known of it.

        Raises:
            PlanStateError: If it was ended meanwhile.
            StoreUnavailableError: Nothing was kept.
        """
        legs = draft.mission.legs
        comes_up = await self._flows.surfacings(plan.robot, config, legs)
        document = {**(found or {}), "draft_text": text, "comes_up": comes_up}
        dry_run = self._dry_runs.before(plan.robot, config)
        if dry_run is not None:
            document["rehearsal"] = asdict(dry_run)
        async with self._naming:
            while await self._ledger.is_taken(plan, draft.mission.sha256()):
                draft = draft.renamed()
            kept = await self._ledger.note(
                plan.id,
                {**document, **draft_document(draft)},
                only_from=("planning",),
                sha256=draft.mission.sha256(),
            )
        if dry_run is not None and dry_run.state == "working":
            return kept
        return await self.offer(kept, dry_run)

    async def fly_ahead(self, plan: PlanRecord, config: PlannerConfig) -> None:
        """Fly a plan ahead, then offer it whatever came of that."""
        dry_run = await self._dry_runs.fly(plan, config)
        await self.settle(plan.id, lambda: self.offer(plan, dry_run))

    async def offer(self, plan: PlanRecord, dry_run: DryRunView | None) -> PlanRecord:
        """Make a plan a draft in the place of the one that it replaces.

        Raises:
            PlanStateError: If it was ended meanwhile.
        """
        replaces = plan.document.get(REPLACES)
        document = {"rehearsal": None if dry_run is None else asdict(dry_run)}
        try:
            return await self._ledger.make_draft(
                plan.id, plan.document["draft_text"], document, replaces=replaces
            )
        except PlanStateError as error:
            if (await self._ledger.get(plan.id)).state != "planning":
                raise
            return await self.fail(plan.id, f"{error} It is left as it is; plan again.")

    async def settle(self, plan: str, step: Callable[[], Awaitable[object]]) -> None:
        """Take a step of planning; someone else may have ended the plan meanwhile."""

        async def work() -> None:
            await step()

        try:
            await until_stored(f"the end of planning {plan}", work)
        except PlanStateError as error:
            log.info("%s needs no end of planning: %s", plan, error)

    async def fail(
        self, plan: str, message: str, document: Mapping[str, Any] | None = None
    ) -> PlanRecord:
        """End a plan that could not be made, with the reason."""
        return await self._ledger.move(
            plan,
            PlanEvidence.NOT_MADE,
            f"{plan} was not made: {message}",
            {**(document or {}), "message": message},
        )

    async def interrupted(self, plan: str) -> None:
        """End a plan that storage let down."""
        message = "The station's storage failed while it planned; plan again."
        await self.fail(plan, message, {"interrupted": True})

    async def draft(
        self,
        robot: str,
        config: PlannerConfig,
        best: Candidate,
        rules: SurfacingOrder | None = None,
    ) -> Draft:
        """Return the draft that a trajectory makes with the settings of now.

        Raises:
            ValueError: If it cannot travel to the robot.
        """
        book = self._foundation.configurations
        controller = await book.current(ONBOARD_CONTROLLER, robot)
        field = await book.current("field", robot)
        draft = draft_of(
            self._fleet.status(robot),
            self._fleet.vehicle(robot),
            config,
            await book.current("trim", robot),
            best,
            controller=controller.value,
            field=field.value_as(FieldConfig),
            tariff=(await book.current("satellite", robot)).value_as(SatelliteConfig).tariff,
            rules=rules,
        )
        legs = draft.mission.legs
        battery = await self._battery.of_legs(robot, config, legs, draft.duration_s)
        lasts = battery_violations(robot, battery)
        return replace(
            draft,
            battery=battery,
            way_there=way_there(self._fleet.status(robot), config, legs),
            violations=(*draft.violations, *lasts),
        )
