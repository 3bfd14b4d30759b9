"""How well a target can be known from its range alone (thesis section 4.3)."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from autonomy.arrays import FloatArray

State = Sequence[float] | FloatArray
"""Relative position north and east (tracker minus target, m), heading rad, speed m/s."""
Plane = Sequence[float] | FloatArray
"""A horizontal vector, north and east."""


def relative_velocity(z: State, target_velocity: Plane) -> tuple[float, float]:
    """Return the tracker's velocity less the target's, north and east, m/s (Eq. 4.16)."""
    _, _, psi, v = z
    return v * math.cos(psi) - target_velocity[0], v * math.sin(psi) - target_velocity[1]


def position_observability_matrix(z: State, target_velocity: Plane) -> FloatArray:
    """Return the part that decides over the relative position, shape ``(2, 2)``.

    Rows: relative position, m, and relative velocity, m/s.

    Source:
        Thesis Eq. 4.19.
    """
    return np.array([[z[0], z[1]], relative_velocity(z, target_velocity)])


def observability_matrix(z: State, target_velocity: Plane) -> FloatArray:
    """Return the gradients of half the squared range, heading, speed, and their first derivatives.

    Returns:
        Shape ``(6, 4)``; columns are relative position north and east, heading, speed; rows as the
        thesis orders them: range, its derivative, heading, its derivative, speed, its derivative.

    Source:
        Thesis Eq. 4.18, with its entries marked ``*`` written out. The inputs are 0 in the
        derivatives, and do not matter.
    """
    x_r, y_r, psi, v = z
    v_xr, v_yr = relative_velocity(z, target_velocity)
    matrix = np.zeros((6, 4))
    matrix[0, :2] = x_r, y_r
    matrix[1] = (
        v_xr,
        v_yr,
        v * (y_r * math.cos(psi) - x_r * math.sin(psi)),
        x_r * math.cos(psi) + y_r * math.sin(psi),
    )
    matrix[2, 2] = 1.0
    matrix[4, 3] = 1.0
    return matrix


def determinant(z: State, target_velocity: Plane) -> float:
    """Return the determinant of the position part, m2/s; 0 where the range tells too little.

    Source:
        Thesis Eq. 4.22.
    """
    v_xr, v_yr = relative_velocity(z, target_velocity)
    return z[0] * v_yr - z[1] * v_xr


def determinant_rates(z: State, target_acceleration: Plane) -> tuple[float, tuple[float, float]]:
    """Return how the determinant changes: by itself, m2/s2, and with each of the two inputs.

    The determinant's derivative is the first plus the second times turn rate and acceleration; the
    products of relative velocities cancel, so that both inputs act at once (relative degree 1).
    """
    x_r, y_r, psi, v = z
    c, s = math.cos(psi), math.sin(psi)
    drift = -(x_r * target_acceleration[1] - y_r * target_acceleration[0])
    return drift, (v * (x_r * c + y_r * s), x_r * s - y_r * c)


def inverse_condition(z: State, target_velocity: Plane) -> float:
    """Return the inverse condition number of the position part, in 0 (unobservable) .. 1.

    Source:
        Thesis Eq. 4.21. Its root, written with the squared lengths and the inner product of both
        rows, is a sum of squares, which loses no digits where the two singular values are alike.
        The thesis's form with gamma lacks the cosine inside of the root.
    """
    x_r, y_r = z[0], z[1]
    v_xr, v_yr = relative_velocity(z, target_velocity)
    position, velocity = x_r * x_r + y_r * y_r, v_xr * v_xr + v_yr * v_yr
    root = math.hypot(position - velocity, 2.0 * (x_r * v_xr + y_r * v_yr))
    whole = position + velocity + root
    return 2.0 * abs(x_r * v_yr - y_r * v_xr) / whole if whole > 0.0 else 0.0


def empirical_gramian(
    step: Callable[[FloatArray], FloatArray],
    measure: Callable[[FloatArray], FloatArray],
    z: State,
    *,
    steps: int,
    dt_s: float,
    perturbation: float | FloatArray = 1e-4,
) -> FloatArray:
    """Return the observability Gramian found by simulating from disturbed starts.

    It needs no derivative, and so judges any simulator and any measurement; it costs two runs per
    state. Its smallest eigenvalue is how strongly the worst known direction shows in the outputs.

    Args:
        step: Takes a state one time step on, shape ``(n,)``; inputs are its own affair.
        measure: Outputs of a state, shape ``(m,)``.
        z: Start, shape ``(n,)``.
        steps: How many time steps are looked at.
        dt_s: Length of one, s.
        perturbation: By how much each state is disturbed, both ways; one number or shape ``(n,)``.

    Returns:
        Shape ``(n, n)``, symmetric.

    Raises:
        ValueError: If ``steps`` or ``dt_s`` or a perturbation is not positive.

    Source:
        Thesis section 4.2.2, remark 1, which names it as a way round the closed form.
    """
    start = np.array(z, dtype=np.float64)
    size = np.broadcast_to(np.asarray(perturbation, dtype=np.float64), start.shape)
    if steps < 1 or not dt_s > 0.0 or not np.all(size > 0.0):
        raise ValueError("steps, dt_s and perturbation must be positive")
    columns: list[FloatArray] = []
    for i in range(start.size):
        outputs: list[FloatArray] = []
        for sign in (1.0, -1.0):
            state = start.copy()
            state[i] += sign * size[i]
            outputs.append(_outputs(step, measure, state, steps))
        columns.append((outputs[0] - outputs[1]) / (2.0 * size[i]))
    sensitivity = np.column_stack(columns)  # (steps * m, n)
    return sensitivity.T @ sensitivity * dt_s


def _outputs(
    step: Callable[[FloatArray], FloatArray],
    measure: Callable[[FloatArray], FloatArray],
    state: FloatArray,
    steps: int,
) -> FloatArray:
    seen: list[FloatArray] = []
    for _ in range(steps):
        seen.append(np.atleast_1d(measure(state)))
        state = step(state)
    return np.concatenate(seen)
