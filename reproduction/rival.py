"""The controllers that thesis Tables 4.2 and 4.3 compare, and another solver for four of them."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from autonomy.arrays import FloatArray
from autonomy.tracking.predictive import kernel as k
from autonomy.tracking.predictive.config import ObjectiveName, PredictiveConfig
from autonomy.tracking.predictive.predictive import PredictiveController, pack_predictive
from autonomy.tracking.predictive.search import resting_plan
from reproduction.result import Hue
from reproduction.tracking.predictive_run import Steer, run_steered
from reproduction.tracking.run import Case, Outcome, run
from reproduction.tracking.scenario import FIT, Scenario

ITERATIONS, MANY_ITERATIONS = 10, 100
OBJECTIVES: dict[str, ObjectiveName] = {
    "O0": "mpc_none",
    "O1": "mpc_trace",
    "O2": "mpc_determinant",
    "O3": "mpc_condition",
}
"""The thesis's surrogates of the estimation error: nothing, trace of the covariance, -det^2, and
condition number."""
BARRIER = "CBF"
HUES = {
    "O0": Hue.MPC_NONE,
    "O1": Hue.MPC_TRACE,
    "O2": Hue.MPC_DETERMINANT,
    "O3": Hue.MPC_CONDITION,
    BARRIER: Hue.BARRIER,
}
"""Every column of both tables, in their order."""
COARSE = replace(FIT, name="FIT, step 0.2 s", step_s=0.2)
DOUBTFUL = replace(
    FIT.with_filter(position_density_m2_s=0.01), name="FIT, step 0.1 s, position noise 0.01 m2/s"
)
"""A filter that trusts its prediction of the position less."""

_TOLERANCE = 1e-12
"""Small, so that the iteration limit ends a search: O1's weights make its cost a small number."""


@dataclass(slots=True, eq=False)
class SlsqpController:
    """SciPy's sequential least squares on our compiled cost and gradient, as a second solver."""

    packed: FloatArray
    """From ``pack_predictive``; its iteration limit holds here too."""
    plan: FloatArray
    """Scaled inputs to begin the next search with."""

    def command(
        self, z: FloatArray, target_velocity: tuple[float, float], P: FloatArray
    ) -> tuple[float, float]:
        """Search from the plan before, shifted by one step, and return its first inputs."""
        tape = k.empty_tape(int(self.packed[k.STEPS]))
        tape[0][0], tape[2][0, 0] = z, P
        found = minimize(
            self._cost_and_gradient,
            self.plan,
            args=(*target_velocity, tape),
            jac=True,
            method="SLSQP",
            bounds=[(-1.0, 1.0)] * len(self.plan),
            options={"maxiter": int(self.packed[k.ITERATIONS]), "ftol": _TOLERANCE},
        )
        plan = np.clip(found.x, -1.0, 1.0)
        self.plan = np.append(plan[2:], plan[-2:])
        turn = self.packed[k.TURN_MIDDLE] + self.packed[k.TURN_HALF] * plan[0]
        faster = self.packed[k.ACCELERATION_MIDDLE] + self.packed[k.ACCELERATION_HALF] * plan[1]
        return float(turn), float(faster)

    def _cost_and_gradient(
        self, plan: FloatArray, vt_x: float, vt_y: float, tape: k.Tape
    ) -> tuple[float, FloatArray]:
        gradient = np.empty(len(plan))
        cost = k.cost_forward(plan, vt_x, vt_y, self.packed, tape)
        k.gradient_backward(vt_x, vt_y, self.packed, tape, gradient)
        return cost, gradient


def steered_by(column: str, scenario: Scenario) -> Scenario:
    """Return the scenario with the controller of a table's column."""
    return scenario.with_barrier(controller=OBJECTIVES.get(column, "barrier"))


def compiled(scenario: Scenario, iterations: int = ITERATIONS) -> PredictiveController:
    """Return our predictive controller for a scenario's objective."""
    return PredictiveController(scenario.config, PredictiveConfig(iterations=iterations))


def slsqp(scenario: Scenario, iterations: int = ITERATIONS) -> SlsqpController:
    """Return the same controller with SLSQP for a solver."""
    packed = pack_predictive(scenario.config, PredictiveConfig(iterations=iterations))
    return SlsqpController(packed, resting_plan(packed))


def run_column(column: str, scenario: Scenario, seed: int, steer: Steer | None = None) -> Outcome:
    """Run one column's controller under output feedback, the target's velocity known.

    Args:
        column: One of ``HUES``.
        scenario: Start, target, noise and filter.
        seed: The same numbers for every column.
        steer: A controller fresh for this run, in place of ours.
    """
    chosen = steered_by(column, scenario)
    if column == BARRIER:
        return run(chosen, Case.OF_CBF, seed)
    return run_steered(chosen, steer or compiled(chosen).command, seed)
