"""What the robot believes of itself, compiled; ``onboard.flight.navigation`` is the readable form.

The filter's own equations are those that the robot runs (``autonomy.estimation.model_kernel``).
"""

import math

import numpy as np

from autonomy.compiled import inlined_kernel, inner_kernel
from autonomy.estimation import fix_watch
from autonomy.estimation import kernel as estimators
from autonomy.estimation import model_kernel as model
from autonomy.estimation.attitude import CORRECTION_S, RATE_SMOOTHING_S
from autonomy.estimation.config import MOST_DOUBT
from simulator.ahead import coarse_belief
from simulator.ahead.state import Robot, Setup, State

BELIEVED, REFUSED, REOPENED = range(3)
"""What becomes of a fix."""

step_attitude = estimators.step_attitude
turn = estimators.turn
predict, measure = model.predict, model.measure
measure_depth, take_fix, widen = model.measure_depth, model.take_fix, model.widen
triangular = model.triangular
step_coarse, measure_coarse_depth = coarse_belief.step, coarse_belief.measure_depth
take_coarse_fix, widen_coarse = coarse_belief.take_fix, coarse_belief.widen
hear_coarse = coarse_belief.hear
NORTH, EAST, DEPTH = model.NORTH, model.EAST, model.DEPTH
FORWARD, BIAS = model.FORWARD, model.BIAS
STEADY_NORTH, STATES = model.STEADY_NORTH, model.STATES
DIVES, PRIOR_FREEDOM = fix_watch.DIVES, fix_watch.PRIOR_FREEDOM
SHORTEST_DIVE_S, SURPRISE = fix_watch.SHORTEST_DIVE_S, fix_watch.SURPRISE
DISTANCES = fix_watch.DISTANCES
"""Names that numba resolves once, when it compiles."""


@inner_kernel
def begin(s: State, setup: Setup, robot: Robot, centre_north: float, centre_east: float) -> None:
    """Begin to navigate with the first readings."""
    for i in range(3):
        s.attitude_rad[i] = s.angles_rad[i]
        s.rates_rad_s[i] = s.gyro_rad_s[i]
        s.before_attitude[i] = s.angles_rad[i]
        s.before_gyro[i] = s.gyro_rad_s[i]
        s.before_actuators[i] = s.actuators[i]
    s.belief[:] = 0.0
    s.belief[DEPTH] = max(s.depth_m, 0.0)
    s.belief[NORTH] = s.fix_ne_m[0] if s.has_reading_fix else centre_north
    s.belief[EAST] = s.fix_ne_m[1] if s.has_reading_fix else centre_east
    s.factor[:, :] = 0.0
    s.covariance[:, :] = 0.0
    for i in range(STATES):
        s.factor[i, i] = setup.first_std[i]
        s.covariance[i, i] = setup.first_std[i] ** 2
    for i in range(2):
        s.belief[STEADY_NORTH + i] = setup.first_current_ne_m_s[i]
    s.doubt = setup.least_doubt
    for _ in range(setup.first_dives):
        _take_dive(s, setup, setup.first_squared, 1.0)
    s.fix_age_s = 0.0 if s.has_reading_fix else math.inf


@inlined_kernel
def step(s: State, setup: Setup, robot: Robot, time_s: float) -> None:
    """Take in one set of readings; the set points in ``s`` were in force since ``time_s``."""
    dt = setup.period_s
    correction, smoothing = min(dt / CORRECTION_S, 1.0), min(dt / RATE_SMOOTHING_S, 1.0)
    step_attitude(
        s.attitude_rad, s.rates_rad_s, s.angles_rad, s.gyro_rad_s, dt, correction, smoothing
    )
    command, during = s.set_points, s.during
    during[:] = s.before_actuators
    during[0] = 0.5 * (s.before_actuators[0] + s.actuators[0])
    is_coarse = setup.belief_every > 1
    if is_coarse:
        step_coarse(s, setup, robot, command, time_s, during)
    else:
        predict(
            s.belief, s.factor, dt, command, time_s, s.before_attitude, s.before_gyro, during,
            robot.believed, robot.still, setup.noise, 1,
        )  # fmt: skip
    s.since_fix_s += dt
    s.stay_s += dt
    _notice_trim(s, setup, dt)
    for i in range(3):
        s.before_attitude[i] = s.attitude_rad[i]
        s.before_gyro[i] = s.gyro_rad_s[i]
        s.before_actuators[i] = s.actuators[i]
    if is_coarse:
        measure_coarse_depth(s, setup)
    else:
        measure_depth(
            s.belief, s.factor, s.depth_m, setup.depth_variance, setup.outlier_limit,
            setup.patience, s.refused_depths,
        )  # fmt: skip
    if s.has_reading_fix and s.depth_m <= setup.surface_depth_m:
        _take_fix(s, setup)
    s.fix_age_s = 0.0 if s.has_reading_fix else s.fix_age_s + dt
    _estimate(s, setup)


