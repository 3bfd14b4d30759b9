"""Fixes by cameras as REST shows them."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from db.identity import public_id
from db.query.camera.fixes import FixRecord
from db.record import same
from server.base.view import View, one_of
from server.camera.views import CALIBRATION


@dataclass(frozen=True, slots=True)
class FixView(View):
    """Where cameras found a robot at one moment."""

    robot: str
    measured_at: datetime
    """When the pictures were taken."""
    received_at: datetime
    ned_m: tuple[float, float, float]
    """North, east, and depth below the real surface of the water."""
    covariance_m2: tuple[float, float, float, float, float, float]
    """Of ``ned_m``: xx, xy, xz, yy, yz, zz."""
    heading_rad: float | None
    """From the frame's north, clockwise; ``null`` where only the position is sure."""
    heading_std_rad: float
    roll_rad: float | None
    pitch_rad: float | None
    tilt_std_rad: float
    cameras: tuple[str, ...]
    tags: tuple[int, ...]
    rms: float
    """Root mean square residual of the tags' corners, in standard deviations."""
    quality: Annotated[str, one_of("good", "position_only", "refused")]
    """``good``, ``position_only`` or ``refused``."""
    reason: str
    """Why it is less than good; empty where it is good."""
    calibration: str | None
    """Id of the calibration that it rests on."""
    sent_at: datetime | None
    """When it was sent to the robot by radio; ``null`` where nobody noted that it was."""


@dataclass(frozen=True, slots=True)
class FixesView(View):
    """Fixes of a robot in order of time."""

    robot: str
    fixes: list[FixView]
    refused: dict[str, int]
    """How many sets of pictures of it gave none, by reason, since the station began."""
    simulation: bool


@dataclass(frozen=True, slots=True)
class StrangerView(View):
    """A tag that cameras saw and nobody knows."""

    tag: int
    camera: str
    """The last that saw it."""
    seen_at: datetime


def fix_view(record: FixRecord) -> FixView:
    """Return a fix as REST shows it."""
    key = record.fix.calibration
    return same(
        FixView,
        record.fix,
        calibration=None if key is None else public_id(CALIBRATION, key),
        received_at=record.received_at,
        sent_at=record.sent_at,
    )
