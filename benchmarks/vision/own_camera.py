"""How far a robot's own camera is off under water, by how the window before its lens is treated.

Cameras, windows, surveys and mounts are drawn when this runs: lens as twenty boards tell it, window
2 mm elsewhere, index 0.0005, tags surveyed to 2 mm and 0.3 deg. The camera looks at two tags of
15 cm on a wall. No picture is drawn: what a detector does to corners is their noise here. Errors
are of the camera's position; the robot's tilt (0.6 deg) and depth (5 mm) are rows. The lens of the
air, which the product refuses, is taken here as if it had been fitted under water.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from autonomy.vision.calibration.lens_fit import LensCalibration
from autonomy.vision.fix import Fix
from autonomy.vision.onboard.own_camera import OwnCamera, lens_under_water
from autonomy.vision.onboard.own_fix import TankWater, find_self
from tests.autonomy.vision.own_camera_tank import (
    LAYOUT,
    LENS,
    TrueEye,
    drawn_eyes,
    facing_wall,
    look,
    said_by,
    wet_board_views,
)

DISTANCES_M = (0.5, 1.0, 1.5, 2.0, 3.0)
EYES, BOARDS, FITTED = 60, 20, 6
BAR_AT_M, BAR_MM = 2.0, 15.0
PAIR = (100, 101)


Told = list[tuple[TrueEye, OwnCamera]]
"""Cameras as they are, and as they are told."""


def measure() -> list[dict[str, Any]]:
    seed = int(np.random.default_rng().integers(2**31))
    eyes = drawn_eyes(EYES, seed)
    right = [(eye, eye.told) for eye in eyes]
    bare = [(eye, replace(eye.told, measured_in="water", port=None)) for eye in eyes]
    salty = [(eye, replace(eye.told, index=eye.told.index + 0.01)) for eye in eyes]
    return [
        *rows("lens of the air", bare, seed),
        *rows("pinhole fitted under water", fitted(eyes[:FITTED], seed), seed),
        *rows("port model", right, seed, bar=True),
        *rows("port model, index 0.01 wrong", salty, seed),
    ]


def fitted(eyes: list[TrueEye], seed: int) -> Told:
    """Return cameras with the pinholes that boards under water tell of them."""
    told: Told = []
    for i, eye in enumerate(eyes):
        views = wet_board_views(eye, BOARDS, seed + i)
        found = lens_under_water(LENS.width_px, LENS.height_px, views)
        if isinstance(found, LensCalibration):
            mount = eye.told.mount
            told.append((eye, OwnCamera(found.lens, "water", mount, None, found.covariance)))
    return told


def rows(
    name: str,
    cameras: Told,
    seed: int,
    *,
    bar: bool = False,
) -> Iterator[dict[str, Any]]:
    """Tell the error of the camera's position at each distance, mean and p95."""
    for distance_m in DISTANCES_M:
        rng = np.random.default_rng([seed, int(10 * distance_m)])
        errors: list[float] = []
        for eye, camera in cameras:
            body = facing_wall(rng, distance_m)
            seen = look(eye, body, rng, ids=PAIR)
            fix = find_self(camera, LAYOUT, TankWater(), seen, telemetry=said_by(body, rng))
            if isinstance(fix, Fix):
                there = (fix.pose @ camera.mount.pose.inverse).position_m
                truth = (body @ eye.mount.pose.inverse).position_m
                errors.append(1e3 * float(np.linalg.norm(there - truth)))
        is_barred = bar and distance_m == BAR_AT_M
        title = f"Own camera, {name}, at {distance_m:g} m"
        yield row(f"{title} (seed {seed}): mean", np.mean(errors), BAR_MM if is_barred else None)
        yield row(f"{title}: p95", np.quantile(errors, 0.95), None)


def row(name: str, value: Any, bar: float | None) -> dict[str, Any]:
    return {
        "area": "own_camera",
        "name": name,
        "value": float(value),
        "unit": "mm",
        "bar": bar,
        "met": None if bar is None else bool(value <= bar),
    }
