r"""The pose of a camera that is near its tags: corners weighed by the whole covariance.

From 2 m a tag that hangs 2 mm from where it was surveyed is a pixel off, twenty times what its
corners are measured to, and pulls a pose that trusts each corner alone by centimetres. Here all
considered errors of the corners count as noise that they have in common, :math:`V = S + R R'` with
the noise S and the considered errors R (``considered``), and the pose is the best that is linear
in what is seen: :math:`P = (J' V^{-1} J + Q)^{-1}`, with the rows Q of the robot's own sensors.

Source:
    Aitken, Proceedings of the Royal Society of Edinburgh 55, 1935 (generalized least squares).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision import sight_kernel as kernel
from autonomy.vision.camera import Rig
from autonomy.vision.considered import considered_root
from autonomy.vision.fix import Fix, Telemetry
from autonomy.vision.rigid import Pose, skew
from autonomy.vision.sight import sights
from autonomy.vision.tag import Tag

_STEPS = 6
_STILL = 1e-7


@dataclass(frozen=True, slots=True, eq=False)
class _Solved:
    """One step of the least squares about a pose."""

    move: FloatArray
    """Of the pose, shape ``(6,)``."""
    noise: FloatArray
    """Covariance by the corners' noise and the robot's own sensors, shape ``(6, 6)``."""
    pulled: FloatArray
    """What each considered error of one standard deviation does to the pose, ``(6, k)``."""
    left_px: FloatArray
    """What the pose after the move leaves unexplained, shape ``(8 m,)``."""
    rms: float


def weighed(fix: Fix, rig: Rig, tags: Sequence[Tag], telemetry: Telemetry) -> Fix | None:
    """Improve the fix of a camera.

    Args:
        fix: To begin with, of that camera.
        rig: That camera alone, whose own pose does not matter, and the water.
        tags: Fixed ones, of each view that the fix used.
        telemetry: Down in camera axes and depth, as far as they are known.

    Returns:
        The fix, of which ``rms`` is in standard deviations of all errors; none where it is lost.
    """
    pose, solved = fix.pose, _solved(fix.pose, fix, rig, tags, telemetry)
    for _ in range(_STEPS):
        if solved is None or float(np.abs(solved.move).max()) < _STILL:
            break
        pose = pose.moved(solved.move[:3], solved.move[3:])
        solved = _solved(pose, fix, rig, tags, telemetry)
    if solved is None:
        return None
    pulled = solved.pulled
    in_tank, by_rig = pulled @ pulled.T, pulled[:, : rig.root.shape[1]].copy()
    under = pulled.copy()
    under[2, : by_rig.shape[1]] += rig.root[-1]  # a depth is counted from the level
    return replace(
        fix,
        pose=pose,
        noise_covariance=0.5 * (solved.noise + solved.noise.T),
        considered_covariance=under @ under.T,
        tank_considered_covariance=in_tank,
        by_rig=by_rig,
        rms=solved.rms,
        residuals_px=solved.left_px.reshape(-1, 4, 2),
    )


def _solved(
    pose: Pose, fix: Fix, rig: Rig, tags: Sequence[Tag], telemetry: Telemetry
) -> _Solved | None:
    """Return the step from a pose; none where a tag is not seen whole from there."""
    (camera,) = rig.cameras
    here = replace(camera, pose=pose).packed[None]
    numbers = np.zeros(len(tags), dtype=np.int64)
    still = [Pose.identity()] * len(tags)
    corners = np.array([tag.corners_m for tag in tags])
    seen = sights(here, numbers, still, corners, rig.level_m, rig.index)
    if not np.isfinite(seen.pixels).all():
        return None
    sigmas = np.array([view.sigma_px for view in fix.used])
    considered = considered_root(
        rig,
        tags,
        numbers,
        seen.slopes,
        sigmas,
        eyes_m=here[:, kernel.EYE : kernel.EDGE],
        carrier=Pose.identity(),
        after_s=np.zeros(len(tags)),
        velocity_std_m_s=0.0,
        seeks_eye=True,
    )
    R = considered.reshape(8 * len(tags), -1)
    J = seen.slopes[:, :, kernel.EYE_PLACE : kernel.EYE_PLACE + 6].reshape(-1, 6)
    off = (np.array([view.corners_px for view in fix.used]) - seen.pixels).ravel()
    variances = np.repeat(sigmas**2, 8)
    rows, lacking = _own_rows(pose, rig.level_m, telemetry)
    weight = _inverse(np.diag(variances) + R @ R.T)
    P = _inverse(J.T @ weight @ J + rows.T @ rows)
    move = P @ (J.T @ weight @ off + rows.T @ lacking)
    gain, left = P @ J.T @ weight, off - J @ move
    return _Solved(
        move,
        (gain * variances) @ gain.T + P @ rows.T @ rows @ P,
        gain @ R,
        left,
        math.sqrt(float(left @ weight @ left) / len(left)),
    )


def _inverse(matrix: FloatArray) -> FloatArray:
    return np.linalg.inv(matrix).astype(np.float64)


def _own_rows(pose: Pose, level_m: float, telemetry: Telemetry) -> tuple[FloatArray, FloatArray]:
    """Return rows of the robot's own sensors, and what they say less what the pose says."""
    rows: list[FloatArray] = []
    lacking: list[float] = []
    if telemetry.down is not None:
        down = pose.rotation[2]  # turned by theta it becomes down + skew(down) theta
        by_turn = np.hstack([np.zeros((3, 3)), skew(down)]) / telemetry.tilt_std_rad
        rows.append(by_turn)
        lacking += ((np.array(telemetry.down) - down) / telemetry.tilt_std_rad).tolist()
    if telemetry.depth_m is not None:
        row = np.zeros((1, 6))
        row[0, 2] = 1.0 / telemetry.depth_std_m
        rows.append(row)
        lacking.append((telemetry.depth_m - pose.position_m[2] + level_m) / telemetry.depth_std_m)
    return np.vstack([np.zeros((0, 6)), *rows]), np.array(lacking)
