"""Answers at once in the place of worker processes: plans are dives in place."""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from autonomy.planner.config import PlannerConfig
from autonomy.planner.plan import Candidate, ObjectivePoint, PlanResult, PlanStatus, PrimitiveKind
from robot_link.dry_run import DryRun, DryRunProblem, DryRunTrack, Safety
from server.base.worker import Withdrawn, WorkerPool, WorkerTaskError
from server.map.task import COMPARE_MAPS
from server.plan.primitive_legs import LegRequest, candidate_of, legs_from
from server.plan.task import MAP_STD, SurveyProblem

DEPTHS_M = (0.30, 0.28, 0.26)
"""Of the best plan's dives and of its runners-up's."""


class FakeWorkers:
    """Stands where ``WorkerPool.run`` stands; what is asked of it is kept."""

    def __init__(self) -> None:
        self.problems: list[SurveyProblem] = []
        self.dry_runs: list[DryRunProblem] = []
        self.dry_run_pools: list[WorkerPool] = []
        self.may_plan = asyncio.Event()
        self.may_plan.set()
        self.may_fly = asyncio.Event()
        self.may_fly.set()
        self.fails: dict[str, Exception] = {
            COMPARE_MAPS: WorkerTaskError("ValueError: maps are not scored here")
        }
        """What a task raises, by its name."""
        self.nothing_feasible = False
        self.breaks_off = 0
        """How many of the next dry runs do not come to the end of their plan."""
        self.enters: tuple[str, ...] = ()
        """Keep-outs that every dry run leads into."""
        self.safety: list[Safety] = []
        """How often the flights of the next dry runs leave the water; of all later ones none."""
        self.map_std = 1.0
        self.run_really = WorkerPool.run

    @staticmethod
    async def run_for(
        pool: WorkerPool,
        fake: "FakeWorkers",
        task: str,
        payload: object,
        *,
        on_progress: Callable[[object], None] | None = None,
        processor_limit_s: float | None = None,
        on_withdrawn: Callable[[Withdrawn | None], None] | None = None,
    ) -> object:
        """Do what ``WorkerPool.run`` does; a pool's own method calls it."""
        return await fake.run(
            pool,
            task,
            payload,
            on_progress=on_progress,
            processor_limit_s=processor_limit_s,
            on_withdrawn=on_withdrawn,
        )

    async def run(
        self,
        pool: WorkerPool,
        task: str,
        payload: object,
        *,
        on_progress: Callable[[object], None] | None = None,
        processor_limit_s: float | None = None,
        on_withdrawn: Callable[[Withdrawn | None], None] | None = None,
    ) -> object:
        if isinstance(payload, SurveyProblem):
            self.problems.append(payload)
            await self.may_plan.wait()
        if isinstance(payload, DryRunProblem):
            self.dry_runs.append(payload)
            self.dry_run_pools.append(pool)
            await self.may_fly.wait()
        if task in self.fails:
            raise self.fails[task]
        if isinstance(payload, SurveyProblem):
            return self.plan(payload)
        if isinstance(payload, DryRunProblem):
            self.breaks_off -= 1
            found = dry_run_of(payload, completed=self.breaks_off < 0, entered=self.enters)
            safe = Safety(payload.runs, 0, (), 0.0)
            return replace(found, safety=self.safety.pop(0) if self.safety else safe)
        if task == MAP_STD:
            return self.map_std
        return await self.run_really(
            pool,
            task,
            payload,
            on_progress=on_progress,
            processor_limit_s=processor_limit_s,
            on_withdrawn=on_withdrawn,
        )

    def plan(self, problem: SurveyProblem) -> PlanResult:
        if self.nothing_feasible:
            message = "No trajectory: the water is too shallow."
            return PlanResult(PlanStatus.NOTHING_FEASIBLE, message, None, (), (), 0, False)
        deeper_m = 0.002 * (problem.round_number - 1)  # no two rounds are the same mission
        best, *others = (
            dives(problem.planner, problem.start_xy, problem.budget, depth_m + deeper_m)
            for depth_m in DEPTHS_M
        )
        history = (ObjectivePoint(0.1, best.objective, 3),)
        return PlanResult(PlanStatus.FOUND, "Dives.", best, tuple(others), history, 3, False)


def dives(
    config: PlannerConfig, start_xy: tuple[float, float], budget: float, depth_m: float
) -> Candidate:
    """Return as many dives in place as a budget allows."""
    down, up = (LegRequest(PrimitiveKind.DIVE, (0.0, 0.0, z)) for z in (depth_m, 0.0))
    once = candidate_of(config, legs_from(config, start_xy, [down, up]))
    legs = legs_from(config, start_xy, [down, up] * int(budget // once.energy))
    found = candidate_of(config, legs)
    return type(found)(
        found.legs, found.points, depth_m, found.energy, found.duration_s, found.worst_std_m
    )


def dry_run_of(problem: DryRunProblem, *, completed: bool, entered: tuple[str, ...] = ()) -> DryRun:
    points = problem.planned_points
    ned = points[:, 1:4]
    return DryRun(
        completed=completed,
        message="Flown." if completed else "The robot did not fly the whole plan: it was lost.",
        rms_error_m=0.05,
        worst_error_m=0.1,
        surfacing_error_m=0.07,
        position_error_m=0.03,
        predicted_error_m=0.04,
        planned_worst_std_m=0.05,
        within_share=0.9,
        duration_s=float(points[-1, 0]),
        energy=3.0,
        runs=problem.runs,
        entered=entered,
        track=DryRunTrack(points[:, 0], ned, ned, points[:, 4], ned, np.full(len(points), 0.04)),
        **(expectation_of(problem) if completed and problem.runs > 1 else {}),
    )


def expectation_of(problem: DryRunProblem) -> dict[str, Any]:
    """Return an expected track 0.2 m east of the legs, of which each takes 30 s and 20 s before."""
    rows, times_s, flown_s = [], [], 0.0
    for number, leg in enumerate(problem.mission.legs):
        for share in (0.0, 0.5, 1.0):
            start, end = np.array(leg.start_ned), np.array(leg.end_ned)
            place = start + share * (end - start) + (0.0, 0.2, 0.0)
            rows.append((flown_s + share * leg.duration_s, *place, 0.06))
        flown_s += leg.duration_s
        times_s.append((50.0 * number + 20.0, 50.0 * number + 50.0))
    return {"expected": np.array(rows), "expected_times_s": tuple(times_s), "spread_m": 0.08}
