"""Which satellite modems belong to which robot."""

from dataclasses import dataclass

from db.query.fleet.robots import RobotRecord
from robot_link.messages import RobotId, SystemId
from robot_link.station.gateway.address import is_satellite, satellite_address


@dataclass(frozen=True, slots=True)
class Modem:
    """One satellite link of a robot."""

    robot: RobotId
    system: SystemId
    uri: str
    carrier: str
    """The gateway that reaches it."""
    imei: str


def modems_of(robot: RobotRecord) -> tuple[Modem, ...]:
    """Return the satellite links of a robot, the preferred one first; a recording has none."""
    if robot.system_id is None:
        return ()
    found: list[Modem] = []
    for uri in robot.links:
        if is_satellite(uri):
            carrier, imei = satellite_address(uri)
            found.append(Modem(robot.id, robot.system_id, uri, carrier, imei))
    return tuple(found)
