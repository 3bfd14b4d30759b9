"""Compiled search for one pose: least squares over all corners, by Levenberg and Marquardt.

A pose is kept as twelve numbers: its rotation by rows, then its place. Either the carrier of the
tags is sought (the cameras are known) or the camera (the tags are). ``autonomy.vision.fix`` tells
what the residuals are.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.compiled import inner_kernel, kernel
from autonomy.vision.sight_kernel import (
    BODY_PLACE,
    CAMERA_SIZE,
    COLUMNS,
    EDGE,
    EYE,
    EYE_PLACE,
    FOLD,
    TURN,
    Room,
    room,
    view_into,
)

# fmt: off
HAS_DOWN, DOWN, DOWN_STD, HAS_DEPTH, DEPTH, DEPTH_STD = 0, 1, 4, 5, 6, 7
# fmt: on
TELEMETRY_SIZE = 8
"""Telemetry: whether there is a direction of down in the sought body's axes, that (3), its standard
deviation in rad; whether there is a depth below the surface, that and its deviation in m."""
HUBER = 3.0
"""Residual of a corner, in standard deviations, from which on it counts less than its square."""
MOST_STEPS = 30
_FIRST_DAMPING, _MOST_DAMPING, _LEAST_DAMPING = 1e-3, 1e8, 1e-9
_SETTLED = 1e-8
"""A step of so few metres and radians is the last."""
_NO_GAIN = 1e-10
"""So is one that makes the cost less by so small a share."""


@inner_kernel
def _evaluate(
    pose: FloatArray,
    seeks_eye: bool,
    cameras: FloatArray,
    numbers: IntArray,
    corners: FloatArray,
    shifts: FloatArray,
    measured: FloatArray,
    sigmas: FloatArray,
    telemetry: FloatArray,
    level: float,
    index: float,
    space: Room,
    pixels: FloatArray,
    slopes: FloatArray,
    H: FloatArray,
    g: FloatArray,
) -> tuple[float, float]:
    """Return half the sum of the robust squares and the plain sum of the corners' squares.

    ``H`` and ``g`` take the normal equations. A pose from which something is not seen costs
    infinitely much.
    """
    R, place = np.eye(3), np.zeros(3)
    if seeks_eye:
        cameras[0, TURN:EYE] = pose[:9]
        cameras[0, EYE:EDGE] = pose[9:]
    else:
        for i in range(3):
            for j in range(3):
                R[i, j] = pose[3 * i + j]
    first = EYE_PLACE if seeks_eye else BODY_PLACE
    H[:] = 0.0
    g[:] = 0.0
    cost, squares = 0.0, 0.0
    for k in range(numbers.shape[0]):
        for j in range(3):
            place[j] = shifts[k, j] + (0.0 if seeks_eye else pose[9 + j])
        if not view_into(
            cameras[numbers[k]], R, place, corners[k], level, index, False, space, pixels, slopes
        ):
            return math.inf, math.inf
        for i in range(4):
            u = (pixels[i, 0] - measured[k, i, 0]) / sigmas[k]
            v = (pixels[i, 1] - measured[k, i, 1]) / sigmas[k]
            square = u * u + v * v
            squares += square
            weight = 1.0
            if square > HUBER * HUBER:
                off = math.sqrt(square)
                weight = HUBER / off
                cost += HUBER * off - 0.5 * HUBER * HUBER
            else:
                cost += 0.5 * square
            for a in range(6):
                su = slopes[2 * i, first + a] / sigmas[k] * weight
                sv = slopes[2 * i + 1, first + a] / sigmas[k] * weight
                g[a] += su * u + sv * v
                for b in range(6):
                    H[a, b] += (
                        su * slopes[2 * i, first + b] + sv * slopes[2 * i + 1, first + b]
                    ) / sigmas[k]
    return cost + _telemetry_cost(pose, telemetry, level, H, g), squares


@inner_kernel
def _telemetry_cost(
    pose: FloatArray,
    telemetry: FloatArray,
    level: float,
    H: FloatArray,
    g: FloatArray,
) -> float:
    """Return half the squares of what the sought body's own sensors say; add to ``H`` and ``g``."""
    cost = 0.0
    if telemetry[HAS_DOWN] > 0.0:
        std = telemetry[DOWN_STD]
        x, y, z = pose[6], pose[7], pose[8]  # down in the body's axes
        a = (x - telemetry[DOWN]) / std
        b = (y - telemetry[DOWN + 1]) / std
        c = (z - telemetry[DOWN + 2]) / std
        cost += 0.5 * (a * a + b * b + c * c)
        # A turn by theta moves down by down x theta.
        x, y, z = x / std, y / std, z / std
        g[3] += b * z - c * y
        g[4] += c * x - a * z
        g[5] += a * y - b * x
        H[3, 3] += y * y + z * z
        H[4, 4] += x * x + z * z
        H[5, 5] += x * x + y * y
        H[3, 4] -= x * y
        H[4, 3] -= x * y
        H[3, 5] -= x * z
        H[5, 3] -= x * z
        H[4, 5] -= y * z
        H[5, 4] -= y * z
    if telemetry[HAS_DEPTH] > 0.0:
        std = telemetry[DEPTH_STD]
        d = (pose[11] - level - telemetry[DEPTH]) / std
        cost += 0.5 * d * d
        g[2] += d / std
        H[2, 2] += 1.0 / (std * std)
    return cost


