"""Accuracy on the spot: each fixed tag is left out in turn and found by the cameras alone."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.calibration.adjustment import LEVEL_STD_M, adjust
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.camera import Camera
from autonomy.vision.fix import NoFix, Sighting, find_robot
from autonomy.vision.refraction import FRESH_WATER_INDEX
from autonomy.vision.tag import Layout, Tag

PLANE_M = 0.1
"""Tags whose depths differ by less are of one plane."""


@dataclass(frozen=True, slots=True)
class TagError:
    """How far a tag was found from where it was surveyed."""

    tag_id: int
    depth_m: float
    """Down coordinate of the survey."""
    error_m: float
    claimed_std_m: float
    """Root of the summed variances of the fix and of the survey, along three axes."""
    cameras: int


@dataclass(frozen=True, slots=True)
class PlaneAccuracy:
    """What cameras do at one depth."""

    depth_m: float
    tags: int
    mean_m: float
    p95_m: float
    worst_m: float
    claimed_std_m: float


@dataclass(frozen=True, slots=True)
class Accuracy:
    """What the cameras of a tank do, measured there."""

    tags: tuple[TagError, ...]
    planes: tuple[PlaneAccuracy, ...]
    left_out: tuple[str, ...]
    """Tags that could not be judged, and why."""


def accuracy_on_the_spot(
    cameras: Sequence[Camera],
    lens_covariances: Sequence[FloatArray],
    layout: Layout,
    sightings: Sequence[Sighting],
    *,
    level_m: float = 0.0,
    level_std_m: float = LEVEL_STD_M,
    index: float = FRESH_WATER_INDEX,
) -> Accuracy:
    """Leave each fixed tag out of the calibration and find it as if it were a robot.

    Arguments are those of ``adjustment.adjust``. A tag that only one camera sees is not judged.
    """
    errors: list[TagError] = []
    left_out: list[str] = []
    for tag in layout.tags:
        views = [s for s in sightings if s.tag_id == tag.id]
        if not views:
            continue
        if len({s.camera for s in views}) < 2:
            left_out.append(f"tag {tag.id}: one camera alone sees it")
            continue
        others = [s for s in sightings if s.tag_id != tag.id]
        found = adjust(
            cameras, lens_covariances, layout.without(tag.id), others,
            level_m=level_m, level_std_m=level_std_m, index=index,
        )  # fmt: skip
        if isinstance(found, Refusal):
            left_out.append(f"tag {tag.id}: without it, {found.reason}")
            continue
        alone = Tag(tag.id, tag.size_m, (0.0, 0.0, 0.0), position_std_m=0.0, angle_std_deg=0.0)
        fix = find_robot(found.rig, [alone], views)
        if isinstance(fix, NoFix):
            left_out.append(f"tag {tag.id}: {fix.reason}")
            continue
        off = float(np.linalg.norm(fix.pose.position_m - tag.position_m))
        claimed = float(np.trace(fix.tank_covariance[:3, :3])) + 3.0 * tag.place_std_m**2
        errors.append(
            TagError(tag.id, tag.position_m[2], off, math.sqrt(claimed), len(fix.cameras))
        )
    return Accuracy(tuple(errors), _by_plane(errors), tuple(left_out))


def _by_plane(errors: Sequence[TagError]) -> tuple[PlaneAccuracy, ...]:
    groups: list[list[TagError]] = []
    for error in sorted(errors, key=lambda error: error.depth_m):
        if groups and error.depth_m - groups[-1][-1].depth_m < PLANE_M:
            groups[-1].append(error)
        else:
            groups.append([error])
    return tuple(_plane(group) for group in groups)


def _plane(group: Sequence[TagError]) -> PlaneAccuracy:
    off = np.array([error.error_m for error in group])
    return PlaneAccuracy(
        float(np.mean([error.depth_m for error in group])),
        len(group),
        float(off.mean()),
        float(np.percentile(off, 95.0)),
        float(off.max()),
        math.sqrt(float(np.mean([error.claimed_std_m**2 for error in group]))),
    )
