"""Thesis Figure 5.7: WMSE of four scenarios of adaptive sampling, and what WMSE does not say."""

import numpy as np

from autonomy.arrays import FloatArray
from reproduction.adaptive.scenario import SCENARIOS
from reproduction.fig_5_surveys import (
    Sweep,
    fly_all,
    panels_of,
    rows_of,
    scenario_of,
    table,
)
from reproduction.result import Figure, Hue, Report, Reproduction

HUES = (Hue.MFE, Hue.MFIG, Hue.SFE, Hue.SFIG)


def scenario_scores(sweep: Sweep, seed: int, report: Report) -> FloatArray:
    """Return the scores of each scenario's own model, shape ``(drifts, scenarios, trials, 4)``."""
    outcomes = fly_all(sweep, seed, lambda trial: (trial.scenario.model,), report)
    scores = table([outcome.scores[outcome.trial.scenario.model] for outcome in outcomes])
    return scores.reshape(len(sweep.drifts_m_sqrt_s), len(SCENARIOS), sweep.trials, -1)


def reproduce(seed: int, report: Report, sweep: Sweep | None = None) -> Reproduction:
    """Fly six trials of the four scenarios at each drift, and score each one's own model."""
    sweep = sweep or Sweep()
    values = scenario_scores(sweep, seed, report)
    columns = tuple(scenario.key for scenario in SCENARIOS)
    thesis = tuple(scenario.thesis_wmse for scenario in SCENARIOS)
    drifts = sweep.drifts_m_sqrt_s
    return Reproduction(
        name="fig-5.7",
        title="Thesis Figure 5.7: adaptive sampling in four scenarios",
        scenario=scenario_of(sweep, seed)
        | {"columns": {scenario.key: scenario.title for scenario in SCENARIOS}},
        rows=rows_of(values, drifts, columns, thesis),
        figure=Figure(
            panels_of(values, drifts, columns, HUES, thesis),
            2,
            "Mean and standard deviation of the trials. Hollow marks: the thesis, whose drift is "
            "not known.",
        ),
        notes=(_factors(values, drifts), _order(values), *_NOTES),
    )


_NOTES = (
    "WMSE is 1 for a calibrated model and falls towards 0 as a model overstates its variance: the "
    "recursive model adds the variances of its levels, also of those that hold no samples.",
    "The drift of the thesis's robot is not known, so its four numbers stand beside every drift.",
)
_CLEAR = 2.0
"""Standard errors by which two means must differ to be told apart."""


def _factors(values: FloatArray, drifts_m_sqrt_s: tuple[float, ...]) -> str:
    wmse = values[..., 0].mean(axis=2)  # (drifts, scenarios)
    factors = wmse[:, 2:].mean(axis=1) / wmse[:, :2].mean(axis=1)
    counted = [
        f"{factor:.1f} at {drift:g}"
        for factor, drift in zip(factors.tolist(), drifts_m_sqrt_s, strict=True)
    ]
    return f"WMSE of single- over that of multi-fidelity, by drift: {', '.join(counted)}."


def _order(values: FloatArray) -> str:
    """Say how often the ergodic objective ends below information gain, as in the thesis."""
    wmse = values[..., 0]  # (drifts, scenarios, trials)
    mean, error = wmse.mean(axis=2), wmse.std(axis=2) / np.sqrt(wmse.shape[2])
    below = mean[:, 1::2] - mean[:, ::2]  # (drifts, fidelities)
    clear = np.abs(below) > _CLEAR * np.hypot(error[:, 1::2], error[:, ::2])
    return (
        f"Ergodic ends below information gain in {int((below > 0).sum())} of {below.size} "
        f"comparisons of the same model and drift, clearly in {int((clear & (below > 0)).sum())}, "
        f"clearly above in {int((clear & (below < 0)).sum())}."
    )
