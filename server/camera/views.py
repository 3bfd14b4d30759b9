"""What REST tells of a camera, put together from all that is known of it."""

import math
from collections.abc import Iterable

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.constants import CAMERA_ERRORS
from autonomy.vision.tag import LATENCY_IDS
from db.identity import public_id
from db.query.camera.calibrations import CalibrationRecord
from db.query.camera.cameras import CameraRecord
from db.record import same
from server.camera.calibrations import CALIBRATION, lens_size
from server.camera.rig import CameraRig
from server.camera.status import CameraStatus
from server.camera.view import (
    CalibrationView,
    CameraPlaceView,
    CameraView,
    LensView,
    Place,
    SetUpStep,
)

_COEFFICIENTS = {"pinhole": 5, "fisheye": 4}


def camera_view(
    record: CameraRecord,
    status: CameraStatus,
    lens: CalibrationRecord | None,
    rig: CameraRig,
    *,
    has_account: bool,
) -> CameraView:
    """Return one camera as REST shows it."""
    report, sighting, stand = status.report, status.sighting, status.stand
    ids = [] if sighting is None else sorted(tag.id for tag in sighting.tags)
    place = _place(rig, record.id)
    step, missing = _step(record, rig, is_placed=place is not None)
    words = status.words or _size_fault(status, lens)
    refused = dict(status.refused)
    for reason, count in ({} if report is None else report.refused).items():
        refused[reason] = refused.get(reason, 0) + count
    return same(
        CameraView,
        record,
        has_account=has_account,
        step=step,
        missing=missing,
        state=status.state,
        words=words,
        size=status.size,
        frames_per_s=0.0 if report is None else report.frames_per_s,
        pictures=0 if report is None else report.pictures,
        dropped=0 if report is None else report.dropped,
        refused=refused,
        restarts=status.restarts,
        seen_at=status.seen_at,
        tags=ids,
        strangers=[one for one in ids if one not in LATENCY_IDS and rig.registry.is_stranger(one)],
        blur_px=status.blur_px,
        advice=status.advice,
        stand=stand.stand,
        shift_px=stand.shift_px,
        moved=stand.sentence,
        is_used=rig.rig is not None and record.id in rig.rig.cameras,
        lens=None if lens is None else _lens_view(lens),
        place=place,
    )


def calibration_view(
    record: CalibrationRecord, *, is_used: bool, is_usable: bool
) -> CalibrationView:
    """Return a calibration as a history shows it."""
    return CalibrationView(
        public_id(CALIBRATION, record.key),
        record.kind,
        record.at,
        record.by,
        _summary(record),
        is_used=is_used,
        is_usable=is_usable,
    )


def _summary(record: CalibrationRecord) -> str:
    if record.kind == "lens":
        share = 100.0 * record.result["focal_std_share"]
        return (
            f"focal length to {share:.2f} %, corners within {record.result['rms_px']:.2f} px, "
            f"of {len(record.result['views'])} pictures"
        )
    names = [camera["id"] for camera in record.result["cameras"]]
    worst = max(_worst_std_m(record.covariance, CAMERA_ERRORS * i, 3) for i in range(len(names)))
    return f"{', '.join(names)} within {1e3 * worst:.0f} mm, rms {record.result['rms']:.1f}"


def _step(record: CameraRecord, rig: CameraRig, *, is_placed: bool) -> tuple[SetUpStep, str]:
    if record.lens_key is None:
        return "lens", "Show it the board, then calibrate its lens."
    if not rig.registry.layout.tags:
        return "tags", "Tell where the fixed tags of the tank are."
    if not is_placed:
        return "pose", "Adjust the cameras: it is not placed yet."
    if rig.lens_key(record.id) not in {None, record.lens_key}:
        return "pose", "Adjust the cameras: its place rests on another calibration of its lens."
    return "done", ""


def _size_fault(status: CameraStatus, lens: CalibrationRecord | None) -> str:
    """Return what is wrong with the size of a camera's pictures, empty where nothing is."""
    if lens is None or status.size is None or lens_size(lens) == status.size:
        return ""
    (width, height), (now_width, now_height) = lens_size(lens), status.size
    return f"Calibrated for {width} x {height}, sends {now_width} x {now_height}."


def _lens_view(record: CalibrationRecord) -> LensView:
    lens = record.result["lens"]
    fx, fy, cx, cy, *distortion = lens["parameters"]
    return LensView(
        public_id(CALIBRATION, record.key),
        lens["kind"],
        (lens["width_px"], lens["height_px"]),
        (fx, fy),
        (cx, cy),
        distortion[: _COEFFICIENTS[lens["kind"]]],
        record.result["rms_px"],
        record.result["focal_std_share"],
        record.at,
    )


def _place(rig: CameraRig, name: str) -> CameraPlaceView | None:
    whole = rig.calibrated
    if whole is None or name not in whole.cameras:
        return None
    every = whole.result["cameras"]
    number = next(i for i, one in enumerate(every) if one["id"] == name)
    camera, first = every[number], CAMERA_ERRORS * number
    rotation = np.array(camera["rotation"])
    return CameraPlaceView(
        _triple(camera["position_m"]),
        (_triple(rotation[0]), _triple(rotation[1]), _triple(rotation[2])),
        [_triple(rotation @ ray) for ray in np.array(camera["corner_rays"])],
        _worst_std_m(whole.covariance, first, 3),
        math.degrees(_worst_std_m(whole.covariance, first + 3, 3)),
    )


def _worst_std_m(covariance: FloatArray, first: int, count: int) -> float:
    part = np.diag(covariance)[first : first + count]
    return math.sqrt(max(float(part.max()), 0.0))


def _triple(values: Iterable[float]) -> Place:
    x, y, z = map(float, values)
    return x, y, z
