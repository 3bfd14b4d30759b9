"""Fish with acoustic tags: where they are, and how often they are heard."""

from dataclasses import dataclass, field
from datetime import datetime

from autonomy.tag.config import TagConfig
from autonomy.tracking.config import TargetConfig
from autonomy.tracking.target_path import place
from simulator.acoustic_modem import Point
from simulator.target import EPOCH


@dataclass(frozen=True, slots=True)
class SimulatedTag:
    """One tag on a fish."""

    code: str
    """Such as ``A69-1601-179``."""
    depth_m: float
    path: TargetConfig
    """How the fish moves."""
    delay_s: tuple[float, float] = (60.0, 180.0)
    """Shortest and longest time between two transmissions; each is drawn."""
    hearing: TagConfig = field(default_factory=TagConfig)
    """Which part of its transmissions is heard from how far."""
    sensor: int | None = None
    """Raw value of its sensor."""

    def place_ned_m(self, at: datetime) -> Point:
        """Return where it is: north, east, depth, m."""
        here = place(self.path, (at - EPOCH).total_seconds())
        return here.north_m, here.east_m, self.depth_m


def _resting(north_m: float, east_m: float) -> TargetConfig:
    return TargetConfig(kind="tag", path="static", north_m=north_m, east_m=east_m)


LAKE_TAGS = (
    SimulatedTag("A69-1601-179", 6.0, _resting(260.0, 150.0)),
    SimulatedTag("A69-1601-204", 2.0, _resting(90.0, 330.0)),
    SimulatedTag(
        "A69-9002-4711",
        4.0,
        TargetConfig(
            kind="tag", path="circle", north_m=200.0, east_m=200.0, width_m=140.0, speed_m_s=0.15
        ),
        sensor=87,
    ),
)
"""Two fish that rest and one that swims around the lake with a depth sensor."""
