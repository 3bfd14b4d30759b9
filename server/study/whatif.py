"""What-if runs: controllers in one scenario on the same seeds, before anybody flies it."""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from autonomy.control.catalogue import CONTROLLERS, ControllerConfig
from autonomy.current.model import tabulate
from autonomy.current.table import FlowTable, table_of
from autonomy.site import Site
from autonomy.vehicle.config import Vehicle
from autonomy.whatif.config import ControllerChoice, TrialConfig
from autonomy.whatif.result import Track
from db.query.mission.studies import StudyRecord
from server.base.configuration_kind import KINDS
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, below, conflict, unprocessable
from server.base.study import Refusal, Studies, study_as
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.current.currents import Currents
from server.current.words import tellers
from server.fleet.fleet import Fleet
from server.study.comparison_view import ShownWhatIfs
from server.study.task import CHECK_WHATIF, WHATIF, WhatIfProblem
from server.study.view import WhatIfAsked, WhatIfSummaryView, WhatIfView
from server.vehicle.vehicles import Vehicles, not_worked_out

_ABOVE_SURFACE_M = 0.05
"""Higher than this is above the surface; a reference that ends there may overshoot a little."""


def water_notices(reference: Track, site: Site) -> list[str]:
    """Say where a reference leaves the water, one sentence each.

    A run is computed without walls and floor, and begins wherever the robot is; what is told of
    walls is what fits nowhere between them.

    Args:
        reference: Where the robot is to be.
        site: Where the robot is.
    """
    north_m, east_m, depth_m = (
        np.array(along, dtype=np.float64)
        for along in (reference.north_m, reference.east_m, reference.depth_m)
    )
    water, place = site.water, f"{site.name} ({site.kind})"
    notices: list[str] = []
    deepest, highest = float(np.nanmax(depth_m)), float(np.nanmin(depth_m))
    if deepest > water.depth_max_m:
        notices.append(
            f"The reference goes {deepest:.1f} m deep; {place} is {water.depth_max_m:g} m deep."
        )
    if highest < -_ABOVE_SURFACE_M:
        notices.append(f"The reference rises {-highest:.1f} m above the surface.")
    for title, along, room_m in (
        ("from south to north", north_m, water.x_max_m - water.x_min_m),
        ("from west to east", east_m, water.y_max_m - water.y_min_m),
    ):
        span_m = float(np.nanmax(along) - np.nanmin(along))
        if span_m > room_m:
            notices.append(
                f"The reference takes {span_m:.1f} m {title}; {place} has {room_m:.1f} m."
            )
    return notices


@dataclass(frozen=True, slots=True)
class ControllerRequest:
    """A controller that is to be compared."""

    kind: str
    title: str | None
    config: Mapping[str, Any]


