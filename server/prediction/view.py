"""Where a robot should be, what it will do by itself, and how good predictions were."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from server.base.view import View, numbers, one_of

PredictionKind = Annotated[str, one_of("afloat", "flying", "unknown")]


@dataclass(frozen=True, slots=True)
class PredictedPlaceView(View):
    """Where a robot should be at one moment. Predicted: the robot did not say so."""

    at: datetime
    north_m: float
    east_m: float
    depth_m: float
    ellipse_m: Annotated[list[float], numbers(2)]
    """Half axes of the ellipse that holds it in 90 of 100 cases, the longer one first."""
    ellipse_rad: float
    """Direction of the longer axis, from north towards east."""


@dataclass(frozen=True, slots=True)
class OwnActView(View):
    """What a robot will do by itself, whether anybody is heard or not."""

    key: str
    text: str
    at: datetime | None
    """When, as far as that can be told; ``null`` for what waits for something to happen."""
    source: str
    """Where that stands: the plan on board, a parameter as the robot said it, or as built."""


@dataclass(frozen=True, slots=True)
class PredictionView(View):
    """What a robot should be doing since its last word."""

    robot: str
    kind: PredictionKind
    """``afloat``: it goes with the water; ``flying``: it keeps to its plan; ``unknown``: nobody
    can say, for the reason in ``text``."""
    text: str
    """What it is predicted from, sentences."""
    is_silent: bool
    """Whether the robot is old enough for a prediction to stand in its place."""
    said_at: datetime | None
    """Of its last word."""
    age_s: float | None
    now: PredictedPlaceView | None
    path: list[PredictedPlaceView]
    """From its last word to now, and on for as long again; empty while it is heard."""
    widened: float
    """By what factor predictions that were judged have widened, or narrowed, the ellipses."""
    next_contact: datetime | None
    acts: list[OwnActView]


@dataclass(frozen=True, slots=True)
class JudgedPredictionView(View):
    """A prediction, and the fix that followed."""

    id: str
    said_at: datetime
    seen_at: datetime
    silent_s: float
    kind: PredictionKind
    miss_m: float
    """Between the predicted place and the fix."""
    ellipse_units: float
    """The same in units of the 90 % ellipse: inside of it where not above 1."""
    is_inside: bool
    ellipse_m: Annotated[list[float], numbers(2)]
    predicted_ne_m: Annotated[list[float], numbers(2)]
    seen_ne_m: Annotated[list[float], numbers(2)]


@dataclass(frozen=True, slots=True)
class JudgedPredictionsView(View):
    """The last predictions of a robot, the newest first."""

    robot: str
    predictions: list[JudgedPredictionView]
    share_inside: float | None
    """Of these; 0.9 is promised. ``null`` while there is none."""
    median_miss_m: float | None
