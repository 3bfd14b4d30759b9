r"""Fixes: the pose of a robot from all its tags in all cameras, by one least squares.

Each corner of each tag in each picture gives a residual, the measured pixel less that at which the
pose would show it (lens, surface and edge shift included), over its noise; beyond three standard
deviations it counts less than its square (Huber). What the robot's own sensors say of down and of
its depth may be added as rows.

The covariance is :math:`P = H^{-1} + \sum_k A_k P_k A_k'`, :math:`A_k = H^{-1} J' W J_k`. The first
part is noise, and becomes less the more often one measures. The sum is over *considered* errors,
which stay as they are from fix to fix: cameras, lenses and level as calibration left them, the
index of refraction, an edge error common to all tags, ripples, and how the tags are fixed to the
robot.

Pose covariances are of north, east and the depth below the real surface (m) and of the turn about
body axes (rad), in this order.

Source:
    Schmidt, "Application of state-space methods to navigation problems", Advances in Control
    Systems 3, 1966, for considered errors; Huber, Annals of Mathematical Statistics 35, 1964.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.vision import pose_kernel as kernel
from autonomy.vision.camera import Camera, Rig
from autonomy.vision.considered import considered_root
from autonomy.vision.corner import AROUND, are_pixels, area_px2
from autonomy.vision.refraction import surface_sights
from autonomy.vision.rigid import Pose, skew, turned_by_rad
from autonomy.vision.sight import sights
from autonomy.vision.start import tag_poses
from autonomy.vision.tag import Tag

VELOCITY_STD_M_S = 0.05
"""How well the velocity is known that brings sightings of different moments together."""
TILT_STD_RAD, DEPTH_STD_M = math.radians(2.0), 0.005
LEAST_AREA_PX2 = 64.0
LEAST_SIGMA_PX, GREATEST_SIGMA_PX = 1e-4, 100.0
GREATEST_AFTER_S = 10.0
_DEEPEST_M = 1e4
_MOST_STARTS = 4
_HELD_RAD = 0.002
_NO_UNIT = 0.01
_TURNED_RAD = math.radians(5.0)
_PLAUSIBLE_RMS = 4.0
"""A guess is believed without others if it explains several views so well."""


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """One tag in one picture."""

    camera: str
    tag_id: int
    corners_px: FloatArray
    """In the order of ``tag.CORNERS``, shape ``(4, 2)``."""
    sigma_px: float
    """Noise of each coordinate."""
    after_s: float = 0.0
    """How long after the moment of the fix the picture was taken; negative where before."""


@dataclass(frozen=True, slots=True)
class Telemetry:
    """What the body that is sought says of itself, if it does."""

    down: tuple[float, float, float] | None = None
    """Direction of down in its own axes, of length 1."""
    depth_m: float | None = None
    """Below the surface of the water."""
    tilt_std_rad: float = TILT_STD_RAD
    depth_std_m: float = DEPTH_STD_M

    @classmethod
    def of_tilt(
        cls, roll_rad: float, pitch_rad: float, depth_m: float | None = None
    ) -> "Telemetry":
        """Return what a robot says that knows its roll, its pitch and perhaps its depth."""
        x, y, z = Pose.of_angles(np.zeros(3), roll_rad, pitch_rad, 0.0).rotation[2].tolist()
        return cls((x, y, z), depth_m)

    @property
    def packed(self) -> FloatArray:
        """The same for the kernel, shape ``(8,)``; what cannot be says nothing."""
        rows = np.zeros(kernel.TELEMETRY_SIZE)
        if self.down is not None and abs(math.hypot(*self.down) - 1.0) < _NO_UNIT:
            rows[kernel.HAS_DOWN : kernel.HAS_DEPTH] = 1.0, *self.down, self.tilt_std_rad
        if self.depth_m is not None and abs(self.depth_m) <= _DEEPEST_M:
            rows[kernel.HAS_DEPTH :] = 1.0, self.depth_m, self.depth_std_m
        return rows


@dataclass(frozen=True, slots=True, eq=False)
class Fix:
    """Where something is: a robot, or the camera that was sought."""

    pose: Pose
    """Takes its axes into the tank's NED, of which the nominal level is 0."""
    level_m: float
    """Down coordinate of the water's surface."""
    noise_covariance: FloatArray
    """The part that averages out, shape ``(6, 6)``."""
    considered_covariance: FloatArray
    """The part that does not; nobody may claim less."""
    tank_considered_covariance: FloatArray
    """The same for ``pose``, whose place does not follow the water, shape ``(6, 6)``."""
    by_rig: FloatArray
    """By how much ``pose`` errs the other way when the rig errs by a column of ``Rig.root``."""
    rms: float
    """Root mean square of the corners' residuals, in standard deviations."""
    margin: float
    """By how much the sum of robust squares of the best solution that is turned by more than 5 deg
    is more; infinite where there is none."""
    cameras: tuple[str, ...]
    tags: tuple[int, ...]
    has_telemetry: bool
    residuals_px: FloatArray
    """Seen less predicted, for each sighting that was used, shape ``(m, 4, 2)``."""
    used: tuple[Sighting, ...]

    @property
    def covariance(self) -> FloatArray:
        """Of ``position_ned_m`` and turn, shape ``(6, 6)``."""
        return self.noise_covariance + self.considered_covariance

    @property
    def tank_covariance(self) -> FloatArray:
        """Of ``pose``: its place in the tank's NED, and turn, shape ``(6, 6)``."""
        return self.noise_covariance + self.tank_considered_covariance

    @property
    def depth_m(self) -> float:
        """Below the real surface: what a pressure sensor means."""
        return float(self.pose.position_m[2]) - self.level_m

    @property
    def position_ned_m(self) -> FloatArray:
        """North, east and the depth below the real surface, shape ``(3,)``."""
        north, east, _ = self.pose.position_m.tolist()
        return np.array([north, east, self.depth_m])

    @property
    def position_covariance(self) -> FloatArray:
        """Of ``position_ned_m``, shape ``(3, 3)``, m^2."""
        return self.covariance[:3, :3]

    @property
    def angle_stds_rad(self) -> tuple[float, float, float]:
        """Standard deviations of roll, pitch and heading."""
        _, pitch, heading = self.pose.angles_rad
        c, s, t = math.cos(heading), math.sin(heading), math.tan(pitch)
        level = max(math.cos(pitch), 1e-6)
        by_turn = np.array([[c / level, s / level, 0.0], [-s, c, 0.0], [t * c, t * s, 1.0]])
        by_turn = by_turn @ self.pose.rotation
        variances = np.diag(by_turn @ self.covariance[3:, 3:] @ by_turn.T)
        roll, pitch_std, heading_std = np.sqrt(np.maximum(variances, 0.0)).tolist()
        return roll, pitch_std, heading_std

    def of_carrier(self, mount: Pose) -> "Fix":
        """Return the fix of what carries the camera that was sought.

        Args:
            mount: Takes the carrier's axes into the camera's.
        """
        move = np.eye(6)
        move[:3, 3:] = -self.pose.rotation @ skew(mount.position_m)
        move[3:, 3:] = mount.rotation.T
        return replace(
            self,
            pose=self.pose @ mount,
            noise_covariance=move @ self.noise_covariance @ move.T,
            considered_covariance=move @ self.considered_covariance @ move.T,
            tank_considered_covariance=move @ self.tank_considered_covariance @ move.T,
            by_rig=move @ self.by_rig,
        )


