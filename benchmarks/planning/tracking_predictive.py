"""Predictive controllers beside the barrier: ours, CasADi's and SciPy's, in one run.

All begin cold, from inputs of zero, on the same states and end after ten iterations at the latest.
Their costs at that point differ, so how far each is above the best known is told beside its time.
"""

import shutil
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.config import THESIS_TRACKING
from autonomy.tracking.control import control_kernel
from autonomy.tracking.control.control_kernel import control_step
from autonomy.tracking.control.pack_control import pack_control
from autonomy.tracking.predictive import search as predictive_search
from autonomy.tracking.predictive.config import ObjectiveName, PredictiveConfig
from autonomy.tracking.predictive.kernel import ITERATIONS
from autonomy.tracking.predictive.predictive import NUMBERS, pack_predictive
from autonomy.tracking.predictive.search import empty_room, minimize, predictive_step
from benchmarks.calibration import COMPILED, Calibration, calibrated, scaled_row
from benchmarks.field.field import at_least, at_most, row
from benchmarks.planning.predictive_peer import (
    Problem,
    Solve,
    casadi_ipopt,
    casadi_qrqp,
    random_problems,
    slsqp,
)
from reproduction.table_4_3 import WARM, Steps, timed_run

AREA = "tracking_predictive"
STEP_BAR_US, RATIO_BAR = 600.0, 12.0
"""The step's where the plain C step takes what ``calibration`` says of the reference machine."""
PROBLEMS, ROUNDS = 60, 9
BARRIER_CALLS = 50
LIMIT, CONVERGED_LIMIT = 10, 300
SHARE_BELOW = 0.9
TITLES: dict[ObjectiveName, str] = {
    "mpc_none": "O0 nothing",
    "mpc_trace": "O1 trace",
    "mpc_determinant": "O2 determinant",
    "mpc_condition": "O3 condition",
}
BARRIER, OURS = "barrier", "ours"


@dataclass(frozen=True, slots=True)
class Times:
    """Medians of one objective, all measured in turn."""

    step_us: dict[str, float]
    """A step called from Python, by controller."""
    excess: dict[str, float]
    """Cost above the best known, by solver; nine tenths of the problems are below."""


def measure() -> list[dict[str, object]]:
    """Race every solver of every objective against the barrier; takes about a minute."""
    rows: list[dict[str, object]] = []
    problems = random_problems(1, PROBLEMS)
    for name, title in TITLES.items():
        p = packed(name)
        with calibrated(COMPILED) as calibration:
            taken = raced(p, problems)
        rows += step_rows(title, taken, calibration)
        with calibrated(COMPILED) as calibration:
            run = timed_run(title.split()[0], seed=0)
        rows += run_rows(f"{title}, on a run", run, loop_us(p, run), calibration)
        rows += peer_rows(title, taken)
    if shutil.which("gcc") is None:
        rows.append(row(AREA, "CasADi compiled", None, "no gcc", None, None))
    return rows


def step_rows(title: str, taken: Times, calibration: Calibration) -> list[dict[str, object]]:
    """Return how long our step takes, alone and beside the barrier's."""
    ours, barrier = taken.step_us[OURS], taken.step_us[BARRIER]
    return [
        step_row(title, ours, calibration),
        at_most(AREA, f"{title}: barrier step beside it", barrier, "us", None),
        at_least(AREA, f"{title}: our step / barrier step", ours / barrier, RATIO_BAR),
    ]


def step_row(title: str, taken_us: float, calibration: Calibration) -> dict[str, object]:
    """Return how long our step takes; it is a median."""
    name = f"{title}: our step"
    return scaled_row(AREA, name, taken_us, "us", STEP_BAR_US, calibration, by="median")


def run_rows(
    what: str, run: Steps, inside: dict[str, float], calibration: Calibration
) -> list[dict[str, object]]:
    """Return the same on a run, where most plans need little more than shifting.

    There the call itself is most of the barrier's time and little of ours, so the ratio has its
    bar where both are compiled in.
    """
    ours_us = 1e3 * float(np.median(run.search_ms[WARM]))
    ratio = inside[OURS] / inside[BARRIER]
    return [
        step_row(what, ours_us, calibration),
        at_least(AREA, f"{what}: our step / barrier step, called", run.ratio(WARM), None),
        at_least(AREA, f"{what}: our step / barrier step, compiled in", ratio, RATIO_BAR),
    ]


def peer_rows(title: str, taken: Times) -> list[dict[str, object]]:
    """Return every peer's time, the fastest one beside the barrier, and what each has missed."""
    peers = [each for each in taken.step_us if each not in (BARRIER, OURS)]
    rows = [at_most(AREA, f"{title}: {each}", taken.step_us[each], "us", None) for each in peers]
    fastest = min(peers, key=lambda each: taken.step_us[each])
    ratio = taken.step_us[fastest] / taken.step_us[BARRIER]
    name = f"{title}: fastest peer ({fastest}) / barrier step"
    rows.append(at_least(AREA, name, ratio, RATIO_BAR))
    for each in (OURS, fastest):
        what = f"{title}: cost above the best known, {SHARE_BELOW:.0%} quantile, {each}"
        rows.append(at_most(AREA, what, taken.excess[each], "m2 s", None))
    return rows


def packed(name: ObjectiveName) -> FloatArray:
    barrier = THESIS_TRACKING.barrier.model_copy(update={"controller": name})
    config = THESIS_TRACKING.model_copy(update={"barrier": barrier})
    return pack_predictive(config, PredictiveConfig(iterations=LIMIT))


