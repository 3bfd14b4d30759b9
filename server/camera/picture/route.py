"""What a camera shows now, for whoever may look; never kept by anybody on the way."""

import asyncio
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response

from server.access.dependency import Viewer
from server.base.dependency import service
from server.base.problem import Problem
from server.camera.cameras import Cameras
from server.camera.picture.marks import Marks, marked
from server.camera.picture.newest import Picture, Pictures
from server.camera.rig import CameraRig
from server.camera.status import CameraStatus, CameraStatuses

router = APIRouter(prefix="/api/cameras/{camera}", tags=["cameras"])

Marked = Annotated[bool, Query(description="Draw into it what was seen, and what is expected.")]


@router.get(
    "/picture.jpg",
    response_class=Response,
    responses={200: {"content": {"image/jpeg": {}}, "description": "The picture."}},
)
async def get_picture(
    caller: Viewer,
    camera: str,
    cameras: Annotated[Cameras, Depends(service(Cameras))],
    pictures: Annotated[Pictures, Depends(service(Pictures))],
    statuses: Annotated[CameraStatuses, Depends(service(CameraStatuses))],
    rig: Annotated[CameraRig, Depends(service(CameraRig))],
    marks: Marked = False,
) -> Response:
    """Return the picture of now; at most two a second are new.

    The camera sends pictures while somebody asks, and for five seconds more. 503 says why none
    came.
    """
    del caller
    cameras.get(camera)
    picture = await pictures.newest(camera)
    jpeg = picture.jpeg
    if marks:
        drawn = _marks(picture, statuses.of(camera), rig)
        try:
            jpeg = jpeg if drawn is None else await asyncio.to_thread(marked, jpeg, drawn)
        except OSError:
            raise Problem(503, f"The picture of {camera} cannot be read.") from None
    return Response(jpeg, media_type="image/jpeg", headers={"Cache-Control": "no-store"})


def _marks(picture: Picture, status: CameraStatus, rig: CameraRig) -> Marks | None:
    sighting = picture.sighting
    if sighting is None:
        return None
    usable = rig.rig
    finds = usable is not None and status.camera in usable.cameras
    refused = frozenset(
        tag.id
        for tag in sighting.tags
        if not finds or not tag.is_fitted or rig.registry.is_stranger(tag.id)
    )
    return Marks(
        sighting.size, sighting.tags, refused, rig.regions(status.camera), status.stand.off_px
    )
