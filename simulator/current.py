"""Water that drifts: what makes a position without a fix wrong."""

import math

import numpy as np

from autonomy.arrays import FloatArray


class DriftingCurrent:
    """A horizontal current that carries an unaware robot away like a random walk.

    Each axis is an Ornstein-Uhlenbeck process. Over times much longer than its correlation time
    the displacement of the water has the variance ``drift**2 * t``, which is the localization
    error of ``drift`` m/sqrt(s) that the position filter and the planner assume.

    Args:
        drift_m_sqrt_s: Growth of the displacement's standard deviation, m per sqrt(s), per axis.
        correlation_s: Time over which the current remembers itself, s.
        generator: Source of randomness; the current starts in its stationary distribution.
        steady_ne_m_s: Current that stays, north and east, m/s.
    """

    def __init__(
        self,
        drift_m_sqrt_s: float,
        correlation_s: float,
        generator: np.random.Generator,
        steady_ne_m_s: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self._correlation_s = correlation_s
        self._std_m_s = drift_m_sqrt_s / math.sqrt(2.0 * correlation_s)
        self._generator = generator
        self._steady = np.array(steady_ne_m_s)
        self._eddy: FloatArray = self._std_m_s * generator.standard_normal(2)

    def advance(self, dt_s: float) -> None:
        """Move on by ``dt_s`` seconds; exact for any step."""
        kept = math.exp(-dt_s / self._correlation_s)
        fresh = self._std_m_s * math.sqrt(1.0 - kept * kept)
        self._eddy = kept * self._eddy + fresh * self._generator.standard_normal(2)

    @property
    def velocity_ne_m_s(self) -> FloatArray:
        """Velocity of the water now, north and east, m/s, shape ``(2,)``."""
        return self._steady + self._eddy
