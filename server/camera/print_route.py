"""What is printed for cameras: plates with tags and the calibration board, in true size."""

import asyncio
from collections.abc import Callable
from typing import Annotated, Final, TypeVar

from fastapi import APIRouter, Query, Response

from autonomy.vision.tag import CELLS_BLACK, CELLS_PLATE, LATENCY_IDS, ROBOT_IDS, TANK_IDS
from robot_link.camera.extra import CameraExtraMissingError, check_extra
from server.access.dependency import Viewer
from server.base.problem import FieldError, Problem, not_found, unprocessable

router = APIRouter(prefix="/api/tags", tags=["cameras"])

T = TypeVar("T")
_PDF: Final = "application/pdf"
_SVG: Final = "image/svg+xml"
Ids = Annotated[str, Query(max_length=400, description="Such as 0-2,100.")]
Size = Annotated[float, Query(description="Side of the black square, m.", allow_inf_nan=False)]


def _answer(media_type: str, words: str) -> dict[int | str, dict[str, object]]:
    return {200: {"content": {media_type: {}}, "description": words}}


@router.get(
    "/sheets.pdf", response_class=Response, responses=_answer(_PDF, "Sheets with the plates.")
)
async def get_sheets(caller: Viewer, ids: Ids, size_m: Size = 0.1) -> Response:
    """Return plates of tags, to be printed at 100 %.

    422 says which id or size cannot be printed; 503 that the extra ``camera`` is not installed.
    """
    del caller

    def drawn() -> bytes:
        from robot_link.camera.printed.pdf import pdf_of
        from robot_link.camera.printed.sheet import ids_of, tag_pages

        return pdf_of(tag_pages(ids_of(ids), 1e3 * size_m))

    try:
        return _file(await _with_extra(drawn), "tags.pdf")
    except ValueError as error:
        field, _, words = str(error).partition(": ")
        name = "size_m" if field == "size" else "ids"
        raise unprocessable(
            "1 field is wrong.", [FieldError(loc=["query", name], msg=words)]
        ) from error


@router.get("/board.pdf", response_class=Response, responses=_answer(_PDF, "The board."))
async def get_board(caller: Viewer) -> Response:
    """Return the calibration board, to be printed at 100 % and glued onto a stiff plate."""
    del caller

    def drawn() -> bytes:
        from robot_link.camera.printed.pdf import pdf_of
        from robot_link.camera.printed.sheet import board_page

        return pdf_of([board_page()])

    return _file(await _with_extra(drawn), "board.pdf")


@router.get("/{tag}.svg", response_class=Response, responses=_answer(_SVG, "The plate."))
async def get_plate(caller: Viewer, tag: int) -> Response:
    """Return one tag with its white rim, for a screen."""
    del caller
    if not any(tag in ids for ids in (ROBOT_IDS, TANK_IDS, LATENCY_IDS)):
        raise not_found(f"{tag} is no tag of a robot, of the tank or of the latency check.")

    def drawn() -> bytes:
        from robot_link.camera.printed.sheet import tag_cells

        cells = tag_cells(tag)
        path = "".join(
            f"M{column + 1} {row + 1}h1v1h-1z"
            for row in range(CELLS_BLACK)
            for column in range(CELLS_BLACK)
            if cells[row, column]
        )
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {CELLS_PLATE} {CELLS_PLATE}"'
            ' shape-rendering="crispEdges">'
            f'<path fill="#fff" d="M0 0h{CELLS_PLATE}v{CELLS_PLATE}H0z"/><path d="{path}"/></svg>'
        ).encode()

    return Response(await _with_extra(drawn), media_type=_SVG)


async def _with_extra(drawn: Callable[[], T]) -> T:
    """Draw in a thread, where OpenCV is there.

    Raises:
        Problem: 503 if it is not installed.
    """
    try:
        check_extra()
    except CameraExtraMissingError as error:
        raise Problem(503, f"{error}.") from None
    return await asyncio.to_thread(drawn)


def _file(content: bytes, name: str) -> Response:
    disposition = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(content, media_type=_PDF, headers=disposition)
