"""What a robot's battery gives, and for how long."""

from typing import Annotated

from fastapi import APIRouter, Depends

from server.access.dependency import Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import FoundationDep, service
from server.base.problem import not_found
from server.battery.battery_use import BatteryUse
from server.battery.lasting import battery_view
from server.battery.view import RobotBatteryView

router = APIRouter(
    prefix="/api/robots/{robot}/battery", tags=["robots"], route_class=IdempotentRoute
)

BatteryUseDep = Annotated[BatteryUse, Depends(service(BatteryUse))]


@router.get("")
async def get_battery(
    caller: Viewer, robot: str, batteries: BatteryUseDep, foundation: FoundationDep
) -> RobotBatteryView:
    """Return what a robot draws in each use, as its flights taught, and when to recover it.

    404 where the vehicle is not known.
    """
    del caller
    battery = await batteries.of(robot)
    if battery is None:
        raise not_found(f"It is not known what vehicle {robot} is, so nor what it draws.")
    return battery_view(robot, battery, foundation.clock.now())
