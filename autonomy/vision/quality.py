"""What a fix is good for: all, its position alone, or nothing, and why."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.fix import Fix

Quality = Literal["good", "position_only", "refused"]
LEAST_MARGIN = 25.0
"""Of the sum of squares, by which one of a single tag's two poses must beat the other."""


@dataclass(frozen=True, slots=True)
class Gates:
    """From where on a fix is refused."""

    rms: float = 4.0
    """Root mean square residual of what still water explains; 1.9 was the most seen there."""
    std_m: float = 0.1
    """Of the position along its worst axis."""
    outside_m: float = 0.3
    """So far outside of the water no robot is."""
    surprise: float = 16.3
    """Squared distance from a prediction, in standard deviations, that 1 in 1,000 exceeds (3
    axes)."""
    patience: int = 5
    """So many surprises in a row are believed."""


USUAL_GATES = Gates()


@dataclass(frozen=True, slots=True, eq=False)
class Expectation:
    """Where a robot should be by what was known before."""

    position_ned_m: FloatArray
    """North, east and depth below the surface, shape ``(3,)``."""
    covariance_m2: FloatArray
    """Shape ``(3, 3)``."""
    surprises: int = 0
    """Fixes in a row, before this one, that were refused as too far from it."""


@dataclass(frozen=True, slots=True)
class Water:
    """The box of water that robots are in, m; depths below the surface."""

    north_m: tuple[float, float]
    east_m: tuple[float, float]
    depth_m: float


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a fix is good for."""

    quality: Quality
    reason: str = ""
    """Why it is refused or less than good; numbers of this fix stand in brackets at the end."""
    is_surprise: bool = False
    """It is refused as too far from where it was expected, and that alone."""


def judge(
    fix: Fix,
    expected: Expectation | None = None,
    water: Water | None = None,
    gates: Gates = USUAL_GATES,
) -> Verdict:
    """Judge a fix.

    Args:
        fix: To be judged.
        expected: Where the robot should be, if that is known.
        water: Outside of which it cannot be, if that is known.
        gates: From where on it is refused.
    """
    if fix.rms > gates.rms:
        return Verdict("refused", f"the corners do not fit together (rms {fix.rms:.1f})")
    std_m = math.sqrt(float(np.linalg.eigvalsh(fix.position_covariance)[-1]))
    if not std_m <= gates.std_m:
        return Verdict("refused", f"the position is not known well enough ({std_m:.2f} m)")
    if water is not None and _is_outside(fix.position_ned_m, water, gates.outside_m):
        return Verdict("refused", "the position is outside of the water")
    is_alone = len(fix.cameras) == 1 and len(fix.tags) == 1 and not fix.has_telemetry
    if is_alone and not fix.margin > LEAST_MARGIN:
        return Verdict("refused", "one tag in one camera may be turned over")
    if expected is not None and expected.surprises + 1 < gates.patience:
        off = fix.position_ned_m - expected.position_ned_m
        both = fix.position_covariance + expected.covariance_m2
        surprise = float(off @ np.linalg.solve(both, off))
        if not surprise <= gates.surprise:
            away_m = float(np.linalg.norm(off))
            reason = f"the position is not where it should be ({away_m:.2f} m from it)"
            return Verdict("refused", reason, is_surprise=True)
    if is_alone:
        return Verdict("position_only", "one tag in one camera: its tilt is not sure")
    return Verdict("good")


def _is_outside(position_ned_m: FloatArray, water: Water, outside_m: float) -> bool:
    north, east, depth = position_ned_m.tolist()
    return not (
        water.north_m[0] - outside_m <= north <= water.north_m[1] + outside_m
        and water.east_m[0] - outside_m <= east <= water.east_m[1] + outside_m
        and -outside_m <= depth <= water.depth_m + outside_m
    )
