"""Simulated surveys behind thesis Figures 5.7 and 5.9, and how their results are drawn."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from autonomy import campaign
from autonomy.arrays import FloatArray
from autonomy.field.config import FieldModelKey
from autonomy.field.score import Scores
from autonomy.planner.search import kernel
from reproduction.adaptive.comparison import scores_of
from reproduction.adaptive.scenario import (
    ITERATIONS,
    LEAST_STATED_DRIFT,
    SCENARIOS,
    THRESHOLDS_M,
    TRUE_KERNEL,
    planner_config,
)
from reproduction.adaptive.trial import DRIFTS_M_SQRT_S, TRIALS, Models, Trial, fly_trial, models_at
from reproduction.result import Hue, Mark, Panel, Report, Row, Series

QUANTITIES = ("WMSE", "RMSE", "NLPD", "90 % coverage")
UNITS = ("", "", "nats", "%")
_TITLES = (
    "WMSE: 1 is calibrated, less is modest",
    "RMSE of log counts",
    "NLPD: less is better",
    "Truth inside the central 90 %",
)
_SPREAD = 0.5
"""Width that the marks of one drift share, of the distance between two drifts."""
_LEARNING_SHARE = 0.05
_LEAST_SHOWN = 0.2
"""Where an error bar on a logarithmic axis ends at the latest, as a share of the mean."""


@dataclass(frozen=True, slots=True)
class Sweep:
    """Which surveys to fly."""

    drifts_m_sqrt_s: tuple[float, ...] = DRIFTS_M_SQRT_S
    trials: int = TRIALS
    """Of each scenario at each drift."""
    iterations: int = ITERATIONS
    """Of each round's search."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """One survey and how good the maps of its samples are."""

    trial: Trial
    scores: Mapping[FieldModelKey, Scores]


def fly_all(
    sweep: Sweep,
    seed: int,
    models: Callable[[Trial], Sequence[FieldModelKey]],
    report: Report,
) -> list[Outcome]:
    """Fly every survey on every core or machine; score models on samples as the robot located them.

    Args:
        sweep: Which surveys.
        seed: Decides every random number; so Figures 5.7 and 5.9 see the same surveys.
        models: Which models to score on a trial's samples.
        report: Told of the progress.
    """
    report(0.0, "compiling")
    kernel.warm_up()
    learned: dict[float, Models] = {}
    for drift in sweep.drifts_m_sqrt_s:
        share = len(learned) / len(sweep.drifts_m_sqrt_s)
        report(_LEARNING_SHARE * share, f"manual survey, drift {drift:g}")
        learned[drift] = models_at(drift, seed)

    trials = [
        Trial(scenario, drift, number, seed)
        for drift in sweep.drifts_m_sqrt_s
        for scenario in SCENARIOS
        for number in range(sweep.trials)
    ]

    def tell(done: int) -> None:
        share = _LEARNING_SHARE + (1.0 - _LEARNING_SHARE) * done / len(trials)
        report(share, f"survey {done} of {len(trials)}")

    with campaign.opened(holds_lock=True) as spread:
        return spread.run(
            _fly_and_score,
            (learned, sweep.iterations),
            [(trial, tuple(models(trial))) for trial in trials],
            on_done=tell,
        )


def _fly_and_score(
    known: tuple[Mapping[float, Models], int], asked: tuple[Trial, tuple[FieldModelKey, ...]]
) -> Outcome:
    (learned, iterations), (trial, models) = known, asked
    field = learned[trial.drift_m_sqrt_s]
    survey = fly_trial(trial, field, iterations)
    return Outcome(
        trial, {model: scores_of(field.filtered, model, survey.samples) for model in models}
    )


def table(scores: Sequence[Scores]) -> FloatArray:
    """Return what ``QUANTITIES`` names for each of ``n`` maps, shape ``(n, 4)``."""
    return np.array([(s.wmse, s.rmse, s.nlpd, 100.0 * s.coverage_90) for s in scores])


