"""What is on the sheets: plates with their tags, and the calibration board.

A plate is 10 cells wide, the black square 8; the outer cell is the white rim that the detector
needs. Its id, its size and an arrow to its top edge stand in the outermost part of the rim, in
grey, where no bit and no edge is sampled.
"""

import re
from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from autonomy.vision.tag import (
    CELLS_BLACK,
    CELLS_PLATE,
    FAMILY,
    LATENCY_IDS,
    ROBOT_IDS,
    TANK_IDS,
)
from robot_link.camera.board import BOARD, MARKER_M, opencv_board
from robot_link.camera.printed.pdf import Page

SIZE_LEAST_MM, SIZE_MOST_MM = 20.0, 600.0
_PAPERS_MM: Final = {
    "A4": (210.0, 297.0),
    "A3": (297.0, 420.0),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
}
_RANGE: Final = re.compile(r"([0-9]{1,6})(?:-([0-9]{1,6}))?")
_MARGIN_MM, _FOOT_MM, _GAP_MM = 8.0, 12.0, 8.0
_MARK_MM, _MARK_OFF_MM, _LINE_MM = 3.0, 0.5, 0.15
_WORDS_CELLS, _WORDS_LEAST_MM = 0.22, 0.8
_RIM_GREY: Final = 0.55
_RULER_MM: Final = 100.0
_FOOT_WORDS_MM: Final = 3.0


def ids_of(text: str) -> list[int]:
    """Return the ids that a list such as ``0-2,100`` names.

    Raises:
        ValueError: If it is none, or an id is of no kind that is used.
    """
    ids: list[int] = []
    for part in text.split(","):
        found = _RANGE.fullmatch(part.strip())
        if found is None:
            raise ValueError(f"ids: {part!r} is neither a number nor two with a - between")
        low, high = int(found[1]), int(found[2] or found[1])
        if low > high:
            raise ValueError(f"ids: {part} runs backwards")
        for kind in (ROBOT_IDS, TANK_IDS, LATENCY_IDS):
            if low in kind and high in kind:
                ids += range(low, high + 1)
                break
        else:
            raise ValueError(
                f"ids: {part} are not ids of robots (0 to 98), of the tank (100 to 199) or of the "
                "latency check (200 to 215)"
            )
    if len(set(ids)) != len(ids):
        raise ValueError("ids: one is there twice")
    return ids


