"""Thesis Table 4.2: the barrier beside predictive controllers of four objectives."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.predictive import search as predictive_search
from autonomy.tracking.predictive.config import PredictiveConfig
from autonomy.tracking.predictive.predictive import SOLVER
from reproduction.result import Figure, Mark, Panel, Report, Reproduction, Row, Series
from reproduction.rival import (
    BARRIER,
    COARSE,
    DOUBTFUL,
    HUES,
    ITERATIONS,
    MANY_ITERATIONS,
    OBJECTIVES,
    compiled,
    run_column,
    slsqp,
    steered_by,
)
from reproduction.tracking import metrics
from reproduction.tracking.run import Outcome
from reproduction.tracking.scenario import Scenario

TRIALS = 10
SCENARIOS: Mapping[str, Scenario] = MappingProxyType({"A": COARSE, "B": DOUBTFUL})
QUANTITIES = (
    ("estimation error", "m"),
    ("tracking error", "m"),
    ("inverse condition, summed", "s"),
)
KAPPA, TAU, CONDITION = range(3)
THESIS: tuple[tuple[tuple[float, ...], tuple[float, ...]], ...] = (
    ((96.6, 0.09, 0.08, 0.07, 0.08), (10.7, 0.005, 0.011, 0.002, 0.009)),
    ((53.1, 1.16, 1.36, 0.61, 0.62), (4.9, 0.165, 0.634, 0.007, 0.016)),
    ((9.2, 167.6, 145.6, 239.2, 230.1), (3.9, 11.4, 54.5, 1.9, 2.9)),
)
"""Mean and standard deviation of each quantity; columns O0, O1, O2, O3, CBF."""
INDEPENDENT: Mapping[str, tuple[tuple[float, ...], ...]] = MappingProxyType(
    {
        "A": (
            (1.80, 0.109, 0.207, 0.108, 0.107),
            (1.45, 1.10, 2.74, 0.621, 0.573),
            (73.7, 137.6, 116.9, 186.7, 210.5),
        ),
        "B": (
            (178.0, 0.111, 0.179, 0.110, 0.112),
            (90.4, 1.56, 7.77, 0.632, 0.615),
            (41.9, 154.6, 108.2, 191.8, 213.2),
        ),
    }
)
"""Means over seeds 0 to 9 by another program: the same costs, projected BFGS with central
differences and another line search, at most ten iterations."""
NEAR = 1.5
"""A mean is called reproduced if it is neither more nor less than so many times the thesis's."""
ALIKE = 0.05
"""... and two programs are said to agree if their means differ by no more than this share."""
_DRAWN_S = 1.0
_FLOOR_M = 0.01
_SEEN_M = 6.0


@dataclass(frozen=True, slots=True, eq=False)
class Trials:
    """All runs of one scenario."""

    scores: FloatArray
    """Estimation error, tracking error, inverse condition: shape ``(columns, trials, 3)``."""
    lost: FloatArray
    """1 where the target was lost, shape ``(columns, trials)``."""
    first: Mapping[str, Outcome]
    """The first seed's runs, by column."""

    def mean(self) -> FloatArray:
        """Return the means over the trials, shape ``(3, columns)``."""
        return self.scores.mean(axis=1).T

    def std(self) -> FloatArray:
        """Return the standard deviations of the sample, shape ``(3, columns)``."""
        return self.scores.std(axis=1, ddof=1).T


def run_trials(scenario: Scenario, seed: int, report: Report, *, trials: int = TRIALS) -> Trials:
    """Run every column's controller with the same seeds."""
    scores, lost = np.empty((len(HUES), trials, 3)), np.empty((len(HUES), trials))
    first: dict[str, Outcome] = {}
    for i, column in enumerate(HUES):
        for n in range(trials):
            report((i * trials + n) / lost.size, f"{scenario.name}: {column}, trial {n + 1}")
            outcome = run_column(column, scenario, seed + n)
            scores[i, n], lost[i, n] = _quantities(outcome), outcome.score.is_lost
            first.setdefault(column, outcome)
    return Trials(scores, lost, first)


def other_solvers(scenario: Scenario, seed: int) -> dict[str, FloatArray]:
    """Run one seed with each solver; three quantities of each objective, ``(3, objectives)``."""
    found: dict[str, FloatArray] = {}
    for name, make, iterations in (
        ("ours", compiled, ITERATIONS),
        ("ours", compiled, MANY_ITERATIONS),
        ("SLSQP", slsqp, ITERATIONS),
    ):
        runs = [
            run_column(
                column, scenario, seed, make(steered_by(column, scenario), iterations).command
            )
            for column in OBJECTIVES
        ]
        found[f"{name} {iterations}"] = np.array([_quantities(run) for run in runs]).T
    return found


