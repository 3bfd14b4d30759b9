"""One mission flown by onboard program and simulated robot, compiled."""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.borrowed import borrowed
from autonomy.compiled import inlined_kernel, inner_kernel, kernel
from autonomy.current.table import FlowTable
from autonomy.vehicle import kernel as body
from simulator.ahead import body as bodies
from simulator.ahead import executive, navigation, pilot
from simulator.ahead.state import (
    ROW_BATTERY,
    ROW_BELIEVED_NORTH,
    ROW_LEG,
    ROW_NORTH,
    ROW_SAMPLES,
    ROW_STD,
    ROW_TIME,
    SENSED,
    Polars,
    Record,
    Robot,
    Setup,
    State,
    Water,
)

move, read = bodies.move, bodies.read
navigate, begin_navigation = navigation.step, navigation.begin
expect_current = navigation.expect_current
decide, start, watch, rest = executive.step, executive.start, executive.watch, pilot.rest
RUNNING, LEG, ON_BOARD = executive.RUNNING, executive.LEG, executive.ON_BOARD
M0_MIN, M0_MAX = body.M0_MIN, body.M0_MAX
RP1_MIN, RP1_MAX, DELTA_MAX = body.RP1_MIN, body.RP1_MAX, body.DELTA_MAX
"""Names that numba resolves once, when it compiles."""

_SETTLED_S = 1e-6


@kernel
def begin(
    states: np.ndarray,
    setups: np.ndarray,
    robot: Robot,
    water: Water,
    legs: np.ndarray,
    first: FloatArray,
) -> None:
    """Switch the robot on where it floats.

    Args:
        states: One record ``State``; position, heading, charge and law are in it already.
        setups: One record ``Setup``.
        robot: Its numbers.
        water: Where it is.
        legs: Records ``Leg``.
        first: Standard normal numbers: two of the eddies, then those of two sets of readings, shape
            ``(2 + 2 SENSED,)``.
    """
    s, setup = borrowed(states)[0], borrowed(setups)[0]
    own = _borrowed_robot(robot)
    s.x[12] = 0.3 * own.true[M0_MIN]
    for i in range(2):
        s.eddy_ne_m_s[i] = setup.eddy_std_m_s * first[i]
    s.wanted_pitch_rad = s.last_pitch_rad = math.nan
    s.speed_share = 1.0
    s.gait_pitch_rate_rad_s = s.gait_pitch_growth_rad_s2 = math.inf
    s.swung_s = s.border_m = -math.inf
    s.pitch_swing[2] = s.mass_swing[2] = -1.0
    s.stage, s.plan_state, s.flown = executive.IDLE, ON_BOARD, -1
    s.told_leg = s.told_mode = -1
    read(s, setup, first)
    box = water.box
    begin_navigation(s, setup, own, 0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3]))
    rest(s, setup, own)
    read(s, setup, first[SENSED:])
    expect_current(s, setup, False, 0.0, 0.0)
    navigate(s, setup, own, 0.0)
    s.driven[:] = 0.0


@kernel
def fly(
    states: np.ndarray,
    setups: np.ndarray,
    robot: Robot,
    water: Water,
    legs: np.ndarray,
    polars: Polars,
    noise: FloatArray,
    record: Record,
) -> int:
    """Fly on until the mission is over or the noise is used up; return the steps taken.

    Args:
        states: One record ``State``, changed in place.
        setups: One record ``Setup``.
        robot: Its numbers.
        water: Where it is.
        legs: Records ``Leg``.
        polars: Its steady glides.
        noise: Standard normal numbers of each step, shape ``(n, NOISE)``.
        record: Where to write down what happens.
    """
    # what the loop uses is never counted: its functions are small and many, its threads share it
    s, setup, flown = borrowed(states)[0], borrowed(setups)[0], borrowed(legs)
    own, around, glides = _borrowed_robot(robot), _borrowed_water(water), _borrowed_polars(polars)
    drawn, told = borrowed(noise), _borrowed_record(record)
    for k in range(noise.shape[0]):
        if s.plan_state == ON_BOARD and s.steps * setup.period_s >= setup.settling_s - _SETTLED_S:
            s.began_s = s.steps * setup.period_s
            start(s, setup)
        _step(s, setup, own, around, flown, glides, drawn[k])
        if s.plan_state == ON_BOARD:
            continue
        _note(s, setup, told)
        if s.plan_state != RUNNING:
            return k + 1
    return noise.shape[0]


