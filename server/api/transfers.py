"""Transfers: plans on their way to robots."""

from fastapi import APIRouter

from server.api.dependency import Viewer
from server.api.station_dependency import StationDep
from server.service.view.plan import TransferView

router = APIRouter(prefix="/api/transfers", tags=["transfers"])


@router.get("/{transfer}")
async def get_transfer(caller: Viewer, transfer: str, station: StationDep) -> TransferView:
    """Return a transfer: items sent, and the level that is proved."""
    del caller
    return await station.uploads.view(transfer)
