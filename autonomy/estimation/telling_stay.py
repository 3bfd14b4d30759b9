"""How long a robot must float until its drift tells the current; read by the station too."""

import math

from autonomy.estimation.config import EstimatorConfig

_TELLING_SHARE = 0.5
"""A stay at the surface tells of the steady current once it could tell it to this share of what was
believed of it at first: in a shorter one fixes and eddies would be taken for the current."""
_FIXES_EVERY_S = 1.0
"""Time between fixes at the surface that ``telling_stay_s`` assumes, as GNSS receivers and cameras
have it; the stay grows with its cube root only, so it need not be known well."""


def telling_stay_s(estimator: EstimatorConfig, steady_std_m_s: float) -> float:
    """Return how long a robot floats until its drift tells the steady current; inf for none, s.

    Eddies displace it by ``drift sqrt(T)`` in a time T, and the speed of a line through fixes has
    the standard deviation ``fix sqrt(12 period / T^3)``.

    Args:
        estimator: Drift and noise of fixes.
        steady_std_m_s: What is believed of the current at first, standard deviation per axis.
    """
    wanted = _TELLING_SHARE * steady_std_m_s
    if wanted == 0.0:
        return math.inf
    by_eddies_s = (estimator.drift_m_sqrt_s / wanted) ** 2
    by_fixes_s = (12.0 * _FIXES_EVERY_S * (estimator.fix_std_m / wanted) ** 2) ** (1.0 / 3.0)
    return max(by_eddies_s, by_fixes_s)
