"""Which robots share a water, and so what is known of it.

Robots share one if they work at one site, in one frame, and are all real or all simulated: what is
computed is never mixed with what was measured. A recording has a water of its own.
"""

from dataclasses import dataclass

from sqlalchemy.orm import Session

from db.query.fleet.robots import RobotRecord, get_robot, list_robots


@dataclass(frozen=True, slots=True)
class Water:
    """What robots have in common that share a map."""

    name: str
    latitude_deg: float
    longitude_deg: float
    """Origin of the frame in which they say where they are."""
    kind: str
    """``real`` or ``simulated``; a recording is its own, by its id."""

    @classmethod
    def of(cls, robot: RobotRecord) -> "Water":
        """Return the water of a robot."""
        site = robot.site
        kind = robot.id if robot.kind == "recorded" else robot.kind
        return cls(site.name, site.origin_latitude_deg, site.origin_longitude_deg, kind)


def site_robots(session: Session, robot: str) -> tuple[str, ...]:
    """Return the ids of the robots that share the map of one, in the order they were added.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    water = Water.of(get_robot(session, robot))
    return tuple(other.id for other in list_robots(session) if Water.of(other) == water)