class WhatIfs(Studies[WhatIfProblem]):
    """What-if runs of all robots. Belongs to one event loop."""

    kind = "whatif"
    task = WHATIF
    event_key = "whatif"

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        vehicles: Vehicles,
        currents: Currents,
        workers: WorkerPool,
    ) -> None:
        super().__init__(foundation.store, foundation.jobs, foundation.clock, workers)
        self._configurations = foundation.configurations
        self._fleet = fleet
        self._vehicles = vehicles
        self._currents = currents
        self._quick = foundation.workers
        self.shown = ShownWhatIfs(foundation.store, fleet)

    async def load(self) -> None:
        """Close the runs that the station left behind, and show again what was shown."""
        await super().load()
        await self.shown.load()

    async def start(
        self,
        robot: str,
        scenario: Mapping[str, Any],
        controllers: Sequence[ControllerRequest],
        *,
        by: str,
    ) -> tuple[str, str]:
        """Begin a run; return its id and the id of its job.

        Fields that are not given have the values that hold for the robot.

        Raises:
            Problem: 404 for an unknown robot, 409 for one without a vehicle, 422 with the path of
                each wrong field or with the limit that the reference breaks, 503 if nothing can
                be worked out.
            StoreError: Nothing was begun.
        """
        vehicle = vehicle_of(robot, self._fleet, self._vehicles)
        problem = await self._problem(robot, vehicle, scenario, controllers)
        await self._check(problem)
        who, flow = await self._flow(robot, problem.scenario)
        asked = WhatIfAsked(
            title=_title(problem),
            vehicle=vehicle.key,
            scenario=problem.scenario,
            controllers=list(problem.controllers),
            current_text=f"Flown in the current that {who} of." if flow else "",
        )
        problem = replace(problem, flow=flow)
        record = await self._add(robot, asked, by)
        return record.id, await self._begin(record, problem, by)

    async def get(self, whatif: str) -> WhatIfView:
        """Return one run with its result.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        record = await self._record(whatif)
        shown = self.shown.id_of(record.robot) == record.id
        view = study_as(WhatIfView, record, shown=shown)
        if view.result is None:
            return view
        site = self._fleet.status(record.robot).record.site
        return view.model_copy(update={"notices": water_notices(view.result.reference, site)})

    async def of_robot(self, robot: str, before: str | None, limit: int) -> list[WhatIfSummaryView]:
        """Return the runs of a robot without their results, the newest first."""
        self._fleet.status(robot)
        shown = self.shown.id_of(robot)
        return [
            study_as(WhatIfSummaryView, record, shown=record.id == shown)
            for record in await self._records(robot, before, limit)
        ]

    async def _problem(
        self,
        robot: str,
        vehicle: Vehicle,
        scenario: Mapping[str, Any],
        controllers: Sequence[ControllerRequest],
    ) -> WhatIfProblem:
        book = self._configurations
        errors: list[FieldError] = []
        config = TrialConfig()
        try:
            config = (await book.merged("trial", robot, scenario)).value_as(TrialConfig)
        except Problem as problem:
            errors += below(problem, "scenario").errors or _reraise(problem)
        choices: list[ControllerChoice] = []
        for number, one in enumerate(controllers):
            if one.kind not in CONTROLLERS:
                message = f"must be one of {', '.join(CONTROLLERS)}"
                errors.append(FieldError(loc=["controllers", number, "kind"], msg=message))
                continue
            try:
                value = (await book.merged(one.kind, robot, one.config)).value
            except Problem as problem:
                prefixed = below(problem, "controllers", number, "config")
                errors += prefixed.errors or _reraise(problem)
                continue
            title = one.title or _free_title(KINDS[one.kind].title, choices)
            choices.append(ControllerChoice(one.kind, title, cast("ControllerConfig", value)))
        if errors:
            count = "1 field is" if len(errors) == 1 else f"{len(errors)} fields are"
            raise unprocessable(f"{count} wrong.", errors)
        return WhatIfProblem(vehicle, config, tuple(choices))

    async def _flow(self, robot: str, scenario: TrialConfig) -> tuple[str, FlowTable | None]:
        """Return who tells of the current that a run flies in, and the table of its map.

        A run begins at the origin of its own frame, which is where the robot is.

        Raises:
            Problem: 422 if the map tells too little, or the robot has not said where it is.
        """
        if scenario.disturbance.current_source != "map":
            return "", None
        status, known = self._fleet.status(robot), self._currents.usable(robot)
        message = (
            "the map of the current tells too little yet; type one"
            if known is None
            else f"{robot} has not said where it is yet"
        )
        if known is None or status.state is None:
            loc: list[str | int] = ["scenario", "disturbance", "current_source"]
            raise unprocessable("1 field is wrong.", [FieldError(loc=loc, msg=message)])
        now_s = self._clock.now().timestamp()
        until_s = now_s + scenario.duration_s
        domain = status.record.site.domain
        record = await asyncio.to_thread(tabulate, known, domain, now_s, until_s)
        table, (north_m, east_m, _) = table_of(record), status.state.position_ned
        low_north_m, low_east_m, low_depth_m, from_s = table.low
        low = (low_north_m - north_m, low_east_m - east_m, low_depth_m, from_s)
        return tellers(self._currents.of(robot), record), table._replace(low=low)

    async def _check(self, problem: WhatIfProblem) -> None:
        try:
            refusal = await self._quick.run(CHECK_WHATIF, problem)
        except WORKER_FAILURES as error:
            raise not_worked_out(error) from error
        if isinstance(refusal, Refusal):
            error = FieldError(loc=list(refusal.loc), msg=refusal.message)
            raise unprocessable(refusal.message, [error])

    def _said(self, record: StudyRecord, state: str) -> str:
        return f"{record.id} of {record.robot} is {state}: {record.asked['title']}."


def vehicle_of(robot: str, fleet: Fleet, vehicles: Vehicles) -> Vehicle:
    """Return the vehicle that a robot is.

    Raises:
        Problem: 404 for an unknown robot, 409 for a recording of something unknown.
    """
    model = fleet.status(robot).record.model
    vehicle = vehicles.find(model)
    if vehicle is None:
        raise conflict(
            f"It is not known what vehicle {robot} is; say so first "
            f"(PATCH /api/robots/{robot} with a model of the catalogue)."
        )
    return vehicle


def _title(problem: WhatIfProblem) -> str:
    names = ", ".join(controller.title for controller in problem.controllers)
    return f"{names}: {problem.scenario.reference.replace('_', ' ')}"


def _free_title(title: str, others: Sequence[ControllerChoice]) -> str:
    taken = {other.title for other in others}
    numbered = (f"{title} {number}" for number in range(2, len(taken) + 3))
    return next(one for one in (title, *numbered) if one not in taken)


def _reraise(problem: Problem) -> list[FieldError]:
    """Pass on a refusal that is about something else than a field."""
    raise problem
