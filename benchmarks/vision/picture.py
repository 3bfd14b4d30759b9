"""How well cameras over a tank know a robot, in drawn pictures from lens to fix, beside the thesis.

Laboratories are drawn when this runs: survey 2 mm and 0.3 deg, level 5 mm, index 0.0005, tags glued
on to 0.3 mm and 0.2 deg, lenses and cameras that nobody was told. In each, lenses are calibrated by
drawn pictures of a board, cameras by pictures of the empty tank, and robots are then found in
pictures that are JPEG 80: blur, noise, gamma, caustics and glare are in all of them. What is told
of the light's curve is right. The thesis's formula works on the same pictures, with the corners
that the AprilTag library tells.
"""

import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from autonomy.vision.calibration.adjustment import Adjustment, adjust, averaged
from autonomy.vision.calibration.board import BoardView
from autonomy.vision.calibration.lens_fit import LensCalibration, calibrate_lens
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.camera import Camera
from autonomy.vision.fix import Fix, NoFix, Sighting, Telemetry, find_robot
from autonomy.vision.quality import judge
from autonomy.vision.rigid import Pose, rotation_of, turned_by_rad
from autonomy.vision.sight import corners_seen, sights
from autonomy.vision.tag import CORNERS, Tag
from autonomy.vision.thesis_formula import formula_pose
from robot_link.camera.board import BOARD, find_board
from robot_link.camera.detector import Candidate, TagDetector, search, search_region
from robot_link.camera.sighting import Region, TagSeen
from simulator.camera.laboratory import told_bundles, told_layout, true_scene
from simulator.camera.painter import Painter
from simulator.camera.scene import Motion, Scene

ROBOT = "mini-1"
LABORATORIES, POSES = 8, 4
DEPTHS_M = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.12)
BOARDS, CALM_PICTURES = 20, 8
LEVEL_STD_M, INDEX_STD = 0.005, 0.0005
FUSED_TAGS = 5
TILT_STD_RAD, DEPTH_STD_M = float(np.radians(2.0)), 0.005
INSIDE_95 = 7.815
TURNED_OVER_RAD = float(np.radians(15.0))
MARGIN_PX = 30
AXES = np.eye(3)[:2]


@dataclass(frozen=True, eq=False)
class Laboratory:
    """A drawn laboratory, its cameras as it calibrated them, and what is wrong of that."""

    scene: Scene
    painters: tuple[Painter, ...]
    calibration: Adjustment
    lens_rms_px: float
    focal_off: float
    camera_off_m: float
    camera_off_rad: float
    ray_off_m: float
    fixed: tuple[Sighting, ...]
    """Raw corners of the fixed tags in one picture each, for the formula."""


def measure() -> list[dict[str, Any]]:
    seed = int(np.random.default_rng().integers(2**31))
    laboratories = [laboratory(seed + i) for i in range(LABORATORIES)]
    trials = [one for i, lab in enumerate(laboratories) for one in dives(lab, seed + i)]
    calm, rippled = (
        [one for one in trials if one.is_rippled is is_rippled] for is_rippled in (False, True)
    )
    return [
        *of_calibration(laboratories, seed),
        *by_depth([one for one in calm if one.kind == "three cameras"]),
        *honesty(calm),
        *alone([one for one in calm if one.kind == "one tag"]),
        p95("Ripples of 0.5 deg: 3D p95", rippled, 20.0),
        *speed(laboratories[0], seed),
    ]


def laboratory(seed: int) -> Laboratory:
    rng = np.random.default_rng([seed, 1])
    drawn = true_scene([ROBOT], seed=seed)
    level, index = rng.normal(0.0, LEVEL_STD_M), drawn.index + rng.normal(0.0, INDEX_STD)
    scene = replace(drawn, level_m=float(level), index=float(index))
    painters = tuple(Painter(scene, camera) for camera in scene.cameras)
    lenses = [lens_of(painter, rng) for painter in painters]
    told = [
        Camera(painter.camera.name, found.lens, Pose.identity())
        for painter, found in zip(painters, lenses, strict=True)
    ]
    seen = [
        one for painter in painters for _ in range(CALM_PICTURES) for one in whole(painter, rng)
    ]
    found = adjust(told, [one.covariance for one in lenses], told_layout(), averaged(seen))
    if isinstance(found, Refusal):
        raise RuntimeError(f"seed {seed}: {found.reason}")  # noqa: TRY004 - not a matter of types
    pairs = list(zip(found.rig.cameras, scene.cameras, strict=True))
    return Laboratory(
        scene,
        painters,
        found,
        max(one.rms_px for one in lenses),
        max(abs(a.lens.focal_px[0] / b.lens.focal_px[0] - 1.0) for a, b in pairs),
        max(float(np.linalg.norm(a.pose.position_m - b.pose.position_m)) for a, b in pairs),
        max(turned_by_rad(a.pose.rotation, b.pose.rotation) for a, b in pairs),
        max(ray_off_m(a, b, found, scene) for a, b in pairs),
        tuple(one for painter in painters for one in raw(painter, picture(painter, rng, {}))),
    )


