"""Projected BFGS in a box, compiled around the predictive controllers' cost."""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_kernel, kernel
from autonomy.tracking.control.control_kernel import LARGEST, SPEED_TIME_S
from autonomy.tracking.predictive.kernel import (
    ACCELERATION_HALF,
    ACCELERATION_MIDDLE,
    ITERATIONS,
    SETTINGS_SIZE,
    SPEED_MAX,
    SPEED_MIN,
    STEPS,
    TURN_HALF,
    TURN_MIDDLE,
    Tape,
    cost_forward,
    empty_tape,
    gradient_backward,
)

CONVERGED, SPENT, STALLED, BAD_INPUT = range(4)
"""How a search ended: at a minimum, at the iteration limit, where no step lowers the cost any
further than rounding, or not begun because a number was not finite or absurd."""

Room: TypeAlias = tuple[Tape, FloatArray, FloatArray, FloatArray]
"""Tape; curvature ``(n, n)``; its factor ``(n, n)``; six vectors ``(6, n)``."""

_GRADIENT, _NEW_GRADIENT, _NEW_PLAN, _WAY, _CURVED, _FREE = range(6)
_SUFFICIENT = 1e-4
_HALVINGS = 25
_SMALL_GRADIENT = 1e-9
_LEAST_DAMPED = 0.2


@dataclass(frozen=True, slots=True)
class SearchOutcome:
    """What a search found."""

    turn_rate_rad_s: float
    acceleration_m_s2: float
    cost: float
    """NaN after bad input."""
    iterations: int
    status: int
    """CONVERGED, SPENT, STALLED or BAD_INPUT."""


class Search:
    """A plan that is improved at every step and shifted to the next; for one robot."""

    def __init__(self, packed: FloatArray) -> None:
        """Begin with inputs in the middle of the box.

        Args:
            packed: Settings, ``(SETTINGS_SIZE,)``.
        """
        steps = int(packed[STEPS])
        self._packed = packed
        self._plan = resting_plan(packed)
        self._room = empty_room(steps)

    def step(
        self, z: FloatArray, target_velocity: tuple[float, float], covariance: FloatArray
    ) -> SearchOutcome:
        """Improve the plan from this state, return its first inputs, and shift it."""
        x, y, psi, v = z
        found = predictive_step(
            float(x),
            float(y),
            float(psi),
            float(v),
            float(target_velocity[0]),
            float(target_velocity[1]),
            np.ascontiguousarray(covariance, dtype=np.float64),
            self._plan,
            self._packed,
            self._room,
        )
        return SearchOutcome(*found)


def empty_room(steps: int) -> Room:
    """Return the room that a search over so many steps works in."""
    n = 2 * steps
    return empty_tape(steps), np.zeros((n, n)), np.zeros((n, n)), np.zeros((6, n))


def resting_plan(packed: FloatArray) -> FloatArray:
    """Return the scaled plan without turn or acceleration, shape ``(2 steps,)``."""
    plan = np.zeros(2 * int(packed[STEPS]))
    plan[1::2] = -packed[ACCELERATION_MIDDLE] / packed[ACCELERATION_HALF]
    return plan


