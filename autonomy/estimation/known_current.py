"""How well a robot will know the steady current along a mission that it has not flown yet.

The recursion that ``model_filter`` amounts to, per axis and without the vehicle: what is known of
the current is forgotten towards what is usual; the fix that ends a dive tells the mean current of
that dive as well as eddies let it, and a stay at the surface tells once it is long enough. Nothing
here is compiled: the station plans with it.
"""

import math
from typing import TypeVar

from autonomy.arrays import FloatArray
from autonomy.estimation.config import EstimatorConfig
from autonomy.estimation.fix_watch import SHORTEST_DIVE_S
from autonomy.estimation.telling_stay import telling_stay_s

UNTOLD = 1.5
"""How strong the current is here is a guess itself: until a fix tells, the filter begins with so
much more. A Student's t of four degrees of freedom has its 95 % circle there."""
TOLD_SHARE, TOLD_LEAST_M_S = 0.5, 0.001
"""Standard deviation of a plan's word of the current, as a share of the prior's."""
SETTLING_S = 20.0
"""Time at the surface before a start in which the robot's estimate settles, as flights ahead have
it."""
Times = TypeVar("Times", float, FloatArray)


class KnownCurrent:
    """How well a robot knows the steady current, from one dive to the next.

    It begins with ``config.steady_current_m_s``. A robot whose position filter learns no current
    keeps that.

    Args:
        config: What is known at first, what is usual, and how fast the one becomes the other.
    """

    def __init__(self, config: EstimatorConfig) -> None:
        self._config = config
        self._learns = config.method == "model"
        self._variance = config.steady_current_m_s**2
        self._usual = config.usual_current_m_s**2
        self._telling_s = telling_stay_s(config, config.usual_current_m_s)
        self._stay_s = 0.0

    @property
    def std_m_s(self) -> float:
        """Standard deviation per axis, without the doubt."""
        return math.sqrt(self._variance)

    def hear_plan(self) -> None:
        """Take the word of a plan that counts on a current, unless more is known already."""
        told = max(TOLD_SHARE * self._config.usual_current_m_s, TOLD_LEAST_M_S) ** 2
        if self._learns and self._config.doubt**2 * self._variance > told:
            self._variance = 1.0 / (1.0 / self._variance + 1.0 / told)

    def dive(self, blind_s: float) -> None:
        """Let a dive pass that a fix ends."""
        if blind_s < SHORTEST_DIVE_S or not self._learns:
            self.stay(blind_s)
            return
        self._stay_s = 0.0
        config, memory_s = self._config, self._config.current_memory_s
        kept = math.exp(-blind_s / memory_s)
        # covariance of an Ornstein-Uhlenbeck process with its integral
        shared = memory_s * (1.0 - kept) * (kept * self._variance + (1.0 - kept) * self._usual)
        walked = config.drift_m_sqrt_s**2 * blind_s + config.fix_std_m**2
        lost = walked + carried_variance(config, self.std_m_s, blind_s)
        self._variance = self._grown(kept) - shared**2 / lost

    def stay(self, time_s: float) -> None:
        """Let a time at the surface pass, where fixes come."""
        if not self._learns:
            return
        self._stay_s += time_s
        told_s = min(time_s, max(self._stay_s - self._telling_s, 0.0))
        later = self._grown(math.exp(-time_s / self._config.current_memory_s))
        # eddies displace by drift sqrt(T), so a time T tells its mean speed to drift / sqrt(T)
        told = told_s / self._config.drift_m_sqrt_s**2
        self._variance = later / (1.0 + told * later)

    def _grown(self, kept: float) -> float:
        return kept**2 * self._variance + (1.0 - kept**2) * self._usual


def carried_variance(config: EstimatorConfig, std_m_s: float, blind_s: Times) -> Times:
    """Return by what variance per axis the current loses a position in times without a fix, m^2.

    Args:
        config: What is usual, and for how long a current stays.
        std_m_s: How well it is known when the last fix comes.
        blind_s: Since then, s.
    """
    return blind_s * blind_s * (std_m_s**2 + forgotten_per_s3(config, std_m_s) * blind_s)


def forgotten_per_s3(config: EstimatorConfig, std_m_s: float) -> float:
    """Return how fast the position is lost because a known current becomes another one, m^2/s^3.

    A current that is known to b where s is usual loses the position by
    ``b^2 t^2 + 2/3 (s^2 - b^2) t^3 / memory`` in a time t that is short beside the memory.

    Args:
        config: What is usual, and for how long a current stays.
        std_m_s: How well it is known at first.

    Returns:
        The factor of ``t^3``.
    """
    unknown = max(config.usual_current_m_s**2 - std_m_s**2, 0.0)
    return 2.0 / 3.0 * unknown / config.current_memory_s
