"""Thesis Figure 5.9: every model on the same data, so that the planner has no part in it."""

from autonomy.arrays import FloatArray
from reproduction.adaptive.comparison import MODELS
from reproduction.fig_5_surveys import (
    QUANTITIES,
    Sweep,
    fly_all,
    panels_of,
    rows_of,
    scenario_of,
    table,
)
from reproduction.result import Figure, Hue, Report, Reproduction

COLUMNS = ("single", "recursive", "joint", "position noise")
HUES = (Hue.SINGLE, Hue.RECURSIVE, Hue.JOINT, Hue.POSITION_NOISE)


def model_scores(sweep: Sweep, seed: int, report: Report) -> FloatArray:
    """Return every model's scores on every survey, shape ``(drifts, models, surveys, 4)``."""
    outcomes = fly_all(sweep, seed, lambda _: MODELS, report)
    scores = table([outcome.scores[model] for outcome in outcomes for model in MODELS])
    by_survey = scores.reshape(len(sweep.drifts_m_sqrt_s), -1, len(MODELS), len(QUANTITIES))
    return by_survey.swapaxes(1, 2)


def reproduce(seed: int, report: Report, sweep: Sweep | None = None) -> Reproduction:
    """Score four models on the samples of every survey of ``fig-5.7``."""
    sweep = sweep or Sweep()
    values = model_scores(sweep, seed, report)
    nothing = (None,) * len(COLUMNS)
    return Reproduction(
        name="fig-5.9",
        title="Thesis Figure 5.9: every field model on the same samples",
        scenario=scenario_of(sweep, seed)
        | {"data": "the samples of all the scenarios' surveys, 24 at each drift with six trials"},
        rows=rows_of(values, sweep.drifts_m_sqrt_s, COLUMNS, nothing),
        figure=Figure(
            panels_of(values, sweep.drifts_m_sqrt_s, COLUMNS, HUES, nothing),
            2,
            "Mean and standard deviation over the surveys. The thesis draws the first two models, "
            "and prints no number.",
        ),
        notes=_NOTES,
    )


_NOTES = (
    "The thesis compares WMSE alone. It rewards a model for claiming to know little: where the "
    "robot drifts most the recursive model has the least, and not the least error.",
    "The model with position-dependent noise is given the kernel of the true field, as the single "
    "one is; recursive and joint model learned theirs from a manual survey.",
)
