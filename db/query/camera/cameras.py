"""The cameras that the station looks through."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.camera_tables import CameraRow
from db.fault import StoreError, UnknownIdError
from db.record import same


class CameraExistsError(StoreError):
    """There is a camera of this id already."""


class CameraChangedError(StoreError):
    """Somebody changed the camera meanwhile."""


@dataclass(frozen=True, slots=True)
class CameraRecord:
    """A camera."""

    key: int
    """Tells it from one of the same id that was removed."""
    id: str
    uri: str
    latency_s: float | None
    """None where nobody measured it: then the usual one of its kind of source."""
    latency_std_s: float | None
    lens_key: int | None
    """The calibration of its lens that is in use."""
    version: int
    """Grows by one with each change."""
    created_at: datetime
    created_by: str
    changed_at: datetime


def add_camera(session: Session, camera: str, uri: str, *, at: datetime, by: str) -> CameraRecord:
    """Add a camera.

    Raises:
        CameraExistsError: If its id is taken.
    """
    if session.scalar(select(CameraRow.key).where(CameraRow.id == camera)) is not None:
        raise CameraExistsError(f"There is a camera {camera!r} already.")
    row = CameraRow(
        id=camera,
        uri=uri,
        latency_s=None,
        latency_std_s=None,
        lens_key=None,
        version=1,
        created_at=at,
        created_by=by,
        changed_at=at,
    )
    session.add(row)
    session.flush()
    return same(CameraRecord, row)


def change_camera(
    session: Session,
    camera: str,
    changes: Mapping[str, Any],
    *,
    at: datetime,
    version: int | None = None,
) -> CameraRecord:
    """Change fields of a camera.

    Args:
        session: Transaction.
        camera: Its id.
        changes: Of ``uri``, ``latency_s``, ``latency_std_s`` and ``lens_key`` those that change.
        at: Now.
        version: The version that the change was made from; None overwrites any.

    Raises:
        UnknownIdError: If there is none of this id.
        CameraChangedError: If it has another version.
    """
    row = _row(session, camera, version)
    for name, value in changes.items():
        setattr(row, name, value)
    row.version += 1
    row.changed_at = at
    session.flush()
    return same(CameraRecord, row)


def remove_camera(session: Session, camera: str, *, version: int | None = None) -> None:
    """Remove a camera; its calibrations stay, for fixes cite them.

    Raises:
        UnknownIdError: If there is none of this id.
        CameraChangedError: If it has another version.
    """
    session.delete(_row(session, camera, version))


def get_camera(session: Session, camera: str) -> CameraRecord:
    """Return one camera.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return same(CameraRecord, _row(session, camera))


def list_cameras(session: Session) -> list[CameraRecord]:
    """Return every camera in the order in which they were added."""
    rows = session.scalars(select(CameraRow).order_by(CameraRow.key))
    return [same(CameraRecord, row) for row in rows]


def _row(session: Session, camera: str, version: int | None = None) -> CameraRow:
    row = session.scalar(select(CameraRow).where(CameraRow.id == camera))
    if row is None:
        raise UnknownIdError("camera", camera)
    if version is not None and row.version != version:
        raise CameraChangedError(f"{camera} was changed meanwhile.")
    return row
