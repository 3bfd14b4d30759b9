"""What one round is planned with: settings, samples of the site, and what robots already plan."""

import asyncio
from collections.abc import Mapping

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray
from autonomy.field.config import FieldConfig
from autonomy.field.samples import FieldSamples
from autonomy.planner.config import PlannerConfig
from autonomy.planner.plan import Leg
from db.query.mission.missions import OPEN_STATES, get_mission
from db.query.mission.plans import PlanRecord, list_plans
from robot_link.messages import PlanReport
from server.base.foundation import Foundation
from server.current.currents import Currents
from server.fleet.fleet import Fleet
from server.fleet.water import Water
from server.map.group import field_config_of
from server.map.samples import in_moving_water, site_samples
from server.plan.ahead import planned_rest
from server.plan.task import MapProblem, SurveyProblem

_WAITING = ("draft", "sent", "on_board")


class RoundProblems:
    """Puts together what a search needs to know. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._currents = foundation.services.get(Currents)

    async def survey(
        self,
        plan: PlanRecord,
        config: PlannerConfig,
        start_xy: tuple[float, float],
        budget: float,
        *,
        warm: tuple[tuple[Leg, ...], ...],
        attempt: int,
        flown: FloatArray | None = None,
    ) -> SurveyProblem:
        """Return one round as a worker takes it.

        Args:
            plan: The plan that is to be made.
            config: Settings of the round.
            start_xy: Where it begins, north and east, m.
            budget: Energy units that it may spend.
            warm: Trajectories to begin with.
            attempt: How often the search went on from an earlier one.
            flown: Where the robot itself samples before the round begins, shape ``(m, 5)``;
                ``None`` for all that is left of what it flies.
        """
        planned = await self._planned(plan.robot, config, flown)
        field = await self._field_config(plan.robot, config)
        return SurveyProblem(
            planner=config,
            field=field,
            samples=await self.samples(plan.robot, config, field),
            start_xy=start_xy,
            budget=budget,
            round_number=plan.round,
            site=self._fleet.status(plan.robot).record.site,
            warm=warm,
            planned_points=planned[:, 1:4],
            planned_std_m=planned[:, 4],
            attempt=attempt,
        )

    async def map(self, robot: str, config: PlannerConfig) -> MapProblem:
        """Return the map of a robot's site as a worker takes it."""
        field = await self._field_config(robot, config)
        return MapProblem(
            planner=config,
            field=field,
            samples=await self.samples(robot, config, field),
            site=self._fleet.status(robot).record.site,
        )

    async def _field_config(self, robot: str, planner: PlannerConfig) -> FieldConfig:
        found = await self._foundation.configurations.current("field", robot)
        return field_config_of(found, planner, self._foundation.channels.catalogue)

    async def samples(self, robot: str, planner: PlannerConfig, field: FieldConfig) -> FieldSamples:
        """Return the samples of a robot's water, where the map has them that is planned for."""
        channel = self._foundation.channels.get(field.variable).channel
        taken = await self._foundation.store.query(
            lambda session: site_samples(session, robot, channel)
        )
        carrier = self._currents.carrier(robot)
        return await asyncio.to_thread(in_moving_water, taken, field, carrier, planner.domain)

    async def _planned(
        self, robot: str, config: PlannerConfig, flown: FloatArray | None
    ) -> FloatArray:
        """Return the points at which robots of the site will sample, shape ``(m, 5)``.

        What this robot flies counts, and of others also what they are about to fly.
        """
        here = Water.of(self._fleet.status(robot).record)
        reports: dict[str, PlanReport | None] = {
            status.record.id: status.plan_report
            for status in self._fleet.statuses
            if Water.of(status.record) == here
        }
        oldest_s = config.mission.draft_age_s
        now_s = self._foundation.clock.now().timestamp()
        plans = await self._foundation.store.query(
            lambda session: _coming(session, robot, reports, now_s - oldest_s)
        )
        rests = [
            planned_rest(plan, reports[plan.robot])
            for plan in plans
            if plan.robot != robot or flown is None
        ]
        return np.concatenate([np.empty((0, 5)) if flown is None else flown, *rests])


def _coming(
    session: Session, robot: str, robots: Mapping[str, PlanReport | None], oldest_s: float
) -> list[PlanRecord]:
    """Return the plans that robots of a site fly, or are about to fly, but for this one's wait."""
    found: list[PlanRecord] = []
    for other in robots:
        found += list_plans(session, robot=other, states=("running",))
        if other != robot:
            waiting = list_plans(session, robot=other, states=_WAITING)
            found += [plan for plan in waiting if _is_meant(session, plan, oldest_s)]
    return found


def _is_meant(session: Session, plan: PlanRecord, oldest_s: float) -> bool:
    """Tell whether a plan that waits is still going to be flown, as far as one can know."""
    if plan.mission is not None:
        return get_mission(session, plan.mission).state in OPEN_STATES
    return plan.created_at.timestamp() >= oldest_s
