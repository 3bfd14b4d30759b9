"""What a step of the observability barrier costs, and that it is the right step."""

import math
import time
from collections.abc import Callable
from typing import Any

import clarabel
import numba
import numpy as np
import osqp
from scipy import sparse

from autonomy.tracking.config import THESIS_TRACKING, BarrierConfig, TrackingConfig
from autonomy.tracking.control import control_kernel
from autonomy.tracking.control.control_kernel import INFEASIBLE, closest, control_step
from autonomy.tracking.control.pack_control import pack_control
from autonomy.tracking.filter import filter_kernel
from benchmarks.calibration import COMPILED, PYTHON, best_of, calibrated, scaled_row
from reproduction.tracking import unicycle
from reproduction.tracking.orbit import follow
from tests.autonomy.closest_point import enumerated, problems

AREA = "tracking_speed"
CALL_BAR_US, LOOP_BAR_US = 2.0, 1.0
"""Where the yardsticks take what ``calibration`` says of the reference machine."""
PROBLEMS, PEER_PROBLEMS = 100_000, 400
DIFFERENCE_BAR, RADIUS_BAR = 1e-9, 0.01
ANCHORS = (
    ((-1.0, 0.5, 0.3, 0.2), (0.02, 0.01), 0.0065, 0.13, (-0.08262551479, 0.01)),
    ((-1.0, 0.5, 0.3, 0.2), (0.02, 0.01), 0.0065, 1.0, (-0.31521397338, 0.01)),
    ((-0.1, 0.5, 0.0, 0.35), (0.0, 0.0), 0.0324, 0.13, (-0.12402040816, 0.01)),
)
"""Relative state, velocity of the target, barrier level, slope, and the command."""
STEPS = 200_000
DT_S = 0.1
_ROUNDS = 9


def measure() -> list[dict[str, Any]]:
    """Measure one step, alone and with the estimator, its anchors, and its solver's peers."""
    return [*_steps(), *_loops(), *_anchors(), *_enumeration(), *_peers()]


def _steps() -> list[dict[str, Any]]:
    """Time calls from Python on states along a run, so that all branches are taken."""
    rows = []
    for title, config in (("default", TrackingConfig()), ("thesis", THESIS_TRACKING)):
        run = follow(config, (-5.0, 0.0, 0.6, 0.1), 335.0)
        packed, states = pack_control(config), run.state.tolist()

        def calls(states: Any = states, packed: Any = packed) -> None:
            for x_r, y_r, psi, v in states:
                control_step(x_r, y_r, psi, v, 0.02, 0.01, 0.0, 0.0, packed)

        with calibrated(PYTHON) as calibration:
            us = best_of(calls, _ROUNDS) / len(states) * 1e6
        name = f"Control step called from Python, {title}"
        rows.append(scaled_row(AREA, name, us, "us", CALL_BAR_US, calibration))
    return rows


def _loops() -> list[dict[str, Any]]:
    config = TrackingConfig()
    packed, q = pack_control(config), filter_kernel.pack_filter(config)
    noise = np.random.default_rng(1).standard_normal((STEPS, 3)) * np.sqrt([0.1, 0.0175, 0.1])
    x, cov = np.empty(4), np.empty(filter_kernel.TRIANGLE)
    velocity = np.empty(filter_kernel.VELOCITY_SIZE)

    def once(is_estimated: bool) -> float:
        return _run(is_estimated, noise, packed, q, x, cov, velocity)

    bare_us = best_of(lambda: once(False), _ROUNDS) / STEPS * 1e6
    with calibrated(COMPILED) as calibration:
        whole_us = best_of(lambda: once(True), _ROUNDS) / STEPS * 1e6
    whole = "Estimator, target velocity, barrier and plant in a compiled loop"
    return [
        _row("Barrier step and plant in a compiled loop", bare_us, "us"),
        scaled_row(AREA, whole, whole_us, "us", LOOP_BAR_US, calibration),
        _row("Mean range over that loop's steps", once(True), "m", 1.0),
    ]


@numba.njit(nogil=True)  # not kept on disk: what it inlines lives in other files
def _run(
    is_estimated: bool,
    noise: Any,
    p: Any,
    q: Any,
    x: Any,
    cov: Any,
    velocity: Any,
) -> float:
    """Follow a target that stays, every command from the estimate; return the mean range."""
    x_r, y_r, psi, v = -3.0, 1.0, 0.6, 0.2
    own_x, own_y, total = 0.0, 0.0, 0.0
    x[0], x[1], x[2], x[3] = x_r, y_r, psi, v
    cov[:], velocity[:] = 0.0, 0.0
    cov[0], cov[4], cov[7], cov[9] = 0.165, 0.165, 0.0175, 0.1
    for i in range(noise.shape[0]):
        distance = math.sqrt(x_r * x_r + y_r * y_r)
        total += distance
        if is_estimated:
            filter_kernel.update_into(
                x,
                cov,
                psi + noise[i, 1],
                v + noise[i, 2],
                abs(distance + noise[i, 0]),
                True,
                q,
            )
            filter_kernel.velocity_into(
                velocity, own_x - x[0], own_y - x[1], DT_S, q[filter_kernel.R_TARGET], q
            )
            vt_x, vt_y = velocity[2], velocity[3]
            u1, u2, _, _, _, _, _ = control_kernel.control_step(
                x[0], x[1], x[2], x[3], vt_x, vt_y, 0.0, 0.0, p
            )
        else:
            u1, u2, _, _, _, _, _ = control_kernel.control_step(
                x_r, y_r, psi, v, 0.0, 0.0, 0.0, 0.0, p
            )
        x_r, y_r, psi, v = unicycle.advance_kernel(x_r, y_r, psi, v, u1, u2, DT_S)
        if is_estimated:
            gone = filter_kernel.predict_into(x, cov, u1, u2, DT_S, vt_x, vt_y, q)
            own_x, own_y = own_x + gone[0], own_y + gone[1]
    return total / noise.shape[0]


