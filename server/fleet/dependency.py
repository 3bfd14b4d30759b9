"""How a route asks for the fleet."""

from typing import Annotated

from fastapi import Depends

from server.base.dependency import service
from server.fleet.fleet import Fleet

FleetDep = Annotated[Fleet, Depends(service(Fleet))]
