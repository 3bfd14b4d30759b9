"""What is printed on plates and boards, as cells that are white or not."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from autonomy.vision.tag import CELLS_BLACK, CELLS_PLATE
from robot_link.camera.extra import check_extra
from simulator.camera.trace_kernel import Cells

BOARD_RIM_M = 0.01
_CELLS_A_SQUARE = 200


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
    check_extra()
    import cv2

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
    check_extra()
    from robot_link.camera.board import BOARD, opencv_board

    size = (_CELLS_A_SQUARE * BOARD.squares_across, _CELLS_A_SQUARE * BOARD.squares_down)
    cell_m = BOARD.square_m / _CELLS_A_SQUARE
    printed = opencv_board().generateImage(size, marginSize=0, borderBits=1) > 0
    rim = round(BOARD_RIM_M / cell_m)
    return Print(np.pad(printed, rim, constant_values=True).astype(np.uint8), cell_m)
