"""What swims or lies in a water and answers pings: acoustic tags that move, beacons that stay."""

from dataclasses import dataclass
from datetime import UTC, datetime

from autonomy.tracking.config import TargetConfig
from autonomy.tracking.target_path import place
from robot_link.clock import Clock
from robot_link.messages import RobotId
from simulator.acoustic_modem import AcousticNode, Point

EPOCH = datetime(2026, 1, 1, tzinfo=UTC)
"""When all targets set out: where one is follows from the time alone, for every robot alike."""


@dataclass(frozen=True, slots=True)
class AcousticTarget:
    """An acoustic modem that no robot carries."""

    name: str
    """Lower case letters, digits and dashes, as of a robot."""
    address: int
    """Of its modem."""
    depth_m: float
    path: TargetConfig
    """How it moves."""
    wander: TargetConfig | None = None
    """A second path, whose displacement is added; two circles together wander."""

    @property
    def id(self) -> RobotId:
        """Its name where links name robots."""
        return RobotId(self.name)

    def place_ned_m(self, at: datetime) -> Point:
        """Return where it is: north, east, depth, m."""
        elapsed_s = (at - EPOCH).total_seconds()
        here = place(self.path, elapsed_s)
        north, east = here.north_m, here.east_m
        if self.wander is not None:
            there = place(self.wander, elapsed_s)
            north += there.north_m - self.wander.north_m
            east += there.east_m - self.wander.east_m
        return north, east, self.depth_m

    def modem(self, clock: Clock) -> AcousticNode:
        """Return its modem, which goes where it goes."""
        return AcousticNode(lambda: self.place_ned_m(clock.now()))


TANK_TARGETS = (
    AcousticTarget(
        name="tank-tag",
        address=10,
        depth_m=0.2,
        path=TargetConfig(
            kind="tag", path="circle", north_m=1.4, east_m=0.4, width_m=0.3, speed_m_s=0.01
        ),
    ),
)
"""A tag on a slow circle around the middle of the tank."""

LAKE_TARGETS = (
    AcousticTarget(
        name="lake-tag",
        address=10,
        depth_m=3.0,
        path=TargetConfig(
            kind="tag", path="circle", north_m=120.0, east_m=130.0, width_m=10.0, speed_m_s=0.03
        ),
        wander=TargetConfig(
            kind="tag", path="circle", north_m=0.0, east_m=0.0, width_m=3.7, speed_m_s=0.02
        ),
    ),
    AcousticTarget(
        name="lake-beacon",
        address=11,
        depth_m=6.0,
        path=TargetConfig(kind="beacon", path="static", north_m=100.0, east_m=150.0),
    ),
)
"""A tag that wanders within 14 m of 120 m north, 144 m east, and a beacon near it."""