def rivals(p: FloatArray) -> dict[str, Solve]:
    """Return the peers; an exact Hessian must be made convex, or qrqp strays for milliseconds."""
    clipped = {"convexify_strategy": "eigen-clip"}
    approximate = {"hessian_approximation": "limited-memory"}
    found = {
        "CasADi qrqp, exact Hessian": casadi_qrqp(p, LIMIT, clipped),
        "CasADi qrqp, BFGS": casadi_qrqp(p, LIMIT, approximate),
        "CasADi IPOPT": casadi_ipopt(p, LIMIT),
        "SLSQP, our gradient": slsqp(p, LIMIT),
    }
    if shutil.which("gcc") is not None:
        compiled = approximate | {
            "jit": True,
            "compiler": "shell",
            "jit_options": {"flags": ["-O2"], "compiler": "gcc"},
        }
        found["CasADi qrqp, BFGS, gcc"] = casadi_qrqp(p, LIMIT, compiled)
    return found


def ours(p: FloatArray, iterations: int) -> Solve:
    """Return our search as a peer is called, for its cost; its time is that of the whole step."""
    limited = p.copy()
    limited[ITERATIONS] = iterations
    room = empty_room(5)

    def solve(one: Problem) -> tuple[FloatArray, float]:
        plan = one.plan.copy()
        room[0][0][0], room[0][2][0, 0] = one.z, one.covariance
        return plan, minimize(plan, *one.target_velocity, limited, room)[0]

    return solve


def raced(p: FloatArray, problems: list[Problem]) -> Times:
    """Let the barrier, ours and the peers take every problem in turn, called from Python."""
    barrier_p, room = pack_control(THESIS_TRACKING), empty_room(5)
    peers = rivals(p)
    taken: dict[str, list[float]] = {name: [] for name in (BARRIER, OURS, *peers)}
    costs: dict[str, list[float]] = {name: [] for name in (OURS, *peers)}
    limited, converged = ours(p, LIMIT), ours(p, CONVERGED_LIMIT)
    best: list[float] = []
    for one in problems:
        state = (*map(float, one.z), *map(float, one.target_velocity))
        plan = one.plan.copy()

        def barriers(state: Any = state) -> None:
            for _ in range(BARRIER_CALLS):
                control_step(*state, 0.0, 0.0, barrier_p)

        def step(state: Any = state, one: Problem = one, plan: FloatArray = plan) -> None:
            predictive_step(*state, one.covariance, plan, p, room)

        taken[BARRIER].append(timed_us(barriers) / BARRIER_CALLS)
        step_us = []
        for _ in range(ROUNDS):
            plan[:] = one.plan
            step_us.append(timed_us(step))
        taken[OURS].append(statistics.median(step_us))
        costs[OURS].append(limited(one)[1])
        for name, solve in peers.items():
            taken[name].append(timed_us(lambda solve=solve, one=one: solve(one)))
            costs[name].append(solve(one)[1])
        best.append(min(converged(one)[1], *(found[-1] for found in costs.values())))
    missed = {
        name: float(np.quantile(np.subtract(found, best), SHARE_BELOW))
        for name, found in costs.items()
    }
    return Times({name: statistics.median(each) for name, each in taken.items()}, missed)


def loop_us(p: FloatArray, run: Steps) -> dict[str, float]:
    """Time both steps along a run inside a compiled loop, where no call from Python is counted.

    The best of the rounds counts: a loop takes milliseconds, and another program's turn as long.
    """
    barrier_p, room, plan = pack_control(THESIS_TRACKING), empty_room(5), np.zeros(10)
    actions = {
        BARRIER: lambda: _barriers(run.estimates, barrier_p, BARRIER_CALLS),
        OURS: lambda: _predictions(run.estimates, run.covariances, plan, p, room),
    }
    taken: dict[str, list[float]] = {name: [] for name in actions}
    for action in actions.values():
        action()
    for _ in range(ROUNDS):
        for name, action in actions.items():
            taken[name].append(timed_us(action))
    per_step = {name: min(each) / len(run.estimates) for name, each in taken.items()}
    per_step[BARRIER] /= BARRIER_CALLS
    return per_step


@numba.njit(nogil=True)  # not kept on disk: what it calls lives in other files
def _barriers(states: Any, p: Any, repeats: int) -> float:
    total = 0.0
    for _ in range(repeats):
        for i in range(states.shape[0]):
            s = states[i]
            x = (
                s[0] + 1e-12 * total
            )  # or the compiler would work the states out once for all rounds
            found = control_kernel.control_step(x, s[1], s[2], s[3], s[4], s[5], 0.0, 0.0, p)
            total += found[0] + found[1]
    return total


@numba.njit(nogil=True)
def _predictions(states: Any, covariances: Any, plan: Any, p: Any, room: Any) -> float:
    total = 0.0
    for i in range(states.shape[0]):
        s = states[i]
        x = s[0] + 1e-12 * total
        found = predictive_search.predictive_step(
            x, s[1], s[2], s[3], s[4], s[5], covariances[i], plan, p, room
        )
        total += found[0] + found[1]
    return total


def timed_us(action: Callable[[], object]) -> float:
    begin = time.perf_counter()
    action()
    return 1e6 * (time.perf_counter() - begin)


if __name__ == "__main__":
    assert set(TITLES) == set(NUMBERS)  # noqa: S101 - every objective is measured
    for line in measure():
        print(line)
