"""Open-loop flights of a known vehicle with noise: what an identification is tried on."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.identification import kernel
from autonomy.identification.config import NoiseLevels
from autonomy.identification.recording import Recording
from autonomy.vehicle.config import Vehicle

_PAUSE_S = 10.0
_STEP_S = 0.02


def open_loop_recording(
    vehicle: Vehicle,
    generator: np.random.Generator,
    *,
    runs: int = 6,
    duration_s: float = 80.0,
    period_s: float = 0.1,
    noise: NoiseLevels | None = None,
    extended: bool = False,
    net_buoyancy_bias_kg: float = 0.0,
    mass_position_bias_m: float = 0.0,
) -> Recording:
    """Fly a vehicle through random steps of its actuators and record it with noise.

    Each run begins 3 m deep, level and slow. Net mass and sliding mass step together so that the
    robot glides up and down, and the tail steps by itself; all within stops and rates.

    Args:
        vehicle: The truth.
        generator: Source of steps and noise.
        runs: Number of runs; a pause lies between two.
        duration_s: Of one run.
        period_s: Between two rows.
        noise: Of the measurements; the defaults are those of the configuration.
        extended: Whether the truth has the forces of thesis Eq. 5.18 instead of Eq. 3.4.
        net_buoyancy_bias_kg: By how much the recorded feedback of the net mass is too great.
        mass_position_bias_m: By how much that of the sliding mass is.
    """
    noise = noise or NoiseLevels()
    rows = round(duration_s / period_s) + 1
    parts: list[FloatArray] = []
    for run in range(runs):
        time_s = run * (duration_s + _PAUSE_S) + period_s * np.arange(rows)
        inputs = _random_steps(vehicle, generator, rows, period_s)
        flown = _fly(vehicle, inputs, period_s, extended)
        part = np.concatenate([time_s[:, None], flown, inputs], axis=1)
        parts.append(part.astype(np.float64))
    table = np.concatenate(parts)
    std = np.array(
        [noise.horizontal_m] * 2 + [noise.depth_m] + [noise.tilt_rad] * 2 + [noise.heading_rad]
    )
    table[:, 1:7] += std * generator.standard_normal((table.shape[0], 6))
    return Recording(
        table[:, 0],
        table[:, 1:4],
        np.full(table.shape[0], noise.horizontal_m),
        np.ones(table.shape[0], dtype=np.bool_),
        table[:, 4:7],
        table[:, 7] + net_buoyancy_bias_kg,
        table[:, 8] + mass_position_bias_m,
        table[:, 9],
    )


def _random_steps(
    vehicle: Vehicle, generator: np.random.Generator, rows: int, period_s: float
) -> FloatArray:
    """Return net mass, sliding mass and tail over time, shape ``(rows, 3)``."""
    limits = vehicle.limits
    low = np.array([limits.m0_min_kg, limits.rp1_min_m, -limits.delta_max_rad])
    high = np.array([limits.m0_max_kg, limits.rp1_max_m, limits.delta_max_rad])
    rate = np.array([limits.m0_rate_kg_s, limits.rp1_rate_m_s, limits.delta_rate_rad_s])
    inputs = np.zeros((rows, 3))
    target = np.zeros(3)
    glide_until = tail_until = 0
    down = generator.random() < 0.5
    for k in range(1, rows):
        if k >= glide_until:
            down = not down
            share = np.array([generator.uniform(0.25, 0.95), generator.uniform(0.1, 0.6)])
            target[:2] = share * (high[:2] if down else low[:2])
            glide_until = k + round(generator.uniform(12.0, 30.0) / period_s)
        if k >= tail_until:
            target[2] = generator.choice([0.0, 1.0]) * generator.uniform(low[2], high[2])
            tail_until = k + round(generator.uniform(6.0, 20.0) / period_s)
        most = rate * period_s
        inputs[k] = inputs[k - 1] + np.clip(target - inputs[k - 1], -most, most)
    return inputs


def _fly(vehicle: Vehicle, inputs: FloatArray, period_s: float, extended: bool) -> FloatArray:
    """Return position and attitude under recorded actuators, shape ``(rows, 6)``."""
    rows = inputs.shape[0]
    parts = max(round(period_s / _STEP_S), 1)
    nodes = (rows - 1) * parts + 1
    at = np.arange(nodes) / parts
    state = np.zeros(12)
    state[2], state[6] = 3.0, 0.05
    node_row = np.where(np.arange(nodes) % parts == 0, np.arange(nodes) // parts, -1)
    flown = np.empty((rows, 6))
    recorded = (
        np.array([0, nodes]),
        np.column_stack([np.interp(at, np.arange(rows), inputs[:, k]) for k in range(3)]),
        np.full(nodes, period_s / parts),
        node_row,
    )
    stayed = kernel.roll_out(
        state, 0, recorded, np.zeros(2), vehicle.packed(), extended, np.empty((4, 12)), flown
    )
    if not stayed:
        raise ValueError("the vehicle's motion leaves all bounds")
    return flown
