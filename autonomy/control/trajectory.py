"""Trajectories to track: where the robot should be, and how fast that moves."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray

Triple = tuple[float, float, float]
"""North, east, down."""


@dataclass(frozen=True, slots=True)
class Reference:
    """Wanted position in NED and pitch at one moment, with their first and second derivatives."""

    position_ned: Triple
    pitch_rad: float
    velocity_ned: Triple = (0.0, 0.0, 0.0)
    pitch_rate_rad_s: float = 0.0
    acceleration_ned: Triple = (0.0, 0.0, 0.0)
    pitch_acceleration_rad_s2: float = 0.0

    def packed(self) -> FloatArray:
        """Return value, first and second derivative, four numbers each, shape ``(12,)``."""
        return np.array(
            [
                *self.position_ned,
                self.pitch_rad,
                *self.velocity_ned,
                self.pitch_rate_rad_s,
                *self.acceleration_ned,
                self.pitch_acceleration_rad_s2,
            ]
        )


def straight_glide(
    start_ned: Triple, velocity_ned: Triple, pitch_rad: float, elapsed_s: float
) -> Reference:
    """Reference of a vehicle that glides on a line with constant velocity and pitch."""
    n, e, d = (s + v * elapsed_s for s, v in zip(start_ned, velocity_ned, strict=True))
    return Reference((n, e, d), pitch_rad, velocity_ned)


LINEAR_GLIDE_VELOCITY_NED: Triple = (0.02, 0.02, 0.03)
"""Velocity of the linear glide, m/s."""


def linear_glide(time_s: float) -> Reference:
    """Linear glide of thesis section 3.3.1."""
    return straight_glide((3.0, 1.5, 0.0), LINEAR_GLIDE_VELOCITY_NED, -math.pi / 4.0, time_s)


def sawtooth(time_s: float) -> Reference:
    """Sawtooth-like glide in a vertical plane, thesis section 3.3.1."""
    w, swing = math.pi / 90.0, 2.0 * math.pi / 9.0
    s, c = math.sin(w * time_s), math.cos(w * time_s)
    return Reference(
        (0.03 * time_s, 1.0, 2.0 - c),
        -swing * s,
        (0.03, 0.0, w * s),
        -swing * w * c,
        (0.0, 0.0, w * w * c),
        swing * w * w * s,
    )


def diagonal(time_s: float) -> Reference:
    """Diagonal glide plane of the experiments, thesis Eq. 3.21."""
    z, pitch = _experiment_dive(time_s, 0.2)
    return Reference(
        (-1.0 + 0.012 * time_s, -1.0 + 0.01 * time_s, z[0]),
        pitch[0],
        (0.012, 0.01, z[1]),
        pitch[1],
        (0.0, 0.0, z[2]),
        pitch[2],
    )


def figure_eight(time_s: float) -> Reference:
    """Figure of eight of the experiments, thesis Eq. 3.22, its printed ``015`` read as 0.15."""
    z, pitch = _experiment_dive(time_s, 0.15)
    w = math.pi / 270.0
    u = w * time_s + math.pi / 4.0
    # 1.2 cos(u) sin(u) is 0.6 sin(2 u)
    return Reference(
        (-1.5 * math.cos(u), -0.6 * math.sin(2.0 * u), z[0]),
        pitch[0],
        (1.5 * w * math.sin(u), -1.2 * w * math.cos(2.0 * u), z[1]),
        pitch[1],
        (1.5 * w * w * math.cos(u), 2.4 * w * w * math.sin(2.0 * u), z[2]),
        pitch[2],
    )


def _experiment_dive(time_s: float, amplitude_m: float) -> tuple[Triple, Triple]:
    """Depth and pitch with derivatives of the yo-yo that both experiments share."""
    w, swing = 2.0 * math.pi / 75.0, 7.0 * math.pi / 36.0
    s, c = math.sin(w * time_s), math.cos(w * time_s)
    depth = (0.35 - amplitude_m * c, amplitude_m * w * s, amplitude_m * w * w * c)
    return depth, (-swing * s, -swing * w * c, swing * w * w * s)


THESIS_REFERENCES: tuple[Callable[[float], Reference], ...] = (
    linear_glide,
    sawtooth,
    diagonal,
    figure_eight,
)
"""The four trajectories of thesis sections 3.3 and 3.4 as functions of time."""
