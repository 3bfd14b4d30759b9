"""The compiled control step: against its readable form, enumeration, other solvers, and orbits."""

import itertools
import math

import clarabel
import numpy as np
import osqp
import pytest
from scipy import sparse

from autonomy.tracking.config import (
    THESIS_TRACKING,
    BarrierConfig,
    MotionConfig,
    TrackingConfig,
)
from autonomy.tracking.control import control_kernel
from autonomy.tracking.control.control_kernel import (
    ACTIVE,
    INFEASIBLE,
    UNCHANGED,
    closest,
    control_step,
)
from autonomy.tracking.control.pack_control import ALPHAS, pack_control
from autonomy.tracking.reference import box_qp
from autonomy.tracking.reference.barrier import ControlStatus, control
from reproduction.tracking import unicycle
from reproduction.tracking.orbit import follow
from tests.autonomy.closest_point import enumerated, problems

START = (-5.0, 0.0, 0.6, 0.1)
TURN_MAX = math.pi / 4


def thesis(**settings):
    barrier = THESIS_TRACKING.barrier.model_dump() | {"epsilon": 0.04, "slope": 1.0} | settings
    return THESIS_TRACKING.model_copy(update={"barrier": BarrierConfig.model_validate(barrier)})


# The closest point


def test_closest_point_is_that_of_exhaustive_enumeration_on_100_000_problems():
    n, g, b, low, high = problems(100_000, 11)
    best, is_feasible = enumerated(n, g, b, low, high)
    columns = np.column_stack([n, g, b, low, high]).tolist()
    found = np.array([closest(*row) for row in columns])
    assert np.array_equal(found[:, 2] != INFEASIBLE, is_feasible)
    assert np.abs(found[is_feasible, :2] - best[is_feasible]).max() < 1e-12
    share = is_feasible.mean()
    assert 0.5 < share < 0.95  # both verdicts were tried
    clipped = np.clip(n, low, high)
    is_clipped = np.all(found[:, :2] == clipped, axis=1)
    assert np.all(is_clipped[found[:, 2] != ACTIVE])
    assert (found[:, 2] == ACTIVE).mean() > 0.1


def test_readable_closest_point_is_the_compiled_one():
    n, g, b, low, high = problems(20_000, 12)
    for row in zip(n.tolist(), g.tolist(), b.tolist(), low.tolist(), high.tolist(), strict=True):
        one, two, is_feasible = box_qp.solve(*row)
        *compiled, status = closest(*row[0], *row[1], row[2], *row[3], *row[4])
        assert is_feasible == (status != INFEASIBLE)
        assert compiled == pytest.approx([one, two], abs=1e-9)


def test_a_closest_point_meets_the_constraint_and_stays_in_the_box():
    n, g, b, low, high = problems(20_000, 13)
    for row in np.column_stack([n, g, b, low, high]).tolist():
        u1, u2, status = closest(*row)
        assert row[5] <= u1 <= row[7]
        assert row[6] <= u2 <= row[8]
        if status != INFEASIBLE:
            size = abs(row[2]) + abs(row[3]) + abs(row[4])
            assert row[2] * u1 + row[3] * u2 >= row[4] - 1e-14 * (1.0 + size)


def feasible_problems(count, seed):
    """Return problems scaled as the barrier's are, with room on either side of the verdict."""
    rows = np.column_stack(problems(20 * count, seed))
    rows = rows[np.abs(rows[:, 2:4]).min(axis=1) > 0.05]
    corner = np.where(rows[:, 2:4] > 0.0, rows[:, 7:9], rows[:, 5:7])
    room = (rows[:, 2:4] * corner).sum(axis=1) - rows[:, 4]
    return rows[room > 0.05][:count].tolist()


