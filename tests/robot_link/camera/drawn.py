"""Pictures of real tags and of the board, for tests and benchmarks of cameras."""

import cv2
import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.vision.corner_kernel import Picture
from robot_link.camera.board import BOARD, opencv_board
from tests.autonomy.vision.drawn_tag import draw, tilted_square


def pattern(tag_id: int) -> npt.NDArray[np.bool_]:
    """Return the white cells of a tag as OpenCV prints it, shape ``(6, 6)``."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    return np.asarray(dictionary.generateImageMarker(tag_id, 8))[1:7, 1:7] > 127


def patch(
    rng: np.random.Generator,
    tag_id: int,
    side_px: float,
    *,
    tilt_deg: float = 20.0,
    turn_rad: float | None = None,
    **light: float,
) -> tuple[Picture, FloatArray]:
    """Return a small picture of one tag, and its corners in order."""
    size = int(1.6 * side_px) + 40
    shift = rng.uniform(-0.5, 0.5, 2)
    turn = rng.uniform(0.0, 2.0 * np.pi) if turn_rad is None else turn_rad
    corners = tilted_square(side_px, np.radians(tilt_deg), turn, size / 2) + shift
    return draw(corners, size, rng, pattern=pattern(tag_id), **light), corners


def scene(
    rng: np.random.Generator, size: tuple[int, int], tags: dict[int, tuple[float, float, float]]
) -> tuple[Picture, dict[int, FloatArray]]:
    """Return a picture of given width and height with tags, and their corners in order.

    Args:
        rng: Draws the noise and how each tag is turned.
        size: Width and height, px.
        tags: Middle and side of each, px.
    """
    width, height = size
    grey = np.clip(137.0 + rng.normal(0.0, 3.0, (height, width)), 0, 255).astype(np.uint8)
    corners: dict[int, FloatArray] = {}
    for tag_id, (u, v, side_px) in tags.items():
        part, inside = patch(rng, tag_id, side_px)
        left, top = round(u) - part.shape[1] // 2, round(v) - part.shape[0] // 2
        grey[top : top + part.shape[0], left : left + part.shape[1]] = part
        corners[tag_id] = inside + np.array([left, top])
    return grey, corners


def board_picture(
    square_px: float, size: tuple[int, int], turn_rad: float
) -> tuple[Picture, FloatArray]:
    """Return a picture of the whole board, turned, and where its inner corners are, ``(n, 2)``."""
    fine = 40
    across, down = BOARD.squares_across, BOARD.squares_down
    print_ = np.asarray(opencv_board().generateImage((across * fine, down * fine), marginSize=0))
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    turn = square_px / fine * np.array([[c, -s], [s, c]])
    middle = np.array([across * fine - 1, down * fine - 1]) / 2.0
    shift = (np.array(size) - 1) / 2.0 - turn @ middle
    affine = np.column_stack([turn, shift])
    grey = cv2.warpAffine(
        cv2.GaussianBlur(print_, (0, 0), 0.8 * fine / square_px),
        affine,
        size,
        flags=cv2.INTER_AREA,
        borderValue=(200,),
    )
    points = BOARD.points_m(np.arange((across - 1) * (down - 1)))[:, :2] / BOARD.square_m * fine
    return np.asarray(grey, dtype=np.uint8), (points - 0.5) @ turn.T + shift
