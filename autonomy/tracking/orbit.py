"""Following a target whose place is known exactly: what the barrier alone does to the path."""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel
from autonomy.tracking import control_kernel, unicycle
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.pack_control import pack_control

control_step = control_kernel.control_step
inverse_condition = control_kernel.inverse_condition
advance_kernel = unicycle.advance_kernel

_SIZE = 9


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
    target_velocity: tuple[float, float] = (0.0, 0.0),
) -> Orbit:
    """Follow a target that stays or goes straight, with exact states.

    Args:
        config: Controller and limits; its target, ranging and filter do not matter.
        start: Relative position north and east, m; heading, rad; speed, m/s.
        duration_s: Length of the run.
        step_s: Time for which a command is held.
        target_velocity: North and east, m/s.

    Raises:
        ValueError: If the duration is shorter than a step, or the step not positive.
    """
    if not 0.0 < step_s <= duration_s:
        raise ValueError("step_s must be positive and at most duration_s")
    record = np.empty((round(duration_s / step_s), _SIZE))
    vt_x, vt_y = target_velocity
    _follow(np.array(start, dtype=np.float64), vt_x, vt_y, pack_control(config), step_s, record)
    return Orbit(
        step_s=step_s,
        state=record[:, :4],
        command=record[:, 4:6],
        determinant_m2_s=record[:, 6],
        inverse_condition=record[:, 7],
        status=record[:, 8],
    )


@kernel
def _follow(
    start: FloatArray,
    vt_x: float,
    vt_y: float,
    p: FloatArray,
    dt_s: float,
    record: FloatArray,
) -> None:
    x_r, y_r, psi, v = start
    for row in record:
        u1, u2, _, _, det, _, status = control_step(x_r, y_r, psi, v, vt_x, vt_y, 0.0, 0.0, p)
        row[0], row[1], row[2], row[3] = x_r, y_r, psi, v
        row[4], row[5], row[6] = u1, u2, det
        row[7], row[8] = inverse_condition(x_r, y_r, psi, v, vt_x, vt_y), status
        x_r, y_r, psi, v = advance_kernel(x_r, y_r, psi, v, u1, u2, dt_s)
        x_r, y_r = x_r - vt_x * dt_s, y_r - vt_y * dt_s


def warm_up() -> None:
    """Compile the kernel of this module with the argument types of real use."""
    follow(TrackingConfig(), (-1.0, 0.5, 0.3, 0.2), 1.0)
