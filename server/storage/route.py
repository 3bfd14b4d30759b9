"""What the station keeps, and what becomes of it."""

from typing import Annotated

from fastapi import APIRouter, Depends

from server.access.dependency import Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.storage.sizes import Sizes
from server.storage.view import StorageView, look_view

router = APIRouter(prefix="/api/storage", tags=["storage"], route_class=IdempotentRoute)

SizesDep = Annotated[Sizes, Depends(service(Sizes))]


@router.get("")
async def get_storage(caller: Viewer, sizes: SizesDep) -> StorageView:
    """Return how much there is of everything, by the newest look."""
    del caller
    return StorageView(look_view(sizes))
