"""Peers of the predictive controllers, brought to the same problem: CasADi and SciPy's SLSQP."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import minimize

from autonomy.arrays import FloatArray
from autonomy.tracking.predictive import kernel as k

UNKNOWNS_PER_STEP = 2


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """One search: from which state, covariance and plan."""

    z: FloatArray
    target_velocity: tuple[float, float]
    covariance: FloatArray
    plan: FloatArray
    """Scaled inputs to begin with, ``(2 steps,)``."""

    def parameters(self) -> FloatArray:
        """Return state, target velocity and covariance in one row, as CasADi's cost takes them."""
        return np.concatenate([self.z, self.target_velocity, self.covariance.ravel(order="F")])


Solve = Callable[[Problem], tuple[FloatArray, float]]
"""Returns the scaled plan and its cost."""


def random_problems(seed: int, count: int, steps: int = 5) -> list[Problem]:
    """Draw states within metres of the target, and covariances as filters have them."""
    generator = np.random.default_rng(seed)
    problems = []
    for _ in range(count):
        place = generator.uniform(-4.0, 4.0, 2)
        z = np.array([*place, generator.uniform(-np.pi, np.pi), generator.uniform(0.05, 0.6)])
        root = generator.normal(size=(4, 4)) * np.array([[0.3], [0.3], [0.1], [0.1]])
        velocity = generator.uniform(-0.03, 0.03, 2)
        plan = np.zeros(UNKNOWNS_PER_STEP * steps)
        problems.append(Problem(z, (velocity[0], velocity[1]), root @ root.T, plan))
    return problems


def casadi_cost(p: FloatArray) -> Any:
    """Return the cost of Eq. (4.23) as a symbolic function of plan and parameters."""
    steps, dt, a, objective = int(p[k.STEPS]), float(p[k.STEP]), float(p[k.WEIGHT]), p[k.OBJECTIVE]
    plan = ca.SX.sym("plan", UNKNOWNS_PER_STEP * steps)
    z, velocity, known = ca.SX.sym("z", 4), ca.SX.sym("v_t", 2), ca.SX.sym("P", 4, 4)
    x, P, total = z, known, 0.0
    Q = dt * ca.diag(ca.DM(p[[k.POSITION_DENSITY] * 2 + [k.HEADING_DENSITY, k.SPEED_DENSITY]]))
    for i in range(steps):
        u1 = p[k.TURN_MIDDLE] + p[k.TURN_HALF] * plan[2 * i]
        u2 = p[k.ACCELERATION_MIDDLE] + p[k.ACCELERATION_HALF] * plan[2 * i + 1]
        psi, v = x[2] + 0.5 * dt * u1, x[3] + 0.5 * dt * u2
        after = x + dt * ca.vertcat(v * ca.cos(psi), v * ca.sin(psi), u1, u2)
        if objective == k.TRACE:
            # CasADi differentiates the step itself: F by the state at held inputs.
            F = ca.SX.eye(4)
            F[0, 2], F[0, 3] = -dt * v * ca.sin(psi), dt * ca.cos(psi)
            F[1, 2], F[1, 3] = dt * v * ca.cos(psi), dt * ca.sin(psi)
            P = _heard(F @ P @ F.T + Q, after, p)
        x = after
        total += dt * (a * (x[0] ** 2 + x[1] ** 2) + (1.0 - a) * _surrogate(x, P, velocity, p))
    return ca.Function("J", [plan, ca.vertcat(z, velocity, ca.vec(known))], [total])


def _heard(P: Any, x: Any, p: FloatArray) -> Any:
    distance = ca.sqrt(x[0] ** 2 + x[1] ** 2)
    rows = (
        (ca.DM([0, 0, 1, 0]), p[k.HEADING_VARIANCE]),
        (ca.DM([0, 0, 0, 1]), p[k.SPEED_VARIANCE]),
        (ca.vertcat(x[0] / distance, x[1] / distance, 0, 0), p[k.RANGE_VARIANCE]),
    )
    for h, variance in rows:
        w = P @ h
        P = P - w @ w.T / (h.T @ w + variance)
    return P


def _surrogate(x: Any, P: Any, velocity: Any, p: FloatArray) -> Any:
    objective = p[k.OBJECTIVE]
    if objective == k.NONE:
        return 0.0
    if objective == k.TRACE:
        return ca.trace(P)
    moved = ca.vertcat(x[3] * ca.cos(x[2]), x[3] * ca.sin(x[2])) - velocity
    determinant = x[0] * moved[1] - x[1] * moved[0]
    if objective == k.DETERMINANT:
        return -(determinant**2)
    squares = ca.sumsqr(x[:2]) + ca.sumsqr(moved)
    largest = 0.5 * (squares + ca.sqrt(squares**2 - 4.0 * determinant**2))
    return largest / ca.sqrt(determinant**2 + k.SMOOTHING)


def casadi_qrqp(p: FloatArray, iterations: int, settings: dict[str, Any]) -> Solve:
    """CasADi's sequential quadratic programming with its own active-set solver qrqp."""
    quiet = {"print_iter": False, "print_header": False, "print_info": False}
    options = {
        "qpsol": "qrqp",
        "qpsol_options": quiet | {"error_on_fail": False},
        "max_iter": iterations,
        "print_header": False,
        "print_iteration": False,
        "print_status": False,
        "print_time": False,
        "error_on_fail": False,
    }
    return _casadi_solver("sqpmethod", p, options | settings)


def casadi_ipopt(p: FloatArray, iterations: int) -> Solve:
    """IPOPT through CasADi, with limited-memory curvature."""
    options = {
        "ipopt.hessian_approximation": "limited-memory",
        "ipopt.max_iter": iterations,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "print_time": False,
        "error_on_fail": False,
    }
    return _casadi_solver("ipopt", p, options)


def _casadi_solver(name: str, p: FloatArray, options: dict[str, Any]) -> Solve:
    n = UNKNOWNS_PER_STEP * int(p[k.STEPS])
    plan, parameters = ca.SX.sym("plan", n), ca.SX.sym("parameters", 22)
    problem = {"x": plan, "p": parameters, "f": casadi_cost(p)(plan, parameters)}
    solver = ca.nlpsol("rival", name, problem, options)

    def solve(one: Problem) -> tuple[FloatArray, float]:
        found = solver(x0=one.plan, p=one.parameters(), lbx=-1.0, ubx=1.0)
        return np.asarray(found["x"]).ravel(), float(found["f"])

    return solve


def slsqp(p: FloatArray, iterations: int, tolerance: float = 1e-12) -> Solve:
    """SciPy's SLSQP with our compiled cost and gradient."""
    steps = int(p[k.STEPS])
    tape = k.empty_tape(steps)
    bounds = [(-1.0, 1.0)] * (UNKNOWNS_PER_STEP * steps)

    def solve(one: Problem) -> tuple[FloatArray, float]:
        tape[0][0], tape[2][0, 0] = one.z, one.covariance
        vt_x, vt_y = one.target_velocity

        def cost_and_gradient(plan: FloatArray) -> tuple[float, FloatArray]:
            gradient = np.empty(plan.size)
            value = k.cost_forward(plan, vt_x, vt_y, p, tape)
            k.gradient_backward(vt_x, vt_y, p, tape, gradient)
            return value, gradient

        found = minimize(
            cost_and_gradient,
            one.plan,
            jac=True,
            method="SLSQP",
            bounds=bounds,
            options={"maxiter": iterations, "ftol": tolerance},
        )
        return np.clip(found.x, -1.0, 1.0), float(found.fun)

    return solve
