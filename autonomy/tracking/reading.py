"""What a tracker is given at each step, and what it answers."""

import math
from dataclasses import dataclass

from autonomy.tracking.phase import SpeedClass, TargetPhase

Pair = tuple[float, float]

LARGEST_M = 1e5
"""A distance or coordinate beyond this is a fault and no measurement."""


@dataclass(frozen=True, slots=True)
class TrackerStart:
    """Where the robot is when it begins to follow."""

    own_ne_m: Pair
    """North and east in the site frame."""
    heading_rad: float
    speed_m_s: float
    target_velocity_ne_m_s: Pair | None = None
    """First guess of the target's velocity through the water; None: none."""


@dataclass(frozen=True, slots=True)
class RangeHeard:
    """One measured range."""

    range_m: float
    """Horizontal distance between robot and target; a bad one is counted and not used."""
    age_s: float = 0.0
    """How long ago it held."""

    @property
    def is_good(self) -> bool:
        """Whether it is a distance at a time that has been."""
        return 0.0 <= self.range_m <= LARGEST_M and 0.0 <= self.age_s < math.inf


@dataclass(frozen=True, slots=True)
class TrackerReading:
    """What the robot knows at one step."""

    own_ne_m: Pair
    """Own position in the site frame; one that is not finite is replaced by dead reckoning."""
    heading_rad: float
    """Measured; one that is not finite is left out."""
    speed_m_s: float
    """Measured forward speed through the water; one that is not finite is left out."""
    ranges: tuple[RangeHeard, ...] = ()
    """Ranges that arrived since the step before, whenever they held."""
    is_quiet: bool = False
    """Whether the robot was told not to ping."""
    target_velocity_ne_m_s: Pair | None = None
    """Of a virtual target, north and east; used where the settings say it is known."""


@dataclass(frozen=True, slots=True)
class TargetHypothesis:
    """Where the target may be."""

    position_ne_m: Pair
    """In the site frame."""
    velocity_ne_m_s: Pair
    covariance_m2: tuple[float, float, float]
    """Of the position: north-north, north-east, east-east."""
    weight: float
    """Probability, 0..1; those of one step add up to 1."""


@dataclass(frozen=True, slots=True)
class TrackerStep:
    """What the tracker believes and wants after one step."""

    phase: TargetPhase
    command: Pair
    """Turn rate rad/s and acceleration m/s2 for the robot; always finite and within the limits."""
    nominal: Pair
    """What the pursuit law wanted, within the limits."""
    hypotheses: tuple[TargetHypothesis, ...]
    """The one that is followed first, and the likeliest other; none before the first range."""
    determinant_m2_s: float
    """Of the observability matrix, at the estimate."""
    barrier: float
    inverse_condition: float
    is_feasible: bool
    """Whether the barrier could be kept."""
    ranges_heard: int
    """Since the beginning, bad ones included."""
    ranges_rejected: int
    """Of them, those that were not believed: bad, too old or far from what was expected."""
    range_m: float | None
    """Newest range that is a number; None before the first."""
    range_age_s: float
    """How long ago it held; 0 before the first."""
    reason: str
    """Why it ended; empty in every other phase."""
    note: str
    """What is wrong while it is coasting or lost; empty while it tracks."""
    is_too_fast: bool = False
    """Whether the target seems too fast to follow: it has been faster than the robot may be."""
    speed_class: SpeedClass | None = None
    """How the target seems to swim; None where that is not estimated, or no range was heard."""
    delay_s: float | None = None
    """By how much ranges seem older than they are told; None as above."""
