"""What the maps tell the other capabilities."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MapChanged:
    """A robot's maps, their scores or their comparison changed."""

    robot: str


@dataclass(frozen=True, slots=True)
class DivesSmoothed:
    """A robot's dives were looked at after a fix."""

    robot: str