def rows_of(
    values: FloatArray,
    drifts_m_sqrt_s: tuple[float, ...],
    columns: Sequence[str],
    thesis_wmse: Sequence[float | None],
) -> tuple[Row, ...]:
    """Return mean and spread of every quantity.

    Args:
        values: Shape ``(drifts, columns, maps, 4)``.
        drifts_m_sqrt_s: Of the first axis.
        columns: Names of the second axis.
        thesis_wmse: The thesis's mean WMSE in each column; its drift is not known.
    """
    rows: list[Row] = []
    for i, drift in enumerate(drifts_m_sqrt_s):
        for q, quantity in enumerate(QUANTITIES):
            for name, spread in (("mean", False), ("s.d.", True)):
                for j, column in enumerate(columns):
                    ours = values[i, j, :, q].std() if spread else values[i, j, :, q].mean()
                    printed = thesis_wmse[j] if q == 0 and not spread else None
                    title = f"drift {drift:g}: {quantity}, {name}"
                    rows.append(Row(title, column, round(float(ours), 6), printed, UNITS[q]))
    return tuple(rows)


def panels_of(
    values: FloatArray,
    drifts_m_sqrt_s: tuple[float, ...],
    columns: Sequence[str],
    hues: Sequence[Hue],
    thesis_wmse: Sequence[float | None],
) -> tuple[Panel, ...]:
    """Return one panel for each quantity: mean and standard deviation over the drifts.

    Arguments are those of ``rows_of``; ``hues`` are the columns' colours.
    """
    calibrated = {0: 1.0, 3: 90.0}
    count = len(drifts_m_sqrt_s)
    panels: list[Panel] = []
    for q, quantity in enumerate(QUANTITIES):
        has_thesis = q == 0 and any(value is not None for value in thesis_wmse)
        places = count + has_thesis
        series: list[Series] = []
        if q in calibrated:
            level = np.full(20, calibrated[q])
            ends = np.linspace(-0.5, places - 0.5, len(level))
            series.append(Series("calibrated", ends, level, Hue.FAINT, Mark.DASHED))
        for j, column in enumerate(columns):
            x = np.arange(float(count)) + _dodge(j, len(columns))
            mean, std = values[:, j, :, q].mean(axis=1), values[:, j, :, q].std(axis=1)
            low = np.maximum(mean - std, _LEAST_SHOWN * mean) if q == 0 else mean - std
            series.append(Series(column, x, mean, hues[j], Mark.FILLED, y_bounds=(low, mean + std)))
            printed = thesis_wmse[j]
            if q == 0 and printed is not None:
                at = np.array([count + _dodge(j, len(columns))])
                series.append(Series("", at, np.array([printed]), hues[j], Mark.HOLLOW))
        names = tuple(f"{drift:g}" for drift in drifts_m_sqrt_s) + ("thesis",) * has_thesis
        unit = f" ({UNITS[q]})" if UNITS[q] else ""
        panels.append(
            Panel(
                _TITLES[q],
                "drift (m/\N{SQUARE ROOT}s)",
                quantity + unit,
                tuple(series),
                x_names=names,
                logarithmic="y" if q == 0 else "",
            )
        )
    return tuple(panels)


def scenario_of(sweep: Sweep, seed: int) -> dict[str, object]:
    """Return everything that was set."""
    return {
        "thesis": "section 5.5 (a robot in a tank with two lamps)",
        "field": "two lamps in dim daylight, log of a 12-bit converter's counts, noise 0.05",
        "robot": "a point that follows its plans; a known offset decays in 10 s; the unknown error "
        "is a random walk of the drift on each axis, ended by a fix at the surface; its filter is "
        f"told the drift, but never less than {LEAST_STATED_DRIFT:g} m/s^0.5",
        "drifts_m_sqrt_s": list(sweep.drifts_m_sqrt_s),
        "trials": f"{sweep.trials} of each scenario at each drift, rounds of 20 of 80 energy units",
        "search": f"ended after {sweep.iterations} iterations a round",
        "samples": "0.5 Hz",
        "scores": "latent predictive distribution at 12 x 7 x 5 points; WMSE with the full "
        "covariance",
        "kernels": "single and position noise: that of the true field; recursive and joint: "
        "learned from one simulated manual survey of 500 samples at each drift",
        "kernel": TRUE_KERNEL.model_dump(mode="json"),
        "fidelity_thresholds_m": list(THRESHOLDS_M),
        "planner": {
            scenario.key: planner_config(scenario, 0.015, sweep.iterations).model_dump(mode="json")
            for scenario in SCENARIOS
        },
        "planner_drift": "the planner's own settings are shown for a drift of 0.015",
        "seed": seed,
    }


def _dodge(column: int, columns: int) -> float:
    return _SPREAD * ((column + 0.5) / columns - 0.5)
