"""How long a camera's pictures are on their way, by tags that a page shows in turn.

The page shows tag ``200 + k`` from ``begun_at + 0.1 k s`` on for 0.1 s by the station's clock, 16
tags one after another, again and again. What arrives at ``a`` with tag k was taken in the 0.1 s
from when that was shown, in the middle of it on average.
"""

import statistics
from collections.abc import Sequence
from datetime import datetime
from typing import Final

from autonomy.vision.tag import LATENCY_IDS
from robot_link.camera.sighting import Sighting

STEP_S: Final = 0.1
PICTURES: Final = 60
_CYCLE_S: Final = STEP_S * len(LATENCY_IDS)
_LONGEST_S: Final = 1.0
"""What is longer is a picture of the cycle before, or an early one."""


def shows_one(sighting: Sighting) -> bool:
    """Tell whether a picture shows one tag of the check, not two of a screen that changes."""
    return sum(tag.id in LATENCY_IDS for tag in sighting.tags) == 1


def latency_of(sightings: Sequence[Sighting], begun_at: datetime) -> tuple[float, float] | None:
    """Return the median latency and its scatter, s; None where the pictures tell none.

    Args:
        sightings: Pictures that show one tag of the check.
        begun_at: When tag 200 was shown first, by the wall's clock.
    """
    found: list[float] = []
    for sighting in sightings:
        number = next(tag.id for tag in sighting.tags if tag.id in LATENCY_IDS) - LATENCY_IDS[0]
        since_s = (sighting.arrived_at - begun_at).total_seconds() - number * STEP_S
        late_s = (since_s % _CYCLE_S) - 0.5 * STEP_S
        if late_s <= _LONGEST_S:
            found.append(late_s)
    if len(found) < 0.8 * len(sightings) or len(found) < 2:
        return None
    return max(statistics.median(found), 0.0), statistics.stdev(found)
