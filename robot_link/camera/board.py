"""The calibration board: what is printed, and its inner corners in a picture."""

from functools import cache
from typing import Final

import cv2
import numpy as np

from autonomy.vision.calibration.board import Board
from autonomy.vision.corner_kernel import Picture
from robot_link.camera.sighting import BoardCorner

BOARD: Final = Board()
MARKER_M: Final = 0.037
"""Side of a marker in a white square."""
DICTIONARY: Final = cv2.aruco.DICT_5X5_100
_LEAST_SIDE_PX: Final = 64


def find_board(grey: Picture) -> list[BoardCorner]:
    """Return the board's inner corners that are in a picture, by their numbers.

    Args:
        grey: Shape ``(rows, columns)``. The first pixel's centre is (0, 0).
    """
    if min(grey.shape) < _LEAST_SIDE_PX:
        return []
    corners, ids, _, _ = _detector().detectBoard(np.ascontiguousarray(grey))
    if ids is None:  # pyright: ignore[reportUnnecessaryComparison] - the stub knows no better
        return []
    pixels = np.asarray(corners, dtype=np.float64).reshape(-1, 2)
    return [
        BoardCorner(int(number), (float(u), float(v)))
        for number, (u, v) in zip(np.ravel(ids), pixels, strict=True)
    ]


@cache
def opencv_board() -> cv2.aruco.CharucoBoard:
    """Return the board as OpenCV knows it."""
    return cv2.aruco.CharucoBoard(
        (BOARD.squares_across, BOARD.squares_down),
        BOARD.square_m,
        MARKER_M,
        cv2.aruco.getPredefinedDictionary(DICTIONARY),
    )


@cache
def _detector() -> cv2.aruco.CharucoDetector:
    return cv2.aruco.CharucoDetector(opencv_board())
