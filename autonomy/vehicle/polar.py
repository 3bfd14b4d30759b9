"""The polar of a glider: how it glides at every net buoyancy and position of its sliding mass."""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.vehicle.config import Vehicle, VehicleParameters
from autonomy.vehicle.stability import eigenvalues_by_growth, linearised
from autonomy.vehicle.steady import SteadyGlide

_POINTS = 21
_FLOW_ANGLES = 1441
"""Angles of attack, a quarter of a degree apart, between which a balance is looked for."""
_HALVINGS = 52


@dataclass(frozen=True, slots=True)
class Polar:
    """Straight glides on a grid; arrays have the shape (net masses, positions).

    NaN stands where the vehicle has no steady glide, as at a net mass of 0.
    """

    m0_kg: FloatArray
    """Net masses, the rows."""
    rp1_m: FloatArray
    """Positions of the sliding mass, the columns."""
    speed_m_s: FloatArray
    glide_angle_rad: FloatArray
    """Inclination of the path, positive up."""
    pitch_rad: FloatArray
    angle_of_attack_rad: FloatArray
    vertical_speed_m_s: FloatArray
    """Positive down."""
    horizontal_speed_m_s: FloatArray
    greatest_growth_per_s: FloatArray
    """Largest real part of the eigenvalues (``stability``): negative where the glide is stable."""

    @property
    def stable(self) -> BoolArray:
        """Whether a glide exists and is stable."""
        return self.greatest_growth_per_s < 0.0


def polar(
    vehicle: Vehicle, m0_kg: FloatArray | None = None, rp1_m: FloatArray | None = None
) -> Polar:
    """Work out a vehicle's polar.

    A straight glide has one unknown, the angle of attack: lift and drag then give the path's
    inclination and the speed, and what is left is the balance of the pitch moments. Each balance
    has a glide with the keel down and one upside down; the latter is left out.

    Args:
        vehicle: The robot.
        m0_kg: Net masses, by default 21 from end stop to end stop.
        rp1_m: Positions of the sliding mass, by default 21 from end stop to end stop.

    Source:
        Thesis Eq. 3.2 to 3.4 with constant states, tail straight.
    """
    limits = vehicle.limits
    if m0_kg is None:
        m0_kg = np.linspace(limits.m0_min_kg, limits.m0_max_kg, _POINTS)
    if rp1_m is None:
        rp1_m = np.linspace(limits.rp1_min_m, limits.rp1_max_m, _POINTS)
    m0, rp1 = np.meshgrid(m0_kg, rp1_m, indexing="ij")
    alpha = _balanced_alpha(vehicle.parameters, m0.ravel(), rp1.ravel()).reshape(m0.shape)
    _, path, speed = _balance(vehicle.parameters, alpha, m0, rp1)
    pitch = path + alpha
    down = -speed * np.sin(path)
    across = np.abs(speed * np.cos(path))
    return Polar(
        m0_kg=m0_kg,
        rp1_m=rp1_m,
        speed_m_s=speed,
        glide_angle_rad=np.arctan2(-down, across),
        pitch_rad=pitch,
        angle_of_attack_rad=alpha,
        vertical_speed_m_s=down,
        horizontal_speed_m_s=across,
        greatest_growth_per_s=_growth(vehicle.parameters, m0, rp1, alpha, pitch, speed),
    )


def _balance(
    p: VehicleParameters, alpha: FloatArray, m0: FloatArray, rp1: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return pitch moment N m, path angle rad and speed m/s of glides with given flow angles."""
    drag = p.drag_0 + p.drag_alpha * alpha**2
    lift = p.lift_0 + p.lift_alpha * alpha
    heavy = np.sign(m0)
    with np.errstate(divide="ignore", invalid="ignore"):
        path = np.where(drag > 0.0, np.arctan2(-heavy * drag, heavy * lift), np.nan)
        # dynamic pressure times area: lift and drag together carry the net weight
        load = np.where(m0 == 0.0, np.nan, np.abs(m0) * p.gravity_m_s2 / np.hypot(drag, lift))
        speed = np.sqrt(2.0 * load / (p.water_density_kg_m3 * p.area_m2))
        pitch = path + alpha
        munk = (p.mass_3_kg - p.mass_1_kg) * speed**2 * np.sin(alpha) * np.cos(alpha)
        hang = p.offset_mass_kg * p.offset_mass_depth_m * np.sin(pitch)
        tilt = p.sliding_mass_kg * rp1 * np.cos(pitch)
        moment = munk + load * (p.pitch_0_m + p.pitch_alpha_m * alpha)
    return moment - p.gravity_m_s2 * (hang + tilt), path, speed


def _balanced_alpha(p: VehicleParameters, m0: FloatArray, rp1: FloatArray) -> FloatArray:
    """Return the angle of attack with the keel down of each pair of inputs, NaN if none."""
    angles = np.linspace(-np.pi, np.pi, _FLOW_ANGLES)
    moment, path, _ = _balance(p, angles, m0[:, None], rp1[:, None])
    upright = np.cos(path + angles) > 0.0
    crossing = upright[:, :-1] & upright[:, 1:] & (moment[:, :-1] * moment[:, 1:] <= 0.0)
    # of several balances the one with the flow nearest to the bow
    first = np.where(crossing, np.abs(angles[:-1]), np.inf).argmin(axis=1)
    low, high = angles[first], angles[first + 1]
    at_low, _, _ = _balance(p, low, m0, rp1)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        at_middle, _, _ = _balance(p, middle, m0, rp1)
        is_beyond = at_low * at_middle <= 0.0
        low, high = np.where(is_beyond, low, middle), np.where(is_beyond, middle, high)
    return np.where(crossing.any(axis=1), 0.5 * (low + high), np.nan)


def _growth(
    p: VehicleParameters,
    m0: FloatArray,
    rp1: FloatArray,
    alpha: FloatArray,
    pitch: FloatArray,
    speed: FloatArray,
) -> FloatArray:
    """Return the largest real part of the eigenvalues of each glide, 1/s, NaN if there is none."""
    packed = p.packed()
    growth = np.full(m0.shape, np.nan)
    for where in np.argwhere(np.isfinite(alpha)):
        at = (int(where[0]), int(where[1]))
        velocity = (float(speed[at] * np.cos(alpha[at])), 0.0, float(speed[at] * np.sin(alpha[at])))
        motion = SteadyGlide(float(pitch[at]), 0.0, velocity, 0.0)
        matrix = linearised(packed, motion, np.array([m0[at], rp1[at], 0.0]))
        growth[at] = eigenvalues_by_growth(matrix)[0].real
    return growth
