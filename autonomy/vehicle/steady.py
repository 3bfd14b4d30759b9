"""Motions that a glider holds by itself with given inputs: straight glides and spirals."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import OptimizeResult, root

from autonomy.arrays import FloatArray
from autonomy.vehicle.config import VehicleParameters
from autonomy.vehicle.glide import NoSteadyGlideError
from autonomy.vehicle.kernel import rk4_step
from autonomy.vehicle.reference.dynamics import hydrodynamic_wrench, rigid_body_rates

_SETTLING_S = 300.0
_STEP_S = 0.05


@dataclass(frozen=True, slots=True)
class SteadyGlide:
    """A motion with constant rates; a spiral if it turns."""

    pitch_rad: float
    roll_rad: float
    velocity_m_s: tuple[float, float, float]
    """Through the water in body axes."""
    turn_rate_rad_s: float
    """Rate of the heading, positive to starboard."""

    @property
    def alpha_rad(self) -> float:
        """Angle of attack."""
        return math.atan2(self.velocity_m_s[2], self.velocity_m_s[0])

    @property
    def glide_angle_rad(self) -> float:
        """Inclination of the path, positive up (thesis: pitch minus angle of attack)."""
        return math.atan2(-self.vertical_speed_m_s, self.horizontal_speed_m_s)

    @property
    def speed_m_s(self) -> float:
        """Speed through the water."""
        return math.hypot(*self.velocity_m_s)

    @property
    def vertical_speed_m_s(self) -> float:
        """Rate of depth, positive down."""
        v1, v2, v3 = self.velocity_m_s
        across = math.sin(self.roll_rad) * v2 + math.cos(self.roll_rad) * v3
        return -math.sin(self.pitch_rad) * v1 + math.cos(self.pitch_rad) * across

    @property
    def horizontal_speed_m_s(self) -> float:
        """Speed over the horizontal plane."""
        return math.sqrt(max(self.speed_m_s**2 - self.vertical_speed_m_s**2, 0.0))

    @property
    def turn_radius_m(self) -> float:
        """Radius of the spiral, infinite for a straight glide."""
        if self.turn_rate_rad_s == 0.0:
            return math.inf
        return self.horizontal_speed_m_s / abs(self.turn_rate_rad_s)


def steady_glide(
    parameters: VehicleParameters,
    m0_kg: float,
    rp1_m: float,
    delta_rad: float = 0.0,
    *,
    extended: bool = False,
) -> SteadyGlide:
    """Find the motion that a vehicle settles into with constant inputs.

    The 12-state model is run until it has settled, and a root finder makes that exact.

    Args:
        parameters: The vehicle's model.
        m0_kg: Net mass, not 0.
        rp1_m: Position of the sliding mass.
        delta_rad: Tail angle.
        extended: Whether to use lift and pitch moment of thesis Eq. 5.18 instead of Eq. 3.4.

    Raises:
        NoSteadyGlideError: If there is none.
    """
    if m0_kg == 0.0:
        raise NoSteadyGlideError("a neutrally buoyant vehicle does not glide")
    inputs = np.array([m0_kg, rp1_m, delta_rad])
    guess = _settled(parameters, inputs)
    found = root(_imbalance, guess, args=(inputs, parameters, extended), tol=1e-14)
    if _scale(found, inputs, parameters, extended) > 1e-9:
        raise NoSteadyGlideError(
            f"no steady motion at net mass {m0_kg * 1e3:.1f} g, sliding mass {rp1_m * 1e3:.1f} mm,"
            f" tail {math.degrees(delta_rad):.0f} deg"
        )
    v1, v2, v3, roll, pitch, turn_rate = (float(value) for value in found.x)
    if delta_rad == 0.0:
        v2 = roll = turn_rate = 0.0
    return SteadyGlide(pitch, roll, (v1, v2, v3), turn_rate)


def _settled(parameters: VehicleParameters, inputs: FloatArray) -> FloatArray:
    """Return forward, side and down speed, roll, pitch and turn rate after a while."""
    state = np.zeros(12)
    # the pendulum's rest pitch: near enough to start from at any sign of the buoyancy
    p = parameters
    state[4] = -math.atan2(p.sliding_mass_kg * inputs[1], p.offset_mass_kg * p.offset_mass_depth_m)
    state[6] = 0.05
    steps = round(_SETTLING_S / _STEP_S)
    x = rk4_step(state, inputs, parameters.packed(), _STEP_S, steps)
    if not np.all(np.isfinite(x)):
        raise NoSteadyGlideError(
            f"the model's motion at net mass {inputs[0] * 1e3:.1f} g grows without bound: no robot"
            " with these parameters glides"
        )
    turn_rate = (math.sin(x[3]) * x[10] + math.cos(x[3]) * x[11]) / math.cos(x[4])
    return np.array([*x[6:9], math.remainder(x[3], 2.0 * math.pi), x[4], turn_rate])


def _imbalance(
    unknown: FloatArray, inputs: FloatArray, p: VehicleParameters, extended: bool
) -> FloatArray:
    """Return linear and angular accelerations of a steadily turning body, shape ``(6,)``."""
    v1, v2, v3, roll, pitch, turn_rate = unknown
    w = turn_rate * np.array(
        [
            -math.sin(pitch),
            math.sin(roll) * math.cos(pitch),
            math.cos(roll) * math.cos(pitch),
        ]
    )
    state = np.array([0.0, 0.0, 0.0, roll, pitch, 0.0, v1, v2, v3, *w])
    force, moment = hydrodynamic_wrench(state[6:9], w, inputs[2], p, extended=extended)
    return rigid_body_rates(state, inputs[0], inputs[1], force, moment, p)[6:]


def _scale(
    found: OptimizeResult, inputs: FloatArray, p: VehicleParameters, extended: bool
) -> float:
    """Return the greatest leftover acceleration relative to what buoyancy alone would give."""
    left = _imbalance(found.x, inputs, p, extended)
    return float(np.max(np.abs(left)) / (abs(inputs[0]) * p.gravity_m_s2 / p.mass_1_kg))
