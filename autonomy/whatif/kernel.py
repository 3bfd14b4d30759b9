"""Compiled trial: controller, actuators, vehicle, sensors and observer in one loop.

It releases the interpreter's lock, so that several seeds run at once in threads.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_entry, inlined_kernel, inner_kernel, kernel
from autonomy.control import governor_kernel
from autonomy.control import law as laws
from autonomy.control.law_number import BACKSTEPPING, GOVERNOR
from autonomy.current.table import FlowTable, uniform_table
from autonomy.planner.leg.flow_kernel import flow_at, is_uniform
from autonomy.vehicle import extended_kernel
from autonomy.vehicle import kernel as body

derivative_into = body.derivative_into
rk4_into = body.rk4_into
advance = extended_kernel.advance
command_into = laws.command_into
clip_into = laws.clip_into
backstepping_into = laws.backstepping_into
rows = laws.rows
"""Names that numba resolves once, when it compiles."""

FED, LEARNING = governor_kernel.FED, governor_kernel.LEARNING
COMMAND_SIZE, MEMORY_SIZE = laws.COMMAND_SIZE, laws.MEMORY_SIZE

(
    NET_BUOYANCY_ERROR,
    MASS_POSITION_ERROR,
    CURRENT_NORTH,
    CURRENT_EAST,
    OBSERVER_VELOCITY_GAIN,
    OBSERVER_DEPTH_GAIN,
) = range(6)
"""Index of each number in the conditions of a flight."""

STATE, INPUTS, COMMANDS, ESTIMATE, RECORD_SIZE = 0, 12, 15, 20, 32
"""First column of each part of a flight's record; the estimate is left out of an exact one."""
_OBSERVER_PARTS = 5


@kernel
def correlate(noise: FloatArray, columns: int, keep: float) -> None:
    """Turn white noise in the first columns into noise that keeps a share from row to row.

    The standard deviation stays; ``noise`` has shape ``(n, m)`` and is changed in place.
    """
    fresh = math.sqrt(1.0 - keep * keep)
    for k in range(1, noise.shape[0]):
        for i in range(columns):
            noise[k, i] = keep * noise[k - 1, i] + fresh * noise[k, i]


@inlined_kernel
def _towards(value: float, target: float, low: float, high: float, most: float) -> float:
    step = min(max(target, low), high) - value
    return value + min(max(step, -most), most)


@inlined_kernel
def actuate(u: FloatArray, wanted: FloatArray, p: FloatArray, dt_s: float) -> None:
    """Move the actuators in ``u`` towards what is wanted, within end stops and rates."""
    m0, rp1, delta = body.M0_RATE, body.RP1_RATE, body.DELTA_RATE
    stop = p[body.DELTA_MAX]
    u[0] = _towards(u[0], wanted[0], p[body.M0_MIN], p[body.M0_MAX], p[m0] * dt_s)
    u[1] = _towards(u[1], wanted[1], p[body.RP1_MIN], p[body.RP1_MAX], p[rp1] * dt_s)
    u[2] = _towards(u[2], wanted[2], -stop, stop, p[delta] * dt_s)


@inner_kernel
def _observe(
    belief: FloatArray,
    inputs: FloatArray,
    measured_depth: float,
    conditions: FloatArray,
    p: FloatArray,
    dt_s: float,
    rates: FloatArray,
) -> None:
    """Let the model-based observer predict depth and velocity in ``belief`` over ``dt_s``.

    Attitude and angular velocity stay as measured. ``rates`` is scratch, shape ``(12,)``.

    Source:
        Thesis section 3.4: the depth error corrects depth by K2 and velocity by K1 R'[0, 0, 1].
    """
    sf, cf = math.sin(belief[3]), math.cos(belief[3])
    st, ct = math.sin(belief[4]), math.cos(belief[4])
    h = dt_s / _OBSERVER_PARTS
    for _ in range(_OBSERVER_PARTS):
        derivative_into(belief, inputs[0], inputs[1], inputs[2], p, rates)
        error = measured_depth - belief[2]
        push = conditions[OBSERVER_VELOCITY_GAIN] * error
        belief[2] += h * (rates[2] + conditions[OBSERVER_DEPTH_GAIN] * error)
        belief[6] += h * (rates[6] - push * st)
        belief[7] += h * (rates[7] + push * ct * sf)
        belief[8] += h * (rates[8] + push * ct * cf)


