"""The ray tracing of ``trace_kernel`` in its readable form: one ray, and all things one by one."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.camera import Camera
from autonomy.vision.rigid import Pose
from simulator.camera.body import Body, Capsule, Panel
from simulator.camera.scene import Scene
from simulator.camera.trace_kernel import CAUSTIC_DEPTH_M


@dataclass(frozen=True, slots=True)
class Seen:
    """What a ray shows."""

    base: float
    """Its mean light."""
    swing: float
    """How much of that the caustics change."""


def seen_at(
    scene: Scene,
    camera: Camera,
    pixel: FloatArray,
    things: Iterable[tuple[Body, Pose]],
    slope_ne: tuple[float, float] = (0.0, 0.0),
) -> Seen:
    """Return what a camera sees at a place of its picture.

    Args:
        scene: The tank.
        camera: One that hangs over it.
        pixel: Shape ``(2,)``, px.
        things: What is in the tank, and where in NED.
        slope_ne: Slope of the surface where the ray meets it.
    """
    bodies = list(things)
    eye, ray = camera.pose.position_m, camera.pose.rotation @ camera.lens.rays(pixel)
    far, shade = _room(scene, eye, ray)
    hit, own = _nearest(scene, bodies, eye, ray)
    if hit < far or shade is not None:
        place = eye + min(hit, far) * ray
        return Seen((own if hit < far else shade or 0.0) * _light(scene, place), 0.0)
    entry = eye + far * ray
    normal = np.array([-slope_ne[0], -slope_ne[1], 1.0])
    inside = _refracted(ray, normal / np.linalg.norm(normal), scene.index)
    far, shade = _tank(scene, entry, inside)
    hit, own = _nearest(scene, bodies, entry, inside)
    if hit < far:
        far, shade = hit, own
    place = entry + far * inside
    clear = float(np.exp(-scene.lighting.haze_per_m * far))
    direct = shade * _light(scene, place) * clear
    veil = scene.lighting.haze_light * (1.0 - clear) + _glare(scene, entry, ray)
    depth = float(place[2]) - scene.level_m
    return Seen(direct + veil, direct * min(depth / CAUSTIC_DEPTH_M, 1.0))


def _refracted(ray: FloatArray, normal: FloatArray, index: float) -> FloatArray:
    """Snell's law: the part along the surface shrinks by the index."""
    along = (ray - (ray @ normal) * normal) / index
    return along + np.sqrt(1.0 - along @ along) * normal


def _light(scene: Scene, place: FloatArray) -> float:
    box = scene.water
    middle = 0.5 * np.array([box.x_min_m + box.x_max_m, box.y_min_m + box.y_max_m])
    sloped = np.array(scene.lighting.gradient_ne_per_m) @ (place[:2] - middle)
    return max(1.0 + float(sloped), 0.05)


def _glare(scene: Scene, entry: FloatArray, ray: FloatArray) -> float:
    light = scene.lighting
    to_lamp = np.array(light.lamp_ned_m) - entry
    halfway = to_lamp / np.linalg.norm(to_lamp) - ray
    tilt = np.hypot(halfway[0], halfway[1]) / halfway[2]
    width = np.hypot(light.glare_width, scene.ripple_slope_rad)
    weaker = (light.glare_width / width) ** 2
    return float(light.glare * weaker * np.exp(-0.5 * (tilt / width) ** 2))


def _room(scene: Scene, eye: FloatArray, ray: FloatArray) -> tuple[float, float | None]:
    """Return where a ray ends in air, and the shade there; None for the water."""
    shades, rim_m = scene.shades, (-scene.rim_m - eye[2]) / ray[2]
    at_rim = (eye + rim_m * ray)[:2]
    out = _out_m(scene, at_rim)
    if out > 0.15:
        return (scene.water.depth_max_m - eye[2]) / ray[2], shades.ground
    if out > 0.0:
        return rim_m, shades.rim
    level = (scene.level_m - eye[2]) / ray[2]
    if _out_m(scene, (eye + level * ray)[:2]) > 0.0:
        return rim_m + _wall(scene, at_rim, ray), shades.wall
    return level, None


def _tank(scene: Scene, place: FloatArray, ray: FloatArray) -> tuple[float, float]:
    """Return where a ray under water meets floor or wall, and the shade there."""
    floor = (scene.water.depth_max_m - place[2]) / ray[2]
    wall = _wall(scene, place[:2], ray)
    return (wall, scene.shades.wall) if wall < floor else (floor, scene.shades.floor)


def _out_m(scene: Scene, place_ne: FloatArray) -> float:
    """Return how far a place is out of the tank seen from above, negative inside."""
    box = scene.water
    sides = (box.x_min_m - place_ne[0], place_ne[0] - box.x_max_m)
    ends = (box.y_min_m - place_ne[1], place_ne[1] - box.y_max_m)
    return float(max(*sides, *ends))


def _wall(scene: Scene, place_ne: FloatArray, ray: FloatArray) -> float:
    box = scene.water
    lows, highs = np.array([box.x_min_m, box.y_min_m]), np.array([box.x_max_m, box.y_max_m])
    ahead = np.where(ray[:2] > 0.0, highs, lows)
    return float(((ahead - place_ne) / ray[:2]).min())


def _nearest(
    scene: Scene, bodies: Iterable[tuple[Body, Pose]], place: FloatArray, ray: FloatArray
) -> tuple[float, float]:
    """Return the nearest thing on a ray, infinitely far if there is none, and its shade."""
    hits = [(np.inf, 0.0)]
    for body, pose in bodies:
        back = pose.inverse
        own, way = back.of_points(place), back.rotation @ ray
        hits += [_panel(scene, panel, own, way) for panel in body.panels]
        hits += [_capsule(capsule, own, way) for capsule in body.capsules]
    return min(hits)


def _panel(scene: Scene, panel: Panel, place: FloatArray, ray: FloatArray) -> tuple[float, float]:
    sides = np.column_stack([panel.across_m, panel.down_m, -ray])
    across, down, t = np.linalg.solve(sides, place - panel.corner_m)
    if t <= 0.0 or not (0.0 <= across < 1.0 and 0.0 <= down < 1.0):
        return np.inf, 0.0
    if panel.printed is None:
        return t, panel.plain
    if np.cross(panel.across_m, panel.down_m) @ ray < 0.0:
        return t, scene.shades.back
    rows, columns = panel.printed.cells.shape
    is_white = panel.printed.cells[int(down * rows), int(across * columns)]
    return t, scene.shades.white if is_white else scene.shades.black


def _capsule(capsule: Capsule, place: FloatArray, ray: FloatArray) -> tuple[float, float]:
    """Go along the ray by the distance that is left to the hull, until none is."""
    one, other = capsule.ends_m
    t = 0.0
    for _ in range(2000):
        at = place + t * ray
        share = np.clip((at - one) @ (other - one) / ((other - one) @ (other - one)), 0.0, 1.0)
        left = float(np.linalg.norm(at - one - share * (other - one))) - capsule.radius_m
        if left < 1e-9:
            return t, capsule.shade
        if left > 50.0:
            break
        t += left
    return np.inf, 0.0
