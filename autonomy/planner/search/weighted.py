"""What a trajectory is worth in a search: information gain, the ergodic measure, or both."""

from typing import NamedTuple

from autonomy.planner.config import PlannerConfig
from autonomy.planner.objective import Objective, WeightedSum


class Worth(NamedTuple):
    """Worth is ``gain_weight gain + measure_weight measure + constant``."""

    gain_weight: float
    measure_weight: float
    constant: float


def worth_of(config: PlannerConfig, objective: Objective) -> Worth:
    """Return the weights of the chosen objective."""
    if isinstance(objective, WeightedSum):
        return Worth(objective.gain_weight, objective.measure_weight, objective.constant)
    if config.objective == "ergodic":
        return Worth(0.0, 1.0, 0.0)
    return Worth(1.0, 0.0, 0.0)
