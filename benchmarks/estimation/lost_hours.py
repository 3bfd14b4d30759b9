"""Whether the 90 % ellipse of a robot that is not heard holds the fix that follows, in lost hours.

Worlds are drawn when this runs (``tests/autonomy/lost_hour.py``): hidden currents and eddies, what
the robot believes of them, one telling in twelve wrong; half of the robots float, half fly a plan.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from autonomy.estimation.prediction import ellipse_90, miss
from tests.autonomy.lost_hour import FIX_STD_M, Lost, lost_hour

WORLDS = 1000
LEAST_HELD, MOST_HELD = 0.85, 0.95


def measure() -> list[dict[str, Any]]:
    return list(lost_hours(int(np.random.default_rng().integers(2**32))))


def lost_hours(seed: int, worlds: int = WORLDS) -> Iterator[dict[str, Any]]:
    """Hold predictions against the first fixes after an hour.

    Args:
        seed: Decides all draws; it is told with the result.
        worlds: How many hours.
    """
    rng = np.random.default_rng(seed)
    drawn = [_judged(lost_hour(rng)) for _ in range(worlds)]
    kinds = {
        "afloat": [one for one in drawn if one[0].track is None],
        "flying": [one for one in drawn if one[0].track is not None],
        "told wrong": [one for one in drawn if one[0].is_wrong],
        "all": drawn,
    }
    for kind, of_kind in kinds.items():
        units = np.array([units for _, _, units, _ in of_kind])
        held = float(np.mean(units <= 1.0))
        miss_m = float(np.median([off_m for _, off_m, _, _ in of_kind]))
        axis_m = float(np.median([axis for *_, axis in of_kind]))
        yield {
            "area": "lost_hours",
            "name": (
                f"Fixes in the 90 % ellipse after {len(of_kind)} lost hours, {kind} (median miss "
                f"{miss_m:.0f} m, longer half axis {axis_m:.0f} m, seed {seed})"
            ),
            "value": held,
            "unit": "",
            "bar": LEAST_HELD if kind == "all" else None,
            "met": LEAST_HELD <= held <= MOST_HELD if kind == "all" else None,
        }


def _judged(world: Lost) -> tuple[Lost, float, float, float]:
    said = world.predicted()
    covariance = said.covariance_m2[0]
    off_m, units = miss(said.position_ned[0, :2], covariance, world.fix_ne_m, FIX_STD_M)
    return world, off_m, units, ellipse_90(covariance)[0][0]
