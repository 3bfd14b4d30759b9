"""Whether cameras still are where the calibration left them, by the fixed tags that they see."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from autonomy.vision.camera import Rig
from autonomy.vision.fix import Sighting, sighting_fault
from autonomy.vision.rigid import Pose
from autonomy.vision.sight import sights
from autonomy.vision.tag import Layout

WATCH_PX, LEFT_OUT_PX = 0.7, 2.0
"""Shift from which on somebody is told, and from which on the camera's sightings are not used."""
OVER_S = 3.0
"""The shift is a median over so long."""
FEWEST_TAGS = 3

Stand = Literal["holds", "moved", "left_out", "unknown"]


@dataclass(frozen=True, slots=True)
class CameraStand:
    """Whether one camera still is where it was."""

    camera: str
    stand: Stand
    shift_px: float
    """Median over the tags of how far each is from where it should be; 0 where that is unknown."""
    turned_deg: float
    """Turn that would shift the picture so far."""
    moved_m: float
    """Move that would."""
    sentence: str = ""


def camera_stands(
    rig: Rig, layout: Layout, sightings: Sequence[Sighting]
) -> tuple[CameraStand, ...]:
    """Hold what cameras see of the fixed tags against where the calibration left these.

    Args:
        rig: Calibrated cameras, at the level of now.
        layout: Tags where the calibration found them.
        sightings: Of the last 3 s.
    """
    return tuple(_stand(rig, layout, sightings, i) for i in range(len(rig.cameras)))


def _stand(rig: Rig, layout: Layout, sightings: Sequence[Sighting], number: int) -> CameraStand:
    camera = rig.cameras[number]
    seen: dict[int, list[Sighting]] = {}
    for sighting in sightings:
        is_fixed = sighting.camera == camera.name and layout.tag(sighting.tag_id) is not None
        if is_fixed and sighting_fault(sighting, rig) is None:
            seen.setdefault(sighting.tag_id, []).append(sighting)
    tags = [tag for tag in layout.tags if tag.id in seen]
    if len(tags) < FEWEST_TAGS:
        said = f"{camera.name} sees {len(tags)} fixed tags: nobody knows whether it has moved"
        return CameraStand(camera.name, "unknown", 0.0, 0.0, 0.0, said)
    corners = np.array([tag.corners_m for tag in tags])
    numbers = np.full(len(tags), number, dtype=np.int64)
    carriers = [Pose.identity()] * len(tags)
    due = sights(rig.packed, numbers, carriers, corners, rig.level_m, rig.index).pixels
    shifts, ways = np.zeros(len(tags)), np.zeros(len(tags))
    for i, tag in enumerate(tags):
        off = np.array([s.corners_px - due[i] for s in seen[tag.id]]).mean(axis=1)
        shifts[i] = np.linalg.norm(np.median(off, axis=0))
        ways[i] = np.linalg.norm(np.array(tag.position_m) - camera.pose.position_m)
    shift = float(np.median(shifts))
    focal = sum(camera.lens.focal_px) / 2.0
    turned, moved = math.degrees(shift / focal), shift / focal * float(np.median(ways))
    if not shift > WATCH_PX:
        return CameraStand(camera.name, "holds", shift, turned, moved)
    said = f"{camera.name} has moved, by about {turned:.1f} deg or {1e3 * moved:.0f} mm"
    if not shift > LEFT_OUT_PX:
        return CameraStand(camera.name, "moved", shift, turned, moved, said)
    said += "; it is left out until it is adjusted again"
    return CameraStand(camera.name, "left_out", shift, turned, moved, said)
