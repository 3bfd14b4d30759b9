"""The steps of a camera's set-up, and the rig that comes of it, as REST shows them."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal

from pydantic import Field

from autonomy.vision.tag import LATENCY_IDS
from server.base.view import Body, View
from server.camera.set_up.boards import CELLS, LEAST, WANTED, Boards
from server.camera.set_up.jobs import LatencyCheck
from server.camera.set_up.latency import STEP_S
from server.camera.view import CameraId


class LensOrder(Body):
    """What kind of lens a camera has."""

    kind: Literal["pinhole", "fisheye"] = "pinhole"
    """``fisheye`` from about 100 degrees on."""


class AdjustOrder(Body):
    """Which cameras are to be placed."""

    camera: CameraId | None = None
    """One that was moved, the others staying where they are; ``null`` for all at once."""
    level_m: float | None = Field(default=None, ge=-10.0, le=10.0, allow_inf_nan=False)
    """Down coordinate of the water's surface as it was read; by default the one that is known."""
    level_std_m: float = Field(default=0.005, gt=0.0, le=1.0, allow_inf_nan=False)
    """How well that was read."""


@dataclass(frozen=True, slots=True)
class ShotView(View):
    """One picture of the board."""

    number: int
    corners_px: list[tuple[float, float]]


@dataclass(frozen=True, slots=True)
class BoardsView(View):
    """What a camera saw of the board, and what is missing yet."""

    size: tuple[int, int] | None
    """Of the pictures, px."""
    shots: list[ShotView]
    wanted: int
    least: int
    cells: list[list[int]]
    """Corners in each part of the picture, by rows from the top."""
    cells_across: int
    missing: list[str]
    """What to show the camera next, in words; empty when there is enough."""


@dataclass(frozen=True, slots=True)
class LatencyCheckView(View):
    """What the page that a camera looks at shows: one tag after another, again and again."""

    job: str | None
    """Id of the job; ``null`` while nothing is measured."""
    begun_at: datetime | None
    """When the first tag is shown, by the station's clock."""
    now: datetime
    """By the station's clock."""
    step_s: float
    """So long each is shown."""
    first_id: int
    count: int


@dataclass(frozen=True, slots=True)
class TagErrorView(View):
    """How far a fixed tag was found from where it was surveyed, by the others alone."""

    tag: int
    depth_m: float
    error_m: float
    claimed_std_m: float
    cameras: int


@dataclass(frozen=True, slots=True)
class PlaneAccuracyView(View):
    """What the cameras do at one depth."""

    depth_m: float
    tags: int
    mean_m: float
    p95_m: float
    worst_m: float
    claimed_std_m: float


@dataclass(frozen=True, slots=True)
class AccuracyView(View):
    """What the cameras do, measured on the spot."""

    calibration: str | None
    """That was in use then."""
    at: datetime
    planes: list[PlaneAccuracyView]
    tags: list[TagErrorView]
    left_out: list[str]
    """Tags that could not be judged, and why."""


@dataclass(frozen=True, slots=True)
class RigView(View):
    """The cameras that robots are found by, and the water that they look into."""

    calibration: str | None
    """Id of the calibration in use; ``null`` before the first."""
    at: datetime | None
    by: str | None
    cameras: list[str]
    """Those that are calibrated."""
    left_out: list[str]
    """Of them, those that are not used since they have moved."""
    rms: float | None
    """Residual of the calibration, in standard deviations."""
    refraction_index: float | None
    level_m: float | None
    """Down coordinate of the surface now: positive where it fell below the nominal level."""
    level_change_m: float | None
    """Since the calibration."""
    level_words: str
    """What is known of the level, in words."""
    ripple_slope_deg: float
    """Root mean square slope of the surface."""
    is_outdated: bool
    """Whether fixed tags were changed since: the cameras should be adjusted again."""
    accuracy: AccuracyView | None


def boards_view(boards: Boards, camera: str) -> BoardsView:
    """Return what a camera saw of the board."""
    shots = boards.shots(camera)
    return BoardsView(
        shots[0].size if shots else None,
        [ShotView(one.number, [corner.pixel for corner in one.corners]) for one in shots],
        WANTED,
        LEAST,
        boards.cells(camera),
        CELLS[0],
        list(boards.missing(camera)),
    )


def latency_view(check: LatencyCheck | None, now: datetime) -> LatencyCheckView:
    """Return what a page is to show."""
    return LatencyCheckView(
        None if check is None else check.job,
        None if check is None else check.begun_at,
        now,
        STEP_S,
        LATENCY_IDS[0],
        len(LATENCY_IDS),
    )


def accuracy_view(kept: Mapping[str, Any], calibration: str | None) -> AccuracyView:
    """Return what was measured on the spot."""
    return AccuracyView(
        calibration,
        datetime.fromisoformat(kept["at"]),
        [PlaneAccuracyView(**one) for one in kept["planes"]],
        [
            TagErrorView(
                one["tag_id"],
                one["depth_m"],
                one["error_m"],
                one["claimed_std_m"],
                one["cameras"],
            )
            for one in kept["tags"]
        ],
        list(kept["left_out"]),
    )