def reproduce(seed: int, report: Report, trials: int = TRIALS) -> Reproduction:
    """Run both scenarios with ten seeds, and one of them with other solvers."""
    report(0.0, "compiling")
    predictive_search.warm_up()
    tables = {
        name: run_trials(scenario, seed, _part(report, n, 3), trials=trials)
        for n, (name, scenario) in enumerate(SCENARIOS.items())
    }
    _part(report, 2, 3)(0.0, "other solvers")
    solvers = other_solvers(COARSE, seed)
    return Reproduction(
        name="table-4.2",
        title="Thesis Table 4.2: the barrier beside predictive controllers",
        scenario=_scenario(seed, trials),
        rows=(
            *(row for name, each in tables.items() for row in _rows(name, each)),
            *_solver_rows(seed, solvers),
        ),
        figure=_figure(tables["A"], tables["A"].mean(), tables["A"].std()),
        notes=(
            f"Every predictive figure is of one solver: {SOLVER}, at most {ITERATIONS} iterations.",
            *_claims(tables),
            *(_missed(name, each.mean()) for name, each in tables.items()),
            _spread(seed, solvers),
            *(_agreement(name, each.mean()) for name, each in tables.items()),
            "The thesis prints neither its weights a nor its scenario; FIT and the weights were "
            "found by search and are not its own. Its captions print O2 = -det, its text -det^2, "
            "which is used here.",
        ),
    )


def _quantities(outcome: Outcome) -> tuple[float, float, float]:
    score = outcome.score
    return score.estimation_error_m, score.tracking_error_m, score.inverse_condition_s


def _part(report: Report, number: int, parts: int) -> Report:
    """Return a report of one part, which fills its share of the whole."""
    return lambda done, doing: report((number + done) / parts, doing)


def _rows(name: str, trials: Trials) -> list[Row]:
    rows: list[Row] = []
    for i, (quantity, unit) in enumerate(QUANTITIES):
        for word, ours, thesis in (
            ("mean", trials.mean()[i], THESIS[i][0]),
            ("std", trials.std()[i], THESIS[i][1]),
        ):
            rows += [
                Row(f"{name}: {quantity}, {word}", column, float(ours[j]), thesis[j], unit)
                for j, column in enumerate(HUES)
            ]
    shares = trials.lost.mean(axis=1)
    lost = f"{name}: share lost (mean range > {metrics.LOST_RANGE_M:g} m)"
    return rows + [
        Row(lost, column, float(share), None, "")
        for column, share in zip(HUES, shares, strict=True)
    ]


def _solver_rows(seed: int, solvers: Mapping[str, FloatArray]) -> list[Row]:
    return [
        Row(
            f"A, seed {seed}, {solver} iterations: {quantity}",
            column,
            float(values[i, j]),
            None,
            unit,
        )
        for solver, values in solvers.items()
        for i, (quantity, unit) in enumerate(QUANTITIES)
        for j, column in enumerate(OBJECTIVES)
    ]


def _claims(tables: Mapping[str, Trials]) -> tuple[str, ...]:
    """Say which of the text's sentences hold; each verdict is worked out."""
    near, doubtful = tables["A"], tables["B"]
    columns = list(HUES)
    o0, o3, cbf = columns.index("O0"), columns.index("O3"), columns.index(BARRIER)
    kept = [column for j, column in enumerate(columns) if near.lost[j].mean() == 0.0]
    mean = near.mean()
    rounded = all(
        mean[TAU, o3] < mean[TAU, j] and mean[CONDITION, o3] > mean[CONDITION, j]
        for j in range(len(OBJECTIVES))
        if j != o3
    )
    comparable = mean[TAU, cbf] < NEAR * mean[TAU, o3] and mean[KAPPA, cbf] < NEAR * mean[KAPPA, o3]
    diverges = [100.0 * trials.lost[o0].mean() for trials in (near, doubtful)]
    return (
        f"{_verdict(set(columns) - set(kept) == {'O0'})} in A: all but O0 keep the target; kept "
        f"in every trial by {', '.join(kept)}.",
        f"{_verdict(rounded)}: of the predictive controllers, the condition number tracks closest "
        "and observes best.",
        f"{_verdict(comparable)}: the barrier's estimation and tracking are comparable to the best "
        f"predictive controller's ({mean[KAPPA, cbf]:.3f} and {mean[TAU, cbf]:.2f} m against "
        f"{mean[KAPPA, o3]:.3f} and {mean[TAU, o3]:.2f} m).",
        f"Whether O0 diverges depends on the filter's noise: {diverges[0]:.0f} % of its trials are "
        f"lost in A, {diverges[1]:.0f} % in B.",
    )


def _verdict(holds: bool) -> str:
    return "Confirmed" if holds else "Not confirmed"


def _missed(name: str, mean: FloatArray) -> str:
    """Name the cells whose mean is far from the thesis's."""
    far = [
        f"{column} {quantity} {mean[i, j]:.3g} (thesis {THESIS[i][0][j]:g}) {unit}"
        for i, (quantity, unit) in enumerate(QUANTITIES)
        for j, column in enumerate(HUES)
        if not 1.0 / NEAR <= mean[i, j] / THESIS[i][0][j] <= NEAR
    ]
    return f"Not reproduced in {name}, more than {NEAR:g} times off: {'; '.join(far) or 'nothing'}."