@dataclass(frozen=True, slots=True)
class NoFix:
    """Why there is none."""

    reason: str


def sighting_fault(sighting: Sighting, rig: Rig) -> str | None:
    """Return why a sighting cannot be used, if so."""
    corners, number = sighting.corners_px, rig.number(sighting.camera)
    if number is None:
        return "the camera is not calibrated"
    if not are_pixels(corners):
        return "corners are not finite"
    if not LEAST_SIGMA_PX <= sighting.sigma_px <= GREATEST_SIGMA_PX:
        return "the corners' noise is no number of pixels above 0"
    if not abs(sighting.after_s) <= GREATEST_AFTER_S:
        return "the time of the picture is not that of the fix"
    ahead = corners[AROUND] - corners
    turning = ahead[:, 0] * ahead[AROUND, 1] - ahead[:, 1] * ahead[AROUND, 0]
    if not (turning > 0.0).all():
        return "corners are not convex, or the print is mirrored"
    if area_px2(corners) < LEAST_AREA_PX2:
        return "the tag is too small in the picture"
    camera = rig.cameras[number]
    if camera.port is None and camera.pose.position_m[2] >= rig.level_m:
        return "the camera is under water"
    return None


def find_robot(
    rig: Rig,
    tags: Sequence[Tag],
    sightings: Sequence[Sighting],
    *,
    guess: Pose | None = None,
    velocity_ned_m_s: Sequence[float] | FloatArray = (0.0, 0.0, 0.0),
    velocity_std_m_s: float = VELOCITY_STD_M_S,
    telemetry: Telemetry | None = None,
) -> Fix | NoFix:
    """Find the pose of what carries tags: a robot, or a fixed tag alone.

    Args:
        rig: Calibrated cameras and the water.
        tags: Of the carrier, in its axes.
        sightings: Of one moment, within 60 ms; wrong ones and those of other tags are passed over.
        guess: Where it should be, if that is known.
        velocity_ned_m_s: With which it moves meanwhile.
        velocity_std_m_s: How well that is known, per axis.
        telemetry: What it says of itself.

    Returns:
        The fix, yet unjudged (``quality.judge``), or why there is none.
    """
    known = {tag.id: tag for tag in tags}
    used = [s for s in sightings if s.tag_id in known and sighting_fault(s, rig) is None]
    if not used:
        return NoFix(_why_none(rig, known, sightings))
    shown = [known[s.tag_id] for s in used]
    velocity = np.array(velocity_ned_m_s, dtype=np.float64)
    search = _Search(rig, used, shown, velocity, velocity_std_m_s, telemetry, seeks_eye=False)
    several = len({s.camera for s in used}) > 1 or len(known.keys() & {s.tag_id for s in used}) > 1
    if guess is not None and several:
        quick = search.solved([guess])
        if quick is not None and quick.rms <= _PLAUSIBLE_RMS:
            return quick
    starts = [] if guess is None else [guess]
    starts.extend(_carriers(rig, search.numbers, used, shown))
    return search.solved(starts) or NoFix("no pose explains what is seen")


