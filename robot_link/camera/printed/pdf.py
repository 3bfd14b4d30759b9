"""Pages of filled shapes and short words as a PDF, in true size.

Source:
    ISO 32000-1:2008; one object for each page, its content and one of the fonts that every reader
    has. Nothing is compressed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

_POINTS_PER_MM: Final = 72.0 / 25.4
_FONT: Final = b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>"
Place = tuple[float, float]
"""Millimetres to the right of, and below, the page's top left corner."""


@dataclass(slots=True)
class Page:
    """One page; what is drawn later lies on top."""

    width_mm: float
    height_mm: float
    _content: list[str] = field(default_factory=list[str])

    def rectangles(
        self, boxes: Sequence[tuple[float, float, float, float]], grey: float = 0.0
    ) -> None:
        """Fill rectangles as one shape, so that no seam shows between neighbours.

        Args:
            boxes: Left, top, width and height of each, mm.
            grey: 0 is black, 1 white.
        """
        paths = [
            f"{_pt(left)} {self._up(top + height)} {_pt(width)} {_pt(height)} re"
            for left, top, width, height in boxes
        ]
        self._content.append(f"{grey:g} g {' '.join(paths)} f")

    def polygon(self, corners: Sequence[Place], grey: float = 0.0) -> None:
        """Fill a polygon."""
        places = [f"{_pt(x)} {self._up(y)}" for x, y in corners]
        self._content.append(f"{grey:g} g {places[0]} m {' l '.join(places[1:])} l h f")

    def words(self, at: Place, text: str, size_mm: float, grey: float = 0.0) -> None:
        """Write a line of ASCII words whose base begins at a place."""
        shown = text.encode("ascii", "replace").decode()
        for special in "\\()":
            shown = shown.replace(special, f"\\{special}")
        place = f"{_pt(at[0])} {self._up(at[1])}"
        self._content.append(f"BT {grey:g} g /F1 {_pt(size_mm)} Tf {place} Td ({shown}) Tj ET")

    def content(self) -> bytes:
        """Return what is drawn, in the language of PDF."""
        return "\n".join(self._content).encode()

    def box(self) -> str:
        """Return the page's box, points."""
        return f"[0 0 {_pt(self.width_mm)} {_pt(self.height_mm)}]"

    def _up(self, y_mm: float) -> str:
        return _pt(self.height_mm - y_mm)


def pdf_of(pages: Sequence[Page]) -> bytes:
    """Return pages as a file."""
    font, first = 3, 4
    kids = " ".join(f"{first + 2 * i} 0 R" for i in range(len(pages)))
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        f"<< /Type /Pages /Kids [{kids}] /Count {len(pages)} >>".encode(),
        _FONT,
    ]
    for i, page in enumerate(pages):
        content = page.content()
        objects.append(
            f"<< /Type /Page /Parent 2 0 R /MediaBox {page.box()} /Contents {first + 2 * i + 1} 0 R"
            f" /Resources << /Font << /F1 {font} 0 R >> >> >>".encode()
        )
        objects.append(b"<< /Length %d >>\nstream\n%s\nendstream" % (len(content), content))
    return _file_of(objects)


def _file_of(objects: Sequence[bytes]) -> bytes:
    file = bytearray(b"%PDF-1.4\n")
    begins: list[int] = []
    for number, body in enumerate(objects, start=1):
        begins.append(len(file))
        file += b"%d 0 obj\n%s\nendobj\n" % (number, body)
    table = len(file)
    file += b"xref\n0 %d\n0000000000 65535 f \n" % (len(objects) + 1)
    for begin in begins:
        file += b"%010d 00000 n \n" % begin
    file += b"trailer << /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n" % (
        len(objects) + 1,
        table,
    )
    return bytes(file)


def _pt(length_mm: float) -> str:
    return f"{length_mm * _POINTS_PER_MM:.4f}"
