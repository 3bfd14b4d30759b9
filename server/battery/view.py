"""What a robot draws from its battery, and how long it lasts."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from server.base.view import View, one_of


@dataclass(frozen=True, slots=True)
class RangeView(View):
    """A quantity with the interval that holds it in 90 of 100 cases."""

    mean: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class BatteryAfterView(View):
    """What is left of a battery after something that is flown; nothing is below 0."""

    left: RangeView
    """At its end, parts of a full battery."""
    left_wh: RangeView
    used_wh: RangeView
    """What it takes until then, the way there included."""
    there: float
    """Part of the full battery that the way to where it begins is expected to take."""
    home: RangeView | None
    """After the swim from there to where the robot was put into the water, parts of a full battery;
    ``null`` where nobody knows where that was."""
    home_m: float | None
    """How far that is."""
    reserve: float
    """Part of the full battery that must be left then."""
    capacity_wh: float
    is_learned: bool
    """Whether past flights taught what it takes; else the vehicle's model says it."""


@dataclass(frozen=True, slots=True)
class UseView(View):
    """What one use of the battery draws."""

    use: Annotated[str, one_of("afloat", "glide", "spiral", "dive", "swim")]
    power_w: RangeView
    model_w: float
    """What the vehicle's model says."""
    learned_h: float
    """Hours of past flights that it was learned from; 0 where it is the model's."""


@dataclass(frozen=True, slots=True)
class RecoverByView(View):
    """When the charge falls to the reserve, at today's rate."""

    at: datetime
    earliest: datetime
    latest: datetime
    rate_w: RangeView
    hours: float
    """Of the last day, of which the rate is; 0 where it is that of a robot afloat."""


@dataclass(frozen=True, slots=True)
class RobotBatteryView(View):
    """A robot's battery: what is left, what draws from it, and how long it lasts."""

    robot: str
    capacity_wh: float
    reserve: float
    """Part of the full battery that plans leave."""
    left: float | None
    """Part of the full battery, as the robot said last; ``null`` if it never did."""
    left_wh: float | None
    measured_at: datetime | None
    age_s: float | None
    is_learned: bool
    """Whether past flights taught it; else everything is the vehicle's model's."""
    flights: int
    """Intervals of past flights that it was learned from."""
    outliers: int
    """Of these, how many were far off and counted less."""
    scatter: float
    """How what a flight takes scatters, as a share of it; a standard deviation."""
    uses: list[UseView]
    recover_by: RecoverByView | None
    text: str
    """Where the figures come from, sentences."""
