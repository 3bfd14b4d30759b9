"""Plans of one robot side by side: what each would tell of the map, on the same belief."""

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from autonomy.planner.plan import Leg
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, unprocessable
from server.base.worker import WORKER_FAILURES
from server.fleet.fleet import Fleet
from server.plan.document import legs_of
from server.plan.ledger import PlanLedger
from server.plan.planning import Planning
from server.schedule.replan.problem import COMPARE, ComparisonProblem, Judged
from server.schedule.replan.view import ComparedPlanView, JudgedView


class PlanComparison:
    """Judges plans as they are written, flown or not. Belongs to one event loop."""

    def __init__(
        self, foundation: Foundation, fleet: Fleet, ledger: PlanLedger, planning: Planning
    ) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._ledger = ledger
        self._planning = planning

    async def of(self, robot: str, plans: Sequence[str]) -> list[ComparedPlanView]:
        """Return what each plan would bring if it alone were flown from now on.

        Raises:
            Problem: 404 for an unknown robot, 409 for one without a map, 422 for a plan without
                legs or of another robot, 503 where the worker failed.
            UnknownIdError: If there is no such plan.
        """
        asked = await self._planning.settings.merged(robot, {})
        config = (await self._planning.in_water(robot, asked)).config
        legs = [await self._legs(robot, number, plan) for number, plan in enumerate(plans)]
        # What the robot flies must not count as sampled already where it is itself compared.
        hand = self._fleet.status(robot).plan
        is_flown = hand is not None and hand.plan_id in plans
        survey = await self._planning.problems.survey(
            await self._ledger.get(plans[0]),
            config,
            legs[0][0].start_ned[:2],
            0.0,
            warm=(),
            attempt=0,
            flown=np.empty((0, 5)) if is_flown else None,
        )
        problem = ComparisonProblem(survey, tuple(legs))
        try:
            found: list[Judged] = await self._foundation.workers.run(COMPARE, problem)
        except WORKER_FAILURES as error:
            raise Problem(503, f"The plans could not be compared: {error}") from error
        return [
            ComparedPlanView(plan, JudgedView(**asdict(one)))
            for plan, one in zip(plans, found, strict=True)
        ]

    async def _legs(self, robot: str, number: int, plan: str) -> tuple[Leg, ...]:
        record = await self._ledger.get(plan)
        flaw = ""
        if record.robot != robot:
            flaw = f"{plan} is {record.robot}'s"
        elif not record.document.get("legs"):
            flaw = f"{plan} has no legs"
        if flaw:
            raise unprocessable(f"{flaw}.", [FieldError(loc=["plans", number], msg=flaw)])
        return legs_of(record.document)