@inner_kernel
def expect_current(s: State, setup: Setup, has_one: bool, north: float, east: float) -> None:
    """Take what the plan counts on for this dive."""
    had, was_north, was_east = s.has_expected_current, s.expected_ne_m_s[0], s.expected_ne_m_s[1]
    s.has_expected_current = has_one
    s.expected_ne_m_s[0], s.expected_ne_m_s[1] = north, east
    if not has_one or (had and north == was_north and east == was_east):
        return
    if not had:
        if _steady_std(s, setup) > setup.told_std_m_s:
            _hear_current(s, setup, north, east)
        return
    change = (north - was_north, east - was_east)
    std = np.zeros(STATES)
    for i in range(2):
        s.belief[STEADY_NORTH + i] += change[i]
        std[STEADY_NORTH + i] = 0.5 * abs(change[i])
    _widen(s, setup, std)


@inner_kernel
def _hear_current(s: State, setup: Setup, north: float, east: float) -> None:
    told = (north, east)
    for i in range(2):
        state = STEADY_NORTH + i
        off, variance = told[i] - s.belief[state], setup.told_std_m_s**2
        if setup.belief_every > 1:
            hear_coarse(s, state, off, variance)
        else:
            measure(s.belief, s.factor, state, off, variance)


@inner_kernel
def _widen(s: State, setup: Setup, std: np.ndarray) -> None:
    if setup.belief_every > 1:
        widen_coarse(s, std)
    else:
        widen(s.factor, std)


@inner_kernel
def _notice_trim(s: State, setup: Setup, dt_s: float) -> None:
    """Doubt the ballast error when the feedback jumps farther than the pump can go."""
    jump = abs(s.actuators[0] - s.before_actuators[0]) - setup.pump_rate_kg_s * dt_s
    if jump > setup.notice_jump_kg:
        std = np.zeros(STATES)
        std[BIAS] = jump
        _widen(s, setup, std)


@inner_kernel
def shared(s: State, setup: Setup, i: int, j: int) -> float:
    """Return an element of the covariance, without the doubt."""
    if setup.belief_every > 1:
        return s.covariance[i, j]
    total = 0.0
    for k in range(min(i, j) + 1):
        total += s.factor[i, k] * s.factor[j, k]
    return total


@inner_kernel
def _worst(s: State, setup: Setup, first: int) -> float:
    """Return the larger standard deviation of two states that follow each other, with doubt."""
    a, b = shared(s, setup, first, first), shared(s, setup, first + 1, first + 1)
    c = shared(s, setup, first, first + 1)
    middle, half = 0.5 * (a + b), 0.5 * (a - b)
    return s.doubt * math.sqrt(max(middle + math.sqrt(half * half + c * c), 0.0))


@inner_kernel
def _steady_std(s: State, setup: Setup) -> float:
    return _worst(s, setup, STEADY_NORTH)


@inner_kernel
def _take_fix(s: State, setup: Setup) -> None:
    """Judge a fix, and take it in if it is believed."""
    variance = setup.fix_std_m**2
    off_n, off_e = s.fix_ne_m[0] - s.belief[NORTH], s.fix_ne_m[1] - s.belief[EAST]
    a, b = shared(s, setup, NORTH, NORTH) + variance, shared(s, setup, EAST, EAST) + variance
    c = shared(s, setup, NORTH, EAST)
    squared = (off_n * off_n * b - 2.0 * off_n * off_e * c + off_e * off_e * a) / (a * b - c * c)
    verdict = _judge(s, setup, squared / (s.doubt * s.doubt))
    if verdict == REFUSED:
        return
    is_after_dive = s.since_fix_s >= SHORTEST_DIVE_S
    if is_after_dive and s.has_believed_fix:
        _take_dive(s, setup, squared, 1.0 - _share_of_current(s, setup, a, b))
    if verdict == REOPENED:
        _doubt_itself(s, setup, math.hypot(off_n, off_e))
    if is_after_dive:
        s.stay_s = 0.0
    tells = is_after_dive or s.stay_s >= setup.telling_stay_s
    if setup.belief_every > 1:
        take_coarse_fix(s, variance, tells)
    else:
        take_fix(s.belief, s.factor, s.fix_ne_m.copy(), variance, tells)
    s.believed_fix[0], s.believed_fix[1] = s.fix_ne_m[0], s.fix_ne_m[1]
    s.has_believed_fix, s.since_fix_s = True, 0.0


@inner_kernel
def _judge(s: State, setup: Setup, squared: float) -> int:
    """Return what becomes of a fix (``fix_watch.FixGate``)."""
    north, east = s.fix_ne_m[0], s.fix_ne_m[1]
    away_m = 0.0
    if s.has_believed_fix:
        away_m = math.hypot(north - s.believed_fix[0], east - s.believed_fix[1])
    alike_m = DISTANCES * math.sqrt(2.0) * setup.fix_std_m
    if squared <= setup.outlier_limit and away_m <= setup.gate_speed_m_s * s.since_fix_s + alike_m:
        s.has_strange_fix, s.strange_in_a_row = False, 0
        return BELIEVED
    apart_m = math.hypot(north - s.strange_fix[0], east - s.strange_fix[1])
    agrees = s.has_strange_fix and apart_m <= setup.gate_speed_m_s * 2.0 + alike_m
    s.has_strange_fix = True
    s.strange_fix[0], s.strange_fix[1] = north, east
    s.strange_in_a_row = s.strange_in_a_row + 1 if agrees else 1
    if s.strange_in_a_row >= setup.fix_patience:
        s.has_strange_fix, s.strange_in_a_row = False, 0
        return REOPENED
    s.refused_fixes += 1
    return REFUSED


