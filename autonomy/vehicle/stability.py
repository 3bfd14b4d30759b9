"""Whether a steady glide or spiral is one that the robot returns to after a push."""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.vehicle.config import VehicleParameters
from autonomy.vehicle.kernel import state_derivative
from autonomy.vehicle.steady import SteadyGlide

ComplexArray: TypeAlias = npt.NDArray[np.complex128]

COORDINATES = ("roll", "pitch", "v1", "v2", "v3", "w1", "w2", "w3")
"""What a small deviation from a steady motion consists of. Position and heading are ignorable:
the motion is the same wherever it happens and wherever it leads."""

_INDICES = (3, 4, 6, 7, 8, 9, 10, 11)
_ANGLE_STEP = 1e-4
_SPEED_STEP = 1e-3
"""Steps of the five-point differences, rad (and rad/s), and as a share of the speed."""
_SPEED_FLOOR_M_S = 1e-3


@dataclass(frozen=True, slots=True)
class Stability:
    """How small deviations from a steady motion grow."""

    eigenvalues: ComplexArray
    """Of the linearised motion, 1/s, the fastest growing first, shape ``(8,)``."""

    @property
    def greatest_growth_per_s(self) -> float:
        """Largest real part: the rate at which a deviation grows, negative if all decay."""
        return float(self.eigenvalues[0].real)

    @property
    def is_stable(self) -> bool:
        """Whether every small deviation decays."""
        return self.greatest_growth_per_s < 0.0


def stability(
    parameters: VehicleParameters,
    motion: SteadyGlide,
    m0_kg: float,
    rp1_m: float,
    delta_rad: float = 0.0,
) -> Stability:
    """Work out the eigenvalues of the 12-state model around a steady glide or spiral.

    Args:
        parameters: The vehicle's model.
        motion: The steady motion that belongs to the inputs (``steady.steady_glide``).
        m0_kg: Net mass.
        rp1_m: Position of the sliding mass.
        delta_rad: Tail angle.
    """
    matrix = linearised(parameters.packed(), motion, np.array([m0_kg, rp1_m, delta_rad]))
    return Stability(eigenvalues_by_growth(matrix))


def eigenvalues_by_growth(matrix: FloatArray) -> ComplexArray:
    """Return eigenvalues, the fastest growing first, of a pair the positive frequency first."""
    eigenvalues = np.linalg.eigvals(matrix).astype(np.complex128)
    return eigenvalues[np.lexsort((-eigenvalues.imag, -eigenvalues.real))]


def linearised(packed: FloatArray, motion: SteadyGlide, inputs: FloatArray) -> FloatArray:
    """Return the matrix of the linear equations of a deviation, shape ``(8, 8)``, 1/s.

    Args:
        packed: ``Vehicle.packed()``, or the parameters' alone.
        motion: Where to linearise.
        inputs: Net mass kg, sliding mass m, tail rad.
    """
    sr, cr = math.sin(motion.roll_rad), math.cos(motion.roll_rad)
    sp, cp = math.sin(motion.pitch_rad), math.cos(motion.pitch_rad)
    turning = motion.turn_rate_rad_s * np.array([-sp, sr * cp, cr * cp])
    angles = [motion.roll_rad, motion.pitch_rad, 0.0]
    state = np.array([0.0, 0.0, 0.0, *angles, *motion.velocity_m_s, *turning])
    speed_step = _SPEED_STEP * max(motion.speed_m_s, _SPEED_FLOOR_M_S)
    matrix = np.empty((len(_INDICES), len(_INDICES)))
    for column, index in enumerate(_INDICES):
        h = speed_step if index in (6, 7, 8) else _ANGLE_STEP
        slope = np.zeros(12)
        for steps, weight in ((-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0)):
            pushed = state.copy()
            pushed[index] += steps * h
            slope += weight * state_derivative(pushed, inputs, packed)
        matrix[:, column] = slope[list(_INDICES)] / (12.0 * h)
    return matrix