def _spread(seed: int, solvers: Mapping[str, FloatArray]) -> str:
    tau = np.array([values[TAU] for values in solvers.values()])
    parts = [
        f"{column} {tau[:, j].min():.2f} to {tau[:, j].max():.2f}"
        for j, column in enumerate(OBJECTIVES)
    ]
    return (
        f"On seed {seed} of A, the solver and its iteration limit alone move the tracking error "
        f"(m): {', '.join(parts)}."
    )


def _agreement(name: str, mean: FloatArray) -> str:
    """Say where another program's means over seeds 0 to 9 differ from ours."""
    apart = [
        f"{column} {quantity} {mean[i, j]:.3g} against {INDEPENDENT[name][i][j]:g}"
        for i, (quantity, _) in enumerate(QUANTITIES)
        for j, column in enumerate(HUES)
        if abs(mean[i, j] / INDEPENDENT[name][i][j] - 1.0) > ALIKE
    ]
    return (
        f"Another program's means of {name} over seeds 0 to 9 agree within {100 * ALIKE:.0f} %"
        f"{' but for ' + '; '.join(apart) if apart else ''}."
    )


def _scenario(seed: int, trials: int) -> dict[str, object]:
    return {
        "thesis": "section 4.4.2, Table 4.2, Figure 4.3",
        "feedback": "output, target velocity known",
        "seeds": [seed + n for n in range(trials)],
        "solver": SOLVER,
        "iterations at most": ITERATIONS,
        "other solvers": f"the same with {MANY_ITERATIONS} iterations, and SciPy's SLSQP with "
        f"{ITERATIONS}, both on seed {seed} of A",
        "prediction": PredictiveConfig().model_dump(mode="json"),
        "O3": "the condition number with sqrt(det^2 + 1e-6) for |det|",
        "O2, O3": "with the target's velocity; its position stays over the horizon",
        "another program": {name: list(means) for name, means in INDEPENDENT.items()},
        "scenarios": {
            name: {
                "name": scenario.name,
                "duration_s": scenario.duration_s,
                "step_s": scenario.step_s,
                "start": list(scenario.start),
                "first guess std_m": scenario.guess_std_m,
                "settings": scenario.config.model_dump(mode="json"),
            }
            for name, scenario in SCENARIOS.items()
        },
    }


def _figure(trials: Trials, mean: FloatArray, std: FloatArray) -> Figure:
    stride = round(_DRAWN_S / COARSE.step_s)
    paths, observed, estimated, tracked = [], [], [], []
    for column, outcome in trials.first.items():
        record, hue = outcome.record[::stride], HUES[column]
        time_s = record[:, metrics.TIME]
        tau = metrics.relative(outcome.record)
        kappa = tau - metrics.estimate(outcome.record)
        seen = np.where(np.hypot(*tau.T) < _SEEN_M, 1.0, np.nan)
        north, east = (outcome.record[:, each] * seen for each in (metrics.NORTH, metrics.EAST))
        paths.append(Series(hue.value, east, north, hue))
        summed = np.cumsum(outcome.record[:, metrics.INVERSE_CONDITION]) * COARSE.step_s
        observed.append(Series(hue.value, time_s, summed[::stride], hue))
        for lines, error in ((estimated, kappa), (tracked, tau)):
            so_far = metrics.mean_so_far(error)
            lines.append(Series(hue.value, time_s, so_far[::stride], hue))
    return Figure(
        (
            Panel("paths", "east (m)", "north (m)", tuple(paths), is_map=True),
            Panel("observability", "time (s)", "inverse condition, summed (s)", tuple(observed)),
            Panel(
                "estimation", "time (s)", "mean error so far (m)", tuple(estimated), logarithmic="y"
            ),
            Panel(
                "tracking", "time (s)", "mean distance so far (m)", tuple(tracked), logarithmic="y"
            ),
            _dots("tracking error, mean (m)", mean[TAU], std[TAU], THESIS[TAU]),
            _dots("estimation error, mean (m)", mean[KAPPA], std[KAPPA], THESIS[KAPPA]),
        ),
        2,
        f"Scenario A. Above: first seed, paths within {_SEEN_M:g} m of the target. "
        "Below: filled marks ours, with std; hollow marks the thesis.",
    )


def _dots(
    title: str,
    ours: FloatArray,
    std: FloatArray,
    thesis: tuple[tuple[float, ...], tuple[float, ...]],
) -> Panel:
    series: list[Series] = []
    for j, hue in enumerate(HUES.values()):
        height = np.array([float(j)])
        bar = (np.maximum(ours[j : j + 1] - std[j], _FLOOR_M), ours[j : j + 1] + std[j])
        series.append(Series(hue.value, ours[j : j + 1], height, hue, Mark.FILLED, bar))
        series.append(Series("", np.array([thesis[0][j]]), height, hue, Mark.HOLLOW))
    return Panel(title, "", "", tuple(series), names=tuple(HUES), logarithmic="x")
