"""Transfers: plans on their way to robots."""

from fastapi import APIRouter

from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.plan.view import TransferView
from server.station_dependency import StationDep

router = APIRouter(prefix="/api/transfers", tags=["transfers"], route_class=IdempotentRoute)


@router.get("/{transfer}")
async def get_transfer(caller: Viewer, transfer: str, station: StationDep) -> TransferView:
    """Return a transfer: its parts, the level that is proved, and what it has cost."""
    del caller
    return await station.uploads.view(transfer)


@router.post("/{transfer}/withdraw")
async def withdraw_transfer(caller: Pilot, transfer: str, station: StationDep) -> TransferView:
    """Withdraw a transfer that has not arrived; what a gateway took may still reach the robot."""
    return await station.uploads.withdraw_transfer(transfer, by=caller.name)
