"""What a mission costs by satellite, before anybody decides how it goes."""

from robot_link.mission import Mission
from robot_link.satellite.blob import Blob
from robot_link.satellite.chunk import sizes
from robot_link.satellite.config import Tariff
from robot_link.satellite.cost import quote


def mission_credits(mission: Mission, tariff: Tariff) -> int | None:
    """Return the credits of sending every part of a mission once.

    Returns:
        ``None`` for a mission that is too long for satellite.
    """
    try:
        return quote(sizes(Blob.of(mission)), tariff).credits
    except ValueError:
        return None
