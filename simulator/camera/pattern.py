"""What is printed on plates and boards, as cells that are white or not."""

from dataclasses import dataclass
from functools import cache
from types import ModuleType

import numpy as np

from autonomy.vision.calibration.board import Board
from autonomy.vision.tag import CELLS_BLACK, CELLS_PLATE
from simulator.camera.trace_kernel import Cells

BOARD = Board()
MARKER_SHARE = 0.74
"""Side of a board's marker over that of its square: 37 mm of 50."""
BOARD_RIM_M = 0.01
_CELLS_A_SQUARE = 200


class CameraExtraMissingError(RuntimeError):
    """OpenCV is not installed."""

    def __init__(self) -> None:
        super().__init__("emulated cameras need OpenCV: install the extra `camera`")


def opencv() -> ModuleType:
    """Return OpenCV.

    Raises:
        CameraExtraMissingError: If it is not installed.
    """
    try:
        import cv2
    except ImportError as missing:
        raise CameraExtraMissingError from missing
    return cv2


@dataclass(frozen=True, slots=True, eq=False)
class Print:
    """A print with its white rim."""

    cells: Cells
    """1 where it is white, shape ``(rows, columns)``, as it is read."""
    cell_m: float


@cache
def tag_print(tag_id: int, size_m: float) -> Print:
    """Return the plate of a tag of the family tag36h11 whose black square has a size.

    Raises:
        CameraExtraMissingError: If OpenCV is not installed.
    """
    cv2 = opencv()
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    cells = np.ones((CELLS_PLATE, CELLS_PLATE), dtype=np.uint8)
    cells[1:-1, 1:-1] = cv2.aruco.generateImageMarker(family, tag_id, CELLS_BLACK) > 0
    return Print(cells, size_m / CELLS_BLACK)


@cache
def board_print() -> Print:
    """Return the board for lenses, with a white rim around it.

    Raises:
        CameraExtraMissingError: If OpenCV is not installed.
    """
    cv2 = opencv()
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    squares = (BOARD.squares_across, BOARD.squares_down)
    board = cv2.aruco.CharucoBoard(squares, BOARD.square_m, BOARD.square_m * MARKER_SHARE, family)
    size = tuple(_CELLS_A_SQUARE * count for count in squares)
    cell_m = BOARD.square_m / _CELLS_A_SQUARE
    printed = board.generateImage(size, marginSize=0, borderBits=1) > 0
    rim = round(BOARD_RIM_M / cell_m)
    return Print(np.pad(printed, rim, constant_values=True).astype(np.uint8), cell_m)
