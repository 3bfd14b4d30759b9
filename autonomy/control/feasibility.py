"""Whether a vehicle can do what a reference asks, and which limit it breaks if not."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.control.trajectory import Reference
from autonomy.vehicle.config import ActuatorLimits, Vehicle
from autonomy.vehicle.glide import NoSteadyGlideError, angle_of_attack

_SAMPLES = 400
_STEEPEST_RAD = math.radians(85.0)
_ANGLES = 160
_TOLERANCE = 1.02
"""A reference at a limit is no fault of its rounding."""
_FLATTER = 0.75
"""How flat the mean path may be against the flattest glide: thesis Eq. 3.22 asks for 26 degrees
where the Miniglider glides no flatter than 34, and is tracked, with an error that grows."""


class InfeasibleReferenceError(ValueError):
    """The vehicle cannot follow the reference; the message names the limit and both numbers."""


@dataclass(frozen=True, slots=True, eq=False)
class GlideEnvelope:
    """Fastest steady glide on each path, one way, all paths of which the vehicle can glide."""

    glide_angle_rad: FloatArray
    """Inclination of the path, negative down, shape ``(n,)``."""
    speed_m_s: FloatArray
    """Greatest speed along the path, shape ``(n,)``."""

    @property
    def vertical_m_s(self) -> float:
        """Greatest vertical speed, a magnitude; 0 if there is no glide this way."""
        return float(np.max(self.speed_m_s * np.abs(np.sin(self.glide_angle_rad)), initial=0.0))

    @property
    def horizontal_m_s(self) -> float:
        """Greatest horizontal speed; 0 if there is no glide this way."""
        return float(np.max(self.speed_m_s * np.cos(self.glide_angle_rad), initial=0.0))

    @property
    def flattest_rad(self) -> float:
        """Least inclination of a path; a right angle if there is no glide this way."""
        return float(np.min(np.abs(self.glide_angle_rad), initial=0.5 * math.pi))


def glide_envelope(vehicle: Vehicle, *, down: bool) -> GlideEnvelope:
    """Work out the fastest glide on every path, from both end stops that bound it.

    On one path every force grows with the square of the speed V: the net mass that it takes is
    proportional to V^2, and the position of the sliding mass is a constant and a multiple of V^2.
    """
    from autonomy.vehicle.reference.dynamics import hydrodynamic_wrench

    p, sign = vehicle.parameters, -1.0 if down else 1.0
    angles, speeds = [], []
    for steep in np.linspace(math.radians(5.0), _STEEPEST_RAD, _ANGLES).tolist():
        path = sign * steep
        try:
            alpha = angle_of_attack(p, path)
        except NoSteadyGlideError:
            continue
        pitch = path + alpha
        one = np.array([math.cos(alpha), 0.0, math.sin(alpha)])
        force, moment = hydrodynamic_wrench(one, np.zeros(3), 0.0, p, extended=True)
        net_mass = float(force @ one) / (p.gravity_m_s2 * math.sin(path))
        lever = p.sliding_mass_kg * p.gravity_m_s2 * math.cos(pitch)
        munk = (p.mass_3_kg - p.mass_1_kg) * one[0] * one[2]
        by_speed = float(munk + moment[1]) / lever
        hang = p.offset_mass_kg * p.offset_mass_depth_m * p.gravity_m_s2 * math.sin(pitch)
        squared = _greatest_squared_speed(net_mass, -hang / lever, by_speed, vehicle.limits)
        if squared > 0.0:
            angles.append(path)
            speeds.append(math.sqrt(squared))
    return GlideEnvelope(np.array(angles), np.array(speeds))


def check_reference(
    vehicle: Vehicle, reference_function: Callable[[float], Reference], duration_s: float
) -> None:
    """Refuse a reference that a gliding vehicle cannot follow.

    Speeds are held against the fastest steady glides, the mean horizontal speed because a glide
    slows down where it turns, the path against the flattest glide, the pitch and its rate against
    the sliding mass.

    Args:
        vehicle: The robot.
        reference_function: The reference by time, s.
        duration_s: How long it is to be followed.

    Raises:
        InfeasibleReferenceError: At the first limit that it breaks.
    """
    times = np.linspace(0.0, duration_s, _SAMPLES)
    packed = np.array([reference_function(float(t)).packed() for t in times])
    if not np.all(np.isfinite(packed)):
        raise InfeasibleReferenceError("the reference holds numbers that are not finite")
    down, up = glide_envelope(vehicle, down=True), glide_envelope(vehicle, down=False)
    _check_vertical(packed[:, 6], down, up)
    _check_horizontal(packed, down, up)
    _check_pitch(packed, vehicle)


def check_swim(
    vehicle: Vehicle, reference_function: Callable[[float], Reference], duration_s: float
) -> None:
    """Refuse a reference that is faster than the vehicle's own gait swims straight ahead.

    Arguments as of ``check_reference``.

    Raises:
        InfeasibleReferenceError: If it is faster at any time.
    """
    from autonomy.control.reference.swimming import swimming_speed

    times = np.linspace(0.0, duration_s, _SAMPLES)
    velocity = np.array([reference_function(float(t)).velocity_ned for t in times])
    asked = float(np.max(np.linalg.norm(velocity[:, :2], axis=1)))
    reached = swimming_speed(vehicle)
    if asked > _TOLERANCE * reached:
        raise InfeasibleReferenceError(
            f"the reference moves at {_cm(asked)} cm/s; {vehicle.title} swims at most"
            f" {_cm(reached)} cm/s with its tail at {vehicle.swim.frequency_hz:.2f} Hz"
        )


def _greatest_squared_speed(
    net_mass: float, rest_m: float, by_speed: float, limits: ActuatorLimits
) -> float:
    """Greatest V^2 at which net mass and sliding mass stay inside their stops, 0 if none."""
    most = (limits.m0_max_kg if net_mass > 0.0 else limits.m0_min_kg) / net_mass
    if by_speed == 0.0:
        return most if limits.rp1_min_m <= rest_m <= limits.rp1_max_m else 0.0
    stops = (limits.rp1_min_m, limits.rp1_max_m)
    low, high = sorted((stop - rest_m) / by_speed for stop in stops)
    most = min(most, high)
    return most if most >= max(low, 0.0) else 0.0


def _check_vertical(sink: FloatArray, down: GlideEnvelope, up: GlideEnvelope) -> None:
    for asked, way, envelope in (
        (float(np.max(sink)), "sinks", down),
        (float(np.max(-sink)), "rises", up),
    ):
        if asked > _TOLERANCE * envelope.vertical_m_s:
            raise InfeasibleReferenceError(
                f"the reference {way} at {_cm(asked)} cm/s; the buoyancy allows at most"
                f" {_cm(envelope.vertical_m_s)} cm/s"
            )


def _check_horizontal(packed: FloatArray, down: GlideEnvelope, up: GlideEnvelope) -> None:
    speed = np.hypot(packed[:, 4], packed[:, 5])
    mean, sink = float(np.mean(speed)), float(np.mean(np.abs(packed[:, 6])))
    fastest = max(down.horizontal_m_s, up.horizontal_m_s)
    if mean > _TOLERANCE * fastest:
        raise InfeasibleReferenceError(
            f"the reference moves {_cm(mean)} cm/s ahead; a glide reaches at most"
            f" {_cm(fastest)} cm/s"
        )
    flattest = min(down.flattest_rad, up.flattest_rad)
    asked = math.atan2(sink, mean)
    if mean > 0.0 and asked < _FLATTER * flattest:
        raise InfeasibleReferenceError(
            f"the reference's mean path falls or rises by {math.degrees(asked):.1f} deg; this"
            f" vehicle glides no flatter than {math.degrees(flattest):.1f} deg"
        )


def _check_pitch(packed: FloatArray, vehicle: Vehicle) -> None:
    p, limits = vehicle.parameters, vehicle.limits
    pitch, rate = packed[:, 3], packed[:, 7]
    if float(np.max(np.abs(pitch))) >= _STEEPEST_RAD:
        raise InfeasibleReferenceError(
            f"the reference pitches to {math.degrees(np.max(np.abs(pitch))):.0f} deg; the model"
            f" holds to {math.degrees(_STEEPEST_RAD):.0f} deg"
        )
    # without flow the sliding mass balances the mass that hangs below the hull
    hang = p.offset_mass_kg * p.offset_mass_depth_m / p.sliding_mass_kg
    needed = -hang * np.tan(pitch)
    low, high = float(np.min(needed)), float(np.max(needed))
    if low < limits.rp1_min_m or high > limits.rp1_max_m:
        worst = low if low < limits.rp1_min_m else high
        raise InfeasibleReferenceError(
            f"the reference's pitch needs the sliding mass at {worst * 1e3:.0f} mm; it reaches"
            f" {limits.rp1_min_m * 1e3:.0f} to {limits.rp1_max_m * 1e3:.0f} mm"
        )
    fastest = float(np.max(np.abs(hang * rate / np.cos(pitch) ** 2)))
    if fastest > _TOLERANCE * limits.rp1_rate_m_s:
        raise InfeasibleReferenceError(
            f"the reference's pitch moves the sliding mass at {fastest * 1e3:.1f} mm/s; it reaches"
            f" {limits.rp1_rate_m_s * 1e3:.1f} mm/s"
        )


def _cm(speed_m_s: float) -> str:
    return f"{speed_m_s * 100.0:.1f}"
