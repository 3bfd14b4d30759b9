"""What crosses to the process that finds robots, and back."""

from collections.abc import Mapping
from dataclasses import dataclass

from autonomy.vision.tag import Registry
from robot_link.camera.config import CameraConfig
from robot_link.camera.fix import CameraFix
from robot_link.camera.sighting import Region, TagSeen
from robot_link.messages import RobotId

Box = tuple[tuple[float, float], tuple[float, float], float]
"""The water of a robot: north and east from .. to, and depth, m (``vision.quality.Water``)."""
Words = tuple[float, float | None, float | None, float | None]
"""Age (s), roll, pitch (rad) and depth (m) as a robot said them (``vision.tracker.Said``)."""


@dataclass(frozen=True, slots=True)
class Pictured:
    """One picture."""

    camera: str
    taken_s: float
    """Seconds since 1970 by the station's clock."""
    tags: tuple[TagSeen, ...]


@dataclass(frozen=True, slots=True)
class FusionCall:
    """Pictures of one moment, and all that is needed to find robots in them."""

    pictures: tuple[Pictured, ...]
    rig: bytes
    """A pickled ``server.camera.used_rig.UsedRig``; packed once, for it is large."""
    calibration: int | None
    registry: Registry
    robots: Mapping[str, RobotId]
    """Of each set of tags that is sought, who carries it."""
    waters: Mapping[str, Box]
    """By set of tags."""
    said: Mapping[str, Words]
    """Likewise, of robots that said something lately."""
    tracks: bytes
    """Of the answer before; empty at the beginning."""
    config: CameraConfig
    """Its gates tell from where on a fix is refused."""


@dataclass(frozen=True, slots=True)
class FoundRobot:
    """What became of one robot that was in the pictures."""

    tags: str
    """Its set of tags."""
    fix: CameraFix | None
    """None where no pose explains what was seen."""
    reason: str
    """Why it is less than good."""


@dataclass(frozen=True, slots=True)
class FusionAnswer:
    """What the pictures of one moment say."""

    tracks: bytes
    found: tuple[FoundRobot, ...]
    standings: Mapping[str, str]
    """Of sets of tags that were found before: ``found``, ``lost`` or ``unseen``."""
    regions: Mapping[str, tuple[Region, ...]]
    """Where each camera should look."""
    left_out: tuple[str, ...]
    """Sets of tags that were in view and not sought, for there were too many."""
