"""What the cameras tell the other capabilities."""

from dataclasses import dataclass
from datetime import datetime

from robot_link.camera.sighting import Sighting


@dataclass(frozen=True, slots=True)
class CameraChanged:
    """A camera was added, changed or removed."""

    id: str
    is_removed: bool = False


@dataclass(frozen=True, slots=True)
class TagsChanged:
    """The fixed tags or those of robots are others."""

    key: int


@dataclass(frozen=True, slots=True)
class RigChanged:
    """Which cameras are used, where they are, or where the water stands is not as it was."""


@dataclass(frozen=True, slots=True)
class PictureSeen:
    """A camera saw tags, or none, in one picture; told of pictures whose times can be believed."""

    camera: str
    sighting: Sighting
    taken_at: datetime
    """When the picture was taken, by the station's clock."""
