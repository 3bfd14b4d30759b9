"""Waypoints as every format writes them: on the globe, each with how the robot comes to it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.design.document import Manner, Motion, Waypoint
from autonomy.frames import wgs84_from_ned
from autonomy.site import Site
from server.base.text import shown
from server.plan_file.proposal import LatitudeLongitude, NorthEast

_NAME_LENGTH_MAX = 60


@dataclass(frozen=True, slots=True)
class WrittenLeg:
    """A waypoint, and the way to it."""

    place_deg: LatitudeLongitude
    name: str
    motion: Motion
    depth_m: float
    """Where its glides turn; 0 of a swim."""
    shallow_m: float
    glide_angle_rad: float
    speed_m_s: float | None
    """Vertical of a glide, along the way of a swim; None is the robot's own."""
    surfaces: bool | None


def written_legs(way: Sequence[Waypoint], usual: Manner, site: Site) -> list[WrittenLeg]:
    """Return the waypoints of a way that is laid out; they need not be sound.

    Args:
        way: The waypoints.
        usual: How its legs are flown, with nothing left to the robot.
        site: The water in whose frame they are.

    Raises:
        ValueError: If the manner leaves depth or angle open.
    """
    places = on_globe([waypoint.ne_m for waypoint in way], site)
    return [_leg(waypoint, at, usual) for waypoint, at in zip(way, places, strict=True)]


def on_globe(places: Sequence[NorthEast], site: Site) -> list[LatitudeLongitude]:
    """Return latitude and longitude of places in a water's frame."""
    if not places:
        return []
    origin = (site.origin_latitude_deg, site.origin_longitude_deg)
    return [(a, b) for a, b in wgs84_from_ned(np.array(places), *origin).tolist()]


def _leg(waypoint: Waypoint, at: LatitudeLongitude, usual: Manner) -> WrittenLeg:
    motion = waypoint.motion or usual.motion
    if usual.deep_m is None or usual.glide_angle_rad is None:
        raise ValueError("the usual manner must say depth and angle")
    is_glide = motion == "glide"
    speed = waypoint.speed_m_s
    if speed is None:
        speed = usual.glide_speed_m_s if is_glide else usual.swim_speed_m_s
    deep = usual.deep_m if waypoint.deep_m is None else waypoint.deep_m
    angle = waypoint.glide_angle_rad
    return WrittenLeg(
        place_deg=at,
        name=shown(waypoint.name, _NAME_LENGTH_MAX).strip(),
        motion=motion,
        depth_m=deep if is_glide else 0.0,
        shallow_m=usual.shallow_m if waypoint.shallow_m is None else waypoint.shallow_m,
        glide_angle_rad=usual.glide_angle_rad if angle is None else angle,
        speed_m_s=speed,
        surfaces=waypoint.surfaces,
    )
