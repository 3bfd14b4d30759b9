"""What a trajectory is worth in a search: information gain, the ergodic measure, or both."""

from typing import NamedTuple

from autonomy.planner.belief import FieldBelief
from autonomy.planner.config import PlannerConfig
from autonomy.planner.objective import weighted_sum


class Worth(NamedTuple):
    """Worth is ``gain_weight gain + measure_weight measure + constant``."""

    gain_weight: float
    measure_weight: float
    constant: float


def worth_of(config: PlannerConfig, belief: FieldBelief, start_xy: tuple[float, float]) -> Worth:
    """Return the weights of the chosen objective, for plans that begin at a place."""
    if config.objective == "weighted":
        both = weighted_sum(config, belief, start_xy)
        return Worth(both.gain_weight, both.measure_weight, both.constant)
    if config.objective == "ergodic":
        return Worth(0.0, 1.0, 0.0)
    return Worth(1.0, 0.0, 0.0)
