"""The planner beside Algorithm 1 to the letter, on the specification's tank problem.

Both run in this process on the same problem; objectives are recomputed by the plain formulas.
"""

import dataclasses
import json
import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from autonomy.estimation.config import EstimatorConfig
from autonomy.field.config import GridShape
from autonomy.field.gaussian_process import GaussianProcess
from autonomy.field.grid import Grid
from autonomy.field.scale import to_model
from autonomy.field.synthetic import measure as sample_field
from autonomy.planner import kernel, literal, search
from autonomy.planner.belief import FieldBelief
from autonomy.planner.config import PlannerConfig, PrimitiveConfig
from autonomy.planner.edge import propose_edge, random_shape
from autonomy.planner.objective import objective
from autonomy.planner.plan import PlanResult

SEEDS = (0, 1, 2)
START = (0.3, 0.3)
BUDGET = 20.0
PAST_EDGES, PAST_SAMPLES = 9, 60
FAST_S = 1.0
LITERAL_S = {"information_gain": 10.0, "ergodic": 2.0}
CONFIG = PlannerConfig(
    max_uncertainty_m=0.5,
    fidelity_counts=False,
    primitives=PrimitiveConfig(swim_length_max_m=1.4),
    position_filter=EstimatorConfig(drift_m_sqrt_s=0.02),
)
TEST_POINTS = Grid.over(CONFIG.domain, GridShape(x=10, y=6, z=4)).points


def measure() -> list[dict[str, object]]:
    """Run both planners on three seeds with each objective; takes about 50 s."""
    kernel.warm_up()
    rows = speed_and_memory()
    for name in ("information_gain", "ergodic"):
        config = CONFIG.model_copy(update={"objective": name})
        for seed in SEEDS:
            rows += duel(config, seed)
    return rows


def speed_and_memory() -> list[dict[str, object]]:
    """Candidates a second, delay of the first trajectory, and memory of a longer search.

    Seconds are the processor's, so that other work on the machine does not count.
    """
    clock = time.process_time
    before = resident_mb()
    results = [plan_for(search.plan, CONFIG, seed, FAST_S, clock) for seed in SEEDS]
    rate = sum(result.candidates for result in results) / (len(SEEDS) * FAST_S)
    delay = max(result.history[0].elapsed_s for result in results)
    plan_for(search.plan, CONFIG, SEEDS[0], 3.0 * FAST_S, clock)
    added = resident_mb() - before
    return [
        row("budget-feasible candidates, information gain", rate, "1/s", 5000.0, rate >= 5000.0),
        row("first trajectory, slowest seed", delay, "s", None, None),
        row("memory that searches of up to 3 s leave in use", added, "MB", 500.0, added <= 500.0),
    ]


def duel(config: PlannerConfig, seed: int) -> list[dict[str, object]]:
    """Compare the objective after one second with the letter's after many."""
    literal_s = LITERAL_S[config.objective]
    worth = objective(config, belief(seed))
    fast = plan_for(search.plan, config, seed, FAST_S)
    letter = plan_for(literal.plan, config, seed, literal_s)
    exact = worth(fast.best.points)
    bar = worth(letter.best.points)
    what = f"{config.objective.replace('_', ' ')}, seed {seed}"
    unit = "nats" if config.objective == "information_gain" else "-KL"
    error = abs(fast.best.objective - exact)
    return [
        row(
            f"{what}: {FAST_S:g} s; bar: the letter's {literal_s:g} s",
            exact,
            unit,
            bar,
            exact > bar,
        ),
        row(f"{what}: error of the reported objective", error, unit, 1e-6, error <= 1e-6),
    ]


def plan_for(
    planner: Callable[..., PlanResult],
    config: PlannerConfig,
    seed: int,
    seconds: float,
    clock: Callable[[], float] = time.perf_counter,
) -> PlanResult:
    """Run one planner for so many seconds of a clock, by default the wall's."""
    problem = belief(seed)
    began = clock()
    return planner(
        config.model_copy(update={"planning_time_s": seconds}),
        problem,
        START,
        rng=np.random.default_rng(seed),
        budget=BUDGET,
        on_progress=lambda _: None,
        is_cancelled=lambda: False,
        elapsed_s=lambda: clock() - began,
    )


def belief(seed: int) -> FieldBelief:
    """What 60 samples along nine random edges say about the tank's blue light."""
    rng = np.random.default_rng([seed, 1])
    domain = CONFIG.domain
    low, high = (domain.x_min_m, domain.y_min_m), (domain.x_max_m, domain.y_max_m)
    places: list[np.ndarray] = []
    while len(places) < PAST_EDGES:
        start, goal = rng.uniform(low, high), rng.uniform(low, high)
        shape = random_shape(CONFIG, rng)
        edge = propose_edge(CONFIG, tuple(start), tuple(goal), BUDGET, shape)
        if edge is not None:
            places.append(edge.points[:, 1:4])
    samples = np.concatenate(places)[:PAST_SAMPLES]
    blank = FieldBelief(
        signal_variance=5.27,
        length_scales_m=(2.41, 2.46, 2.40),
        noise_variance=0.0025,
        sample_points=samples,
        test_points=TEST_POINTS,
        mean=np.zeros(len(TEST_POINTS)),
        std=np.ones(len(TEST_POINTS)),
    )
    seen = to_model("log", sample_field("blue_light", samples, rng))
    posterior = GaussianProcess(blank.kernel(), samples, seen)
    return dataclasses.replace(
        blank,
        mean=posterior.mean(TEST_POINTS),
        std=np.sqrt(np.maximum(posterior.variance(TEST_POINTS), 0.0)),
    )


def resident_mb() -> float:
    """Memory of this process that is in use now."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def row(
    name: str, value: float, unit: str, bar: float | None, met: bool | None
) -> dict[str, object]:
    """Make one line of the benchmark's report."""
    return {
        "area": "planner",
        "name": name,
        "value": round(value, 9) if value < 1e-3 else round(value, 3),
        "unit": unit,
        "bar": bar if bar is None else round(bar, 6),
        "met": met,
    }


if __name__ == "__main__":
    print(json.dumps(measure(), indent=1))