def lens_of(painter: Painter, rng: np.random.Generator) -> LensCalibration:
    """Return a lens by pictures of a board, held all over the picture and tilted each way.

    A picture that the calibration names as one that does not fit is left out, as a person would.
    """
    lens = painter.camera.lens
    views: list[BoardView] = []
    while len(views) < BOARDS:
        cell = np.array([(len(views) % 4 + 0.5) / 4, (len(views) // 4 % 3 + 0.5) / 3])
        pixel = (cell + rng.uniform(-0.08, 0.08, 2)) * [lens.width_px, lens.height_px]
        ray = lens.rays(pixel[None])[0]
        turn = rotation_of(np.append(np.radians(rng.uniform(-35.0, 35.0, 2)), rng.normal(0, 0.2)))
        middle = np.array([0.5 * BOARD.squares_across, 0.5 * BOARD.squares_down, 0.0])
        place = ray / ray[2] * rng.uniform(0.45, 0.85) - turn @ (BOARD.square_m * middle)
        corners = find_board(sent(painter, painter.picture(0.0, {}, Pose(turn, place))))
        if len(corners) >= 20:
            points = BOARD.points_m([one.id for one in corners])
            pixels = np.array([one.pixel for one in corners])
            views.append(BoardView(str(len(views)), points, pixels))
    while True:
        found = calibrate_lens(lens.kind, lens.width_px, lens.height_px, views)
        if isinstance(found, LensCalibration):
            return found
        named = re.match(r"picture (\d+) does not fit", found.reason)
        if named is None:
            raise RuntimeError(found.reason)
        views = [view for view in views if view.name != named[1]]


@dataclass(frozen=True)
class Trial:
    kind: str
    is_rippled: bool
    depth_m: float
    off_m: float
    """In the tank."""
    depth_off_m: float
    """Of the depth below the surface, which errs by what the level does, too."""
    nees: float
    heading_off_rad: float
    turned_rad: float
    formula_off_m: float
    is_used: bool


def dives(lab: Laboratory, seed: int) -> Iterator[Trial]:
    rng = np.random.default_rng([seed, 2])
    rippled_scene = replace(lab.scene, ripple_slope_rad=float(np.radians(0.5)))
    rippled = [Painter(rippled_scene, camera) for camera in rippled_scene.cameras]
    for depth in DEPTHS_M * POSES:
        pose = robot_pose(lab.scene, rng, depth)
        grey = [picture(painter, rng, {ROBOT: Motion(pose)}) for painter in lab.painters]
        yield from fixes(lab, pose, depth, grey, rng)
    for depth in (0.2, 0.6, 1.0) * POSES:
        pose = robot_pose(lab.scene, rng, depth)
        grey = [picture(painter, rng, {ROBOT: Motion(pose)}) for painter in rippled]
        yield from fixes(lab, pose, depth, grey, rng, is_rippled=True)


def fixes(
    lab: Laboratory,
    pose: Pose,
    depth_m: float,
    grey: Sequence[Any],
    rng: np.random.Generator,
    *,
    is_rippled: bool = False,
) -> Iterator[Trial]:
    rig = lab.calibration.rig
    if is_rippled:
        rig = replace(rig, ripple_slope_rad=float(np.radians(0.5)))
    bundle = told_bundles([ROBOT])[0]
    found = [
        near(painter, one, pose, bundle.tags)
        for painter, one in zip(lab.painters, grey, strict=True)
    ]
    seen = [one for ours, _ in found for one in ours]
    raws = [one for _, theirs in found for one in theirs]
    formula = formula_pose(rig, told_layout(), bundle, [*raws, *lab.fixed])
    theirs = np.nan if formula is None else np.linalg.norm(formula.position_m - pose.position_m)
    roll, pitch, _ = pose.angles_rad
    tilt = roll + rng.normal(0.0, TILT_STD_RAD), pitch + rng.normal(0.0, TILT_STD_RAD)
    telemetry = Telemetry.of_tilt(*tilt, depth_m + rng.normal(0.0, DEPTH_STD_M))
    kinds: dict[str, tuple[list[Sighting], Telemetry | None]] = {"three cameras": (seen, None)}
    if not is_rippled and seen:
        one = seen[int(rng.integers(len(seen)))]
        kinds["one camera"] = [s for s in seen if s.camera == one.camera], None
        kinds["one tag"] = [one], telemetry
    for kind, (sightings, rows) in kinds.items():
        if len(sightings) < (1 if kind == "one tag" else 2):
            continue
        fix = find_robot(rig, bundle.tags, sightings, telemetry=rows)
        if not isinstance(fix, NoFix):
            yield trial(kind, fix, pose, depth_m, float(theirs), is_rippled=is_rippled)


def trial(
    kind: str, fix: Fix, pose: Pose, depth_m: float, theirs_m: float, *, is_rippled: bool
) -> Trial:
    off = fix.pose.position_m - pose.position_m
    under = fix.position_ned_m - [*pose.position_m[:2], depth_m]
    heading = fix.pose.angles_rad[2] - pose.angles_rad[2]
    return Trial(
        kind,
        is_rippled,
        depth_m,
        float(np.linalg.norm(off)),
        abs(float(under[2])),
        float(under @ np.linalg.solve(fix.position_covariance, under)),
        abs(float((heading + np.pi) % (2.0 * np.pi) - np.pi)),
        turned_by_rad(fix.pose.rotation, pose.rotation),
        theirs_m,
        judge(fix).quality == "good",
    )


def robot_pose(scene: Scene, rng: np.random.Generator, depth_m: float) -> Pose:
    """Return a pose anywhere in the tank, a hand from its walls, pitched as gliders are."""
    box = scene.water
    north = rng.uniform(box.x_min_m + 0.3, box.x_max_m - 0.3)
    east = rng.uniform(box.y_min_m + 0.3, box.y_max_m - 0.3)
    roll, pitch = np.radians([rng.normal(0.0, 3.0), rng.uniform(-37.0, 37.0)]).tolist()
    place = np.array([north, east, depth_m + scene.level_m])
    return Pose.of_angles(place, roll, pitch, float(rng.uniform(-np.pi, np.pi)))


def picture(painter: Painter, rng: np.random.Generator, robots: dict[str, Motion]) -> Any:
    return sent(painter, painter.picture(float(rng.uniform(0.0, 1000.0)), robots))


def sent(painter: Painter, grey: Any) -> Any:
    """Return a picture as it arrives: compressed."""
    return cv2.imdecode(np.frombuffer(painter.jpeg(grey), np.uint8), cv2.IMREAD_GRAYSCALE)


def whole(painter: Painter, rng: np.random.Generator) -> list[Sighting]:
    grey = picture(painter, rng, {})
    detector = TagDetector(painter.scene.sensor.gamma)
    return [sighting(painter, tag) for tag in detector.find(grey, decimate=1.0).tags]


def raw(painter: Painter, grey: Any) -> list[Sighting]:
    return [unfitted(painter, one) for one in search(grey)]


def near(
    painter: Painter, grey: Any, pose: Pose, tags: Sequence[Tag]
) -> tuple[list[Sighting], list[Sighting]]:
    """Return what is found where the robot is, by our corners and by the library's."""
    scene = painter.scene
    corners = np.vstack(
        [
            corners_seen(painter.camera, pose.of_points(tag.corners_m), scene.level_m, scene.index)
            for tag in tags
        ]
    )
    corners = corners[np.isfinite(corners).all(axis=1)]
    if not len(corners):
        return [], []
    low, high = corners.min(axis=0) - MARGIN_PX, corners.max(axis=0) + MARGIN_PX
    region = Region(*(round(float(value)) for value in (*low, *high)))
    if region.right < 0 or region.bottom < 0 or region.left >= grey.shape[1]:
        return [], []
    ids = {tag.id for tag in tags}
    ours = TagDetector(scene.sensor.gamma).find(grey, [region]).tags
    return (
        [sighting(painter, tag) for tag in ours if tag.id in ids],
        [unfitted(painter, one) for one in search_region(grey, region) if one.id in ids],
    )


def sighting(painter: Painter, tag: TagSeen) -> Sighting:
    return Sighting(painter.camera.name, tag.id, np.array(tag.corners_px), tag.sigma_px)


def unfitted(painter: Painter, one: Candidate) -> Sighting:
    return Sighting(painter.camera.name, one.id, one.corners_px, 0.3)


def ray_off_m(found: Camera, true: Camera, calibration: Adjustment, scene: Scene) -> float:
    """Return by how much rays miss places in the tank, at most, at five depths.

    The pixel at which the true camera shows a place is where the found one has another place at
    that depth; how far that is away follows from how pixels move with the place.
    """
    box, rig, worst, step = scene.water, calibration.rig, 0.0, 1e-4
    north = np.linspace(box.x_min_m + 0.1, box.x_max_m - 0.1, 9)
    east = np.linspace(box.y_min_m + 0.1, box.y_max_m - 0.1, 7)

    def found_at(places_m: Any) -> Any:
        return places_seen(found, places_m, rig.level_m, rig.index)

    for depth in np.linspace(0.0, 1.12, 5).tolist():
        places = np.array([(n, e, depth + scene.level_m) for n in north for e in east])
        theirs = places_seen(true, places, scene.level_m, scene.index)
        ours = found_at(places)
        slopes = np.stack([(found_at(places + step * axis) - ours) / step for axis in AXES], axis=2)
        is_known = np.isfinite(theirs).all(axis=1) & np.isfinite(ours).all(axis=1)
        for i in np.flatnonzero(is_known & true.lens.shows(np.nan_to_num(theirs), 8.0)):
            off = np.linalg.solve(slopes[i], theirs[i] - ours[i])
            worst = max(worst, float(np.linalg.norm(off)))
    return worst


def places_seen(camera: Camera, places_m: Any, level_m: float, index: float) -> Any:
    """Return where a camera sees points, shapes ``(n, 3)`` m and ``(n, 2)`` px.

    A point is the middle of a square of a centimetre, of which the sights are made.
    """
    count = len(places_m)
    corners = places_m[:, None, :] + 0.01 * CORNERS
    which, carriers = np.zeros(count, dtype=np.int64), [Pose.identity()] * count
    return sights(camera.packed[None], which, carriers, corners, level_m, index).pixels.mean(axis=1)


def of_calibration(labs: Sequence[Laboratory], seed: int) -> Iterator[dict[str, Any]]:
    def worst(of: Callable[[Laboratory], float]) -> float:
        return max(of(lab) for lab in labs)

    name = f"{len(labs)} laboratories (seed {seed}): worst"
    yield row(f"{name} lens rms", worst(lambda lab: lab.lens_rms_px), "px", 0.2)
    yield row(f"{name} focal length", 100.0 * worst(lambda lab: lab.focal_off), "%", 0.1)
    yield row(f"{name} place of a camera", 1e3 * worst(lambda lab: lab.camera_off_m), "mm", 8.0)
    turn = np.degrees(worst(lambda lab: lab.camera_off_rad))
    yield row(f"{name} turn of a camera", turn, "deg", 0.15)
    yield row(f"{name} ray at any depth", 1e3 * worst(lambda lab: lab.ray_off_m), "mm", 3.0)


def by_depth(trials: Sequence[Trial]) -> Iterator[dict[str, Any]]:
    for depth in DEPTHS_M:
        off = np.array([one.off_m for one in trials if one.depth_m == depth])
        theirs = np.array([one.formula_off_m for one in trials if one.depth_m == depth])
        name = f"Three cameras, calm, {depth:.2f} m: 3D"
        yield row(f"{name} mean of {len(off)}", 1e3 * off.mean(), "mm", 3.0)
        yield row(f"{name} p95", 1e3 * np.percentile(off, 95), "mm", 8.0)
        yield row(f"{name} mean by the thesis's formula", 1e3 * np.nanmean(theirs), "mm", None)
    off = np.array([one.off_m for one in trials])
    depth_off = np.array([one.depth_off_m for one in trials])
    yield row("Depth below the surface, mean error", 1e3 * depth_off.mean(), "mm", None)
    better = np.nanmean([one.formula_off_m for one in trials]) / off.mean()
    yield {
        **row("Times better than the thesis's formula, 3D", better, "", 10.0),
        "met": bool(better >= 10.0),
    }
    heading = np.degrees(np.percentile([one.heading_off_rad for one in trials], 95))
    yield row("Three cameras: heading p95", heading, "deg", 0.5)
    used = [one for one in trials if one.is_used]
    yield row("Three cameras: called good", len(used) / len(trials), "", None)
    yield row("Three cameras: turned over of those", turned(used), "", 0.0)


def alone(trials: Sequence[Trial]) -> Iterator[dict[str, Any]]:
    used = [one for one in trials if one.is_used]
    name = f"One tag, one camera, telemetry ({len(used)} of {len(trials)} good)"
    yield row(f"{name}: 3D mean", 1e3 * float(np.mean([one.off_m for one in used])), "mm", 8.0)
    yield row(f"{name}: turned over", turned(used), "", 0.0)


def honesty(trials: Sequence[Trial]) -> Iterator[dict[str, Any]]:
    for kind in ("three cameras", "one camera", "one tag"):
        nees = np.array([one.nees for one in trials if one.kind == kind and one.is_used])
        one = row(f"NEES of the position, {kind} (3 is right)", nees.mean(), "", 4.5)
        yield {**one, "met": bool(1.0 <= nees.mean() <= 4.5)}
        inside = float((nees <= INSIDE_95).mean())
        share = row(f"Fixes inside their 95 % region, {kind}", inside, "", 0.9)
        yield {**share, "met": bool(inside >= 0.9)}


def p95(name: str, trials: Sequence[Trial], bar: float) -> dict[str, Any]:
    used = [one.off_m for one in trials if one.is_used]
    whole_name = f"{name} ({len(used)} of {len(trials)} good)"
    return row(whole_name, 1e3 * float(np.percentile(used, 95)), "mm", bar)


def turned(trials: Sequence[Trial]) -> float:
    return sum(one.turned_rad > TURNED_OVER_RAD for one in trials) / len(trials)


def speed(lab: Laboratory, seed: int) -> Iterator[dict[str, Any]]:
    rng = np.random.default_rng([seed, 3])
    painter = lab.painters[1]
    yield from drawing_speed(painter, lab.scene, rng)
    bundle = told_bundles([ROBOT])[0]
    seen: list[Sighting] = []
    while len(seen) < FUSED_TAGS:
        pose = robot_pose(lab.scene, rng, 0.5)
        seen = []
        for camera in lab.painters:
            grey = picture(camera, rng, {ROBOT: Motion(pose)})
            seen += near(camera, grey, pose, bundle.tags)[0]
    taken: list[float] = []
    for _ in range(50):
        begun = time.process_time()
        find_robot(lab.calibration.rig, bundle.tags, seen)
        taken.append(time.process_time() - begun)
    name = f"Fusion from nothing, {len(seen)} tags in three cameras"
    yield row(name, 1e3 * float(np.median(taken)), "ms", 5.0)


def drawing_speed(
    painter: Painter, scene: Scene, rng: np.random.Generator
) -> Iterator[dict[str, Any]]:
    drawing: list[float] = []
    packing: list[float] = []
    for _ in range(40):
        pose = robot_pose(scene, rng, 0.4)
        begun = time.process_time()
        grey = painter.picture(float(rng.uniform(0.0, 100.0)), {ROBOT: Motion(pose)})
        drawn = time.process_time()
        painter.jpeg(grey)
        drawing.append(drawn - begun)
        packing.append(time.process_time() - drawn)
    yield row("Drawing a picture of 1280 x 720", 1e3 * float(np.median(drawing)), "ms", 12.0)
    yield row("Writing it as a JPEG", 1e3 * float(np.median(packing)), "ms", None)


def row(name: str, value: float, unit: str, bar: float | None) -> dict[str, Any]:
    return {
        "area": "camera_picture",
        "name": name,
        "value": float(value),
        "unit": unit,
        "bar": bar,
        "met": None if bar is None else bool(value <= bar),
    }
