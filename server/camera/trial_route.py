"""A camera looked through before it is added: what the doctor says of it."""

import asyncio
from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import Field, SecretStr, field_validator

from robot_link.camera.doctor import examine_camera
from robot_link.camera.extra import CameraExtraMissingError, check_extra
from robot_link.camera.sighting import SourceSettings
from server.access.dependency import Admin
from server.base.dependency import service
from server.base.foundation import Foundation
from server.base.problem import conflict
from server.base.view import Body, View
from server.camera.address import checked_uri
from server.camera.cameras import Cameras

router = APIRouter(prefix="/api/cameras", tags=["cameras"])


class CameraTrials:
    """Looks through one camera at a time. Belongs to one event loop."""

    def __init__(self, foundation: Foundation) -> None:
        self._folder = foundation.settings.camera_dir
        self._turn = asyncio.Lock()

    async def look(
        self, uri: str, user: str, password: str, seconds: float
    ) -> tuple[bool, list[str]]:
        """Return whether a camera is as it should be, and every finding in words.

        Raises:
            Problem: 409 while another one is looked through.
        """
        if self._turn.locked():
            raise conflict("Another camera is being looked through; try again in a moment.")
        folder = None if self._folder is None else str(self._folder)
        settings = SourceSettings("trial", uri, folder=folder, user=user, password=password)
        lines: list[str] = []
        async with self._turn:
            is_well = await examine_camera(settings, seconds, lines.append)
        return is_well, lines


class CameraTrialRequest(Body):
    """A camera that somebody may add."""

    uri: str = Field(max_length=500)
    """As of a camera that is added, without user and password."""
    user: str = Field(default="", max_length=200)
    """Name of the account that it asks for; not kept."""
    password: SecretStr = Field(default=SecretStr(""), max_length=500)
    """Password of the account; not kept."""
    seconds: float = Field(default=3.0, gt=0.0, le=10.0)
    """How long to look, from its first picture on."""

    @field_validator("uri")
    @classmethod
    def _is_one(cls, value: str) -> str:
        return checked_uri(value)


@dataclass(frozen=True, slots=True)
class CameraTrialView(View):
    """What a camera showed."""

    uri: str
    is_well: bool
    """Whether pictures come in which tags are found, and nothing needs to be put right."""
    lines: list[str]
    """Every finding, with what to try."""


@router.post("/test")
async def try_camera(
    caller: Admin,
    body: CameraTrialRequest,
    cameras: Annotated[Cameras, Depends(service(Cameras))],
    trials: Annotated[CameraTrials, Depends(service(CameraTrials))],
) -> CameraTrialView:
    """Look through a camera for a moment and tell what is seen; one in use is left alone.

    422 with the reason if it is none; 409 while another one is looked through.
    """
    del caller
    users = [record.id for record in cameras.records if record.uri == body.uri]
    if users:
        words = f"{users[0]} has this address already; what it sees stands with it."
        return CameraTrialView(body.uri, False, [words])
    try:
        check_extra()
    except CameraExtraMissingError as error:
        return CameraTrialView(body.uri, False, [f"{error}."])
    password = body.password.get_secret_value()
    is_well, lines = await trials.look(body.uri, body.user, password, body.seconds)
    return CameraTrialView(body.uri, is_well, lines)