@inner_kernel
def _borrowed_robot(robot: Robot) -> Robot:
    return Robot(
        borrowed(robot.true),
        borrowed(robot.believed),
        borrowed(robot.surroundings),
        borrowed(robot.still),
    )


@inner_kernel
def _borrowed_water(water: Water) -> Water:
    flow = water.flow
    return Water(
        borrowed(water.box),
        borrowed(water.domain),
        borrowed(water.begins),
        borrowed(water.ends),
        borrowed(water.floor_north),
        borrowed(water.floor_east),
        borrowed(water.floor_depth),
        FlowTable(borrowed(flow.values), flow.low, flow.per_step),
    )


@inner_kernel
def _borrowed_polars(polars: Polars) -> Polars:
    return Polars(
        borrowed(polars.steepness_rad),
        borrowed(polars.pitch_rad),
        borrowed(polars.rate_m_s),
        borrowed(polars.net_buoyancy_max_kg),
    )


@inner_kernel
def _borrowed_record(record: Record) -> Record:
    return Record(borrowed(record.rows), borrowed(record.changes), borrowed(record.surfaced))


@inlined_kernel
def _step(
    s: State,
    setup: Setup,
    robot: Robot,
    water: Water,
    legs: np.ndarray,
    polars: Polars,
    noise: FloatArray,
) -> None:
    """Let one period of body and program pass."""
    move(s, setup, robot, water, noise)
    began_s = s.steps * setup.period_s
    s.steps += 1
    read(s, setup, noise)
    if setup.tells_current and s.plan_state == RUNNING and s.leg < legs.shape[0]:
        told = legs[s.leg].current_ne_m_s
        expect_current(s, setup, True, told[0], told[1])
    else:
        expect_current(s, setup, False, 0.0, 0.0)
    navigate(s, setup, robot, began_s)
    p = robot.believed
    watch(s, setup, robot, min(max(s.set_points[1] + s.trim_m, p[RP1_MIN]), p[RP1_MAX]))
    decide(s, setup, robot, water, legs, polars)
    s.driven[:] = s.set_points
    net_mass = min(max(s.set_points[0] + s.trim_kg, p[M0_MIN]), p[M0_MAX])
    sliding = min(max(s.set_points[1] + s.trim_m, p[RP1_MIN]), p[RP1_MAX])
    s.driven[0] = net_mass - setup.buoyancy_bias_kg
    s.driven[1] = sliding - setup.mass_position_bias_m
    s.driven[2] = min(max(s.set_points[2], -p[DELTA_MAX]), p[DELTA_MAX])


@inlined_kernel
def _note(s: State, setup: Setup, record: Record) -> None:
    """Write down where the robot is, what it does, and where it came up."""
    time_s = s.steps * setup.period_s - s.began_s
    samples = s.stage == LEG
    is_new = s.leg != s.told_leg or s.mode != s.told_mode or samples != s.told_sampling
    if is_new:
        if s.change < record.changes.shape[0]:
            change = record.changes[s.change]
            change[0], change[1], change[2] = time_s, s.mode, s.leg
            change[3] = 1.0 if samples else 0.0
            s.change += 1
        s.told_leg, s.told_mode, s.told_sampling = s.leg, s.mode, samples
    s.worst_std_m = max(s.worst_std_m, s.position_std_m)
    if (is_new or s.steps % setup.row_every == 0) and s.row < record.rows.shape[0]:
        row = record.rows[s.row]
        row[ROW_TIME], row[ROW_LEG], row[ROW_SAMPLES] = time_s, s.leg, 1.0 if samples else 0.0
        for i in range(3):
            row[ROW_NORTH + i] = s.x[i] if i < 2 else max(s.x[2], 0.0)
            row[ROW_BELIEVED_NORTH + i] = s.position_ned[i]
        row[ROW_STD], row[ROW_BATTERY] = s.position_std_m, s.battery
        s.row += 1
    # a mission ends where the robot believes to be up, which waves and noise may belie
    if samples or (s.x[2] >= setup.surfaced_m and s.plan_state == RUNNING):
        return
    at = s.leg - 1
    if 0 <= at < record.surfaced.shape[0] and math.isnan(record.surfaced[at, 0]):
        place = record.surfaced[at]
        place[0], place[1], place[2], place[3] = time_s, s.x[0], s.x[1], s.battery
