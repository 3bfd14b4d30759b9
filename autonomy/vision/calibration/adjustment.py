"""Joint adjustment of all cameras over a tank, of the water's level and of the fixed tags.

What was known before stays in as rows: each lens with its covariance, the level, the survey of each
tag, and that edge shifts are small. The tags' survey holds the frame. What comes out is known
jointly: a camera that stands too far north sees every robot too far north.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.vision import sight_kernel as kernel
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.camera import Camera, Rig
from autonomy.vision.constants import CAMERA_ERRORS
from autonomy.vision.corner import are_pixels
from autonomy.vision.fix import GREATEST_SIGMA_PX, NoFix, Sighting, find_camera, sighting_fault
from autonomy.vision.refraction import FRESH_WATER_INDEX
from autonomy.vision.rigid import Pose, turn_of
from autonomy.vision.sight import sights
from autonomy.vision.tag import CORNERS, Layout, Tag, planes

EDGE_STD_PX = 0.3
LEVEL_STD_M = 0.005
LEAST_NOISE_PX = 0.03
"""What is left of a corner's noise however many pictures are averaged."""
FEWEST_TAGS = 4
HUBER = 4.0
GREATEST_RMS = 4.0
GREATEST_MOVE = 5.0
"""A tag that lies farther from its survey, in its standard deviations, is not where it is said."""
_SWAPPED_SHARE = 0.4
"""A corner that is so much of a side away belongs to another plate, or to a turned one."""
_MOST_STEPS = 40
_LENS, _EDGE = slice(6, 15), 15


@dataclass(frozen=True, slots=True, eq=False)
class Adjustment:
    """Calibrated cameras, and where the tags were found."""

    rig: Rig
    """With the joint covariance of cameras, lenses, edges and level."""
    layout: Layout
    """Every tag that was seen where it was found, and how well; the others as surveyed. Another
    adjustment begins with the survey, not with this."""
    rms: float
    """Root mean square residual, in standard deviations."""
    tag_rms_px: Mapping[int, float]
    """Residual of each tag that was seen."""


def averaged(sightings: Sequence[Sighting]) -> tuple[Sighting, ...]:
    """Return the mean of many pictures, one sighting for each camera and tag.

    Its noise is that of a mean, by the scatter that was seen if that is more than was claimed, and
    what no averaging takes away. Sightings without numbers are passed over.
    """
    groups: dict[tuple[str, int], list[Sighting]] = {}
    for sighting in sightings:
        if not are_pixels(sighting.corners_px) or not 0.0 < sighting.sigma_px <= GREATEST_SIGMA_PX:
            continue
        groups.setdefault((sighting.camera, sighting.tag_id), []).append(sighting)
    means: list[Sighting] = []
    for (camera, tag_id), group in sorted(groups.items()):
        corners = np.array([sighting.corners_px for sighting in group])
        claimed = math.sqrt(float(np.mean([sighting.sigma_px**2 for sighting in group])))
        seen = float(np.sqrt(corners.var(axis=0).mean()))
        noise = max(claimed, seen) / math.sqrt(len(group))
        mean = corners.mean(axis=0)
        means.append(Sighting(camera, tag_id, mean, math.hypot(noise, LEAST_NOISE_PX)))
    return tuple(means)


def adjust(
    cameras: Sequence[Camera],
    lens_covariances: Sequence[FloatArray],
    layout: Layout,
    sightings: Sequence[Sighting],
    *,
    level_m: float = 0.0,
    level_std_m: float = LEVEL_STD_M,
    index: float = FRESH_WATER_INDEX,
) -> Adjustment | Refusal:
    """Find the poses of all cameras, the level and the true places of the tags at once.

    Args:
        cameras: With their lenses; where they are is not used.
        lens_covariances: Of each camera's lens parameters, shape ``(9, 9)``; zero where exact.
        layout: The tags as surveyed, with their standard deviations.
        sightings: Means over many pictures (``averaged``).
        level_m: Down coordinate of the surface as it was read.
        level_std_m: How well it was.
        index: Index of refraction of the water.
    """
    seen = [s for s in sightings if layout.tag(s.tag_id) is not None]
    begun: list[Camera] = []
    for camera in cameras:
        mine = [s for s in seen if s.camera == camera.name]
        found = placed(camera, mine, layout, level_m, index)
        if isinstance(found, Refusal):
            return found
        begun.append(found)
    used = [s for s in seen if any(s.camera == camera.name for camera in begun)]
    problem = _Problem(begun, lens_covariances, layout, used, level_m, level_std_m, index)
    problem.run()
    return problem.judged()


