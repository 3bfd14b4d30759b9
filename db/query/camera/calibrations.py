"""Calibrations of lenses and of all cameras together; they are added, never changed."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal

import numpy as np
from sqlalchemy import or_, select
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray
from db.camera_tables import CameraCalibrationRow
from db.fault import UnknownIdError
from db.query.station.settings import get_setting, put_setting

Document = Mapping[str, Any]
CalibrationKind = Literal["lens", "rig"]
_SETTING = "camera.rig"
_DOUBLES = "<f8"


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationRecord:
    """What a calibration found, and of what."""

    key: int
    kind: CalibrationKind
    """``lens`` of one camera, or ``rig`` of all that hang over the tank."""
    camera_key: int | None
    """Of a lens: whose (``CameraRecord.key``)."""
    tag_set_key: int | None
    """Of a rig: the tags that it rests on."""
    result: Document
    covariance: FloatArray
    """Of what was found, shape ``(n, n)``."""
    inputs: Document
    at: datetime
    by: str


def add_calibration(
    session: Session,
    kind: CalibrationKind,
    *,
    result: Document,
    covariance: FloatArray,
    inputs: Document,
    at: datetime,
    by: str,
    camera_key: int | None = None,
    tag_set_key: int | None = None,
) -> CalibrationRecord:
    """Keep a calibration; it is in use once somebody says so."""
    row = CameraCalibrationRow(
        kind=kind,
        camera_key=camera_key,
        tag_set_key=tag_set_key,
        result=dict(result),
        covariance=covariance.astype(_DOUBLES).tobytes(),
        inputs=dict(inputs),
        at=at,
        by=by,
    )
    session.add(row)
    session.flush()
    return _record(row)


def get_calibration(session: Session, key: int) -> CalibrationRecord:
    """Return a calibration.

    Raises:
        UnknownIdError: If there is none of this key.
    """
    row = session.get(CameraCalibrationRow, key)
    if row is None:
        raise UnknownIdError("calibration", str(key))
    return _record(row)


def list_calibrations(
    session: Session, camera_key: int, *, limit: int = 100
) -> list[CalibrationRecord]:
    """Return the calibrations of a camera's lens and those of the rig, the newest first."""
    statement = (
        select(CameraCalibrationRow)
        .where(
            or_(CameraCalibrationRow.camera_key == camera_key, CameraCalibrationRow.kind == "rig")
        )
        .order_by(CameraCalibrationRow.key.desc())
        .limit(limit)
    )
    return [_record(row) for row in session.scalars(statement)]


def use_rig(session: Session, key: int | None) -> None:
    """Say which calibration of the rig is in use, with all its cameras; None for none."""
    put_setting(session, _SETTING, {"calibration": key, "left_out": []})


def leave_out(session: Session, key: int | None, cameras: Collection[str]) -> None:
    """Say which cameras of the calibration in use are not used; nothing if another one is."""
    setting = get_setting(session, _SETTING)
    if setting is not None and setting["calibration"] == key:
        put_setting(session, _SETTING, {"calibration": key, "left_out": sorted(cameras)})


def rig_in_use(session: Session) -> CalibrationRecord | None:
    """Return the calibration of the rig that is in use, None where there is none."""
    setting = get_setting(session, _SETTING)
    key = None if setting is None else setting["calibration"]
    return None if key is None else get_calibration(session, key)


def left_out(session: Session) -> frozenset[str]:
    """Return the cameras of the calibration in use that are not used."""
    setting = get_setting(session, _SETTING)
    return frozenset(() if setting is None else setting.get("left_out", ()))


def _record(row: CameraCalibrationRow) -> CalibrationRecord:
    numbers = np.frombuffer(row.covariance, _DOUBLES).astype(np.float64)
    side = math.isqrt(len(numbers))
    kind: CalibrationKind = "lens" if row.kind == "lens" else "rig"
    return CalibrationRecord(
        row.key,
        kind,
        row.camera_key,
        row.tag_set_key,
        row.result,
        numbers.reshape(side, side),
        row.inputs,
        row.at,
        row.by,
    )
