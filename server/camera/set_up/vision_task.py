"""Calibrations, worked out in a worker process."""

from collections.abc import Callable, Sequence
from dataclasses import asdict

import numpy as np

from autonomy.vision.calibration.accuracy import accuracy_on_the_spot
from autonomy.vision.calibration.adjustment import adjust, averaged
from autonomy.vision.calibration.board import Board, BoardView, missing_views
from autonomy.vision.calibration.lens_fit import calibrate_lens
from autonomy.vision.calibration.readjustment import readjusted
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.camera import Camera
from autonomy.vision.lens import Lens
from autonomy.vision.rigid import Pose
from server.camera.task import AdjustProblem, Found, LensProblem, ReadjustProblem, Shot
from server.camera.used_rig import Document
from server.camera.vision import (
    adjustment_document,
    calibration_document,
    lens_of,
    rig_document,
    rig_of,
    sightings_document,
    sightings_of,
    with_exact,
)

Report = Callable[[object], None]
IsCancelled = Callable[[], bool]
_BOARD = Board()
_USUAL_FOCAL = 0.6
"""Focal length over the width of the picture, of a camera that nobody has calibrated."""


def missing_boards(
    problem: LensProblem, report: Report, is_cancelled: IsCancelled
) -> tuple[str, ...]:
    """Return what views of the board are missing yet, in words."""
    del report, is_cancelled
    width, height = problem.shots[0].size if problem.shots else (1280, 720)
    focal = _USUAL_FOCAL * width
    about = Lens(problem.kind, width, height, (focal, focal), (0.5 * width, 0.5 * height))
    return missing_views(_views(problem.shots), about)


def lens(problem: LensProblem, report: Report, is_cancelled: IsCancelled) -> Found | Refusal:
    """Calibrate a lens by views of the board."""
    del report, is_cancelled
    if not problem.shots:
        return Refusal("there is no picture of the board yet")
    sizes = {shot.size for shot in problem.shots}
    if len(sizes) > 1:
        return Refusal("the pictures are of different sizes; begin anew")
    ((width, height),) = sizes
    found = calibrate_lens(problem.kind, width, height, _views(problem.shots))
    if isinstance(found, Refusal):
        return found
    shots = [
        {"number": one.number, "corners": [[c.id, *c.pixel] for c in one.corners]}
        for one in problem.shots
    ]
    return Found(calibration_document(found), found.covariance, {"shots": shots})


def adjust_all(
    problem: AdjustProblem, report: Report, is_cancelled: IsCancelled
) -> Found | Refusal:
    """Place all cameras at once."""
    del report, is_cancelled
    means = averaged(sightings_of(problem.seen))
    found = adjust(
        _cameras(problem),
        [one.covariance for one in problem.cameras],
        problem.layout,
        means,
        level_m=problem.level_m,
        level_std_m=problem.level_std_m,
        index=problem.index,
    )
    if isinstance(found, Refusal):
        return found
    keys = {one.camera: one.key for one in problem.cameras}
    inputs: Document = {
        "cameras": [{"id": one.camera, "lens": one.lens} for one in problem.cameras],
        "level_m": problem.level_m,
        "level_std_m": problem.level_std_m,
        "pictures": len(problem.seen),
        "sightings": sightings_document(means),
    }
    return Found(adjustment_document(found, keys), with_exact(found.rig), inputs)


def readjust(
    problem: ReadjustProblem, report: Report, is_cancelled: IsCancelled
) -> Found | Refusal:
    """Place one camera again, the others as they are."""
    del report, is_cancelled
    means = averaged(sightings_of(problem.seen))
    found = readjusted(rig_of(problem.used), problem.layout, problem.camera, means)
    if isinstance(found, Refusal):
        return found
    before = problem.used.result
    px = {int(tag): value for tag, value in before["tag_rms_px"].items()}
    result = rig_document(found, problem.keys, problem.layout, before["rms"], px)
    inputs: Document = {
        "follows": problem.used.calibration,
        "camera": problem.camera,
        "pictures": len(problem.seen),
        "sightings": sightings_document(means),
    }
    return Found(result, with_exact(found), inputs)


def accuracy(problem: AdjustProblem, report: Report, is_cancelled: IsCancelled) -> Document:
    """Leave each fixed tag out in turn and find it by the cameras alone."""
    del report, is_cancelled
    found = accuracy_on_the_spot(
        _cameras(problem),
        [one.covariance for one in problem.cameras],
        problem.layout,
        averaged(sightings_of(problem.seen)),
        level_m=problem.level_m,
        level_std_m=problem.level_std_m,
        index=problem.index,
    )
    return asdict(found)


def _cameras(problem: AdjustProblem) -> list[Camera]:
    return [Camera(one.camera, lens_of(one.lens), Pose.identity()) for one in problem.cameras]


def _views(shots: Sequence[Shot]) -> list[BoardView]:
    return [
        BoardView(
            str(shot.number),
            _BOARD.points_m([corner.id for corner in shot.corners]),
            np.array([corner.pixel for corner in shot.corners]),
        )
        for shot in shots
    ]