def placed(
    camera: Camera, sightings: Sequence[Sighting], layout: Layout, level_m: float, index: float
) -> Camera | Refusal:
    """Return a camera where its tags put it, or why that cannot be."""
    name = camera.name
    tags = [tag for s in sightings if (tag := layout.tag(s.tag_id)) is not None]
    above = replace(camera, pose=Pose(np.eye(3), np.array([0.0, 0.0, level_m - 1.0])))
    alone = Rig((above,), level_m, index=index)
    for sighting in sightings:
        fault = sighting_fault(sighting, alone)
        if fault is not None:
            return Refusal(f"tag {sighting.tag_id} in {name}: {fault}")
    if len(tags) < FEWEST_TAGS:
        return Refusal(f"{name} sees {len(tags)} fixed tags; {FEWEST_TAGS} are needed")
    if planes(tags) < 2:
        return Refusal(
            f"{name} sees fixed tags of one plane alone: its tilt and its place cannot be told "
            "apart; it must see some on the floor and some on the dry rim"
        )
    fix = find_camera(alone, tags, sightings)
    if isinstance(fix, NoFix):
        return Refusal(f"{name} cannot be placed: {fix.reason}")
    if fix.pose.position_m[2] >= level_m:
        return Refusal(f"{name} would be under water: is the layout mirrored?")
    off = np.linalg.norm(fix.residuals_px, axis=2).max(axis=1)
    sides = [float(np.linalg.norm(s.corners_px[1] - s.corners_px[0])) for s in fix.used]
    worst = int(np.argmax(off / sides))
    if off[worst] > _SWAPPED_SHARE * sides[worst]:
        return Refusal(
            f"tag {fix.used[worst].tag_id} in {name} is {off[worst]:.0f} px from where the layout "
            "puts it: are plates swapped or turned?"
        )
    return replace(camera, pose=fix.pose)


