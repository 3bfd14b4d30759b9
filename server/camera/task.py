"""What the tasks about cameras are given and leave, and their names; this loads no numba."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from autonomy.arrays import FloatArray
from autonomy.vision.tag import Layout
from robot_link.camera.sighting import BoardCorner, Sighting
from server.camera.used_rig import Document, UsedRig

MISSING_BOARDS: Final = "server.camera.set_up.vision_task:missing_boards"
"""Takes a ``LensProblem``, leaves what views are missing, in words."""
LENS: Final = "server.camera.set_up.vision_task:lens"
"""Takes a ``LensProblem``, leaves ``Found`` or a ``Refusal``."""
ADJUST: Final = "server.camera.set_up.vision_task:adjust_all"
"""Takes an ``AdjustProblem``, leaves ``Found`` or a ``Refusal``."""
READJUST: Final = "server.camera.set_up.vision_task:readjust"
"""Takes a ``ReadjustProblem``, leaves ``Found`` or a ``Refusal``."""
ACCURACY: Final = "server.camera.set_up.vision_task:accuracy"
"""Takes an ``AdjustProblem``, leaves a document."""
WATCH: Final = "server.camera.watch_task:watch"
"""Takes a ``WatchProblem``, leaves what a ``Watched`` holds."""

LensKind = Literal["pinhole", "fisheye"]


@dataclass(frozen=True, slots=True)
class Shot:
    """The board in one picture."""

    number: int
    """As a person is told which one it is."""
    size: tuple[int, int]
    corners: tuple[BoardCorner, ...]


@dataclass(frozen=True, slots=True)
class LensProblem:
    """Views of the board by one camera."""

    kind: LensKind
    shots: tuple[Shot, ...]


@dataclass(frozen=True, slots=True, eq=False)
class KnownLens:
    """A camera with a calibrated lens, whose place is sought."""

    camera: str
    key: int
    lens: Document
    covariance: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class AdjustProblem:
    """What cameras saw of the fixed tags."""

    cameras: tuple[KnownLens, ...]
    layout: Layout
    """As surveyed."""
    seen: tuple[Sighting, ...]
    level_m: float
    level_std_m: float
    index: float


@dataclass(frozen=True, slots=True, eq=False)
class ReadjustProblem:
    """What one camera saw of the fixed tags after it was moved."""

    used: UsedRig
    layout: Layout
    """Where the calibration found them."""
    camera: str
    keys: Mapping[str, int]
    seen: tuple[Sighting, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A calibration as it is kept."""

    result: Document
    covariance: FloatArray
    inputs: Document


@dataclass(frozen=True, slots=True, eq=False)
class WatchProblem:
    """What cameras saw of the fixed tags lately."""

    used: UsedRig
    """With the level that is known, all calibrated cameras among them."""
    layout: Layout
    """Where the calibration found them."""
    newest: tuple[Sighting, ...]
    """Of the last 3 s."""
    longer: tuple[Sighting, ...]
    """Of the last 10 s."""
    left_out: frozenset[str]
    """Cameras that say nothing of the water."""


@dataclass(frozen=True, slots=True)
class StandFound:
    """How one camera stands, in numbers."""

    tags: int
    shift_px: float
    turned_deg: float
    moved_m: float
    off_px: Mapping[int, tuple[float, float]]
    """Of each fixed tag that it sees, how far it is from where it should be."""


@dataclass(frozen=True, slots=True)
class LevelFound:
    """Where the surface is, by the cameras that still are where they were."""

    level_m: float
    std_m: float
    change_m: float
    """Since the calibration; positive where it fell."""
    spread_m: float
    """How far cameras disagree."""
    cameras: int


@dataclass(frozen=True, slots=True)
class Watched:
    """What the fixed tags tell."""

    stands: Mapping[str, StandFound]
    level: LevelFound | None
    """None where no fixed tag under water is seen."""
    ripple_slope_rad: float | None
    """None where too few pictures tell."""
