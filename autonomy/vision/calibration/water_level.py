"""The water's level and its ripples, by fixed tags under water whose places are known."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.vision import sight_kernel as kernel
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.camera import Rig
from autonomy.vision.considered import ripple_px
from autonomy.vision.constants import GREATEST_CHANGE_M, GREATEST_SPREAD_M
from autonomy.vision.fix import Sighting, sighting_fault
from autonomy.vision.rigid import Pose
from autonomy.vision.sight import Sights, sights
from autonomy.vision.tag import Layout, Tag

TOLD_CHANGE_M = 0.005
_STEPS = 8
_SETTLED_M = 1e-7
_HUBER = 3.0
_FEWEST_PICTURES = 5

Outcome = Literal["applied", "told", "alarm"]


@dataclass(frozen=True, slots=True)
class LevelFit:
    """Where the surface is now."""

    level_m: float
    """Down coordinate of the surface."""
    std_m: float
    """Of the change since the calibration, by noise alone."""
    change_m: float
    """Since the level that the rig was told."""
    by_camera_m: dict[str, float]
    """What each camera says alone."""
    outcome: Outcome
    """Whether it may be applied by itself, and whether a person is told."""
    sentence: str


def fit_level(rig: Rig, layout: Layout, sightings: Sequence[Sighting]) -> LevelFit | Refusal:
    """Fit the water's level to the fixed tags under water, all else as it was calibrated.

    Args:
        rig: Calibrated cameras with the level that was known.
        layout: Tags where the calibration found them.
        sightings: Of the fixed tags, best means of some pictures (``adjustment.averaged``).
    """
    used, tags = _wet(rig, layout, sightings)
    if not used:
        return Refusal("no fixed tag under water is seen")
    level, std = _fitted(rig, used, tags)
    by_camera: dict[str, float] = {}
    for camera in sorted({s.camera for s in used}):
        mine = [i for i, s in enumerate(used) if s.camera == camera]
        by_camera[camera] = _fitted(rig, [used[i] for i in mine], [tags[i] for i in mine])[0]
    if not math.isfinite(level + sum(by_camera.values())):
        return Refusal("no level explains the fixed tags")
    change = level - rig.level_m
    spread = max(by_camera.values()) - min(by_camera.values())
    word = "fell" if change > 0.0 else "rose"
    said = f"the water {word} by {1e3 * abs(change):.0f} mm"
    if spread > GREATEST_SPREAD_M:
        outcome: Outcome = "alarm"
        said = f"cameras disagree on the water's level by {1e3 * spread:.0f} mm"
    elif abs(change) > GREATEST_CHANGE_M:
        outcome = "alarm"
    else:
        outcome = "told" if abs(change) >= TOLD_CHANGE_M else "applied"
    return LevelFit(level, std, change, by_camera, outcome, said)


def ripple_slope_rad(rig: Rig, layout: Layout, sightings: Sequence[Sighting]) -> float | None:
    """Return the surface's root mean square slope per axis, by the scatter of tags under water.

    Args:
        rig: Calibrated cameras and the level.
        layout: The fixed tags.
        sightings: Of single pictures over some seconds.

    Returns:
        The slope, rad, 0 where noise explains the scatter; none where too few pictures tell.
    """
    used, tags = _wet(rig, layout, sightings)
    groups: dict[tuple[str, int], list[int]] = {}
    for i, sighting in enumerate(used):
        groups.setdefault((sighting.camera, sighting.tag_id), []).append(i)
    shares, weights = 0.0, 0.0
    for members in groups.values():
        if len(members) < _FEWEST_PICTURES:
            continue
        tag, number = tags[members[0]], rig.number(used[members[0]].camera) or 0
        middles = np.array([used[i].corners_px.mean(axis=0) for i in members])
        noise = float(np.mean([used[i].sigma_px ** 2 for i in members])) / 4.0
        excess = float(middles.var(axis=0, ddof=1).mean()) - noise
        eye = rig.cameras[number].pose.position_m
        size = ripple_px(rig, number, eye, np.array(tag.position_m), 1.0)
        weight = (len(members) - 1) * size**2
        shares += weight * excess
        weights += weight * size**2
    return math.sqrt(max(shares / weights, 0.0)) if weights > 0.0 else None


def _wet(
    rig: Rig, layout: Layout, sightings: Sequence[Sighting]
) -> tuple[list[Sighting], list[Tag]]:
    """Return sightings of tags that lie under the water with all corners, and these tags."""
    used: list[Sighting] = []
    tags: list[Tag] = []
    for sighting in sightings:
        tag = layout.tag(sighting.tag_id)
        if tag is None or sighting_fault(sighting, rig) is not None:
            continue
        if tag.corners_m[:, 2].min() > rig.level_m + GREATEST_CHANGE_M:
            used.append(sighting)
            tags.append(tag)
    return used, tags


def _fitted(rig: Rig, used: Sequence[Sighting], tags: Sequence[Tag]) -> tuple[float, float]:
    """Return the level that fits best and its standard deviation; not finite where none does."""
    numbers: IntArray = np.array([rig.number(s.camera) or 0 for s in used])
    corners = np.array([tag.corners_m for tag in tags])
    measured = np.array([s.corners_px for s in used])
    sigmas = np.array([s.sigma_px for s in used])[:, None]
    level, information = rig.level_m, 0.0
    for _ in range(_STEPS):
        seen = _seen(rig, numbers, corners, level)
        off = (measured - seen.pixels).reshape(len(used), 8) / sigmas
        by_level = seen.slopes[:, :, kernel.BY_LEVEL] / sigmas
        size = np.repeat(np.linalg.norm(off.reshape(-1, 4, 2), axis=2), 2, axis=1)
        weights: FloatArray = 1.0 / np.maximum(1.0, size / _HUBER)
        information = float((weights * by_level**2).sum())
        step = float((weights * by_level * off).sum()) / max(information, 1e-12)
        level += step
        if not abs(step) > _SETTLED_M:
            break
    return level, 1.0 / math.sqrt(max(information, 1e-12))


def _seen(rig: Rig, numbers: IntArray, corners: FloatArray, level_m: float) -> Sights:
    carriers = [Pose.identity()] * len(numbers)
    return sights(rig.packed, numbers, carriers, corners, level_m, rig.index)
