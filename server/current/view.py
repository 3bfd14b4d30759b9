"""The current of a water as REST tells it."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from autonomy.current.config import CurrentMapConfig
from server.base.view import View, numbers


@dataclass(frozen=True, slots=True)
class CurrentStatusView(View):
    """What is known of the current of a robot's water, and what its predictions were worth."""

    robot: str
    site: str
    is_enabled: bool
    is_usable: bool
    """Whether a plan may rely on it now: dives enough, and recent ones."""
    dives: int
    """Dives that the map is made of; stays at the surface come on top."""
    stays: int
    robots: list[str]
    """Robots whose dives count."""
    oldest_at: datetime | None
    newest_at: datetime | None
    """When the first and the last observation of the map ended; null without any."""
    text: str
    """What the map is made of, and what it says of the robot's place now."""
    worth: str
    """How far the last surfacings were from what had been said of them; empty before there are
    three."""
    told: str
    """Who else tells of the current, how old that is, until when it holds and how far the dives
    bear it out; empty where nobody does."""
    left_out: str
    """Whose dives are not counted, and why; empty where all are."""
    error_m: float | None
    """Root mean square distance of the last surfacings from the prediction."""
    last_error_m: float | None
    """The same by the newest current known before each of them."""
    judged: int
    """How many of the last surfacings that is of."""
    prior_std_m_s: float
    """Standard deviation of the current, per axis, where nothing was seen."""
    learned: CurrentMapConfig | None
    """What the dives taught of the settings; null before they did."""
    simulation: bool


@dataclass(frozen=True, slots=True)
class CurrentWorthView(View):
    """What each choice of a current to plan in is worth, by the last dives; sentences."""

    robot: str
    none: str
    typed: str
    map: str
    is_map_usable: bool
    """Whether a plan may rely on the map now; the typed current holds until then."""


@dataclass(frozen=True, slots=True)
class FlowArrowView(View):
    """The depth-averaged current at one place."""

    north_m: float
    east_m: float
    velocity_ne_m_s: Annotated[tuple[float, float], numbers(2)]
    std_ne_m_s: Annotated[tuple[float, float], numbers(2)]
    ellipse_m_s: Annotated[tuple[float, float], numbers(2)]
    """Half axes of the ellipse that holds the current in 90 of 100 cases, the longer one first."""
    ellipse_rad: float
    """Direction of the longer axis, from north towards east."""
    is_told: bool
    """Whether the map tells anything here: the standard deviation is at most 80 % of the prior."""
    is_sure: bool
    """Whether the arrow is longer than the ellipse."""


@dataclass(frozen=True, slots=True)
class FlowView(View):
    """Depth-averaged currents on a grid at one moment."""

    robot: str
    site: str
    at: datetime
    is_predicted: bool
    """Whether that is beyond now."""
    is_tabulated: bool
    """Whether there are dives enough for arrows."""
    spacing_m: float
    """Between neighbouring places."""
    arrows: list[FlowArrowView]
    """Where there is water."""
    simulation: bool


@dataclass(frozen=True, slots=True)
class FlowAtView(View):
    """The current at one place, depth and time."""

    velocity_ne_m_s: Annotated[tuple[float, float], numbers(2)]
    """North and east."""
    std_ne_m_s: Annotated[tuple[float, float], numbers(2)]
    """Of each."""
    at: datetime
