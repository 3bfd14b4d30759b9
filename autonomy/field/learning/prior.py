"""What is believed of hyperparameters before the data speak."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from autonomy.arrays import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class LogNormalPrior:
    """Independent log-normal priors about known hyperparameters.

    They keep what the data cannot tell near what is known (the length scale along an axis on
    which the robot hardly moved, the kernel of a level with few samples), and hardly hold back
    what the data tell plainly.
    """

    centre: FloatArray
    """Logarithms of the hyperparameters about which the priors lie, shape ``(p,)``."""
    strength: float
    """One over the standard deviation in decades; 0 for no prior at all."""

    @classmethod
    def none(cls, size: int) -> Self:
        """Return the flat prior of ``size`` hyperparameters."""
        return cls(np.zeros(size), 0.0)

    def penalty(self, log_parameters: FloatArray) -> tuple[float, FloatArray]:
        """Return the negative log density, but for a constant, and its gradient, ``(p,)``."""
        offset = log_parameters - self.centre
        return 0.5 * self.precision * float(offset @ offset), self.precision * offset

    @property
    def precision(self) -> float:
        """One over the variance of each logarithm."""
        return (self.strength / math.log(10.0)) ** 2