def test_osqp_finds_the_same_point():
    solver = osqp.OSQP()
    first = True
    rows = feasible_problems(300, 14)
    assert len(rows) == 300
    for row in rows:
        n, g, b, low, high = row[:2], row[2:4], row[4], row[5:7], row[7:9]
        a = sparse.csc_matrix(np.array([g, [1.0, 0.0], [0.0, 1.0]]))
        lower, upper = np.array([b, *low]), np.array([np.inf, *high])
        if first:
            accuracy = {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 200_000}
            cost = sparse.eye(2, format="csc")
            solver.setup(cost, -np.array(n), a, lower, upper, verbose=False, **accuracy)
            first = False
        else:
            solver.update(q=-np.array(n), Ax=a.data, l=lower, u=upper)
        result = solver.solve(raise_error=True)
        assert closest(*row)[:2] == pytest.approx(result.x.tolist(), abs=1e-5)


def test_clarabel_finds_the_same_point_and_the_same_verdict():
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    verdicts = []
    for row in np.column_stack(problems(400, 15)).tolist():
        n, g, b, low, high = row[:2], row[2:4], row[4], row[5:7], row[7:9]
        a = sparse.csc_matrix(np.array([[-g[0], -g[1]], [1.0, 0], [0, 1.0], [-1.0, 0], [0, -1.0]]))
        bounds = np.array([-b, *high, -low[0], -low[1]])
        cost, cones = sparse.eye(2, format="csc"), [clarabel.NonnegativeConeT(5)]
        result = clarabel.DefaultSolver(cost, -np.array(n), a, bounds, cones, settings).solve()
        u1, u2, status = closest(*row)
        edge = max(g[0] * low[0], g[0] * high[0]) + max(g[1] * low[1], g[1] * high[1])
        if abs(edge - b) < 1e-6 * (1.0 + abs(b)):
            continue  # exactly at a corner an interior point has no interior
        verdicts.append(status != INFEASIBLE)
        assert (str(result.status) == "Solved") == verdicts[-1]
        if verdicts[-1]:
            assert (u1, u2) == pytest.approx(list(result.x), abs=1e-5)
    assert 50 < sum(verdicts) < len(verdicts) - 50


# The compiled step


def configurations():
    for alpha, shape, fallback in itertools.product(
        ALPHAS, ("absolute", "squared"), ("best_effort", "nominal")
    ):
        barrier = BarrierConfig(alpha=alpha, shape=shape, fallback=fallback, slope=0.7)
        motion = MotionConfig(speed_min_m_s=0.1, speed_max_m_s=0.4)
        yield TrackingConfig(barrier=barrier, motion=motion)
    yield TrackingConfig(barrier=BarrierConfig(controller="nominal"))
    yield TrackingConfig(motion=MotionConfig(acceleration_min_m_s2=0.0))


def states(count, seed):
    rng = np.random.default_rng(seed)
    low = np.array([-6.0, -6.0, -7.0, -0.1, -0.1, -0.1, -0.02, -0.02])
    rows = rng.uniform(low, -low, (count, 8))
    rows[:, 3] += 0.25
    rows[::3, :2] *= 0.1  # near the target
    rows[::5, 4:6] = 0.0
    rows[::7, 6:8] = 0.0
    return rows.tolist()


def test_compiled_step_is_the_readable_one_with_every_setting():
    seen = set()
    for number, config in enumerate(configurations()):
        packed = pack_control(config)
        for row in states(400, number):
            wanted = control(row[:4], row[4:6], row[6:], config)
            u1, u2, nominal1, nominal2, det, barrier, status = control_step(*row, packed)
            assert (nominal1, nominal2) == pytest.approx(wanted.nominal, abs=1e-11)
            assert (det, barrier) == pytest.approx(
                (wanted.determinant_m2_s, wanted.barrier), abs=1e-12
            )
            assert status == wanted.status
            assert u1 == pytest.approx(wanted.turn_rate_rad_s, abs=1e-9)
            assert u2 == pytest.approx(wanted.acceleration_m_s2, abs=1e-9)
            seen.add(status)
    assert seen == {UNCHANGED, ACTIVE, INFEASIBLE}


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e12])
@pytest.mark.parametrize("place", range(8))
def test_bad_input_commands_nothing(place, value):
    numbers = [-1.0, 0.5, 0.3, 0.2, 0.02, 0.01, 0.0, 0.0]
    numbers[place] = value
    step = control_step(*numbers, pack_control(TrackingConfig()))
    assert step == (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, ControlStatus.BAD_INPUT)


