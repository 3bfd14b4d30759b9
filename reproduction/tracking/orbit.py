"""Following a target whose place is known exactly: what the barrier alone does to the path."""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.config import TargetConfig, TrackingConfig
from autonomy.tracking.control import control_kernel
from reproduction.tracking import metrics
from reproduction.tracking.run import Case, run
from reproduction.tracking.scenario import Scenario


@dataclass(frozen=True, slots=True, eq=False)
class Orbit:
    """A run with state feedback, one entry for each control step before its command acts."""

    step_s: float
    state: FloatArray
    """Relative position (robot minus target) north and east, m; heading, rad; speed, m/s; shape
    ``(n, 4)``."""
    command: FloatArray
    """Turn rate, rad/s, and acceleration, m/s2, shape ``(n, 2)``."""
    determinant_m2_s: FloatArray
    """Shape ``(n,)``."""
    inverse_condition: FloatArray
    """Shape ``(n,)``."""
    status: FloatArray
    """As ``barrier.ControlStatus``, shape ``(n,)``."""

    @property
    def time_s(self) -> FloatArray:
        """Time of each entry, shape ``(n,)``, s."""
        return np.arange(len(self.state), dtype=np.float64) * self.step_s

    @property
    def range_m(self) -> FloatArray:
        """Distance from the target, shape ``(n,)``, m."""
        return np.hypot(self.state[:, 0], self.state[:, 1])

    def radius_m(self, last_s: float) -> float:
        """Return the mean distance over the end of the run."""
        return float(self.range_m[-max(1, round(last_s / self.step_s)) :].mean())

    def arrival_s(self, range_m: float) -> float | None:
        """Return when the robot first is nearer than ``range_m``; None if it never is."""
        near = np.flatnonzero(self.range_m < range_m)
        return float(self.time_s[near[0]]) if near.size else None

    def observability_s(self, until_s: float = float("inf")) -> float:
        """Return the inverse condition number summed over time, up to a moment."""
        return float(self.inverse_condition[self.time_s < until_s].sum() * self.step_s)

    @property
    def fallback_share(self) -> float:
        """Share of the steps in which no command within the limits met the constraint."""
        return float((self.status == control_kernel.INFEASIBLE).mean())


def follow(
    config: TrackingConfig,
    start: tuple[float, float, float, float],
    duration_s: float,
    step_s: float = 0.1,
) -> Orbit:
    """Follow a target that stays, with exact states: ``run.run`` under SF or SF+CBF.

    Args:
        config: Controller (``barrier`` or ``nominal``) and limits; where its target is, ranging and
            filter do not matter.
        start: Relative position north and east, m; heading, rad; speed, m/s.
        duration_s: Length of the run.
        step_s: Time for which a command is held.

    Raises:
        ValueError: If the duration is shorter than a step, or the step not positive.
    """
    if not 0.0 < step_s <= duration_s:
        raise ValueError("step_s must be positive and at most duration_s")
    target = TargetConfig(path="static", north_m=0.0, east_m=0.0)
    scenario = Scenario(
        name="orbit",
        config=config.model_copy(update={"target": target}),
        start=start,
        duration_s=duration_s,
        step_s=step_s,
    )
    case = Case.SF_CBF if config.barrier.controller == "barrier" else Case.SF
    record = run(scenario, case, seed=0).record
    return Orbit(
        step_s=step_s,
        state=record[:, metrics.NORTH : metrics.SPEED + 1],
        command=record[:, metrics.TURN_RATE : metrics.ACCELERATION + 1],
        determinant_m2_s=record[:, metrics.DETERMINANT],
        inverse_condition=record[:, metrics.INVERSE_CONDITION],
        status=record[:, metrics.STATUS],
    )