@inner_kernel
def _take_dive(s: State, setup: Setup, squared: float, weight: float) -> None:
    """Let a dive tell by how much larger the deviations are to be stated (``FixWatch``)."""
    s.dive_squared[s.dives % DIVES], s.dive_weight[s.dives % DIVES] = squared, weight
    s.dives += 1
    count = min(s.dives, DIVES)
    largest, second = -math.inf, 0.0
    for i in range(count):
        if s.dive_squared[i] > largest:
            second = largest if i > 0 else 0.0
            largest = s.dive_squared[i]
        elif s.dive_squared[i] > second:
            second = s.dive_squared[i]
    cap = max(SURPRISE, second)
    freedom, total = PRIOR_FREEDOM, PRIOR_FREEDOM
    for i in range(count):
        freedom += 2.0 * s.dive_weight[i]
        total += min(s.dive_squared[i], cap) * s.dive_weight[i]
    s.doubt = min(max(setup.least_doubt, math.sqrt(total / freedom)), MOST_DOUBT)


@inner_kernel
def _share_of_current(s: State, setup: Setup, a: float, b: float) -> float:
    """Return which part of a fix's expected distance comes from not knowing the current."""
    variance = (a, b)
    total = 0.0
    for i in range(2):
        own = shared(s, setup, STEADY_NORTH + i, STEADY_NORTH + i)
        both = shared(s, setup, NORTH + i, STEADY_NORTH + i)
        if own > 0.0:
            total += both * both / own / variance[i]
    return 0.5 * total


@inner_kernel
def _doubt_itself(s: State, setup: Setup, off_m: float) -> None:
    """Doubt position and current, each so far that it alone explains where the fixes lie."""
    rows = np.zeros((STATES + 4, STATES))
    for i in range(2):
        rows[STATES + i, NORTH + i] = off_m
        if s.since_fix_s >= SHORTEST_DIVE_S:
            rows[STATES + 2 + i, NORTH + i] = off_m
            rows[STATES + 2 + i, STEADY_NORTH + i] = off_m / s.since_fix_s
    if setup.belief_every > 1:
        s.covariance[:, :] += np.dot(rows.T, rows)
        return
    for i in range(STATES):
        for j in range(STATES):
            rows[i, j] = s.factor[j, i]
    s.factor[:, :] = triangular(rows)


@inlined_kernel
def _estimate(s: State, setup: Setup) -> None:
    """Put together what the executive and the pilot see."""
    sf, cf = math.sin(s.attitude_rad[0]), math.cos(s.attitude_rad[0])
    st, ct = math.sin(s.attitude_rad[1]), math.cos(s.attitude_rad[1])
    sp, cp = math.sin(s.attitude_rad[2]), math.cos(s.attitude_rad[2])
    v1, v2, v3 = s.belief[FORWARD], s.belief[FORWARD + 1], s.belief[FORWARD + 2]
    s.velocity_ned[0] = ct * cp * v1 + (cp * st * sf - cf * sp) * v2 + (sf * sp + cf * cp * st) * v3
    s.velocity_ned[1] = ct * sp * v1 + (cf * cp + st * sf * sp) * v2 + (cf * st * sp - cp * sf) * v3
    s.velocity_ned[2] = -st * v1 + ct * sf * v2 + ct * cf * v3
    s.position_ned[0], s.position_ned[1] = s.belief[NORTH], s.belief[EAST]
    s.position_ned[2] = max(s.belief[DEPTH], 0.0)
    s.position_std_m = _worst(s, setup, NORTH)
    for i in range(3):
        s.estimate[i] = s.position_ned[i]
        s.estimate[3 + i] = s.attitude_rad[i]
        s.estimate[6 + i] = s.belief[FORWARD + i]
        s.estimate[9 + i] = s.rates_rad_s[i]
    s.course_heading_rad = _mean_heading(s, setup)
    north, east = s.belief[STEADY_NORTH], s.belief[STEADY_NORTH + 1]
    squared = north * north + east * east
    by_chance = 2.0 * _steady_std(s, setup) ** 2
    share = 1.0 - by_chance / squared if squared > by_chance else 0.0
    s.sure_ne_m_s[0], s.sure_ne_m_s[1] = share * north, share * east


@inner_kernel
def _mean_heading(s: State, setup: Setup) -> float:
    """Return the heading averaged over one beat of the tail."""
    newest = s.attitude_rad[2]
    s.headings[s.heading_count % setup.headings] = newest
    s.heading_count += 1
    count = min(s.heading_count, setup.headings)
    wiggle = 0.0
    for i in range(count):
        wiggle += turn(s.headings[i] - newest)
    return turn(newest + wiggle / count)
