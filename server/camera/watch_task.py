"""What the fixed tags tell of cameras and water, worked out in a worker process.

The level is sought first: tags under water look to be elsewhere where it is another one. Cameras
that disagree on it may have moved; then those that still are where they were tell it.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.calibration.adjustment import averaged
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.calibration.watch import WATCH_PX, CameraStand, camera_stands
from autonomy.vision.calibration.water_level import (
    LevelFit,
    fit_level,
    ripple_slope_rad,
)
from autonomy.vision.camera import Rig
from autonomy.vision.constants import GREATEST_SPREAD_M
from autonomy.vision.fix import Sighting
from autonomy.vision.rigid import Pose
from autonomy.vision.sight import sights
from autonomy.vision.tag import Layout
from server.camera.task import LevelFound, StandFound, Watched, WatchProblem
from server.camera.vision import rig_of, sightings_of


def watch(
    problem: WatchProblem,
    report: Callable[[object], None],
    is_cancelled: Callable[[], bool],
) -> Watched:
    """Hold what cameras see of the fixed tags against their calibration."""
    del report, is_cancelled
    at_now, layout = rig_of(problem.used), problem.layout
    calibrated = replace(problem.used, level_m=problem.used.result["level_m"])
    at_calibration = rig_of(calibrated)
    newest, longer = sightings_of(problem.newest), sightings_of(problem.longer)
    trusted = {camera.name for camera in at_now.cameras} - problem.left_out
    fit = _level(at_calibration, layout, longer, trusted)
    if fit is not None and _spread_m(fit) > GREATEST_SPREAD_M:
        stands = camera_stands(at_now, layout, newest)
        trusted &= {stand.camera for stand in stands if stand.shift_px <= WATCH_PX}
        fit = _level(at_calibration, layout, longer, trusted)
    rig = at_now
    if fit is not None and _spread_m(fit) <= GREATEST_SPREAD_M:
        rig = at_calibration.at_new_level(fit.level_m, fit.std_m)
    stands = camera_stands(rig, layout, newest)
    means = averaged(newest)
    return Watched(
        {stand.camera: _stand(rig, layout, means, stand) for stand in stands},
        None
        if fit is None
        else LevelFound(fit.level_m, fit.std_m, fit.change_m, _spread_m(fit), len(fit.by_camera_m)),
        ripple_slope_rad(rig, layout, [one for one in longer if one.camera in trusted]),
    )


def _level(
    rig: Rig, layout: Layout, sightings: Sequence[Sighting], trusted: Collection[str]
) -> LevelFit | None:
    found = fit_level(rig, layout, averaged([one for one in sightings if one.camera in trusted]))
    return None if isinstance(found, Refusal) else found


def _spread_m(fit: LevelFit) -> float:
    return max(fit.by_camera_m.values()) - min(fit.by_camera_m.values())


def _stand(rig: Rig, layout: Layout, means: Sequence[Sighting], stand: CameraStand) -> StandFound:
    off = {
        one.tag_id: (float(shift[0]), float(shift[1]))
        for one in means
        if one.camera == stand.camera
        and layout.tag(one.tag_id) is not None
        and np.isfinite(shift := _off_px(rig, layout, one)).all()
    }
    return StandFound(len(off), stand.shift_px, stand.turned_deg, stand.moved_m, off)


def _off_px(rig: Rig, layout: Layout, seen: Sighting) -> FloatArray:
    """Return how far a fixed tag is from where it should be, mean over its corners, px."""
    tag, number = layout.tag(seen.tag_id), rig.number(seen.camera)
    if tag is None or number is None:
        return np.full(2, np.nan)
    numbers = np.array([number], dtype=np.int64)
    due = sights(
        rig.packed, numbers, [Pose.identity()], tag.corners_m[None], rig.level_m, rig.index
    ).pixels[0]
    return (seen.corners_px - due).mean(axis=0)
