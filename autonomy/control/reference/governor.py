"""The robust controller, readable: wrong masses and a slow, late mass actuator.

``governor_kernel`` is the fast twin.
"""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.control.governor_config import GovernorConfig
from autonomy.control.reference.backstepping import Solution, solve
from autonomy.control.reference.integral import apply_learned
from autonomy.control.trajectory import Reference
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.kernel import rk4_step


@dataclass(frozen=True, slots=True)
class SentCommands:
    """What the controller remembers of its own commands; actuators are thought to start at 0."""

    actuators: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where net mass kg, sliding mass m and tail rad are by the commands so far."""
    sliding_m: tuple[float, ...] = ()
    """Set points of the sliding mass, oldest first."""

    def before(self, calls: int) -> float:
        """Set point of so many calls ago, 0 where there was none."""
        return self.sliding_m[-calls] if calls <= len(self.sliding_m) else 0.0


def governor_inputs(
    state: FloatArray,
    reference: Reference,
    learned: FloatArray,
    sent: SentCommands,
    config: GovernorConfig,
    vehicle: Vehicle,
    dt_s: float,
) -> tuple[FloatArray, FloatArray, SentCommands]:
    """Net mass kg, sliding mass m and tail angle rad, not yet limited; what is learned and sent.

    Net mass and tail are those of the integral backstepping law. The sliding mass is that of the
    law for the state at which its command arrives, with the pitch gains lowered to a bandwidth
    that its rate can follow; its integral learns from the present error, which shows what the
    prediction has wrong.

    Args:
        state: The 12 states or their estimate, shape ``(12,)``.
        reference: Where the vehicle should be.
        learned: As of ``integral_inputs``.
        sent: The controller's own commands so far.
        config: Gains, and what is known of the mass actuator.
        vehicle: The model and the end stops.
        dt_s: Time since the last call.
    """
    calls = config.delay_calls(dt_s)
    rate = config.mass_rate_share * vehicle.limits.rp1_rate_m_s
    predicted = _predicted(state, learned, sent, calls, rate, vehicle, dt_s)
    ahead = _extrapolated(reference, calls * dt_s)
    distance = float(learned[2])
    law = solve(predicted, ahead, config, vehicle, added_along_m=distance)
    share = _bandwidth_share(law, config, rate, calls * dt_s)
    given_up = (1.0 - share) * config.k_3 * law.error.hybrid_rate
    given_up += (1.0 - share**2) * config.k_xi * law.error.hybrid

    now = solve(state, reference, config, vehicle, added_along_m=distance)
    wanted = now.inputs.copy()
    wanted[1] = law.inputs[1] + given_up / law.slide_effect
    inputs, learned = apply_learned(wanted, now, learned, config, vehicle, dt_s, share**3)
    return inputs, learned, _remembered(inputs, sent, calls, rate, vehicle, dt_s)


def _predicted(
    state: FloatArray,
    learned: FloatArray,
    sent: SentCommands,
    calls: int,
    rate_m_s: float,
    vehicle: Vehicle,
    dt_s: float,
) -> FloatArray:
    """Return the state after ``calls`` calls, under the commands that are on their way."""
    predicted, sliding = state.copy(), sent.actuators[1]
    for late in range(calls, 0, -1):
        moved = _towards(sliding, sent.before(late), rate_m_s * dt_s)
        inputs = np.array([sent.actuators[0], 0.5 * (sliding + moved), sent.actuators[2]])
        inputs[:2] += learned[:2]
        predicted = rk4_step(predicted, inputs, vehicle.packed(), dt_s, 1)
        sliding = moved
    return predicted


def _bandwidth_share(
    law: Solution, config: GovernorConfig, rate_m_s: float, delay_s: float
) -> float:
    """Share of the greatest bandwidth that the mass actuator can follow at the present error."""
    greatest = math.sqrt(config.k_xi)
    error = abs(law.error.hybrid) + abs(law.error.hybrid_rate) / greatest
    jerk = config.rate_use * abs(law.slide_effect) * rate_m_s
    bandwidth = min(
        greatest,
        math.cbrt(jerk / max(error, config.error_floor_rad)),
        config.delay_margin / max(delay_s, 1e-9),
    )
    return bandwidth / greatest


def _remembered(
    inputs: FloatArray,
    sent: SentCommands,
    calls: int,
    rate_m_s: float,
    vehicle: Vehicle,
    dt_s: float,
) -> SentCommands:
    """Note the new set points and move the actuators as they will until the next call."""
    limits = vehicle.limits
    m0, rp1, tail = limits.clip(*inputs.tolist())
    now = SentCommands(sent.actuators, (*sent.sliding_m, rp1))
    actuators = (
        _towards(sent.actuators[0], m0, limits.m0_rate_kg_s * dt_s),
        _towards(sent.actuators[1], now.before(calls + 1), rate_m_s * dt_s),
        _towards(sent.actuators[2], tail, limits.delta_rate_rad_s * dt_s),
    )
    return SentCommands(actuators, now.sliding_m)


def _towards(value: float, target: float, most: float) -> float:
    return value + min(max(target - value, -most), most)


def _extrapolated(reference: Reference, ahead_s: float) -> Reference:
    """Return where a reference is a little later, if its acceleration stays."""
    packed = reference.packed()
    velocity = packed[4:8] + ahead_s * packed[8:]
    value = packed[:4] + ahead_s * packed[4:8] + 0.5 * ahead_s**2 * packed[8:]
    n, e, d, pitch = value.tolist()
    vn, ve, vd, pitch_rate = velocity.tolist()
    return Reference(
        (n, e, d),
        pitch,
        (vn, ve, vd),
        pitch_rate,
        reference.acceleration_ned,
        reference.pitch_acceleration_rad_s2,
    )
