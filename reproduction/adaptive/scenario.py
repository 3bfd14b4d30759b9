"""The thesis's four scenarios, in the tank of the specification's benchmark."""

from dataclasses import dataclass
from typing import Literal

from autonomy.estimation.config import EstimatorConfig
from autonomy.field.config import KernelParameters
from autonomy.planner.config import MissionConfig, PlannerConfig, PrimitiveConfig, SearchConfig

VARIABLE = "blue_light"
START_NE_M = (0.3, 0.3)
LEAST_STATED_DRIFT = 0.005
"""The filter is told the true drift, but never that there is less than this, m/s^0.5."""
THRESHOLDS_M = (0.05, 0.12)
"""Position uncertainties that part the three levels."""
ITERATIONS = 30
"""Steps of growth and refinement of one round's search: a fraction of a second, and repeatable."""
TRUE_KERNEL = KernelParameters(
    signal_variance=5.27, length_x_m=2.41, length_y_m=2.46, length_z_m=2.40, noise_variance=0.0025
)
"""What the true field teaches: the models with one kernel are given it, as in the thesis."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """Which map a survey plans with, and what its plans are for."""

    key: str
    title: str
    model: Literal["single", "recursive"]
    objective: Literal["ergodic", "information_gain"]
    thesis_wmse: float
    """What the thesis's robot came to in its tank (section 5.5.3)."""


SCENARIOS = (
    Scenario("MFE", "multi-fidelity, ergodic", "recursive", "ergodic", 0.3879),
    Scenario("MFIG", "multi-fidelity, information gain", "recursive", "information_gain", 0.4556),
    Scenario("SFE", "single-fidelity, ergodic", "single", "ergodic", 2.8812),
    Scenario("SFIG", "single-fidelity, information gain", "single", "information_gain", 3.7766),
)


def planner_config(
    scenario: Scenario, drift_m_sqrt_s: float, iterations: int = ITERATIONS
) -> PlannerConfig:
    """Return the benchmark's planner: 20 of 80 energy units a round, and no time at the surface.

    Information gain counts every sample alike, as the thesis's heuristic does.
    """
    return PlannerConfig(
        objective=scenario.objective,
        max_uncertainty_m=0.5,
        fidelity_counts=False,
        fidelity_thresholds_m=THRESHOLDS_M,
        planning_time_s=600.0,
        primitives=PrimitiveConfig(swim_length_max_m=1.4),
        position_filter=position_filter(drift_m_sqrt_s),
        search=SearchConfig(iterations_max=iterations, runners_up=0),
        mission=MissionConfig(turn_time_s=0.0),
    )


def position_filter(drift_m_sqrt_s: float) -> EstimatorConfig:
    """Return the robot's filter, which is told the drift."""
    return EstimatorConfig(
        drift_m_sqrt_s=max(drift_m_sqrt_s, LEAST_STATED_DRIFT), steady_current_m_s=0.0
    )
