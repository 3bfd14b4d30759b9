"""Calibrations that there are, and which of them are in use."""

from sqlalchemy.orm import Session

from db.identity import key_of, public_id
from db.query.camera import calibrations as query
from db.query.camera.calibrations import CalibrationRecord
from db.query.station.events import add_event
from server.base.foundation import Foundation
from server.base.problem import conflict
from server.camera.cameras import Cameras
from server.camera.rig import CameraRig

CALIBRATION = "calibration"
"""Kind of a calibration's public id."""


class Calibrations:
    """The history of calibrations. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, cameras: Cameras, rig: CameraRig) -> None:
        self._foundation = foundation
        self._cameras = cameras
        self._rig = rig
        self._lenses: dict[int, CalibrationRecord] = {}

    async def load(self) -> None:
        """Take up the lenses that are in use."""
        keys = [one.lens_key for one in self._cameras.records if one.lens_key is not None]

        def read(session: Session) -> dict[int, CalibrationRecord]:
            return {key: query.get_calibration(session, key) for key in keys}

        self._lenses = await self._foundation.store.query(read)

    def lens(self, camera: str) -> CalibrationRecord | None:
        """Return the calibration of a camera's lens that is in use.

        Raises:
            UnknownIdError: If there is no such camera.
        """
        key = self._cameras.get(camera).lens_key
        return None if key is None else self._lenses.get(key)

    async def of(self, camera: str) -> list[CalibrationRecord]:
        """Return those of a camera's lens and those of the rig that it was part of, newest first.

        Raises:
            UnknownIdError: If there is no such camera.
        """
        key = self._cameras.get(camera).key
        found = await self._foundation.store.query(
            lambda session: query.list_calibrations(session, key)
        )
        return [one for one in found if one.kind == "lens" or key in _camera_keys(one)]

    def is_used(self, record: CalibrationRecord) -> bool:
        """Tell whether a calibration is in use."""
        if record.kind == "rig":
            return record.key == self._rig.calibration
        return any(one.lens_key == record.key for one in self._cameras.records)

    def is_usable(self, record: CalibrationRecord) -> bool:
        """Tell whether a calibration can be chosen: a camera that it rests on is still there."""
        return any(one.key in _camera_keys(record) for one in self._cameras.records)

    async def use(self, camera: str, calibration: str, *, by: str) -> None:
        """Choose a calibration of a camera.

        Raises:
            UnknownIdError: If there is no such camera, or it has no such calibration.
            Problem: 409 if the cameras that it rests on are gone.
        """
        key = key_of(CALIBRATION, calibration)
        record = await self._foundation.store.query(
            lambda session: query.get_calibration(session, key)
        )
        if self._cameras.get(camera).key not in _camera_keys(record):
            raise conflict(f"{calibration} is not one of {camera} as it is now.")
        await self.take(record, camera, by=by)

    async def take(self, record: CalibrationRecord, camera: str | None, *, by: str) -> None:
        """Use a calibration from now on, and note it in the log."""
        if record.kind == "lens" and camera is not None:
            self._lenses[record.key] = record
            await self._cameras.change(camera, {"lens_key": record.key}, by=by)
        else:
            await self._rig.use(record)
        at, name = self._foundation.clock.now(), public_id(CALIBRATION, record.key)

        def write(session: Session) -> None:
            about = "the lens of " + camera if record.kind == "lens" and camera else "the cameras"
            text = f"{by} put {name} of {about} into use."
            add_event(session, at, "camera.calibration", text, data={"calibration": name})

        await self._foundation.store.write(write)


def lens_size(record: CalibrationRecord) -> tuple[int, int]:
    """Return the size of the pictures that the calibration of a lens holds for, px."""
    lens = record.result["lens"]
    return lens["width_px"], lens["height_px"]


def _camera_keys(record: CalibrationRecord) -> set[int]:
    if record.kind == "lens":
        return set() if record.camera_key is None else {record.camera_key}
    return {camera["key"] for camera in record.result["cameras"]}