def find_camera(
    rig: Rig,
    tags: Sequence[Tag],
    sightings: Sequence[Sighting],
    *,
    guess: Pose | None = None,
    telemetry: Telemetry | None = None,
) -> Fix | NoFix:
    """Find the pose of a camera from fixed tags.

    Args:
        rig: That camera alone, whose own pose does not matter, and the water.
        tags: In the tank's NED.
        sightings: Of the camera; those of other tags, and wrong ones, are passed over.
        guess: Where the camera should be, if that is known.
        telemetry: What the camera's carrier says, turned into camera axes.

    Returns:
        The fix of the camera, or why there is none.
    """
    (camera,) = rig.cameras
    known = {tag.id: tag for tag in tags}
    above = rig if camera.port is not None else _lifted(rig)
    used = [s for s in sightings if s.tag_id in known and sighting_fault(s, above) is None]
    if not used:
        return NoFix(_why_none(above, known, sightings))
    shown = [known[s.tag_id] for s in used]
    search = _Search(rig, used, shown, np.zeros(3), VELOCITY_STD_M_S, telemetry, seeks_eye=True)
    starts = [] if guess is None else [guess]
    for sighting, tag in zip(used, shown, strict=True):
        starts.extend(_camera_starts(camera, sighting, tag, rig))
    return search.solved(starts) or NoFix("no pose explains what is seen")


