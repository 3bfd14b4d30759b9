"""Rigid poses: a rotation and a place that take coordinates of one frame into another."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.frames import rotation_ned_from_body

_SMALL_RAD = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Takes coordinates of a frame A into a frame B: ``p_B = rotation @ p_A + position_m``."""

    rotation: FloatArray
    """Axes of A in B as columns, shape ``(3, 3)``."""
    position_m: FloatArray
    """Origin of A in B, shape ``(3,)``, m."""

    @classmethod
    def of_angles(
        cls, position_m: npt.ArrayLike, roll_rad: float, pitch_rad: float, heading_rad: float
    ) -> "Pose":
        """Return the pose of a body in NED by its angles (``frames.rotation_ned_from_body``)."""
        rotation = rotation_ned_from_body(roll_rad, pitch_rad, heading_rad)
        return cls(rotation, np.array(position_m, dtype=np.float64))

    @classmethod
    def identity(cls) -> "Pose":
        """Return the pose that changes nothing."""
        return cls(np.eye(3), np.zeros(3))

    def __matmul__(self, inner: "Pose") -> "Pose":
        """Return the pose that goes by ``inner`` first."""
        return Pose(self.rotation @ inner.rotation, self.of_points(inner.position_m))

    @property
    def inverse(self) -> "Pose":
        """The way back."""
        return Pose(self.rotation.T, -self.rotation.T @ self.position_m)

    def of_points(self, points_m: npt.ArrayLike) -> FloatArray:
        """Return points of A in B, shape ``(..., 3)``, m."""
        return np.asarray(points_m, dtype=np.float64) @ self.rotation.T + self.position_m

    def moved(self, shift_m: FloatArray, turn_rad: FloatArray) -> "Pose":
        """Return the pose after a shift in B and a turn about the axes of A."""
        return Pose(self.rotation @ rotation_of(turn_rad), self.position_m + shift_m)

    @property
    def angles_rad(self) -> tuple[float, float, float]:
        """Roll, pitch and heading, where B is NED."""
        R = self.rotation
        return (
            math.atan2(R[2, 1], R[2, 2]),
            math.asin(max(-1.0, min(1.0, -float(R[2, 0])))),
            math.atan2(R[1, 0], R[0, 0]),
        )


def skew(vector: FloatArray) -> FloatArray:
    """Return the matrices of cross products, ``skew(a) @ b = a x b``, shape ``(..., 3, 3)``."""
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    o = np.zeros_like(x)
    rows = [np.stack(row, axis=-1) for row in ((o, -z, y), (z, o, -x), (-y, x, o))]
    return np.stack(rows, axis=-2)


def rotation_of(turn_rad: FloatArray) -> FloatArray:
    """Return the rotation by a vector, Rodrigues' formula, shape ``(3, 3)``."""
    angle = float(np.linalg.norm(turn_rad))
    across = skew(turn_rad)
    if angle < _SMALL_RAD:
        return np.eye(3) + across + 0.5 * across @ across
    first, second = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2
    return np.eye(3) + first * across + second * across @ across


def turn_of(rotation: FloatArray) -> FloatArray:
    """Return the vector of a rotation, of a length up to pi, shape ``(3,)``, rad."""
    half = 0.5 * np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    sine, cosine = float(np.linalg.norm(half)), 0.5 * (float(np.trace(rotation)) - 1.0)
    angle = math.atan2(sine, cosine)
    if sine > _SMALL_RAD:
        return half * (angle / sine)
    if cosine > 0.0:
        return half
    axis = np.sqrt(np.maximum(0.5 * (np.diag(rotation) + 1.0), 0.0))
    largest = int(axis.argmax())
    signs = np.where(rotation[largest] + rotation[:, largest] < 0.0, -1.0, 1.0)
    signs[largest] = 1.0
    return math.pi * signs * axis / float(np.linalg.norm(axis))


def turned_by_rad(one: FloatArray, other: FloatArray) -> float:
    """Return the angle between two rotations."""
    return float(np.linalg.norm(turn_of(one.T @ other)))


def nearest_rotation(matrix: FloatArray) -> FloatArray:
    """Return the rotation that is nearest to a matrix, by singular values, shape ``(3, 3)``."""
    U, _, Vt = np.linalg.svd(matrix)
    U[:, 2] *= np.sign(np.linalg.det(U @ Vt))
    return U @ Vt


def fitted(points_m: FloatArray, places_m: FloatArray) -> Pose:
    """Return the pose that brings points nearest to their places, both ``(n, 3)``, m.

    Source:
        Kabsch, Acta Crystallographica A 32, 1976.
    """
    middle, centre = points_m.mean(axis=0), places_m.mean(axis=0)
    rotation = nearest_rotation((places_m - centre).T @ (points_m - middle))
    return Pose(rotation, centre - rotation @ middle)