def test_the_largest_and_the_emptiest_states_give_a_finite_command_within_the_limits():
    extremes = (0.0, -0.0, 1e-300, -1e-12, 1.0, 9e8, -9e8)
    rng = np.random.default_rng(2)
    for config in configurations():
        packed = pack_control(config)
        for row in rng.choice(extremes, (200, 8)).tolist():
            step = control_step(*row, packed)
            assert all(math.isfinite(value) for value in step)
            assert abs(step[0]) <= TURN_MAX
            assert abs(step[1]) <= 0.01


def test_both_forms_share_their_numbers():
    numbers = (control_kernel.UNCHANGED, ACTIVE, INFEASIBLE, control_kernel.BAD_INPUT)
    assert numbers == tuple(ControlStatus)
    assert pack_control(TrackingConfig()).size == control_kernel.SIZE


# What it makes of a path


def test_readable_run_of_a_minute_is_the_compiled_one():
    config, state = thesis(), START
    run = follow(config, START, 60.0)
    for compiled in run.state:
        assert state == pytest.approx(compiled.tolist(), abs=1e-9)
        step = control(state, (0.0, 0.0), (0.0, 0.0), config)
        state = unicycle.advance(state, step.turn_rate_rad_s, step.acceleration_m_s2, run.step_s)


@pytest.mark.parametrize("shape", ["squared", "absolute"])
@pytest.mark.parametrize("epsilon", [0.0065, 0.04])
def test_orbit_around_a_target_that_stays_is_as_wide_as_barrier_and_turn_rate_say(shape, epsilon):
    run = follow(thesis(shape=shape, epsilon=epsilon), START, 300.0)
    radius = math.sqrt(math.sqrt(epsilon) / TURN_MAX)
    assert run.radius_m(100.0) == pytest.approx(radius, rel=0.01)
    assert run.state[-1000:, 3].mean() == pytest.approx(radius * TURN_MAX, rel=0.01)
    assert run.inverse_condition[-1000:].mean() == pytest.approx(TURN_MAX, rel=0.01)


@pytest.mark.parametrize("speed", [0.1, 0.2, 0.4])
def test_a_barrier_that_may_not_fall_keeps_the_determinant_of_the_start(speed):
    run = follow(thesis(alpha="zero"), (*START[:3], speed), 300.0)
    start = abs(run.determinant_m2_s[0])
    assert start == pytest.approx(5.0 * speed * math.sin(0.6))
    assert run.radius_m(100.0) == pytest.approx(math.sqrt(start / TURN_MAX), rel=0.01)


def test_the_squared_barrier_is_dead_on_the_line_of_sight_until_the_target_is_passed():
    collinear = (-5.0, 0.0, 0.0, 0.1)
    dead = follow(thesis(), collinear, 100.0)
    approach = dead.time_s < 20.0
    assert np.all(dead.determinant_m2_s[approach] == 0.0)
    assert np.all(dead.status[approach] == INFEASIBLE)
    for config in (thesis(shape="absolute"), thesis(fallback="best_effort")):
        run = follow(config, collinear, 100.0)
        assert run.fallback_share < 0.01
        assert np.all(np.abs(run.determinant_m2_s[50:]) > 0.1)
        assert run.observability_s(20.0) > 10.0 * dead.observability_s(20.0)


def test_the_speed_stays_between_cap_and_floor_on_the_way():
    motion = MotionConfig(speed_min_m_s=0.12, speed_max_m_s=0.2)
    config = TrackingConfig(motion=motion)
    run = follow(config, (-20.0, 3.0, 0.6, 0.05), 600.0)
    settled = run.state[200:, 3]
    assert settled.max() < 0.2 + 1e-9
    assert settled.min() > 0.12 - 1e-9
    assert settled.max() > 0.19  # the cap was reached


def test_a_run_says_whether_it_ever_came_near():
    run = follow(thesis(), START, 5.0)
    assert run.arrival_s(1.0) is None
    assert run.arrival_s(6.0) == 0.0
    with pytest.raises(ValueError, match="step_s must be positive"):
        follow(thesis(), START, 0.05)