@inner_kernel
def _observe_swimming(
    belief: FloatArray,
    inputs: FloatArray,
    measured_depth: float,
    conditions: FloatArray,
    p: FloatArray,
    command: FloatArray,
    time_s: float,
    dt_s: float,
    steps: int,
) -> None:
    """Predict as ``_observe`` with the model of section 5.3, which knows the tail's thrust."""
    water = np.array([0.0, 0.0, 0.0, -np.inf, np.inf, -np.inf, np.inf, np.inf, 0.0])
    x = np.empty(15)
    x[:12] = belief
    x[12:] = inputs
    x = advance(x, command, p, water, time_s, dt_s / steps, steps)
    error = measured_depth - belief[2]
    push = dt_s * conditions[OBSERVER_VELOCITY_GAIN] * error
    sf, cf = math.sin(belief[3]), math.cos(belief[3])
    st, ct = math.sin(belief[4]), math.cos(belief[4])
    belief[2] = x[2] + dt_s * conditions[OBSERVER_DEPTH_GAIN] * error
    belief[6] = x[6] - push * st
    belief[7] = x[7] + push * ct * sf
    belief[8] = x[8] + push * ct * cf


@inner_kernel
def _measure(x: FloatArray, noise: FloatArray, belief: FloatArray, is_first: bool) -> float:
    """Write what the sensors say into ``belief`` and return the measured depth.

    The velocity stays the observer's, and so does the depth, except at the first time.
    """
    belief[0] = x[0] + noise[0]
    belief[1] = x[1] + noise[1]
    for i in range(3):
        belief[3 + i] = x[3 + i] + noise[3 + i]
        belief[9 + i] = x[9 + i] + noise[6 + i]
    depth = x[2] + noise[2]
    if is_first:
        belief[2] = depth
    return depth


@inlined_kernel
def _record(
    record: FloatArray,
    k: int,
    x: FloatArray,
    estimate: FloatArray,
    inputs: FloatArray,
    command: FloatArray,
) -> None:
    """Write state, sensed actuators, command and estimate in row ``k``."""
    for i in range(12):
        record[k, STATE + i] = x[i]
    for i in range(3):
        record[k, INPUTS + i] = inputs[i]
    for i in range(COMMAND_SIZE):
        record[k, COMMANDS + i] = command[i]
    for i in range(record.shape[1] - ESTIMATE):
        record[k, ESTIMATE + i] = estimate[i]


@kernel
def move_extended(
    x: FloatArray,
    inputs: FloatArray,
    applied: FloatArray,
    true: FloatArray,
    surroundings: FloatArray,
    conditions: FloatArray,
    time_s: float,
    dt_s: float,
) -> None:
    """Advance the 15-state robot ``x`` and its sensed actuators by one step under a command.

    The model moves the true masses, whose end stops are as far off as their sensors.
    """
    m0_error, rp1_error = conditions[NET_BUOYANCY_ERROR], conditions[MASS_POSITION_ERROR]
    biased = true.copy()
    biased[body.M0_MIN] += m0_error
    biased[body.M0_MAX] += m0_error
    biased[body.RP1_MIN] += rp1_error
    biased[body.RP1_MAX] += rp1_error
    wanted = applied.copy()
    wanted[0] += m0_error
    wanted[1] += rp1_error
    x[12], x[13], x[14] = inputs[0] + m0_error, inputs[1] + rp1_error, inputs[2]
    x[:] = advance(x, wanted, biased, surroundings, time_s, dt_s, 1)
    inputs[0], inputs[1], inputs[2] = x[12] - m0_error, x[13] - rp1_error, x[14]


@inlined_entry
def move_within_rates(
    x: FloatArray,
    inputs: FloatArray,
    applied: FloatArray,
    true: FloatArray,
    conditions: FloatArray,
    dt_s: float,
    slope: FloatArray,
    total: FloatArray,
    probe: FloatArray,
) -> None:
    """Advance the 12-state robot ``x`` and its sensed actuators by one step under a command."""
    actuate(inputs, applied, true, dt_s)
    m0 = inputs[0] + conditions[NET_BUOYANCY_ERROR]
    rp1 = inputs[1] + conditions[MASS_POSITION_ERROR]
    rk4_into(x, m0, rp1, inputs[2], true, dt_s, slope, total, probe)
    x[0] += conditions[CURRENT_NORTH] * dt_s
    x[1] += conditions[CURRENT_EAST] * dt_s