def tag_pages(ids: Sequence[int], size_mm: float) -> list[Page]:
    """Return sheets with plates.

    Args:
        ids: Which tags.
        size_mm: Side of the black square.

    Raises:
        ValueError: If they do not fit on any paper.
    """
    if not SIZE_LEAST_MM <= size_mm <= SIZE_MOST_MM:
        raise ValueError(f"size: {size_mm:g} mm is not {SIZE_LEAST_MM:g} to {SIZE_MOST_MM:g} mm")
    plate_mm = size_mm * CELLS_PLATE / CELLS_BLACK
    width, height = _paper(plate_mm, plate_mm)
    step = plate_mm + _GAP_MM
    across = int((width - 2.0 * _MARGIN_MM + _GAP_MM) // step)
    down = int((height - _MARGIN_MM - _FOOT_MM + _GAP_MM) // step)
    pages: list[Page] = []
    for begin in range(0, len(ids), across * down):
        page = _sheet(width, height)
        for i, tag_id in enumerate(ids[begin : begin + across * down]):
            left = _MARGIN_MM + step * (i % across)
            _plate(page, left, _MARGIN_MM + step * (i // across), tag_id, size_mm)
        pages.append(page)
    return pages


def board_page() -> Page:
    """Return the sheet with the calibration board."""
    square = 1e3 * BOARD.square_m
    wide, high = BOARD.squares_across * square, BOARD.squares_down * square
    width, height = _paper(wide, high)
    page = _sheet(width, height)
    left, top = 0.5 * (width - wide), _MARGIN_MM
    board = opencv_board()
    corners = np.asarray(board.getObjPoints(), dtype=np.float64).reshape(-1, 4, 3)
    marker = 1e3 * MARKER_M
    places = 1e3 * corners[:, 0, :2]
    with_marker = {(int(x // square), int(y // square)) for x, y in places}
    page.rectangles(
        [
            (left + column * square, top + row * square, square, square)
            for row in range(BOARD.squares_down)
            for column in range(BOARD.squares_across)
            if (column, row) not in with_marker
        ]
    )
    for marker_id, (x, y) in zip(np.ravel(board.getIds()).tolist(), places.tolist(), strict=True):
        cells = np.asarray(board.getDictionary().generateImageMarker(marker_id, 7)) < 128
        _cells(page, left + x, top + y, marker, cells)
    return page


def tag_cells(tag_id: int) -> npt.NDArray[np.bool_]:
    """Return which cells of a tag's black square are black, as printed, shape ``(8, 8)``."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    return np.asarray(dictionary.generateImageMarker(tag_id, CELLS_BLACK)) < 128


def _plate(page: Page, left: float, top: float, tag_id: int, size_mm: float) -> None:
    cell = size_mm / CELLS_BLACK
    plate = CELLS_PLATE * cell
    _cells(page, left + cell, top + cell, size_mm, tag_cells(tag_id))
    words_mm = max(_WORDS_CELLS * cell, _WORDS_LEAST_MM)
    text = f"{FAMILY}  id {tag_id}  {size_mm:g} mm"
    page.words((left + cell, top + plate - 0.07 * cell), text, words_mm, _RIM_GREY)
    middle, tip, foot = left + 0.5 * plate, top + 0.05 * cell, top + 0.30 * cell
    page.polygon(
        [(middle, tip), (middle + 0.2 * cell, foot), (middle - 0.2 * cell, foot)], _RIM_GREY
    )
    _cutting_marks(page, left, top, plate)


def _cells(
    page: Page, left: float, top: float, size_mm: float, black: npt.NDArray[np.bool_]
) -> None:
    """Fill the black cells of a square."""
    cell = size_mm / len(black)
    page.rectangles(
        [
            (left + column * cell, top + row * cell, cell, cell)
            for row, column in np.argwhere(black).tolist()
        ]
    )


def _cutting_marks(page: Page, left: float, top: float, plate: float) -> None:
    """Draw thin lines outside of the plate that lengthen its edges."""
    near, far = _MARK_OFF_MM, _MARK_OFF_MM + _MARK_MM
    half = 0.5 * _LINE_MM
    boxes: list[tuple[float, float, float, float]] = []
    for edge in (0.0, plate):
        for begin in (-far, plate + near):
            boxes.append((left + begin, top + edge - half, _MARK_MM, _LINE_MM))
            boxes.append((left + edge - half, top + begin, _LINE_MM, _MARK_MM))
    page.rectangles(boxes)


def _sheet(width_mm: float, height_mm: float) -> Page:
    """Return an empty sheet with a line by which its scale is measured."""
    page = Page(width_mm, height_mm)
    base = height_mm - 0.5 * _FOOT_MM
    page.rectangles(
        [
            (_MARGIN_MM, base, _RULER_MM, 2.0 * _LINE_MM),
            (_MARGIN_MM, base - 2.0, _LINE_MM, 4.0),
            (_MARGIN_MM + _RULER_MM - _LINE_MM, base - 2.0, _LINE_MM, 4.0),
        ]
    )
    page.words(
        (_MARGIN_MM + _RULER_MM + 3.0, base + 1.0),
        "100 mm. Print at 100 %, not fitted.",
        _FOOT_WORDS_MM,
    )
    return page


def _paper(width_mm: float, height_mm: float) -> tuple[float, float]:
    """Return the smallest paper on which something fits, either way up."""
    for short, long in _PAPERS_MM.values():
        for width, height in ((short, long), (long, short)):
            if width_mm + 2.0 * _MARGIN_MM <= width and height_mm + _MARGIN_MM + _FOOT_MM <= height:
                return width, height
    raise ValueError(f"size: {width_mm:g} x {height_mm:g} mm fits on no paper up to A0")
