"""What is known of each camera now: how its process fares, what it sees, whether it has moved."""

import statistics
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Literal

from robot_link.camera.sighting import Sighting, SourceReport
from server.camera.view import CameraState

BLURRED_PX = 1.5
"""From this blur on tags of usual size are lost."""


@dataclass(frozen=True, slots=True)
class Stand:
    """Whether a camera still is where the calibration left it."""

    stand: Literal["holds", "moved", "left_out", "unknown"] = "unknown"
    shift_px: float = 0.0
    """Median over the fixed tags of how far each is from where it should be."""
    sentence: str = ""
    off_px: Mapping[int, tuple[float, float]] = field(
        default_factory=dict[int, tuple[float, float]]
    )
    """Of each fixed tag that it sees, how far it is from where it should be."""


@dataclass(slots=True)
class CameraStatus:
    """One camera."""

    camera: str
    state: CameraState = "starting"
    words: str = ""
    """What is wrong and what to do, empty where nothing is."""
    report: SourceReport | None = None
    """The newest of its process; None before the first."""
    restarts: int = 0
    refused: Counter[str] = field(default_factory=Counter[str])
    """What came of it and was not used, by reason, since the station began."""
    seen_at: datetime | None = None
    """When its newest picture was taken, by the station's clock."""
    sighting: Sighting | None = None
    """What was in it."""
    stand: Stand = Stand()
    """Whether it still is where the calibration left it."""

    @property
    def size(self) -> tuple[int, int] | None:
        """Of its pictures, px; None before the first."""
        if self.sighting is not None:
            return self.sighting.size
        return None if self.report is None else self.report.size

    @property
    def blur_px(self) -> float | None:
        """Median over the tags of its newest picture."""
        if self.sighting is None or not self.sighting.tags:
            return None
        return statistics.median(tag.blur_px for tag in self.sighting.tags)

    @property
    def advice(self) -> str:
        """What would make its pictures better; empty where nothing is known."""
        if self.state == "dark":
            return "More light, from the side; or a longer exposure, up to 1/60 s."
        if self.state == "glare":
            return "Less light from above; lamps mirror themselves in the surface."
        if self.blur_px is not None and self.blur_px > BLURRED_PX:
            return "Its pictures are blurred: focus it, and expose for 1/60 s or less."
        return ""


class CameraStatuses:
    """All cameras. Belongs to one event loop."""

    def __init__(self, changed: Callable[[], None]) -> None:
        self._statuses: dict[str, CameraStatus] = {}
        self._changed = changed

    def of(self, camera: str) -> CameraStatus:
        """Return what is known of a camera, of a new one that it starts."""
        return self._statuses.setdefault(camera, CameraStatus(camera))

    def drop(self, camera: str) -> None:
        """Forget a camera."""
        self._statuses.pop(camera, None)
        self._changed()

    def tell(self) -> None:
        """Say that something of a camera changed that a person would want to see."""
        self._changed()
