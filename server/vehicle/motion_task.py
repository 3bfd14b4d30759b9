"""Works out how a vehicle moves by itself: its polar, and one motion with actuators held."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.glide import NoSteadyGlideError
from autonomy.vehicle.polar import polar
from autonomy.vehicle.stability import stability
from autonomy.vehicle.steady import steady_glide
from server.base.study import Refusal
from server.vehicle.task import SteadyProblem

_TABLES = (
    "speed_m_s",
    "glide_angle_rad",
    "pitch_rad",
    "angle_of_attack_rad",
    "vertical_speed_m_s",
    "horizontal_speed_m_s",
    "greatest_growth_per_s",
)


def polar_document(
    vehicle: Vehicle, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> dict[str, Any]:
    """Return a vehicle's polar for JSON: rows by net buoyancy, columns by mass position."""
    del report, is_cancelled
    found = polar(vehicle)
    exists = np.isfinite(found.speed_m_s)
    return {
        "vehicle": vehicle.key,
        "title": vehicle.title,
        "note": vehicle.note,
        "m0_kg": found.m0_kg.tolist(),
        "rp1_m": found.rp1_m.tolist(),
        **{name: _table(getattr(found, name), exists) for name in _TABLES},
        "stable": _table(found.stable, exists),
    }


def steady_document(
    problem: SteadyProblem, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> dict[str, Any] | Refusal:
    """Return the glide or spiral that a vehicle settles into, with its eigenvalues, for JSON."""
    del report, is_cancelled
    parameters = problem.vehicle.parameters
    inputs = (problem.m0_kg, problem.rp1_m, problem.delta_rad)
    try:
        motion = steady_glide(parameters, *inputs)
    except NoSteadyGlideError as error:
        text = str(error)
        return Refusal(f"{text[0].upper()}{text[1:]}.")
    found = stability(parameters, motion, *inputs)
    radius_m = motion.turn_radius_m
    return {
        "pitch_rad": motion.pitch_rad,
        "roll_rad": motion.roll_rad,
        "speed_m_s": motion.speed_m_s,
        "glide_angle_rad": motion.glide_angle_rad,
        "angle_of_attack_rad": motion.alpha_rad,
        "vertical_speed_m_s": motion.vertical_speed_m_s,
        "horizontal_speed_m_s": motion.horizontal_speed_m_s,
        "turn_rate_rad_s": motion.turn_rate_rad_s,
        "turn_radius_m": radius_m if math.isfinite(radius_m) else None,
        "stable": bool(found.is_stable),
        "eigenvalues": [
            {"real": float(value.real), "imag": float(value.imag)} for value in found.eigenvalues
        ],
    }


def _table(values: FloatArray | BoolArray, exists: BoolArray) -> list[list[Any]]:
    """Return rows of numbers, ``None`` where there is no steady glide."""
    return [
        [value if known else None for value, known in zip(row, knows, strict=True)]
        for row, knows in zip(values.tolist(), exists.tolist(), strict=True)
    ]
