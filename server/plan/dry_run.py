"""Plans flown ahead against the robot's full dynamics, in a worker, before they are offered.

A dry run informs; it never keeps a plan from becoming a draft. One that fails or takes too long
leaves a sentence instead of figures.
"""

import asyncio
import logging
from collections.abc import Callable
from dataclasses import replace

from autonomy.arrays import FloatArray
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.waterway import closed_areas
from autonomy.planner.plan import PrimitiveKind
from autonomy.planner.preset import MINIGLIDER
from autonomy.site import TANK
from autonomy.vehicle.battery import RESERVE
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

LIMIT_S = 300.0
"""Most processor time of a dry run that a plan waits for, at which something is wrong: usually it
takes some seconds. A machine that is busy with something else only takes longer over it."""
RUNS = 200
"""Flights of one dry run, each of another robot in other water."""
WAITED_S = 30.0
"""Processor time after which no further flight begins while a plan waits. A core flies some
70 000 s in a second, so plans of more than three hours have fewer flights."""
_LEAST_CHARGE = 1.2 * RESERVE
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
        points = points_of(plan.document)
        problem = self.problem(plan.robot, mission_of(plan), points, config)
        return await self._fly(plan.robot, problem, config, None, is_limited=is_limited)

    async def fly_mission(
        self,
        robot: str,
        mission: Mission,
        config: PlannerConfig,
        *,
        on_progress: Callable[[float], None] | None = None,
        is_limited: bool = False,
    ) -> DryRunView:
        """Fly any mission with legs ahead, and return how that went; it need be no plan.

        Cancelling the awaiting task ends the flights.

        Args:
            robot: Who would fly it; from where its first leg begins, with the charge that the
                robot told last.
            mission: Its legs as they would travel.
            config: The current and the drift that are expected, keep-outs and limits.
            on_progress: Told the share that is flown, 0..1.
            is_limited: Whether fewer flights must do for a long mission (``WAITED_S``).

        Raises:
            Problem: 404 if there is no such robot.
        """
        candidate = await asyncio.to_thread(candidate_of, config, mission.legs)
        problem = self.problem(robot, mission, candidate.points, config)
        return await self._fly(robot, problem, config, on_progress, is_limited=is_limited)

    async def _fly(
        self,
        robot: str,
        problem: DryRunProblem | None,
        config: PlannerConfig,
        on_progress: Callable[[float], None] | None,
        *,
        is_limited: bool,
    ) -> DryRunView:
        if problem is None:
            return DryRunView("skipped", message="Not rehearsed: the vehicle is not known.")
        if is_limited:
            problem = replace(problem, processor_s=WAITED_S)
        limit_s = LIMIT_S if is_limited else None
        try:
            found: DryRun = await self._workers.run(
                DRY_RUN, problem, on_progress=on_progress, processor_limit_s=limit_s
            )
        except WorkerSpentError:
            text = f"Not rehearsed: that would have taken longer than {LIMIT_S:g} s of work."
            return DryRunView("skipped", message=text)
        except WORKER_FAILURES as error:
            log.warning("a mission of %s was not rehearsed: %s", robot, error)
            return DryRunView("failed", message=f"Not rehearsed: {error}")
        document = found.document()
        if found.expected is not None:
            site = self._fleet.status(robot).record.site
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
            runs=2,
        )
        await self._workers.run(DRY_RUN, problem)

    def problem(
        self, robot: str, mission: Mission, points: FloatArray, config: PlannerConfig
    ) -> DryRunProblem | None:
        """Return how a mission of a robot is flown ahead, ``None`` where its vehicle is not known.

        Args:
            robot: Who would fly it.
            mission: Its legs as they would travel.
            points: What is promised, shape ``(n, 5)``.
            config: The current and the drift that are expected, keep-outs and limits.

        Raises:
            Problem: 404 if there is no such robot.
        """
        status, vehicle = self._fleet.status(robot), self._fleet.vehicle(robot)
        if vehicle is None:
            return None
        state, position = status.state, config.position_filter
        told = None if state is None else state.battery_fraction
        known_m_s = position.steady_current_m_s
        return DryRunProblem(
            mission=mission,
            planned_points=points,
            vehicle=_with_known_key(vehicle),
            site=status.record.site,
            start_ne_m=(mission.settings.start_x_m, mission.settings.start_y_m),
            heading_rad=0.0 if state is None else state.heading_rad,
            drift_m_sqrt_s=position.drift_m_sqrt_s,
            current_ne_m_s=config.current.steady_ne_m_s,
            flow=config.current.flow,
            # what the filter allows for beyond the usual is that nobody knows how strong that is
            unknown_current_std_m_s=min(known_m_s, position.usual_current_m_s),
            known_current_std_m_s=known_m_s,
            doubt=position.doubt,
            runs=RUNS,
            seed=config.seed,
            keep_outs=closed_areas(config, status.record.site),
            greatest_chance=config.adaptive.greatest_chance,
            # a battery that tells nonsense, or that lets no mission begin, is no start to judge by
            battery=min(max(1.0 if told is None else told, _LEAST_CHARGE), 1.0),
        )


def _with_known_key(vehicle: Vehicle) -> Vehicle:
    """Return a vehicle under the key of the built-in one whose instruments it has."""
    if vehicle.key in VEHICLES:
        return vehicle
    return replace(vehicle, key=nearest_built_in(vehicle))
