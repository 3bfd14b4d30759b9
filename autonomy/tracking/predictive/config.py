"""Settings of the predictive controllers, the thesis's rivals of the barrier."""

from typing import Literal, Self

from pydantic import model_validator

from autonomy.configuration import Configuration, quantity

ObjectiveName = Literal["mpc_none", "mpc_trace", "mpc_determinant", "mpc_condition"]
"""O0 .. O3 of thesis section 4.4.2: what stands for the estimation error in the cost."""

MOST_STEPS = 20
MOST_ITERATIONS = 1000


class PredictiveConfig(Configuration):
    """How far a predictive controller looks ahead, what it weighs, and how long it searches."""

    steps: int = quantity(5, title="Steps ahead", ge=1, le=MOST_STEPS)
    """How many steps the robot plans ahead (thesis: 5)."""
    step_s: float = quantity(0.2, "s", title="Planning step", gt=0.0, le=60.0)
    """Time of one step; the inputs are held that long (thesis: 0.2)."""
    iterations: int = quantity(10, title="Most iterations", ge=1, le=MOST_ITERATIONS)
    """The search ends here at the latest (thesis: 10). So early it has not converged, and another
    solver gives another course."""
    trace_weight: float = quantity(0.0015, title="Weight of distance, trace", ge=0.0, le=1.0)
    """Share a of the squared distance beside the covariance's trace (O1). The thesis prints none
    of the three weights; these were found by search."""
    determinant_weight: float = quantity(
        0.60, title="Weight of distance, determinant", ge=0.0, le=1.0
    )
    """Share a of the squared distance beside -det^2 (O2). At about a half and below, the robot
    gains more by speed than it loses by distance, and leaves."""
    condition_weight: float = quantity(0.94, title="Weight of distance, condition", ge=0.0, le=1.0)
    """Share a of the squared distance beside the condition number (O3)."""

    @model_validator(mode="after")
    def _looks_not_too_far(self) -> Self:
        if self.steps * self.step_s > 600.0:
            raise ValueError("steps times step_s must not exceed 600 s")
        return self

    def weight(self, objective: ObjectiveName) -> float:
        """Return the share a of the squared distance in the cost of an objective."""
        return {
            "mpc_none": 1.0,
            "mpc_trace": self.trace_weight,
            "mpc_determinant": self.determinant_weight,
            "mpc_condition": self.condition_weight,
        }[objective]