class _Problem:
    """All unknowns while they are improved: cameras one after the other, level, tags."""

    def __init__(
        self,
        cameras: Sequence[Camera],
        lens_covariances: Sequence[FloatArray],
        layout: Layout,
        used: Sequence[Sighting],
        level_m: float,
        level_std_m: float,
        index: float,
    ) -> None:
        self._layout, self._used, self._index = layout, used, index
        ids = sorted({s.tag_id for s in used})
        self._surveyed = [tag for tag_id in ids if (tag := layout.tag(tag_id)) is not None]
        names = [camera.name for camera in cameras]
        self._numbers: IntArray = np.array([names.index(s.camera) for s in used])
        self._tag_numbers = [ids.index(s.tag_id) for s in used]
        self._measured = np.array([s.corners_px for s in used], dtype=np.float64)
        self._sigmas = np.array([s.sigma_px for s in used], dtype=np.float64)
        sizes = np.array([self._surveyed[i].size_m for i in self._tag_numbers])
        self._corners = sizes[:, None, None] * CORNERS
        self._before = list(cameras)
        self._cameras, self._level_m = list(cameras), level_m
        self._level_before_m = level_m
        self._poses = [tag.pose for tag in self._surveyed]
        self._level_at = CAMERA_ERRORS * len(cameras)
        self._size = self._level_at + 1 + 6 * len(ids)
        self._prior, self._free = self._known_before(lens_covariances, level_std_m)
        self._cost, self._rms = self._evaluate(self._cameras, self._level_m, self._poses)[:2]

    def _known_before(
        self, lens_covariances: Sequence[FloatArray], level_std_m: float
    ) -> tuple[FloatArray, BoolArray]:
        """Return the information of what was known before, and which unknowns there are."""
        prior = np.zeros((self._size, self._size))
        free = np.ones(self._size, dtype=np.bool_)
        for i, covariance in enumerate(lens_covariances):
            first = CAMERA_ERRORS * i
            unsure = np.diag(covariance) > 0.0
            free[first + 6 : first + 15] = unsure
            at = first + 6 + np.flatnonzero(unsure)
            prior[np.ix_(at, at)] = _inverse(covariance[np.ix_(unsure, unsure)])
            prior[first + _EDGE, first + _EDGE] = 1.0 / EDGE_STD_PX**2
        at_level = self._level_at
        free[at_level] = level_std_m > 0.0
        prior[at_level, at_level] = 1.0 / level_std_m**2 if level_std_m > 0.0 else 0.0
        for i, tag in enumerate(self._surveyed):
            first = at_level + 1 + 6 * i
            for j, std in enumerate((tag.place_std_m,) * 3 + (tag.turn_std_rad,) * 3):
                free[first + j] = std > 0.0
                prior[first + j, first + j] = 1.0 / std**2 if std > 0.0 else 0.0
        return prior, free

    def run(self) -> None:
        """Improve until nothing more is gained."""
        damping = 1e-6
        for _ in range(_MOST_STEPS):
            H, g = self.normal_equations()
            trial = self._moved(_solution(H, g, self._free, damping))
            cost, rms = (math.inf, math.inf) if trial is None else self._evaluate(*trial)[:2]
            if trial is not None and cost <= self._cost:
                gain = self._cost - cost
                self._cameras, self._level_m, self._poses = trial
                self._cost, self._rms = cost, rms
                damping = max(0.1 * damping, 1e-12)
                if gain < 1e-9 * (1.0 + cost):
                    break
            else:
                damping *= 10.0
                if damping > 1e8:
                    break

    def _evaluate(
        self, cameras: Sequence[Camera], level_m: float, poses: Sequence[Pose]
    ) -> tuple[float, float, FloatArray, FloatArray, FloatArray]:
        """Return cost, rms, residuals over their noise, weights, and slopes over the noise."""
        packed = np.array([camera.packed for camera in cameras])
        carriers = [poses[i] for i in self._tag_numbers]
        seen = sights(packed, self._numbers, carriers, self._corners, level_m, self._index)
        residuals = (seen.pixels - self._measured) / self._sigmas[:, None, None]
        off = np.linalg.norm(residuals, axis=2)
        if not np.isfinite(off).all():
            return math.inf, math.inf, residuals, off, seen.slopes
        robust = np.where(off <= HUBER, 0.5 * off**2, HUBER * off - 0.5 * HUBER**2)
        shift = self._from_before(cameras, level_m, poses)
        cost = float(robust.sum()) + 0.5 * float(shift @ self._prior @ shift)
        rms = math.sqrt(float((off**2).mean()) / 2.0)
        weights = 1.0 / np.maximum(1.0, off / HUBER)
        return cost, rms, residuals, weights, seen.slopes / self._sigmas[:, None, None]

    def normal_equations(self) -> tuple[FloatArray, FloatArray]:
        """Return the matrix and the right side at the present state."""
        _, _, residuals, weights, slopes = self._evaluate(self._cameras, self._level_m, self._poses)
        J = np.zeros((len(self._used), 8, self._size))
        for i, (camera, tag) in enumerate(zip(self._numbers, self._tag_numbers, strict=True)):
            first, at_tag = CAMERA_ERRORS * int(camera), self._level_at + 1 + 6 * tag
            own = slopes[i, :, kernel.EYE_PLACE : kernel.BY_LEVEL]
            J[i, :, first : first + CAMERA_ERRORS] = own
            J[i, :, self._level_at] = slopes[i, :, kernel.BY_LEVEL]
            J[i, :, at_tag : at_tag + 6] = slopes[i, :, : kernel.EYE_PLACE]
        rows = J.reshape(-1, self._size)
        weighted = rows * np.repeat(weights.ravel(), 2)[:, None]
        shift = self._from_before(self._cameras, self._level_m, self._poses)
        right = weighted.T @ residuals.ravel() + self._prior @ shift
        return weighted.T @ rows + self._prior, right

    def _from_before(
        self, cameras: Sequence[Camera], level_m: float, poses: Sequence[Pose]
    ) -> FloatArray:
        """Return how far everything is from what was known before; 0 where nothing was."""
        shift = np.zeros(self._size)
        for i, (camera, before) in enumerate(zip(cameras, self._before, strict=True)):
            first = CAMERA_ERRORS * i
            shift[first + 6 : first + 15] = camera.lens.parameters - before.lens.parameters
            shift[first + _EDGE] = camera.edge_px
        shift[self._level_at] = level_m - self._level_before_m
        for i, (pose, tag) in enumerate(zip(poses, self._surveyed, strict=True)):
            first, before = self._level_at + 1 + 6 * i, tag.pose
            shift[first : first + 3] = pose.position_m - before.position_m
            shift[first + 3 : first + 6] = turn_of(before.rotation.T @ pose.rotation)
        return shift

    def _moved(self, step: FloatArray) -> tuple[list[Camera], float, list[Pose]] | None:
        try:
            cameras = [
                camera.moved(step[CAMERA_ERRORS * i : CAMERA_ERRORS * (i + 1)])
                for i, camera in enumerate(self._cameras)
            ]
        except ValueError:
            return None
        turns = step[self._level_at + 1 :].reshape(-1, 6)
        poses = [
            pose.moved(turn[:3], turn[3:]) for pose, turn in zip(self._poses, turns, strict=True)
        ]
        return cameras, self._level_m + float(step[self._level_at]), poses

    def judged(self) -> Adjustment | Refusal:
        """Return what was found, or why it is not taken."""
        shift = self._from_before(self._cameras, self._level_m, self._poses)
        for i, tag in enumerate(self._surveyed):
            first = self._level_at + 1 + 6 * i
            moved_m = float(np.linalg.norm(shift[first : first + 3]))
            turned_rad = float(np.linalg.norm(shift[first + 3 : first + 6]))
            if moved_m > GREATEST_MOVE * tag.place_std_m + 1e-9:
                return Refusal(f"tag {tag.id} lies {1e3 * moved_m:.0f} mm from its surveyed place")
            if turned_rad > GREATEST_MOVE * tag.turn_std_rad + 1e-9:
                angle = math.degrees(turned_rad)
                return Refusal(f"tag {tag.id} is turned by {angle:.1f} deg against its survey")
        if not self._rms <= GREATEST_RMS:
            return Refusal(f"cameras and tags do not fit together (rms {self._rms:.1f})")
        whole = np.zeros((self._size, self._size))
        H = self.normal_equations()[0]
        whole[np.ix_(self._free, self._free)] = _inverse(H[np.ix_(self._free, self._free)])
        end = self._level_at + 1
        rig = Rig(tuple(self._cameras), self._level_m, whole[:end, :end], self._index)
        stds = np.sqrt(np.diag(whole)[end:].reshape(-1, 2, 3).mean(axis=2))  # of place and turn
        found = {
            tag.id: replace(
                Tag.at_pose(tag.id, tag.size_m, pose),
                position_std_m=float(place),
                angle_std_deg=math.degrees(turn),
            )
            for tag, pose, (place, turn) in zip(self._surveyed, self._poses, stds, strict=True)
        }
        layout = Layout(tuple(found.get(tag.id, tag) for tag in self._layout.tags))
        return Adjustment(rig, layout, self._rms, self._tag_rms_px())

    def _tag_rms_px(self) -> dict[int, float]:
        residuals = self._evaluate(self._cameras, self._level_m, self._poses)[2]
        squares = (residuals * self._sigmas[:, None, None]) ** 2
        ids = np.array([s.tag_id for s in self._used])
        return {int(i): float(np.sqrt(squares[ids == i].mean())) for i in np.unique(ids)}


def _solution(H: FloatArray, g: FloatArray, free: BoolArray, damping: float) -> FloatArray:
    """Return the damped step of those unknowns that are free."""
    part = H[np.ix_(free, free)]
    scale = 1.0 / np.sqrt(np.diag(part))
    scaled = part * np.outer(scale, scale) + damping * np.eye(len(part))
    step = np.zeros(len(g))
    step[free] = -scale * np.linalg.lstsq(scaled, scale * g[free], rcond=None)[0]
    return step


def _inverse(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a covariance or an information of numbers of very different size."""
    scale = 1.0 / np.sqrt(np.diag(matrix))
    both = np.outer(scale, scale)
    inverse = np.linalg.pinv(matrix * both, rcond=1e-14, hermitian=True) * both
    return 0.5 * (inverse + inverse.T)
