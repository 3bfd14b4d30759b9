"""Which cameras there are: added, changed, removed, with the accounts that some ask for."""

import asyncio
from collections.abc import Mapping
from typing import Any

from sqlalchemy.orm import Session

from db.fault import UnknownIdError
from db.query.camera import cameras as query
from db.query.camera.cameras import CameraChangedError, CameraExistsError, CameraRecord
from db.query.station.events import add_event
from server.base.foundation import Foundation
from server.base.problem import Problem, conflict
from server.base.secret import CameraAccount, SecretUnreadableError
from server.camera.address import host_of, source_of
from server.camera.event import CameraChanged


class Cameras:
    """Every camera of the station. Belongs to one event loop."""

    def __init__(self, foundation: Foundation) -> None:
        self._foundation = foundation
        self._records: dict[str, CameraRecord] = {}

    async def load(self) -> None:
        """Take up the cameras that the database knows."""
        found = await self._foundation.store.query(query.list_cameras)
        self._records = {record.id: record for record in found}

    @property
    def records(self) -> tuple[CameraRecord, ...]:
        """All cameras in the order in which they were added."""
        return tuple(self._records.values())

    def get(self, camera: str) -> CameraRecord:
        """Return one camera.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        if camera not in self._records:
            raise UnknownIdError("camera", camera)
        return self._records[camera]

    async def add(self, camera: str, uri: str, *, by: str) -> CameraRecord:
        """Add a camera.

        Raises:
            Problem: 409 if its id is taken.
        """
        at = self._foundation.clock.now()

        def write(session: Session) -> CameraRecord:
            record = query.add_camera(session, camera, uri, at=at, by=by)
            text = f"{by} added the camera {camera}."
            add_event(session, at, "camera.added", text, data={"camera": camera})
            return record

        try:
            record = await self._foundation.store.write(write)
        except CameraExistsError as error:
            raise conflict(str(error)) from error
        return self._told(record)

    async def change(
        self, camera: str, changes: Mapping[str, Any], *, by: str, if_match: str | None = None
    ) -> CameraRecord:
        """Change address, latency or lens of a camera.

        An account is forgotten where the address is another host's: it must not go there unasked.
        It is gone before the new address is kept, and stays where that is refused. What is known
        of a lens is that of one camera: it is not used for one at another address, until somebody
        chooses it again.

        Raises:
            UnknownIdError: If there is none of this id.
            Problem: 412 if ``if_match`` names another version.
        """
        now = self.get(camera)
        self._check_version(now, if_match)
        at = self._foundation.clock.now()
        uri, changed = changes.get("uri", now.uri), ", ".join(sorted(changes))
        if source_of(uri) != source_of(now.uri):
            changes = {**changes, "lens_key": None}

        def write(session: Session) -> CameraRecord:
            record = query.change_camera(session, camera, changes, at=at, version=now.version)
            if host_of(uri) != host_of(now.uri):
                self._foundation.secrets.set_camera_account(camera, None)
            text = f"{by} changed the camera {camera} ({changed})."
            data = {"camera": camera, "fields": sorted(changes)}
            add_event(session, at, "camera.changed", text, data=data)
            return record

        try:
            record = await self._foundation.store.write(write)
        except CameraChangedError as error:
            raise _outdated(camera) from error
        return self._told(record)

    async def remove(self, camera: str, *, by: str, if_match: str | None = None) -> None:
        """Remove a camera and its account; its calibrations stay in the history.

        Raises:
            UnknownIdError: If there is none of this id.
            Problem: 412 if ``if_match`` names another version.
        """
        now = self.get(camera)
        self._check_version(now, if_match)
        at = self._foundation.clock.now()

        def write(session: Session) -> None:
            query.remove_camera(session, camera, version=now.version)
            self._foundation.secrets.set_camera_account(camera, None)
            text = f"{by} removed the camera {camera}."
            add_event(session, at, "camera.removed", text, data={"camera": camera})

        try:
            await self._foundation.store.write(write)
        except CameraChangedError as error:
            raise _outdated(camera) from error
        self._records.pop(camera, None)
        self._foundation.bus.publish(CameraChanged(camera, is_removed=True))

    async def account(self, camera: str) -> CameraAccount | None:
        """Return what a camera asks for; None where nothing is kept that can be read."""
        try:
            return await asyncio.to_thread(self._foundation.secrets.camera_account, camera)
        except SecretUnreadableError:
            return None

    async def set_account(self, camera: str, account: CameraAccount | None, *, by: str) -> None:
        """Keep the account with a camera, or forget it.

        Raises:
            UnknownIdError: If there is no such camera.
        """
        self.get(camera)
        await asyncio.to_thread(self._foundation.secrets.set_camera_account, camera, account)
        at = self._foundation.clock.now()

        def write(session: Session) -> None:
            verb = "forgot" if account is None else "entered"
            text = f"{by} {verb} the account with the camera {camera}."
            add_event(session, at, "camera.account", text, data={"camera": camera})

        await self._foundation.store.write(write)
        self._foundation.bus.publish(CameraChanged(camera))

    def _told(self, record: CameraRecord) -> CameraRecord:
        self._records[record.id] = record
        self._foundation.bus.publish(CameraChanged(record.id))
        return record

    def _check_version(self, now: CameraRecord, if_match: str | None) -> None:
        if if_match is not None and if_match not in {"*", etag(now)}:
            raise _outdated(now.id)


def etag(camera: CameraRecord) -> str:
    """Return the name of a version for ``ETag`` and ``If-Match``, quotes included."""
    return f'"{camera.version}"'


def _outdated(camera: str) -> Problem:
    return Problem(412, f"{camera} was changed meanwhile; read it again.")
