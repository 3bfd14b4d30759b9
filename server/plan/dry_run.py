"""Plans flown ahead against the robot's full dynamics, in a worker, before they are offered.

A dry run informs; it never keeps a plan from becoming a draft. One that fails or takes too long
leaves a sentence instead of figures.
"""

import logging
from dataclasses import replace

from autonomy.planner.config import PlannerConfig
from autonomy.planner.plan import PrimitiveKind
from autonomy.planner.preset import MINIGLIDER
from autonomy.site import TANK
from autonomy.vehicle.config import VEHICLES, Vehicle
from autonomy.vehicle.trim import TrimConfig
from db.query.mission.plans import PlanRecord
from robot_link.dry_run import DRY_RUN, DryRun, DryRunProblem
from robot_link.mission import Mission, MissionSettings
from server.base.vehicle_catalogue import nearest_built_in
from server.base.worker import WORKER_FAILURES, WorkerPool, WorkerSpentError
from server.fleet.fleet import Fleet
from server.plan.document import dry_run_view, mission_of, points_of
from server.plan.expected import judged
from server.plan.primitive_legs import LegRequest, candidate_of, legs_from
from server.plan.view import DryRunView

log = logging.getLogger(__name__)

LIMIT_S = 90.0
"""Most processor time of a dry run that a plan waits for: usually some seconds. A machine that is
busy with something else only takes longer over it."""
RUNS = 4
"""Most flights of one dry run, each in other eddies."""
FLOWN_S = 2000.0
"""Planned time that all flights of a dry run may have together; a longer plan is flown once.
A worker flies 300 to 500 s of it in a second."""
WORKING = DryRunView("working", message="The plan is flown against the robot's dynamics.")


class DryRuns:
    """Flies plans ahead. Belongs to one event loop."""

    def __init__(self, fleet: Fleet, workers: WorkerPool) -> None:
        self._fleet = fleet
        self._workers = workers

    def before(self, robot: str, config: PlannerConfig) -> DryRunView | None:
        """Return what a plan says before its dry run, ``None`` if that is not wanted."""
        if not config.adaptive.rehearse:
            return None
        if self._fleet.vehicle(robot) is None:
            return DryRunView("skipped", message="Not rehearsed: the vehicle is not known.")
        return WORKING

    async def fly(
        self, plan: PlanRecord, config: PlannerConfig, *, is_limited: bool = True
    ) -> DryRunView:
        """Fly a plan that has its legs, and return how that went.

        Args:
            plan: With the document of a draft.
            config: What it was planned with: the drift and the current that are expected.
            is_limited: Whether it is given up after ``LIMIT_S``, since a plan waits for it.
        """
        problem = self._problem(plan, config)
        if problem is None:
            return DryRunView("skipped", message="Not rehearsed: the vehicle is not known.")
        try:
            found: DryRun = await self._workers.run(
                DRY_RUN, problem, processor_limit_s=LIMIT_S if is_limited else None
            )
        except WorkerSpentError:
            text = f"Not rehearsed: that would have taken longer than {LIMIT_S:g} s of work."
            return DryRunView("skipped", message=text)
        except WORKER_FAILURES as error:
            log.warning("%s was not rehearsed: %s", plan.id, error)
            return DryRunView("failed", message=f"Not rehearsed: {error}")
        document = found.document()
        if found.expected is not None:
            site = self._fleet.status(plan.robot).record.site
            document |= judged(found.expected, found.duration_s, config, site)
        return dry_run_view({"state": "done", **document})

    async def warm_up(self) -> None:
        """Let a worker load what a dry run needs, by a dive in place.

        Raises:
            WorkerTaskError: The task raised.
            WorkerEndedError: The process died.
        """
        down, up = (LegRequest(PrimitiveKind.DIVE, (1.0, 0.5, depth_m)) for depth_m in (0.25, 0.0))
        dive = candidate_of(MINIGLIDER, legs_from(MINIGLIDER, (1.0, 0.5), (down, up)))
        settings = MissionSettings.of(MINIGLIDER, TrimConfig(), dive.legs[0].start_ned, 600.0)
        problem = DryRunProblem(
            mission=Mission.from_legs(settings, dive.legs),
            planned_points=dive.points,
            vehicle=VEHICLES["miniglider"],
            site=TANK,
            start_ne_m=(1.0, 0.5),
            heading_rad=0.0,
            drift_m_sqrt_s=0.0,
            runs=1,
        )
        await self._workers.run(DRY_RUN, problem)

    def _problem(self, plan: PlanRecord, config: PlannerConfig) -> DryRunProblem | None:
        status, vehicle = self._fleet.status(plan.robot), self._fleet.vehicle(plan.robot)
        if vehicle is None:
            return None
        mission = mission_of(plan)
        return DryRunProblem(
            mission=mission,
            planned_points=points_of(plan.document),
            vehicle=_with_known_key(vehicle),
            site=status.record.site,
            start_ne_m=(mission.settings.start_x_m, mission.settings.start_y_m),
            heading_rad=0.0 if status.state is None else status.state.heading_rad,
            drift_m_sqrt_s=config.position_filter.drift_m_sqrt_s,
            current_ne_m_s=config.current.steady_ne_m_s,
            flow=config.current.flow,
            unknown_current_std_m_s=config.position_filter.steady_current_m_s,
            runs=max(1, min(RUNS, int(FLOWN_S // plan.document["account"]["duration_s"]))),
            seed=config.seed,
            keep_outs=config.keep_outs,
        )


def _with_known_key(vehicle: Vehicle) -> Vehicle:
    """Return a vehicle under the key of the built-in one whose instruments it has."""
    if vehicle.key in VEHICLES:
        return vehicle
    return replace(vehicle, key=nearest_built_in(vehicle))
