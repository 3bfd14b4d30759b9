"""Whether a bumped camera and another water level are noticed in drawn pictures, and nothing else.

A laboratory is drawn when this runs and calibrated by its own drawn pictures. Then its fixed tags
are watched in one whole picture of each camera a second, as the station watches them, faster than
life: ten minutes of calm, ten minutes of ripples, bumps about drawn axes, and other levels.
"""

import math
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from benchmarks.vision.picture import Laboratory, laboratory, sent
from robot_link.camera.config import CameraConfig
from robot_link.camera.detector import TagDetector
from robot_link.camera.sighting import Sighting
from server.camera.task import Watched, WatchProblem
from server.camera.used_rig import UsedRig
from server.camera.vision import adjustment_document, with_exact
from server.camera.watch import LONGER, NEWEST
from server.camera.watch_task import watch
from simulator.camera.painter import Painter
from simulator.camera.scene import Scene

CALM_S, BUMPS, BEFORE_S, AFTER_S, LEVEL_S = 600, 4, 4, 8, 12
BAR_S, BAR_LEVEL_MM = 5.0, 2.0
_EPOCH = datetime(2026, 5, 1, tzinfo=UTC)


class Watcher:
    """Sees the fixed tags of a laboratory once a second, and holds them against its calibration."""

    def __init__(self, lab: Laboratory) -> None:
        found, rig = lab.calibration, lab.calibration.rig
        names = tuple(camera.name for camera in rig.cameras)
        covariance = with_exact(rig)
        document = adjustment_document(found, {name: i for i, name in enumerate(names)})
        self._used = UsedRig(1, document, covariance, names, rig.level_m)
        self._layout = found.layout
        self._detector = TagDetector(lab.scene.sensor.gamma)
        self._seen: deque[tuple[datetime, Sighting]] = deque()
        self._second = 0

    def see(self, painters: Mapping[str, Painter]) -> Watched:
        """Take a picture with each camera, and judge."""
        at = _EPOCH + timedelta(seconds=self._second)
        self._second += 1
        for name, painter in painters.items():
            grey = sent(painter, painter.picture(float(self._second)))
            rows, columns = grey.shape
            tags = self._detector.find(grey, decimate=1.0).tags
            size = (columns, rows)
            self._seen.append((at, Sighting(name, self._second, at, at, size, "whole", tags)))
        while at - self._seen[0][0] > LONGER:
            self._seen.popleft()
        newest = tuple(one for when, one in self._seen if at - when <= NEWEST)
        longer = tuple(one for _, one in self._seen)
        problem = WatchProblem(self._used, self._layout, newest, longer, frozenset())
        return watch(problem, lambda _: None, lambda: False)


def painters_of(scene: Scene) -> dict[str, Painter]:
    return {camera.name: Painter(scene, camera) for camera in scene.cameras}


def measure() -> list[dict[str, Any]]:
    seed = int(np.random.default_rng().integers(2**31))
    lab = laboratory(seed)
    rng = np.random.default_rng([seed, 3])
    rippled = replace(lab.scene, ripple_slope_rad=math.radians(0.25))
    return [
        *quiet(f"Calm (seed {seed})", lab, lab.scene),
        *quiet("Ripples of 0.25 deg", lab, rippled),
        *bumps(lab, rng),
        *levels(lab),
    ]


def quiet(name: str, lab: Laboratory, scene: Scene) -> Iterator[dict[str, Any]]:
    """Count the seconds in which a camera that hangs still is told to have moved."""
    limit_px = CameraConfig().moved_px
    watcher, painters = Watcher(lab), painters_of(scene)
    shifts = [
        max(stand.shift_px for stand in watcher.see(painters).stands.values())
        for _ in range(CALM_S)
    ]
    false = sum(shift > limit_px for shift in shifts)
    yield row(f"{name}: seconds with a false alarm of {CALM_S}", false, "s", 0.0)
    yield row(f"{name}: greatest shift", max(shifts), "px")


def bumps(lab: Laboratory, rng: np.random.Generator) -> Iterator[dict[str, Any]]:
    """Bump cameras in drawn directions; the longest time until somebody is told is the figure."""
    config = CameraConfig()
    for name, turn_deg, shift_m, limit_px in (
        ("0.1 deg: told after, at most", 0.1, 0.0, config.moved_px),
        ("5 mm: told after, at most", 0.0, 0.005, config.moved_px),
        ("0.25 deg: left out after, at most", 0.25, 0.0, config.left_out_px),
    ):
        waited = [bumped(lab, rng, turn_deg, shift_m, limit_px) for _ in range(BUMPS)]
        yield row(f"Bump of {name}", max(waited), "s", BAR_S)


def bumped(
    lab: Laboratory, rng: np.random.Generator, turn_deg: float, shift_m: float, limit_px: float
) -> float:
    """Return how many seconds after a bump its camera is past a limit; infinity if never."""
    watcher, painters = Watcher(lab), painters_of(lab.scene)
    for _ in range(BEFORE_S):
        watcher.see(painters)
    name = str(rng.choice(list(painters)))
    camera = lab.scene.camera(name)
    pose = camera.pose.moved(shift_m * sideways(rng), math.radians(turn_deg) * sideways(rng))
    painters[name] = Painter(lab.scene, replace(camera, pose=pose))
    for second in range(1, AFTER_S + 1):
        if watcher.see(painters).stands[name].shift_px > limit_px:
            return second
    return math.inf


def sideways(rng: np.random.Generator) -> FloatArray:
    """Return a drawn direction across the optical axis, of length 1."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def levels(lab: Laboratory) -> Iterator[dict[str, Any]]:
    """Let water in and out."""
    for change_m in (-0.02, -0.01, 0.01):
        scene = replace(lab.scene, level_m=lab.scene.level_m + change_m)
        watcher, painters = Watcher(lab), painters_of(scene)
        found = None
        for _ in range(LEVEL_S):
            found = watcher.see(painters).level
        off = math.inf if found is None else abs(found.change_m - change_m)
        name = f"Level by {100 * change_m:+.0f} cm: found it off by"
        yield row(name, 1e3 * off, "mm", BAR_LEVEL_MM)


def row(name: str, value: float, unit: str, bar: float | None = None) -> dict[str, Any]:
    return {
        "area": "camera_watch",
        "name": name,
        "value": float(value),
        "unit": unit,
        "bar": bar,
        "met": None if bar is None else bool(value <= bar),
    }
