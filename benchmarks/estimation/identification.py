"""Identification of the Miniglider from six noisy open-loop runs of 80 s, and what it costs.

Errors are the worst of several recordings and guesses. The swarm is given 20 moves and then
polished by least squares, which is the product's default order of work with fewer moves, so that
the whole measurement stays under a minute.
"""

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from autonomy.identification import least_squares, nuisance
from autonomy.identification.config import IdentificationConfig, NoiseLevels
from autonomy.identification.problem import Problem, Workers, problem_from
from autonomy.identification.result import IdentificationResult
from autonomy.identification.run import identify
from autonomy.identification.unknown import free_names
from autonomy.vehicle.config import MINIGLIDER, Vehicle
from benchmarks.calibration import COMPILED, calibrated, scaled_row
from tests.autonomy.identification_flight import open_loop_recording

PARTICLES = 100
ROUNDS = 5
MOVES = 20
ITERATION_BAR_S = 0.5
"""Where the plain C step takes what ``calibration`` says of the reference machine."""
ERROR_BAR = 0.03
COST_BAR = 1.02
CASES = ((3, 7), (13, 17), (23, 27))
"""Seeds of recording and guess."""
WELL_KNOWN = ("mass_1_kg", "drag_0", "drag_alpha", "drag_delta", "lift_0", "lift_alpha")
PRODUCT = ("offset_mass_kg", "offset_mass_depth_m")


def measure() -> list[dict[str, Any]]:
    recording = open_loop_recording(MINIGLIDER, np.random.default_rng(CASES[0][0]))
    config = IdentificationConfig(
        model="thesis",
        fits_offsets=False,
        iterations=MOVES,
        particles=PARTICLES,
        noise=NoiseLevels(fix_hold_s=0.0),
    )
    start = _guess(config, CASES[0][1])
    problem = problem_from(start, recording, config)
    exact = problem_from(start, recording, config.model_copy(update={"step_s": 0.05}))
    with calibrated(COMPILED) as calibration:
        one_s = _iteration_s(exact, 1, time.process_time)
    two_s = _iteration_s(exact, 2, time.perf_counter)
    swarm, swarm_s = _timed(problem, config)
    by_descent = config.model_copy(update={"method": "least_squares"})
    descent, descent_s = _timed(problem, by_descent)
    others = [_other(by_descent, *seeds) for seeds in CASES[1:]]
    truth = _cost_of_truth(recording, config)
    found = all(
        result.parameter(name).verdict == "not identifiable"
        for result in (swarm, descent)
        for name in PRODUCT
    )
    return [
        scaled_row(
            "identification",
            "Swarm iteration, 100 x 480 s, dt 0.05, processor time",
            one_s,
            "s",
            ITERATION_BAR_S,
            calibration,
        ),
        _row("Swarm iteration on two threads", two_s, "s"),
        _row(f"Swarm of {MOVES} moves with polish", swarm_s, "s"),
        _row("Least squares from up to 15 % off", descent_s, "s"),
        _row("Worst of six parameters, swarm with polish", _worst(swarm), "", ERROR_BAR),
        _row(
            f"Worst of six parameters, least squares, {len(CASES)} recordings and guesses",
            max(_worst(result) for result in (descent, *others)),
            "",
            ERROR_BAR,
        ),
        _row(
            "Cost after swarm with polish / cost of truth", swarm.cost_after / truth, "", COST_BAR
        ),
        _row("Cost after least squares / cost of truth", descent.cost_after / truth, "", COST_BAR),
        _row("Product of offset mass and depth, error", _product_error(swarm), "", 0.1),
        {
            "area": "identification",
            "name": "Null direction named: only offset mass x depth enters",
            "value": float(found),
            "unit": "",
            "bar": 1.0,
            "met": found,
        },
    ]


def _other(config: IdentificationConfig, flown: int, guessed: int) -> IdentificationResult:
    """Return the result of another recording from another guess, recorded half as often."""
    recording = open_loop_recording(MINIGLIDER, np.random.default_rng(flown), period_s=0.2)
    coarse = config.model_copy(update={"step_s": 0.2})
    return _timed(problem_from(_guess(config, guessed), recording, coarse), coarse)[0]


def _guess(config: IdentificationConfig, seed: int) -> Vehicle:
    """Return the Miniglider with every free parameter wrong by up to 15 %."""
    generator = np.random.default_rng(seed)
    values = MINIGLIDER.parameters.model_dump()
    wrong = {
        name: values[name] * (1.0 + 0.15 * generator.uniform(-1.0, 1.0))
        for name in free_names(config.free)
    }
    return replace(MINIGLIDER, parameters=MINIGLIDER.parameters.model_copy(update=wrong))


def _iteration_s(problem: Problem, threads: int, clock: Callable[[], float]) -> float:
    generator = np.random.default_rng(1)
    u = generator.uniform(problem.low, problem.high, (PARTICLES, len(problem.sought)))
    best = math.inf
    with Workers(threads) as workers:
        profile = nuisance.profile_of(problem, 0.0 * u[0], problem.guess, workers)
        nuisance.costs(problem, u, profile, workers)
        for _ in range(ROUNDS):
            begin = clock()
            nuisance.costs(problem, u, profile, workers)
            best = min(best, clock() - begin)
    return best


def _timed(problem: Problem, config: IdentificationConfig) -> tuple[IdentificationResult, float]:
    begin = time.perf_counter()
    result = identify(
        problem,
        config,
        np.random.default_rng(config.seed),
        report=lambda _: None,
        is_cancelled=lambda: False,
    )
    return result, time.perf_counter() - begin


def _cost_of_truth(recording: Any, config: IdentificationConfig) -> float:
    problem = problem_from(MINIGLIDER, recording, config)
    with Workers(2) as workers:
        return least_squares.begin(problem, np.zeros(len(problem.sought)), workers).cost


def _worst(result: IdentificationResult) -> float:
    truth = MINIGLIDER.parameters.model_dump()
    return max(abs(result.parameter(name).after / truth[name] - 1.0) for name in WELL_KNOWN)


def _product_error(result: IdentificationResult) -> float:
    truth = MINIGLIDER.parameters.model_dump()
    found = math.prod(result.parameter(name).after for name in PRODUCT)
    return abs(found / math.prod(truth[name] for name in PRODUCT) - 1.0)


def _row(name: str, value: float, unit: str, bar: float | None = None) -> dict[str, Any]:
    met = None if bar is None else bool(value <= bar)
    return {
        "area": "identification",
        "name": name,
        "value": value,
        "unit": unit,
        "bar": bar,
        "met": met,
    }


if __name__ == "__main__":
    for row in measure():
        print(row)