@kernel
def predictive_step(
    x_r: float,
    y_r: float,
    psi: float,
    v: float,
    vt_x: float,
    vt_y: float,
    covariance: FloatArray,
    plan: FloatArray,
    p: FloatArray,
    room: Room,
) -> tuple[float, float, float, int, int]:
    """Improve a plan, return its first inputs and leave it shifted by one step.

    Args:
        x_r: Tracker minus target, north, m.
        y_r: Same, east, m.
        psi: Heading, rad.
        v: Speed, m/s.
        vt_x: Target's velocity north, m/s.
        vt_y: Same, east, m/s.
        covariance: Of these four states, ``(4, 4)``.
        plan: Scaled plan of the step before, ``(2 steps,)``; replaced.
        p: Packed settings.
        room: From ``empty_room``.

    Returns:
        Turn rate, acceleration, cost, iterations, and how the search ended.
    """
    tape = room[0]
    state, known = tape[0][0], tape[2][0, 0]
    state[0], state[1], state[2], state[3] = x_r, y_r, psi, v
    is_good = abs(vt_x) < LARGEST and abs(vt_y) < LARGEST
    for i in range(4):
        is_good = is_good and abs(state[i]) < LARGEST
    for i in range(4):
        is_good = is_good and covariance[i, i] >= 0.0
        for j in range(4):
            known[i, j] = 0.5 * (covariance[i, j] + covariance[j, i])
            is_good = is_good and abs(known[i, j]) < LARGEST * LARGEST
    cost, iterations, status = math.nan, 0, BAD_INPUT
    if is_good:
        cost, iterations, status = minimize(plan, vt_x, vt_y, p, room)
    if status == BAD_INPUT:
        for k in range(int(p[STEPS])):
            plan[2 * k] = 0.0
            plan[2 * k + 1] = -p[ACCELERATION_MIDDLE] / p[ACCELERATION_HALF]
        return 0.0, 0.0, math.nan, 0, BAD_INPUT
    turn = p[TURN_MIDDLE] + p[TURN_HALF] * plan[0]
    low = p[ACCELERATION_MIDDLE] - p[ACCELERATION_HALF]
    high = p[ACCELERATION_MIDDLE] + p[ACCELERATION_HALF]
    most = min(high, max(low, (p[SPEED_MAX] - v) / SPEED_TIME_S))
    least = max(low, min(high, (p[SPEED_MIN] - v) / SPEED_TIME_S))
    acceleration = p[ACCELERATION_MIDDLE] + p[ACCELERATION_HALF] * plan[1]
    acceleration = min(most, max(least, acceleration))
    for i in range(plan.size - 2):
        plan[i] = plan[i + 2]
    return turn, acceleration, cost, iterations, status


@kernel
def minimize(
    plan: FloatArray, vt_x: float, vt_y: float, p: FloatArray, room: Room
) -> tuple[float, int, int]:
    """Lower the cost of a plan within -1 .. 1, from the state that begins the tape.

    Bertsekas's projected quasi-Newton method: inputs that lie at a bound and want to go beyond it
    are held, the others take a Newton step with the BFGS curvature, and the step is halved along
    its projection into the box until the cost falls enough.

    Args:
        plan: Scaled inputs to begin with; replaced by the best.
        vt_x: Target's velocity north, m/s.
        vt_y: Same, east, m/s.
        p: Packed settings; ``ITERATIONS`` bounds the search.
        room: From ``empty_room``.

    Returns:
        Cost, iterations, and how the search ended.
    """
    tape, curvature, factor, vectors = room
    gradient, new_gradient = vectors[_GRADIENT], vectors[_NEW_GRADIENT]
    new_plan, way, free = vectors[_NEW_PLAN], vectors[_WAY], vectors[_FREE]
    n = plan.size
    cost = cost_forward(plan, vt_x, vt_y, p, tape)
    if not math.isfinite(cost):
        return cost, 0, BAD_INPUT
    gradient_backward(vt_x, vt_y, p, tape, gradient)
    is_fresh = True
    iteration = 0
    while iteration < int(p[ITERATIONS]):
        steepest = _hold(plan, gradient, free)
        if steepest <= _SMALL_GRADIENT * (abs(cost) + _SMALL_GRADIENT):
            return cost, iteration, CONVERGED
        if is_fresh:
            _begin_curvature(curvature, steepest)
        if not _newton(curvature, factor, gradient, free, way):
            _begin_curvature(curvature, steepest)
            is_fresh = True
            _newton(curvature, factor, gradient, free, way)
        new_cost = _descend(plan, way, gradient, new_plan, cost, vt_x, vt_y, p, tape)
        if not new_cost < cost:
            if is_fresh:
                return cost, iteration, STALLED
            is_fresh = True
            continue
        gradient_backward(vt_x, vt_y, p, tape, new_gradient)
        _curve(curvature, plan, new_plan, gradient, new_gradient, vectors[_CURVED], is_fresh)
        is_fresh = False
        for i in range(n):
            plan[i] = new_plan[i]
            gradient[i] = new_gradient[i]
        cost = new_cost
        iteration += 1
    return cost, iteration, SPENT


@inlined_kernel
def _hold(plan: FloatArray, gradient: FloatArray, free: FloatArray) -> float:
    """Mark the inputs that may move with 1, and return the largest slope among them."""
    steepest = 0.0
    for i in range(plan.size):
        at_bound = (plan[i] <= -1.0 and gradient[i] >= 0.0) or (
            plan[i] >= 1.0 and gradient[i] <= 0.0
        )
        free[i] = 0.0 if at_bound else 1.0
        if not at_bound:
            steepest = max(steepest, abs(gradient[i]))
    return steepest


