"""Depth of a pressure."""

from typing import Final, Literal

import numpy as np

from autonomy.arrays import FloatArray

_FRESH_M_DBAR: Final = 1.0197
"""Of one decibar of fresh water of 1000 kg/m3 under 9.80665 m/s2."""


def depth_of_pressure(
    pressure_dbar: FloatArray, latitude_deg: FloatArray, water: Literal["sea", "fresh"]
) -> FloatArray:
    """Return depths in m, shape ``(n,)``; NaN where pressure or, in the sea, latitude is missing.

    Source:
        Fofonoff and Millard, Algorithms for computation of fundamental properties of seawater,
        Unesco technical papers in marine science 44 (1983), section 4; standard ocean.
        Check value: 10,000 dbar at 30 degrees are 9712.653 m.
    """
    if water == "fresh":
        return pressure_dbar * _FRESH_M_DBAR
    sine2 = np.sin(np.radians(latitude_deg)) ** 2
    p = pressure_dbar
    gravity = 9.780318 * (1.0 + (5.2788e-3 + 2.36e-5 * sine2) * sine2) + 1.092e-6 * p
    return (((-1.82e-15 * p + 2.279e-10) * p - 2.2512e-5) * p + 9.72659) * p / gravity