@kernel
def fly(
    law: int,
    gains: FloatArray,
    believed: FloatArray,
    true: FloatArray,
    start: FloatArray,
    references: FloatArray,
    noise: FloatArray,
    conditions: FloatArray,
    surroundings: FloatArray,
    is_extended: bool,
    dt_s: float,
    steps: int,
    delay_steps: int,
    flow: FlowTable,
) -> tuple[FloatArray, FloatArray]:
    """Let a controller track a reference.

    Args:
        law: Which law, of ``autonomy.control.law_number``.
        gains: Its packed configuration.
        believed: ``Vehicle.packed()`` that the controller and the observer know.
        true: ``Vehicle.packed()`` of the robot that flies, its actuators' true rates included.
        start: The 12 states at the start; the actuators start at 0.
        references: Packed reference at each command, shape ``(n, 12)``.
        noise: Added to position, attitude and angular velocity at each command, shape
            ``(n, 9)``; shape ``(0, 9)`` where the controller sees the true state.
        conditions: Shape ``(6,)``, by the indices above; its current moves the 12-state model.
        surroundings: ``Surroundings.packed()`` of the extended model.
        is_extended: Whether the robot is the 15-state model.
        dt_s: Step of the model.
        steps: Steps for which a command is held.
        delay_steps: Steps by which the sliding mass's commands come late.
        flow: The current by place, depth and time of the flight, taken anew at each command; one
            that is the same everywhere leaves that of conditions and surroundings.

    Returns:
        The record at each command before it takes effect, shape ``(n, RECORD_SIZE)``, or
        ``(n, ESTIMATE)`` where the estimate is the state; and what the actuators did, shape
        ``(2, 3)``: way, and integral of the squared rate.
    """
    n = references.shape[0]
    width = ESTIMATE if noise.shape[0] == 0 else RECORD_SIZE
    record, effort = np.empty((n, width)), np.zeros((2, 3))
    x, belief, estimate = np.zeros(15), np.zeros(12), np.zeros(12)
    x[:12] = start
    inputs, before = np.zeros(3), np.zeros(3)
    memory, scratch = np.zeros(MEMORY_SIZE), rows()
    slope, total, probe, errors = np.empty(12), np.empty(12), np.empty(12), np.empty(16)
    late, command, applied = np.zeros(delay_steps + 1), np.zeros(COMMAND_SIZE), np.zeros(5)
    period_s, depth, slot = steps * dt_s, 0.0, 0
    there, water, is_steady = conditions.copy(), surroundings.copy(), is_uniform(flow)
    for k in range(n):
        if not is_steady:
            north, east = flow_at(flow, x[0], x[1], x[2], k * period_s)
            there[CURRENT_NORTH], there[CURRENT_EAST] = north, east
            water[0], water[1] = north, east
        if noise.shape[0] == 0:
            estimate[:] = x[:12]
        else:
            if k > 0 and is_extended:
                start_s = (k - 1) * period_s
                _observe_swimming(
                    belief, inputs, depth, there, believed, command, start_s, period_s, steps
                )
            elif k > 0:
                _observe(belief, inputs, depth, there, believed, period_s, slope)
            depth = _measure(x, noise[k], belief, k == 0)
            estimate[:] = belief
            estimate[2] = depth
        r = references[k]
        if law == BACKSTEPPING:
            # without the choice among all laws, which takes a tenth of a step's time
            backstepping_into(estimate, r, gains, believed, 0.0, errors, probe, slope, command)
            clip_into(believed, command)
        else:
            if law == GOVERNOR:
                memory[FED] = LEARNING
                memory[FED + 1 : FED + 4] = inputs
            command_into(law, estimate, r, gains, believed, period_s, memory, scratch, command)
        _record(record, k, x, estimate, inputs, command)
        applied[:] = command
        for step in range(k * steps, (k + 1) * steps):
            late[slot] = command[1]
            slot = slot + 1 if slot < delay_steps else 0
            applied[1] = late[slot]
            before[:] = inputs
            if is_extended:
                move_extended(x, inputs, applied, true, water, there, step * dt_s, dt_s)
            else:
                move_within_rates(x, inputs, applied, true, there, dt_s, slope, total, probe)
            for i in range(3):
                moved = inputs[i] - before[i]
                effort[0, i] += abs(moved)
                effort[1, i] += moved * moved
    effort[1] /= dt_s
    return record, effort


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    packed, start = np.ones(body.DELTA_RATE + 1), np.zeros(12)
    start[6] = 0.1
    one, water, conditions = np.zeros((1, 12)), np.zeros(9), np.zeros(6)
    gains, noise = np.ones(32), np.zeros((0, 9))
    correlate(np.zeros((2, 9)), 2, 0.5)
    still = uniform_table(0.0, 0.0)
    fly(
        BACKSTEPPING,
        gains,
        packed,
        packed,
        start,
        one,
        noise,
        conditions,
        water,
        False,
        0.01,
        1,
        0,
        still,
    )