@inlined_kernel
def _begin_curvature(curvature: FloatArray, steepest: float) -> None:
    """Set a curvature with which no input moves by more than half its range."""
    curvature[:] = 0.0
    for i in range(curvature.shape[0]):
        curvature[i, i] = steepest


@inlined_kernel
def _newton(
    curvature: FloatArray,
    factor: FloatArray,
    gradient: FloatArray,
    free: FloatArray,
    way: FloatArray,
) -> bool:
    """Solve for the step of the free inputs; return whether the curvature was positive."""
    n = gradient.size
    for i in range(n):
        way[i] = 0.0
        if free[i] == 0.0:
            continue
        total = -gradient[i]
        for j in range(i):
            if free[j] == 0.0:
                continue
            entry = curvature[i, j]
            for k in range(j):
                entry -= factor[i, k] * factor[j, k] * free[k]
            factor[i, j] = entry / factor[j, j]
            total -= factor[i, j] * way[j]
        pivot = curvature[i, i]
        for k in range(i):
            pivot -= factor[i, k] * factor[i, k] * free[k]
        if not pivot > 1e-14 * curvature[i, i]:
            return False
        factor[i, i] = math.sqrt(pivot)
        way[i] = total / factor[i, i]
    for i in range(n - 1, -1, -1):
        if free[i] == 0.0:
            continue
        for k in range(i + 1, n):
            way[i] -= factor[k, i] * way[k] * free[k]
        way[i] /= factor[i, i]
    return True


@inlined_kernel
def _descend(
    plan: FloatArray,
    way: FloatArray,
    gradient: FloatArray,
    new_plan: FloatArray,
    cost: float,
    vt_x: float,
    vt_y: float,
    p: FloatArray,
    tape: Tape,
) -> float:
    """Go along the projected way until the cost falls enough; return the cost, or infinity."""
    length = 1.0
    for _ in range(_HALVINGS):
        slope = 0.0
        for i in range(plan.size):
            new_plan[i] = min(1.0, max(-1.0, plan[i] + length * way[i]))
            slope += gradient[i] * (new_plan[i] - plan[i])
        new_cost = cost_forward(new_plan, vt_x, vt_y, p, tape)
        # An absurd covariance can round to a cost of minus infinity, which is no progress.
        if slope < 0.0 and -math.inf < new_cost <= cost + _SUFFICIENT * slope:
            return new_cost
        length *= 0.5
    return math.inf


@inlined_kernel
def _curve(
    curvature: FloatArray,
    plan: FloatArray,
    new_plan: FloatArray,
    gradient: FloatArray,
    new_gradient: FloatArray,
    curved: FloatArray,
    is_fresh: bool,
) -> None:
    """Update the curvature by BFGS with Powell's damping, which keeps it positive."""
    n = plan.size
    along, bent = 0.0, 0.0
    for i in range(n):
        moved, turned = new_plan[i] - plan[i], new_gradient[i] - gradient[i]
        along += moved * turned
        bent += turned * turned
    if is_fresh and along > 0.0:
        _begin_curvature(curvature, bent / along)
    quadratic = 0.0
    for i in range(n):
        curved[i] = 0.0
        for j in range(n):
            curved[i] += curvature[i, j] * (new_plan[j] - plan[j])
        quadratic += curved[i] * (new_plan[i] - plan[i])
    if not quadratic > 0.0:
        return
    share = 1.0
    if along < _LEAST_DAMPED * quadratic:
        share = (1.0 - _LEAST_DAMPED) * quadratic / (quadratic - along)
    damped = share * along + (1.0 - share) * quadratic
    # ``plan`` is overwritten by the caller, so the damped change of slope may stand in it.
    for i in range(n):
        plan[i] = share * (new_gradient[i] - gradient[i]) + (1.0 - share) * curved[i]
    for i in range(n):
        for j in range(n):
            curvature[i, j] += plan[i] * plan[j] / damped - curved[i] * curved[j] / quadratic


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    p = np.ones(SETTINGS_SIZE)
    p[ACCELERATION_MIDDLE] = 0.0
    plan = resting_plan(p)
    predictive_step(1.0, 0.5, 0.0, 0.1, 0.0, 0.0, np.eye(4), plan, p, empty_room(1))
