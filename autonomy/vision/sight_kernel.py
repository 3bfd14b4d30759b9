"""Compiled sight: where a camera sees the four corners of a tag, and how that changes with all.

What moves them, in the order of the columns: place of the tag's carrier in NED and its turn about
its own axes, place of the camera and its turn about its own, the lens's parameters, the edge shift,
the water's level, and its index of refraction.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.compiled import inner_kernel, kernel
from autonomy.vision.lens_kernel import FOLD as FOLD
from autonomy.vision.lens_kernel import LENS_SIZE, PARAMETERS, project_into
from autonomy.vision.refraction_kernel import PORT_SIZE, seen_into, through_port_into

LENS = 0
TURN = LENS + LENS_SIZE
EYE = TURN + 9
EDGE = EYE + 3
HAS_PORT = EDGE + 1
PORT = HAS_PORT + 1
CAMERA_SIZE = PORT + PORT_SIZE
"""A packed camera: lens, rotation from camera axes to NED by rows, place in NED, edge shift, and
whether it has a port, with that."""

BODY_PLACE, BODY_TURN, EYE_PLACE, EYE_TURN, BY_LENS = 0, 3, 6, 9, 12
BY_EDGE = BY_LENS + PARAMETERS
BY_LEVEL, BY_INDEX = BY_EDGE + 1, BY_EDGE + 2
COLUMNS = BY_INDEX + 1
POSE_COLUMNS = BY_LENS
"""Columns of the two poses, which alone a search for a pose needs."""

Room = tuple[
    FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray
]
"""Arrays that a sight is worked out in."""


@inner_kernel
def room() -> Room:
    """Return new arrays to work in."""
    return (
        np.empty(3),
        np.zeros((3, 8)),
        np.empty(3),
        np.zeros((3, 4)),
        np.zeros((2, 12)),
        np.empty(3),
        np.empty((4, 2)),
        np.zeros((8, COLUMNS)),
    )


@inner_kernel
def _look_into(
    camera: FloatArray, point: FloatArray, level: float, index: float, space: Room
) -> tuple[float, float]:
    """Return the pixel of a point; the room holds the ways there. NaN where it is not seen."""
    way, way_slopes, ahead, port_slopes, lens_slopes, at, _, _ = space
    has_port = camera[HAS_PORT] > 0.0
    if has_port:
        way_slopes[:] = 0.0
        for i in range(3):
            way[i] = point[i] - camera[EYE + i]
            way_slopes[i, i], way_slopes[i, 3 + i] = -1.0, 1.0
    elif not seen_into(camera[EYE:EDGE], point, level, index, way, way_slopes):
        return math.nan, math.nan
    for i in range(3):
        at[i] = (
            camera[TURN + i] * way[0]
            + camera[TURN + 3 + i] * way[1]
            + camera[TURN + 6 + i] * way[2]
        )
    ahead[:] = at
    if has_port and not through_port_into(
        camera[PORT:], at[0], at[1], at[2], index, ahead, port_slopes
    ):
        return math.nan, math.nan
    return project_into(camera[:TURN], ahead[0], ahead[1], ahead[2], lens_slopes)


@inner_kernel
def _slopes_into(
    camera: FloatArray,
    R: FloatArray,
    corner: FloatArray,
    row: int,
    is_whole: bool,
    space: Room,
    slopes: FloatArray,
) -> None:
    """Write the derivatives of one coordinate of a pixel, whose ways the room holds."""
    _, way_slopes, _, port_slopes, lens_slopes, at, _, _ = space
    axis = row % 2
    d0, d1, d2 = lens_slopes[axis, 0], lens_slopes[axis, 1], lens_slopes[axis, 2]
    by_index = 0.0
    if camera[HAS_PORT] > 0.0:
        by_index = d0 * port_slopes[0, 3] + d1 * port_slopes[1, 3]
        e0 = d0 * port_slopes[0, 0] + d1 * port_slopes[1, 0]
        e1 = d0 * port_slopes[0, 1] + d1 * port_slopes[1, 1]
        d2 = d0 * port_slopes[0, 2] + d1 * port_slopes[1, 2]
        d0, d1 = e0, e1
    w0 = camera[TURN] * d0 + camera[TURN + 1] * d1 + camera[TURN + 2] * d2
    w1 = camera[TURN + 3] * d0 + camera[TURN + 4] * d1 + camera[TURN + 5] * d2
    w2 = camera[TURN + 6] * d0 + camera[TURN + 7] * d1 + camera[TURN + 8] * d2
    for j in range(3):
        slopes[row, EYE_PLACE + j] = (
            w0 * way_slopes[0, j] + w1 * way_slopes[1, j] + w2 * way_slopes[2, j]
        )
        slopes[row, BODY_PLACE + j] = (
            w0 * way_slopes[0, 3 + j] + w1 * way_slopes[1, 3 + j] + w2 * way_slopes[2, 3 + j]
        )
    # A turn by theta moves a point b of the body by theta x b, one of the camera q by q x theta.
    p0, p1, p2 = slopes[row, 0], slopes[row, 1], slopes[row, 2]
    g0 = p0 * R[0, 0] + p1 * R[1, 0] + p2 * R[2, 0]
    g1 = p0 * R[0, 1] + p1 * R[1, 1] + p2 * R[2, 1]
    g2 = p0 * R[0, 2] + p1 * R[1, 2] + p2 * R[2, 2]
    slopes[row, BODY_TURN] = corner[1] * g2 - corner[2] * g1
    slopes[row, BODY_TURN + 1] = corner[2] * g0 - corner[0] * g2
    slopes[row, BODY_TURN + 2] = corner[0] * g1 - corner[1] * g0
    slopes[row, EYE_TURN] = d1 * at[2] - d2 * at[1]
    slopes[row, EYE_TURN + 1] = d2 * at[0] - d0 * at[2]
    slopes[row, EYE_TURN + 2] = d0 * at[1] - d1 * at[0]
    if is_whole:
        for j in range(PARAMETERS):
            slopes[row, BY_LENS + j] = lens_slopes[axis, 3 + j]
        slopes[row, BY_LEVEL] = (
            w0 * way_slopes[0, 6] + w1 * way_slopes[1, 6] + w2 * way_slopes[2, 6]
        )
        slopes[row, BY_INDEX] = by_index + (
            w0 * way_slopes[0, 7] + w1 * way_slopes[1, 7] + w2 * way_slopes[2, 7]
        )


@inner_kernel
def view_into(
    camera: FloatArray,
    R: FloatArray,
    place: FloatArray,
    corners: FloatArray,
    level: float,
    index: float,
    is_whole: bool,
    space: Room,
    pixels: FloatArray,
    slopes: FloatArray,
) -> bool:
    """Write where a camera sees four corners, with derivatives; tell if it sees them all.

    Args:
        camera: Packed camera, shape ``(28,)``.
        R: Rotation from the carrier's axes to NED, shape ``(3, 3)``.
        place: Of the carrier in NED, shape ``(3,)``, m.
        corners: In the carrier's axes, in order, shape ``(4, 3)``, m.
        level: Down coordinate of the surface, m.
        index: Index of refraction of the water.
        is_whole: Whether the columns beyond those of the poses are wanted.
        space: To work in.
        pixels: Takes the corners with their edge shift, shape ``(4, 2)``.
        slopes: Takes the derivatives, rows u, v of each corner, shape ``(8, 24)``.
    """
    point, raw, raw_slopes = np.empty(3), space[6], space[7]
    for i in range(4):
        for j in range(3):
            point[j] = place[j] + (
                R[j, 0] * corners[i, 0] + R[j, 1] * corners[i, 1] + R[j, 2] * corners[i, 2]
            )
        raw[i, 0], raw[i, 1] = _look_into(camera, point, level, index, space)
        if not abs(raw[i, 0]) < math.inf:
            return False
        _slopes_into(camera, R, corners[i], 2 * i, is_whole, space, raw_slopes)
        _slopes_into(camera, R, corners[i], 2 * i + 1, is_whole, space, raw_slopes)
    columns = COLUMNS if is_whole else POSE_COLUMNS
    edge = camera[EDGE]
    pixels[:] = raw
    slopes[:, :columns] = raw_slopes[:, :columns]
    slopes[:, BY_EDGE] = 0.0
    for i in range(4):
        for k in ((i + 1) % 4, (i + 3) % 4):
            du, dv = raw[k, 0] - raw[i, 0], raw[k, 1] - raw[i, 1]
            length = math.hypot(du, dv)
            if not length > 0.0:
                return False
            du, dv = du / length, dv / length
            slopes[2 * i, BY_EDGE] += du
            slopes[2 * i + 1, BY_EDGE] += dv
            if edge == 0.0:
                continue
            pixels[i, 0] += edge * du
            pixels[i, 1] += edge * dv
            share = edge / length
            for j in range(columns):
                if j == BY_EDGE:
                    continue
                su = raw_slopes[2 * k, j] - raw_slopes[2 * i, j]
                sv = raw_slopes[2 * k + 1, j] - raw_slopes[2 * i + 1, j]
                along = du * su + dv * sv
                slopes[2 * i, j] += share * (su - along * du)
                slopes[2 * i + 1, j] += share * (sv - along * dv)
    return True


@kernel
def views(
    cameras: FloatArray,
    numbers: IntArray,
    rotations: FloatArray,
    places: FloatArray,
    corners: FloatArray,
    level: float,
    index: float,
    pixels: FloatArray,
    slopes: FloatArray,
) -> None:
    """Write where cameras see tags, with all derivatives; NaN where one is not seen whole.

    Args:
        cameras: Packed cameras, shape ``(n, 28)``.
        numbers: Which camera each view is of, shape ``(m,)``.
        rotations: From each view's carrier to NED, shape ``(m, 3, 3)``.
        places: Of each view's carrier in NED, shape ``(m, 3)``, m.
        corners: In the carrier's axes, shape ``(m, 4, 3)``, m.
        level: Down coordinate of the surface, m.
        index: Index of refraction of the water.
        pixels: Takes the corners, shape ``(m, 4, 2)``.
        slopes: Takes the derivatives, shape ``(m, 8, 24)``.
    """
    space = room()
    for k in range(numbers.shape[0]):
        if not view_into(
            cameras[numbers[k]], rotations[k], places[k], corners[k], level, index, True, space,
            pixels[k], slopes[k],
        ):  # fmt: skip
            pixels[k] = math.nan
            slopes[k] = math.nan


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    camera = np.zeros((1, CAMERA_SIZE))
    camera[0, 1:3], camera[0, FOLD], camera[0, EYE + 2] = 1.0, math.inf, -2.0
    camera[0, TURN : TURN + 9 : 4] = 1.0
    views(
        camera, np.zeros(1, dtype=np.int64), np.eye(3)[None], np.zeros((1, 3)),
        np.zeros((1, 4, 3)), 0.0, 1.333, np.zeros((1, 4, 2)), np.zeros((1, 8, COLUMNS)),
    )  # fmt: skip
