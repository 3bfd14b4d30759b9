"""How a route asks for the fleet, and what it refuses of a recording."""

from typing import Annotated

from fastapi import Depends

from server.base.dependency import service
from server.base.problem import conflict
from server.fleet.fleet import Fleet
from server.fleet.status import RobotStatus

FleetDep = Annotated[Fleet, Depends(service(Fleet))]


def refuse_recording(status: RobotStatus, what: str) -> None:
    """Refuse what only a robot can do.

    Args:
        status: Robot or recording.
        what: What a recording does not, such as "flies no plans".

    Raises:
        Problem: 409 for a recording.
    """
    if status.is_retired:
        raise conflict(f"{status.record.id} is retired; it {what} until it is brought back.")
    if status.record.system_id is None:
        raise conflict(f"{status.record.id} is a recording; it {what}.")
