"""How well cameras over a tank know a robot, on corners drawn with stated noise, beside the thesis.

Tanks are drawn when this runs: survey 2 mm and 0.3 deg, level 5 mm, index 0.0005, lenses as twenty
boards tell them, tags glued on to 0.3 mm and 0.2 deg, an edge error common to all tags. No picture
is drawn: what a detector does to corners is their noise here. Positions are those in the tank.
"""

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from autonomy.vision.calibration.adjustment import Adjustment, adjust
from autonomy.vision.fix import Telemetry, find_robot
from autonomy.vision.rigid import Pose, turned_by_rad
from autonomy.vision.thesis_formula import formula_pose
from tests.autonomy.vision.tank import (
    LENS,
    ROBOT,
    TrueTank,
    lens_covariance,
    mounted,
    random_pose,
    see,
    see_means,
    true_tank,
)

DEPTHS_M = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.12)
TANKS, POSES = 8, 6
INSIDE_95 = 7.815


def measure() -> list[dict[str, Any]]:
    seed = int(np.random.default_rng().integers(2**31))
    covariance = lens_covariance(LENS)
    tanks: list[tuple[TrueTank, Adjustment]] = []
    for i in range(TANKS):
        tank = true_tank(seed + i, covariance)
        found = adjust(
            tank.told_cameras, tank.lens_covariances, tank.told_layout, see_means(tank, seed + i)
        )
        if isinstance(found, Adjustment):
            tanks.append((tank, found))
    drawn = {kind: sets(tanks, kind, seed) for kind in ("three cameras", "one camera", "one tag")}
    return [
        *by_depth(drawn["three cameras"], seed),
        *honesty(drawn),
        row(
            "One tag, one camera, telemetry: 3D mean",
            1e3 * drawn["one tag"][:, 1].mean(),
            "mm",
            8.0,
        ),
        row("One tag, one camera, telemetry: turned over", turned(drawn["one tag"]), "", 0.0),
        row("Fusion of three cameras, from nothing", speed_ms(tanks[0]), "ms", 5.0),
    ]


def sets(tanks: list[tuple[TrueTank, Adjustment]], kind: str, seed: int) -> Any:
    """Return rows of depth, error m, NEES, heading error rad, turn rad, error of the formula m."""
    rows: list[tuple[float, ...]] = []
    rng = np.random.default_rng(seed)
    for tank, calibration in tanks:
        water = {"level_m": tank.level_m, "index": tank.index}
        floor = see(tank.cameras, tank.tags, Pose.identity(), rng, **water)
        for depth in DEPTHS_M * POSES:
            pose = random_pose(rng, depth + tank.level_m)
            tags = mounted(ROBOT, rng, 0.0003, 0.2).tags
            seen = see(tank.cameras, tags, pose, rng, least_side_px=14.0, **water)
            telemetry = None
            if kind != "three cameras":
                name = tank.cameras[int(rng.integers(3))].name
                seen = [s for s in seen if s.camera == name]
            if len(seen) < 2:
                continue
            if kind == "one tag":
                seen = [seen[int(rng.integers(len(seen)))]]
                roll, pitch, _ = pose.angles_rad
                tilt = roll + rng.normal(0.0, 0.035), pitch + rng.normal(0.0, 0.035)
                telemetry = Telemetry.of_tilt(*tilt, depth + rng.normal(0.0, 0.005))
            fix = find_robot(calibration.rig, ROBOT.tags, seen, telemetry=telemetry)
            off = fix.pose.position_m - pose.position_m
            under = fix.position_ned_m - [*pose.position_m[:2], depth]
            nees = float(under @ np.linalg.solve(fix.position_covariance, under))
            heading = fix.pose.angles_rad[2] - pose.angles_rad[2]
            formula = formula_pose(calibration.rig, tank.told_layout, ROBOT, [*seen, *floor])
            theirs = (
                np.nan if formula is None else np.linalg.norm(formula.position_m - pose.position_m)
            )
            rows.append(
                (
                    depth,
                    float(np.linalg.norm(off)),
                    nees,
                    abs((heading + np.pi) % (2.0 * np.pi) - np.pi),
                    turned_by_rad(fix.pose.rotation, pose.rotation),
                    float(theirs),
                )
            )
    return np.array(rows)


def by_depth(rows: Any, seed: int) -> Iterator[dict[str, Any]]:
    for depth in DEPTHS_M:
        at = rows[rows[:, 0] == depth]
        name = f"Three cameras at {depth:.2f} m (seed {seed}): 3D"
        yield row(f"{name} mean", 1e3 * at[:, 1].mean(), "mm", 3.0)
        yield row(f"{name} p95", 1e3 * np.percentile(at[:, 1], 95), "mm", 8.0)
        yield row(f"{name} mean by the thesis's formula", 1e3 * np.nanmean(at[:, 5]), "mm", None)
    better = np.nanmean(rows[:, 5]) / rows[:, 1].mean()
    yield {
        **row("Times better than the thesis's formula", better, "", 10.0),
        "met": bool(better >= 10.0),
    }
    heading = np.degrees(np.percentile(rows[:, 3], 95))
    yield row("Three cameras: heading p95", heading, "deg", 0.5)


def honesty(drawn: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for kind, rows in drawn.items():
        nees, inside = rows[:, 2].mean(), (rows[:, 2] <= INSIDE_95).mean()
        one = row(f"NEES of the position, {kind} (3 is right)", nees, "", 4.5)
        yield {**one, "met": bool(1.0 <= nees <= 4.5)}
        share = row(f"Fixes inside their 95 % region, {kind}", inside, "", 0.9)
        yield {**share, "met": bool(inside >= 0.9)}


def turned(rows: Any) -> float:
    return float((rows[:, 4] > np.radians(15.0)).mean())


def speed_ms(tank: tuple[TrueTank, Adjustment]) -> float:
    rng = np.random.default_rng(0)
    seen = see(tank[0].cameras, ROBOT.tags, random_pose(rng, 0.5), rng)
    taken: list[float] = []
    for _ in range(50):
        begun = time.process_time()
        find_robot(tank[1].rig, ROBOT.tags, seen)
        taken.append(time.process_time() - begun)
    return 1e3 * float(np.median(taken))


def row(name: str, value: float, unit: str, bar: float | None) -> dict[str, Any]:
    return {
        "area": "camera_fix",
        "name": name,
        "value": float(value),
        "unit": unit,
        "bar": bar,
        "met": None if bar is None else bool(value <= bar),
    }
