"""Cameras: listed, added, changed, removed; their accounts and calibrations."""

from typing import Annotated

from fastapi import APIRouter, Depends, Header, Response

from server.access.dependency import Admin, Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.secret import CameraAccount
from server.camera.calibrations import Calibrations
from server.camera.cameras import Cameras, etag
from server.camera.rig import CameraRig
from server.camera.status import CameraStatuses
from server.camera.view import (
    CalibrationView,
    CameraAccountBody,
    CameraChanges,
    CameraView,
    NewCamera,
)
from server.camera.views import calibration_view, camera_view

router = APIRouter(prefix="/api/cameras", tags=["cameras"], route_class=IdempotentRoute)

CamerasDep = Annotated[Cameras, Depends(service(Cameras))]
CalibrationsDep = Annotated[Calibrations, Depends(service(Calibrations))]
IfMatch = Annotated[str | None, Header()]


class _Teller:
    """Puts the views of cameras together."""

    def __init__(
        self,
        cameras: CamerasDep,
        calibrations: CalibrationsDep,
        statuses: Annotated[CameraStatuses, Depends(service(CameraStatuses))],
        rig: Annotated[CameraRig, Depends(service(CameraRig))],
    ) -> None:
        self._cameras, self._calibrations = cameras, calibrations
        self._statuses, self._rig = statuses, rig

    async def view(self, camera: str) -> CameraView:
        """Return one camera.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        record = self._cameras.get(camera)
        return camera_view(
            record,
            self._statuses.of(camera),
            self._calibrations.lens(camera),
            self._rig,
            has_account=await self._cameras.account(camera) is not None,
        )


TellerDep = Annotated[_Teller, Depends()]


@router.get("")
async def list_cameras(caller: Viewer, cameras: CamerasDep, teller: TellerDep) -> list[CameraView]:
    """Return every camera in the order in which they were added."""
    del caller
    return [await teller.view(record.id) for record in cameras.records]


@router.post("", status_code=201)
async def create_camera(
    caller: Admin, body: NewCamera, cameras: CamerasDep, teller: TellerDep, response: Response
) -> CameraView:
    """Add a camera; its process is started at once."""
    record = await cameras.add(body.id, body.uri, by=caller.name)
    response.headers["ETag"] = etag(record)
    return await teller.view(record.id)


@router.get("/{camera}")
async def get_camera(
    caller: Viewer, camera: str, cameras: CamerasDep, teller: TellerDep, response: Response
) -> CameraView:
    """Return one camera; its version is the ``ETag``."""
    del caller
    view = await teller.view(camera)
    response.headers["ETag"] = etag(cameras.get(camera))
    return view


@router.patch("/{camera}")
async def patch_camera(
    caller: Admin,
    camera: str,
    body: CameraChanges,
    cameras: CamerasDep,
    teller: TellerDep,
    response: Response,
    if_match: IfMatch = None,
) -> CameraView:
    """Change where a camera's pictures come from, or their latency.

    412 says that it has another version than ``If-Match``. Its account is forgotten where the
    address is another host's; its lens and its place are where the camera may be another one.
    """
    changes = body.model_dump(exclude_none=True)
    record = await cameras.change(camera, changes, by=caller.name, if_match=if_match)
    response.headers["ETag"] = etag(record)
    return await teller.view(camera)


@router.delete("/{camera}", status_code=204)
async def delete_camera(
    caller: Admin, camera: str, cameras: CamerasDep, if_match: IfMatch = None
) -> None:
    """Remove a camera with its account; fixes go on citing its calibrations."""
    await cameras.remove(camera, by=caller.name, if_match=if_match)


@router.put("/{camera}/account", status_code=204)
async def put_account(
    caller: Admin, camera: str, body: CameraAccountBody, cameras: CamerasDep
) -> None:
    """Enter the user and the password that a camera asks for; nobody is ever shown them."""
    account = CameraAccount(user=body.user, password=body.password.get_secret_value())
    await cameras.set_account(camera, account, by=caller.name)


@router.delete("/{camera}/account", status_code=204)
async def delete_account(caller: Admin, camera: str, cameras: CamerasDep) -> None:
    """Forget the user and the password of a camera."""
    await cameras.set_account(camera, None, by=caller.name)


@router.get("/{camera}/calibrations")
async def list_calibrations(
    caller: Viewer, camera: str, calibrations: CalibrationsDep
) -> list[CalibrationView]:
    """Return the calibrations of a camera's lens and those of the rig with it, newest first."""
    del caller
    return [
        calibration_view(
            record,
            is_used=calibrations.is_used(record),
            is_usable=calibrations.is_usable(record),
        )
        for record in await calibrations.of(camera)
    ]


@router.post("/{camera}/calibrations/{calibration}/use")
async def use_calibration(
    caller: Pilot,
    camera: str,
    calibration: str,
    calibrations: CalibrationsDep,
    teller: TellerDep,
) -> CameraView:
    """Choose a calibration: of the lens for this camera, of the rig for all cameras."""
    await calibrations.use(camera, calibration, by=caller.name)
    return await teller.view(camera)