def _anchors() -> list[dict[str, Any]]:
    """Compare printed commands and the radii of orbits around a target that stays."""
    worst = 0.0
    for state, velocity, epsilon, slope, command in ANCHORS:
        packed = pack_control(_thesis(epsilon=epsilon, slope=slope))
        found = control_step(*state, *velocity, 0.0, 0.0, packed)[:2]
        worst = max(worst, float(np.abs(np.subtract(found, command)).max()))
    apart = 0.0
    for settings, speed in (
        *(({"epsilon": epsilon, "shape": "squared"}, 0.1) for epsilon in (0.0065, 0.04)),
        *(({"epsilon": epsilon, "shape": "absolute"}, 0.1) for epsilon in (0.0065, 0.04)),
        *(({"epsilon": 0.04, "alpha": "zero"}, speed) for speed in (0.1, 0.2, 0.4)),
    ):
        run = follow(_thesis(slope=1.0, **settings), (-5.0, 0.0, 0.6, speed), 300.0)
        held = math.sqrt(settings["epsilon"])
        if "alpha" in settings:
            held = abs(float(run.determinant_m2_s[0]))
        apart = max(apart, abs(run.radius_m(100.0) / math.sqrt(held / (math.pi / 4.0)) - 1.0))
    return [
        _row("Printed commands, worst difference", worst, "", DIFFERENCE_BAR),
        _row("Radius of seven orbits against theory, relative", apart, "", RADIUS_BAR),
    ]


def _thesis(**settings: Any) -> TrackingConfig:
    barrier = BarrierConfig.model_validate(THESIS_TRACKING.barrier.model_dump() | settings)
    return THESIS_TRACKING.model_copy(update={"barrier": barrier})


def _enumeration() -> list[dict[str, Any]]:
    n, g, b, low, high = problems(PROBLEMS, 11)
    best, is_feasible = enumerated(n, g, b, low, high)
    found = np.array([closest(*row) for row in np.column_stack([n, g, b, low, high]).tolist()])
    verdicts = int(np.sum((found[:, 2] != INFEASIBLE) != is_feasible))
    worst = float(np.abs(found[is_feasible, :2] - best[is_feasible]).max())
    name = f"Closed form against enumeration, {PROBLEMS} problems"
    return [
        _row(f"{name}: other verdicts", verdicts, "", 0),
        _row(f"{name}: worst difference", worst, "", DIFFERENCE_BAR),
    ]


def _peers() -> list[dict[str, Any]]:
    """Time two general solvers on problems that have a solution."""
    rows = np.column_stack(problems(PEER_PROBLEMS, 15)).tolist()
    rows = [row for row in rows if closest(*row)[2] != INFEASIBLE and row[2] and row[3]]
    own = best_of(lambda: [closest(*row) for row in rows], _ROUNDS) / len(rows) * 1e6
    lines = [_row("Closest point alone, closed form, called from Python", own, "us")]
    for title, solve in (("OSQP, set up once", _osqp()), ("Clarabel", _clarabel)):
        times, worst = [], 0.0
        for row in rows:
            begin = time.perf_counter()
            point = solve(row)
            times.append(time.perf_counter() - begin)
            worst = max(worst, float(np.abs(np.subtract(point, closest(*row)[:2])).max()))
        us = float(np.median(times)) * 1e6
        lines.append(_row(f"Closest point, {title}, median", us, "us"))
        lines.append(_row(f"Closest point, {title}, worst difference", worst, ""))
    return lines


def _osqp() -> Callable[[list[float]], Any]:
    solver = osqp.OSQP()
    solver.setup(
        sparse.eye(2, format="csc"),
        np.zeros(2),
        sparse.csc_matrix(np.array([[1.0, 1.0], [1.0, 0.0], [0.0, 1.0]])),
        np.full(3, -1.0),
        np.full(3, 1.0),
        verbose=False,
    )

    def solve(row: list[float]) -> Any:
        solver.update(
            q=-np.array(row[:2]),
            Ax=np.array([row[2], 1.0, row[3], 1.0]),
            l=np.array([row[4], *row[5:7]]),
            u=np.array([math.inf, *row[7:9]]),
        )
        return solver.solve(raise_error=False).x

    return solve


def _clarabel(row: list[float]) -> Any:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    a = [[-row[2], -row[3]], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]
    bounds = np.array([-row[4], *row[7:9], -row[5], -row[6]])
    cost, cones = sparse.eye(2, format="csc"), [clarabel.NonnegativeConeT(5)]
    parts = (cost, -np.array(row[:2]), sparse.csc_matrix(np.array(a)), bounds, cones, settings)
    return clarabel.DefaultSolver(*parts).solve().x


def _row(name: str, value: float, unit: str, bar: float | None = None) -> dict[str, Any]:
    met = None if bar is None else bool(value <= bar)
    return {
        "area": AREA,
        "name": name,
        "value": float(value),
        "unit": unit,
        "bar": bar,
        "met": met,
    }


if __name__ == "__main__":
    for row in measure():
        print(row)
