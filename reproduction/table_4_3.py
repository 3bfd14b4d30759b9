"""Thesis Table 4.3: what a step of the barrier and of its predictive rivals costs in time."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.control.control_kernel import control_step
from autonomy.tracking.control.pack_control import pack_control
from autonomy.tracking.predictive import search as predictive_search
from autonomy.tracking.predictive.config import PredictiveConfig
from autonomy.tracking.predictive.predictive import SOLVER
from reproduction.result import Figure, Mark, Panel, Report, Reproduction, Row, Series
from reproduction.rival import (
    BARRIER,
    COARSE,
    HUES,
    ITERATIONS,
    OBJECTIVES,
    compiled,
    run_column,
    slsqp,
    steered_by,
)

THESIS_MS = {"O0": 36.0, "O1": 182.0, "O2": 51.0, "O3": 51.0, BARRIER: 3.0}
"""Mean times in MATLAB on an Intel Core i5 of the eighth generation."""
DURATION_S = 120.0
WARM, COLD, SLSQP = "from the plan before", "from a plan of zeros", "SLSQP, from the plan before"
_BARRIER_CALLS = 50
_SLSQP_EVERY = 5
_MAGNITUDE = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """What the barrier and one objective's searches took at the estimates of one run."""

    barrier_ms: FloatArray
    """One for each estimate."""
    search_ms: dict[str, FloatArray]
    """By the way to search: WARM, COLD, SLSQP."""
    iterations: dict[str, FloatArray]
    """Of our search, WARM and COLD."""
    estimates: FloatArray
    """Relative position, heading, speed, and the target's velocity: ``(n, 6)``."""
    covariances: FloatArray
    """Shape ``(n, 4, 4)``."""

    def ratio(self, way: str) -> float:
        """Return how many barrier steps a step takes, by medians."""
        return float(np.median(self.search_ms[way]) / np.median(self.barrier_ms))


def timed_run(column: str, seed: int, duration_s: float = DURATION_S) -> Steps:
    """Steer a run by one objective and time every way to search at each of its estimates.

    All are called from Python, one after the other, so that other work on the machine meets all.

    Args:
        column: One of ``OBJECTIVES``.
        seed: Of the run; the times differ from run to run all the same.
        duration_s: How much of FIT is run.
    """
    scenario = replace(steered_by(column, COARSE), duration_s=duration_s)
    controller, rival = compiled(scenario), slsqp(scenario)
    barrier_p = pack_control(COARSE.config)
    barrier_ms: list[float] = []
    search_ms: dict[str, list[float]] = {WARM: [], COLD: [], SLSQP: []}
    iterations: dict[str, list[int]] = {WARM: [], COLD: []}
    estimates: list[tuple[float, ...]] = []
    covariances: list[FloatArray] = []

    def steer(z: FloatArray, velocity: tuple[float, float], P: FloatArray) -> tuple[float, float]:
        x, y, psi, v = map(float, z)
        vt_x, vt_y = velocity
        number = len(estimates)
        estimates.append((x, y, psi, v, vt_x, vt_y))
        covariances.append(P)

        def barriers() -> None:
            for _ in range(_BARRIER_CALLS):
                control_step(x, y, psi, v, vt_x, vt_y, 0.0, 0.0, barrier_p)

        barrier_ms.append(_ms(barriers) / _BARRIER_CALLS)
        cold = compiled(scenario)
        search_ms[COLD].append(
            _ms(lambda: iterations[COLD].append(cold.plan(z, velocity, P).iterations))
        )
        if number % _SLSQP_EVERY == 0:
            search_ms[SLSQP].append(_ms(lambda: rival.command(z, velocity, P)))
        begin = time.perf_counter()
        found = controller.plan(z, velocity, P)
        search_ms[WARM].append(1e3 * (time.perf_counter() - begin))
        iterations[WARM].append(found.iterations)
        return found.turn_rate_rad_s, found.acceleration_m_s2

    run_column(column, scenario, seed, steer)
    return Steps(
        np.array(barrier_ms),
        {way: np.array(each) for way, each in search_ms.items()},
        {way: np.array(each) for way, each in iterations.items()},
        np.array(estimates),
        np.array(covariances),
    )


def reproduce(seed: int, report: Report, duration_s: float = DURATION_S) -> Reproduction:
    """Time all five controllers on this machine; the times are not those of another run."""
    report(0.0, "compiling")
    predictive_search.warm_up()
    timed_run("O0", seed, 1.0)
    runs: dict[str, Steps] = {}
    for n, column in enumerate(OBJECTIVES):
        report((n + 1) / (len(OBJECTIVES) + 1), f"timing {column}")
        runs[column] = timed_run(column, seed, duration_s)
    return Reproduction(
        name="table-4.3",
        title="Thesis Table 4.3: time of a step of the barrier and its predictive rivals",
        scenario=_scenario(seed, duration_s),
        rows=(*_times(runs), *_ratios(runs), *_iterations(runs)),
        figure=_figure(runs),
        notes=_notes(runs),
    )


