"""The simulated robot's body, compiled: water that drifts, the plant, its battery and sensors.

``simulator.plant``, ``simulator.current``, ``simulator.sensor`` and ``simulator.battery`` are the
readable form. The heading counts from the frame's north: the compass counts from true north and the
program takes that back, which leaves a millionth of a radian.
"""

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_kernel, inner_kernel
from autonomy.planner.leg import flow_kernel
from autonomy.vehicle import extended_kernel
from autonomy.vehicle import kernel as body
from simulator.ahead import water as waters
from simulator.ahead.state import Robot, Setup, State, Water
from simulator.plant import FLOOR, PHYSICS_STEP_S, SHALLOWEST_M

advance_into = extended_kernel.advance_into
flow_at = flow_kernel.flow_at
floor_m = waters.floor_m
M0_RATE, RP1_RATE = body.M0_RATE, body.RP1_RATE
ENERGY_M0, ENERGY_RP1 = body.ENERGY_M0, body.ENERGY_RP1
"""Names that numba resolves once, when it compiles."""

CLEAR_M = 1.0
"""Water above and below a robot whose tail is still, from which on its steps are longer."""
_EARLY_S = 1e-6


@inlined_kernel
def _is_clear(s: State, setup: Setup, water: Water) -> bool:
    """Tell whether nothing is near that pushes the robot: a step may then be longer."""
    depth = s.x[2]
    if setup.has_walls or depth < CLEAR_M or s.set_points[3] != 0.0:
        return False
    return floor_m(water, s.x[0], s.x[1]) - depth > CLEAR_M


@inlined_kernel
def move(s: State, setup: Setup, robot: Robot, water: Water, noise: FloatArray) -> None:
    """Let a period pass under the set points that hold."""
    kept, fresh = setup.eddy_kept, setup.eddy_fresh_m_s
    north, east = flow_at(water.flow, s.x[0], s.x[1], max(s.x[2], 0.0), setup.water_s + s.plant_s)
    around = robot.surroundings
    for i in range(2):
        s.eddy_ne_m_s[i] = kept * s.eddy_ne_m_s[i] + fresh * noise[i]
        around[i] = setup.steady_ne_m_s[i] + s.eddy_ne_m_s[i] + (north if i == 0 else east)
    if setup.is_uneven:
        around[FLOOR] = max(floor_m(water, s.x[0], s.x[1]), SHALLOWEST_M)
    s.x[15] = 0.0
    steps = setup.clear_steps if _is_clear(s, setup, water) else setup.plant_steps
    step_s = setup.period_s / steps
    net_mass, sliding = s.x[12], s.x[13]
    advance_into(
        s.x, s.driven, robot.true, around, s.plant_s, step_s, steps,
        s.slope, s.total, s.probe,
    )  # fmt: skip
    s.plant_s += steps * step_s
    used_j = s.x[15]
    if step_s > PHYSICS_STEP_S + _EARLY_S:
        p = robot.true
        used_j += p[ENERGY_M0] * _hurried(s.x[12] - net_mass, p[M0_RATE], step_s, setup.period_s)
        used_j += p[ENERGY_RP1] * _hurried(s.x[13] - sliding, p[RP1_RATE], step_s, setup.period_s)
    s.battery = max(0.0, s.battery - used_j / setup.battery_j)


@inner_kernel
def _hurried(way: float, rate: float, step_s: float, period_s: float) -> float:
    """Return what a coarse step leaves out of the integral of an actuator's squared rate.

    An actuator goes its way at its greatest rate and rests; a longer step spreads the way over its
    whole length. The way is taken as gone in one such step.
    """
    whole = int(abs(way) / (rate * PHYSICS_STEP_S))
    rest = abs(way) - whole * rate * PHYSICS_STEP_S
    true = whole * rate * rate * PHYSICS_STEP_S + rest * rest / PHYSICS_STEP_S
    return max(true - way * way / min(max(abs(way) / rate, step_s), period_s), 0.0)


@inlined_kernel
def read(s: State, setup: Setup, noise: FloatArray) -> None:
    """Read all sensors, in the terms of the model: with the mission's trim taken off."""
    std, x = setup.noise_std, s.x
    s.depth_m = x[2] + std[0] * noise[2]
    for i in range(3):
        s.angles_rad[i] = x[3 + i] + std[1 + i] * noise[3 + i]
        s.gyro_rad_s[i] = x[9 + i] + std[4 + i] * noise[6 + i]
        s.actuators[i] = x[12 + i] + std[7 + i] * noise[9 + i]
    s.actuators[0] += setup.buoyancy_bias_kg - s.trim_kg
    s.actuators[1] += setup.mass_position_bias_m - s.trim_m
    s.has_reading_fix = x[2] <= setup.fix_depth_m and s.plant_s >= s.next_fix_s - _EARLY_S
    if s.has_reading_fix:
        s.next_fix_s = s.plant_s + setup.fix_period_s
        for i in range(2):
            s.fix_ne_m[i] = x[i] + std[11 + i] * noise[13 + i]