class _Search:
    """What is seen, as arrays for the kernel, and the fix that a solution becomes."""

    def __init__(
        self,
        rig: Rig,
        used: Sequence[Sighting],
        shown: Sequence[Tag],
        velocity_ned_m_s: FloatArray,
        velocity_std_m_s: float,
        telemetry: Telemetry | None,
        *,
        seeks_eye: bool,
    ) -> None:
        self._rig, self._used, self._shown = rig, tuple(used), tuple(shown)
        self._seeks_eye, self._velocity_std_m_s = seeks_eye, velocity_std_m_s
        self._velocity = velocity_ned_m_s
        self.numbers: IntArray = np.array([rig.number(s.camera) or 0 for s in used])
        self._corners = np.array([tag.corners_m for tag in shown])
        self._measured = np.array([s.corners_px for s in used], dtype=np.float64)
        self._sigmas = np.array([s.sigma_px for s in used], dtype=np.float64)
        self._after_s = np.array([s.after_s for s in used], dtype=np.float64)
        self._shifts = self._after_s[:, None] * velocity_ned_m_s
        self._telemetry = (telemetry or Telemetry()).packed

    def solved(self, starts: Sequence[Pose]) -> Fix | None:
        """Return the fix of the best start, or nothing where none of them sees all tags."""
        if not starts:
            return None
        poses = np.array([np.append(start.rotation, start.position_m) for start in starts])
        if len(poses) > _MOST_STARTS:
            costs = self._run(poses.copy(), 0)[0]
            poses = poses[np.argsort(costs, kind="stable")[:_MOST_STARTS]]
        costs, squares, normals = self._run(poses, kernel.MOST_STEPS)
        best = int(np.argmin(costs))
        if not np.isfinite(costs[best]) or not np.isfinite(poses[best]).all():
            return None
        rivals, rival_costs = poses, costs
        if len(self._used) == 1 and not self._seeks_eye:
            other = self._mirrored(poses[best])[None]
            held = self._held(other)
            poses = np.vstack([poses, other])
            costs, squares, normals = self._run(poses, kernel.MOST_STEPS)
            best = int(np.argmin(costs))
            rivals = np.vstack([poses, held])
            rival_costs = np.append(costs, self._run(held, 0)[0])
        turned = [
            turned_by_rad(rival[:9].reshape(3, 3), poses[best, :9].reshape(3, 3)) > _TURNED_RAD
            for rival in rivals
        ]
        margin = 2.0 * float(np.min(rival_costs[turned], initial=math.inf) - costs[best])
        rms = math.sqrt(float(squares[best]) / (8 * len(self._used)))
        pose = Pose(poses[best, :9].reshape(3, 3), poses[best, 9:])
        return self._fix(pose, normals[best], rms, margin)

    def _mirrored(self, pose: FloatArray) -> FloatArray:
        """Return the pose in which the one tag that is seen looks about the same.

        Its corners are mirrored at the plane through its middle across the ray.
        """
        mount = self._shown[0].pose
        tag = Pose(pose[:9].reshape(3, 3), pose[9:]) @ mount
        camera, level = self._rig.cameras[self.numbers[0]], self._rig.level_m
        eye = camera.pose.position_m
        way = tag.position_m - eye
        if camera.port is None and tag.position_m[2] > level:
            way = way - surface_sights(eye, tag.position_m, level, self._rig.index)[0]
        ray = way / np.linalg.norm(way)
        turned = tag.rotation - 2.0 * np.outer(ray, ray @ tag.rotation)
        other = Pose(turned * [1.0, 1.0, -1.0], tag.position_m) @ mount.inverse
        return np.append(other.rotation, other.position_m)

    def _held(self, pose: FloatArray) -> FloatArray:
        """Return a pose, shape ``(1, 12)``, improved in all but its tilt.

        Where noise has left no second solution, this still tells what the other tilt costs.
        """
        rows = np.zeros(kernel.TELEMETRY_SIZE)
        rows[kernel.HAS_DOWN : kernel.HAS_DEPTH] = 1.0, *pose[0, 6:9], _HELD_RAD
        held = pose.copy()
        self._run(held, kernel.MOST_STEPS, rows)
        return held

    def _run(
        self,
        poses: FloatArray,
        steps: int,
        telemetry: FloatArray | None = None,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Improve poses in place; return their costs, sums of squares and normal equations."""
        n = len(poses)
        costs, squares, normals = np.empty(n), np.empty(n), np.zeros((n, 6, 6))
        kernel.solve_into(
            poses, costs, squares, normals, steps, self._seeks_eye, self._rig.packed.copy(),
            self.numbers, self._corners, self._shifts, self._measured, self._sigmas,
            self._telemetry if telemetry is None else telemetry,
            self._rig.level_m, self._rig.index,
        )  # fmt: skip
        return costs, squares, normals

    def _fix(self, pose: Pose, H: FloatArray, rms: float, margin: float) -> Fix | None:
        cameras, carriers = self._rig.packed, [Pose.identity()] * len(self._used)
        if self._seeks_eye:
            (camera,) = self._rig.cameras
            cameras = Camera(camera.name, camera.lens, pose, camera.edge_px, camera.port).packed
            cameras = cameras[None]
        else:
            carriers = [Pose(pose.rotation, pose.position_m + shift) for shift in self._shifts]
        seen = sights(
            cameras, self.numbers, carriers, self._corners, self._rig.level_m, self._rig.index
        )
        residuals = self._measured - seen.pixels
        try:
            noise = np.linalg.inv(H)
        except np.linalg.LinAlgError:
            return None
        eyes_m = cameras[:, kernel.EYE : kernel.EDGE]
        A = noise @ self._pull(seen.slopes, residuals, eyes_m, carriers[0])
        in_tank, by_rig = A @ A.T, A[:, : self._rig.root.shape[1]].copy()
        A[2, : by_rig.shape[1]] += self._rig.root[-1]  # a depth is counted from the level
        rest = A @ A.T
        if not (np.isfinite(noise + rest).all() and (np.diag(noise) > 0.0).all()):
            return None
        return Fix(
            pose,
            self._rig.level_m,
            0.5 * (noise + noise.T),
            rest,
            in_tank,
            by_rig,
            rms,
            margin,
            tuple(sorted({s.camera for s in self._used})),
            tuple(sorted({s.tag_id for s in self._used})),
            bool(self._telemetry[kernel.HAS_DOWN] or self._telemetry[kernel.HAS_DEPTH]),
            residuals,
            self._used,
        )

    def _pull(
        self, slopes: FloatArray, residuals: FloatArray, eyes_m: FloatArray, carrier: Pose
    ) -> FloatArray:
        """Return what each considered error of one standard deviation adds to the right side."""
        root = considered_root(
            self._rig,
            self._shown,
            self.numbers,
            slopes,
            self._sigmas,
            eyes_m=eyes_m,
            carrier=carrier,
            after_s=self._after_s,
            velocity_std_m_s=self._velocity_std_m_s,
            velocity_ned_m_s=self._velocity,
            seeks_eye=self._seeks_eye,
        )
        first = kernel.EYE_PLACE if self._seeks_eye else kernel.BODY_PLACE
        own = slopes[:, :, first : first + 6]
        off = np.linalg.norm(residuals, axis=2) / self._sigmas[:, None]
        weights = 1.0 / np.maximum(1.0, off / kernel.HUBER) / self._sigmas[:, None] ** 2
        weighted = own * np.repeat(weights, 2, axis=1)[:, :, None]
        pull = np.tensordot(weighted, root, axes=((0, 1), (0, 1)))
        if self._telemetry[kernel.HAS_DEPTH] > 0.0:
            level = self._rig.root[-1]
            pull[2, : len(level)] -= level / self._telemetry[kernel.DEPTH_STD] ** 2
        return pull


def _carriers(
    rig: Rig, numbers: IntArray, sightings: Sequence[Sighting], tags: Sequence[Tag]
) -> list[Pose]:
    """Return both poses of the carrier by each tag that is seen."""
    corners = np.array([s.corners_px for s in sightings], dtype=np.float64)
    sizes = np.array([tag.size_m for tag in tags])
    turns, places = tag_poses(rig.cameras, numbers, corners, sizes, rig.level_m, rig.index)
    mounts = [tag.pose for tag in tags]
    turns = turns @ np.array([mount.rotation.T for mount in mounts])[:, None]
    offsets = np.array([mount.position_m for mount in mounts])[:, None, :, None]
    places = places - (turns @ offsets)[..., 0]
    return _poses(turns, places)


def _camera_starts(camera: Camera, sighting: Sighting, tag: Tag, rig: Rig) -> list[Pose]:
    """Return both poses of a camera by one fixed tag, put to the depth at which it looks to be."""
    level, index = rig.level_m, rig.index
    aboard = Camera(camera.name, camera.lens, Pose.identity(), port=camera.port)
    corners, sizes = sighting.corners_px[None], np.array([tag.size_m])
    there = tag.pose
    if camera.port is None and there.position_m[2] > level:
        looks = there.position_m.copy()
        looks[2] = level + (looks[2] - level) / index
        there = Pose(there.rotation, looks)
    one = np.zeros(1, dtype=np.int64)
    seen = _poses(*tag_poses((aboard,), one, corners, sizes, None, index))
    return [there @ pose.inverse for pose in seen]


def _poses(turns: FloatArray, places: FloatArray) -> list[Pose]:
    """Return those that are finite, ``(m, 2, 3, 3)`` and ``(m, 2, 3)``, as poses."""
    flat = zip(turns.reshape(-1, 3, 3), places.reshape(-1, 3), strict=True)
    return [Pose(R, t) for R, t in flat if math.isfinite(float(R.sum() + t.sum()))]


def _lifted(rig: Rig) -> Rig:
    """Return a rig whose camera is above the water, wherever that is sought."""
    (camera,) = rig.cameras
    above = Pose(camera.pose.rotation, np.array([0.0, 0.0, rig.level_m - 1.0]))
    lifted = Camera(camera.name, camera.lens, above, camera.edge_px)
    return Rig((lifted,), rig.level_m, None, rig.index)


def _why_none(rig: Rig, known: dict[int, Tag], sightings: Sequence[Sighting]) -> str:
    faults = [sighting_fault(s, rig) for s in sightings if s.tag_id in known]
    return next((fault for fault in faults if fault), "no tag of it is seen")
