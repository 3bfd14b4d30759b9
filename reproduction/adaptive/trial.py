"""One trial of a scenario at one drift: the same seed, the same survey."""

from dataclasses import dataclass

import numpy as np

from autonomy.field.config import FieldConfig
from reproduction.adaptive.manual import learned_models, manual_survey
from reproduction.adaptive.scenario import ITERATIONS, SCENARIOS, Scenario, planner_config
from reproduction.adaptive.survey import Survey, run_survey

DRIFTS_M_SQRT_S = (0.0, 0.005, 0.01, 0.015, 0.02, 0.03)
"""How fast the robot loses its position, m/s^0.5."""
TRIALS = 6
_MICRO = 1e6


@dataclass(frozen=True, slots=True)
class Trial:
    """Which survey to fly."""

    scenario: Scenario
    drift_m_sqrt_s: float
    number: int
    seed: int


@dataclass(frozen=True, slots=True)
class Models:
    """Every model's kernels for samples at one drift."""

    filtered: FieldConfig
    """For samples as the robot located them."""
    smoothed: FieldConfig
    """For samples of smoothed dives."""


def trials_at(drift_m_sqrt_s: float, count: int, seed: int) -> list[Trial]:
    """Return so many trials of each scenario."""
    return [
        Trial(scenario, drift_m_sqrt_s, number, seed)
        for scenario in SCENARIOS
        for number in range(count)
    ]


def models_at(drift_m_sqrt_s: float, seed: int) -> Models:
    """Learn every model's kernels from one manual survey at a drift; takes a second or two."""
    rng = np.random.default_rng([seed, round(_MICRO * drift_m_sqrt_s)])
    survey = manual_survey(planner_config(SCENARIOS[0], drift_m_sqrt_s), drift_m_sqrt_s, rng)
    return Models(learned_models(survey.samples, rng), learned_models(survey.smoothed(), rng))


def fly_trial(trial: Trial, models: Models, iterations: int = ITERATIONS) -> Survey:
    """Run a trial's survey, with its scenario's model in the loop.

    Args:
        trial: Which one.
        models: Kernels at its drift.
        iterations: Of each round's search.

    Raises:
        NoPlanError: If a round has no plan.
    """
    scenario, drift = trial.scenario, trial.drift_m_sqrt_s
    place = SCENARIOS.index(scenario)
    rng = np.random.default_rng([trial.seed, round(_MICRO * drift), place, trial.number])
    field = models.filtered.model_copy(update={"model": scenario.model})
    return run_survey(field, planner_config(scenario, drift, iterations), drift, rng)