def _ms(action: Callable[[], object]) -> float:
    begin = time.perf_counter()
    action()
    return 1e3 * (time.perf_counter() - begin)


def _times(runs: dict[str, Steps]) -> list[Row]:
    rows: list[Row] = []
    barrier = np.concatenate([each.barrier_ms for each in runs.values()])
    for word, middle in (("median", np.median), ("mean", np.mean)):
        name = f"time of a step: {WARM}, {word}"
        rows += [
            Row(name, column, float(middle(each.search_ms[WARM])), THESIS_MS[column], "ms")
            for column, each in runs.items()
        ]
        rows.append(Row(name, BARRIER, float(middle(barrier)), THESIS_MS[BARRIER], "ms"))
    rows += [
        Row(
            f"time of a step: {way}, median",
            column,
            float(np.median(each.search_ms[way])),
            None,
            "ms",
        )
        for way in (COLD, SLSQP)
        for column, each in runs.items()
    ]
    return rows


def _ratios(runs: dict[str, Steps]) -> list[Row]:
    return [
        Row(
            f"step / barrier step: {way}",
            column,
            each.ratio(way),
            THESIS_MS[column] / THESIS_MS[BARRIER],
            "",
        )
        for way in (WARM, COLD, SLSQP)
        for column, each in runs.items()
    ]


def _iterations(runs: dict[str, Steps]) -> list[Row]:
    return [
        Row(
            f"iterations of a step: {way}, mean",
            column,
            float(np.mean(each.iterations[way])),
            None,
            "",
        )
        for way in (WARM, COLD)
        for column, each in runs.items()
    ]


def _notes(runs: dict[str, Steps]) -> tuple[str, ...]:
    least = {way: min(each.ratio(way) for each in runs.values()) for way in (WARM, COLD, SLSQP)}
    is_reached = {way: ratio >= _MAGNITUDE for way, ratio in least.items()}
    verdicts = [
        f"{'Confirmed' if is_reached[way] else 'Not confirmed'} {way}: the barrier is an order of "
        f"magnitude faster (at least {ratio:.0f} times)."
        for way, ratio in least.items()
    ]
    dearest = max(runs, key=lambda column: runs[column].ratio(COLD))
    slowest = max(float(np.median(each.search_ms[WARM])) for each in runs.values())
    return (
        f"Ours is {SOLVER}, at most {ITERATIONS} iterations; SLSQP is SciPy's with our compiled "
        "cost and gradient and the same limit. The barrier is a closed form, compiled.",
        "The thesis prints means in MATLAB on another processor, so only ratios compare. Called "
        "from Python, most of the barrier's time is the call itself.",
        *verdicts,
        f"The dearest objective is {dearest}, as in the thesis."
        if dearest == "O1"
        else f"The dearest objective is {dearest}; in the thesis it is O1.",
        f"With a step of {1e3 * slowest:.0f} us at most, the time no longer decides between these "
        "controllers at five commands a second.",
    )


def _scenario(seed: int, duration_s: float) -> dict[str, object]:
    return {
        "thesis": "section 4.4.2, Table 4.3",
        "run": f"{COARSE.name}, the first {duration_s:g} s, each objective steering its own run",
        "timed": "one step after the other, called from Python; the barrier at the same estimates",
        "solver": SOLVER,
        "iterations at most": ITERATIONS,
        "SLSQP": f"at every {_SLSQP_EVERY}th estimate, from its own plan before",
        "prediction": PredictiveConfig().model_dump(mode="json"),
        "random": "the noise of the run; the times belong to this machine at this moment",
        "seed": seed,
    }


def _figure(runs: dict[str, Steps]) -> Figure:
    panels: list[Panel] = []
    for way in (WARM, COLD):
        dots: list[Series] = []
        for height, (column, each) in enumerate(runs.items()):
            y, hue = np.array([float(height)]), HUES[column]
            thesis = np.array([THESIS_MS[column] / THESIS_MS[BARRIER]])
            dots += [
                Series(hue.value, np.array([each.ratio(way)]), y, hue, Mark.FILLED),
                Series("", thesis, y, hue, Mark.HOLLOW),
            ]
        title = f"step / barrier step, {way}"
        panels.append(Panel(title, "", "", tuple(dots), names=tuple(runs)))
    for way in (WARM, SLSQP):
        lines: list[Series] = []
        for column, each in runs.items():
            taken = np.sort(each.search_ms[way])
            share = 100.0 * np.arange(1.0, len(taken) + 1.0) / len(taken)
            lines.append(Series(HUES[column].value, taken, share, HUES[column]))
        title = f"steps done within, {way}"
        panels.append(Panel(title, "time (ms)", "share (%)", tuple(lines), logarithmic="x"))
    return Figure(
        tuple(panels),
        2,
        "Above, filled marks ours, hollow marks the thesis. Times of this machine.",
    )