@inner_kernel
def _solve(H: FloatArray, g: FloatArray, damping: float, step: FloatArray) -> bool:
    """Write the damped step by Cholesky's factors; tell if the matrix is positive definite."""
    n = 6
    L = np.zeros((6, 6))
    for i in range(n):
        for j in range(i + 1):
            total = H[i, j]
            if i == j:
                total += damping * H[i, i] + 1e-12
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                L[i, i] = math.sqrt(total)
            else:
                L[i, j] = total / L[j, j]
    for i in range(n):
        total = -g[i]
        for k in range(i):
            total -= L[i, k] * step[k]
        step[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        total = step[i]
        for k in range(i + 1, n):
            total -= L[k, i] * step[k]
        step[i] = total / L[i, i]
    return True


@inner_kernel
def _moved_into(pose: FloatArray, step: FloatArray, new: FloatArray) -> None:
    """Write the pose after a shift in NED and a turn about its own axes (Rodrigues' formula)."""
    x, y, z = step[3], step[4], step[5]
    angle2 = x * x + y * y + z * z
    angle = math.sqrt(angle2)
    if angle > 1e-6:
        s, c = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle2
    else:
        s, c = 1.0, 0.5
    for i in range(3):
        p, q, r = pose[3 * i], pose[3 * i + 1], pose[3 * i + 2]
        along = p * x + q * y + r * z
        # row (1 + s K + c K^2), where row K = row x turn
        new[3 * i] = p + s * (q * z - r * y) + c * (along * x - angle2 * p)
        new[3 * i + 1] = q + s * (r * x - p * z) + c * (along * y - angle2 * q)
        new[3 * i + 2] = r + s * (p * y - q * x) + c * (along * z - angle2 * r)
    for j in range(3):
        new[9 + j] = pose[9 + j] + step[j]


@kernel
def solve_into(
    poses: FloatArray,
    costs: FloatArray,
    squares: FloatArray,
    normals: FloatArray,
    most_steps: int,
    seeks_eye: bool,
    cameras: FloatArray,
    numbers: IntArray,
    corners: FloatArray,
    shifts: FloatArray,
    measured: FloatArray,
    sigmas: FloatArray,
    telemetry: FloatArray,
    level: float,
    index: float,
) -> None:
    """Improve poses, each from its own start, until they no longer move.

    Args:
        poses: Starts, and then solutions, shape ``(s, 12)``.
        costs: Takes half the sum of robust squares, shape ``(s,)``; infinite where a start is none.
        squares: Takes the plain sum of the corners' squares, shape ``(s,)``.
        normals: Takes the matrices of the normal equations at the solutions, shape ``(s, 6, 6)``.
        most_steps: Steps after which a search ends anyway; 0 only costs the starts.
        seeks_eye: Whether the first camera is sought, not the carrier.
        cameras: Packed cameras, shape ``(n, 28)``; the first is used up where it is sought.
        numbers: Which camera each view is of, shape ``(m,)``.
        corners: In the carrier's axes, or in NED where the camera is sought, ``(m, 4, 3)``, m.
        shifts: How far the carrier is displaced in each view, shape ``(m, 3)``, m.
        measured: Corners in the pictures, shape ``(m, 4, 2)``, px.
        sigmas: Noise of each view's coordinates, shape ``(m,)``, px.
        telemetry: Shape ``(8,)``.
        level: Down coordinate of the surface, m.
        index: Index of refraction of the water.
    """
    space, pixels, slopes = room(), np.empty((4, 2)), np.zeros((8, COLUMNS))
    g, step, trial = np.zeros(6), np.zeros(6), np.empty(12)
    new_H, new_g = np.zeros((6, 6)), np.zeros(6)
    for start in range(poses.shape[0]):
        pose, H = poses[start], normals[start]
        cost, square = _evaluate(
            pose, seeks_eye, cameras, numbers, corners, shifts, measured, sigmas, telemetry,
            level, index, space, pixels, slopes, H, g,
        )  # fmt: skip
        damping = _FIRST_DAMPING
        for _ in range(most_steps):
            if not cost < math.inf or not _solve(H, g, damping, step):
                break
            _moved_into(pose, step, trial)
            new_cost, new_square = _evaluate(
                trial, seeks_eye, cameras, numbers, corners, shifts, measured, sigmas, telemetry,
                level, index, space, pixels, slopes, new_H, new_g,
            )  # fmt: skip
            gain = cost - new_cost
            if new_cost <= cost:
                pose[:], H[:], g[:] = trial, new_H, new_g
                cost, square = new_cost, new_square
                damping = max(0.1 * damping, _LEAST_DAMPING)
            else:
                damping *= 10.0
            if np.max(np.abs(step)) < _SETTLED or damping > _MOST_DAMPING:
                break
            if 0.0 <= gain < _NO_GAIN * (1.0 + cost):
                break
        costs[start], squares[start] = cost, square


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    camera = np.zeros((1, CAMERA_SIZE))
    camera[0, 1:3], camera[0, FOLD], camera[0, EYE + 2] = 100.0, math.inf, -2.0
    camera[0, TURN : TURN + 9 : 4] = 1.0
    square = np.array([[[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]]])
    pose = np.concatenate([np.eye(3).ravel(), np.zeros(3)])[None]
    solve_into(
        pose, np.zeros(1), np.zeros(1), np.zeros((1, 6, 6)), MOST_STEPS, False, camera,
        np.zeros(1, dtype=np.int64), square, np.zeros((1, 3)), 40.0 * square[:, :, :2].copy(),
        np.ones(1), np.zeros(TELEMETRY_SIZE), 0.0, 1.333,
    )  # fmt: skip
