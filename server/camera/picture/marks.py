"""What was seen, drawn into a camera's picture. Pillow blocks, so call it in a thread."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from PIL import Image, ImageDraw

from robot_link.camera.sighting import Region, TagSeen

GREEN, AMBER, WHITE = (60, 220, 90), (255, 176, 0), (240, 240, 240)
ENLARGED: Final = 20
"""Residuals are too small to be seen as they are."""
_DASH_PX, _QUALITY = 8, 85


@dataclass(frozen=True, slots=True)
class Marks:
    """What is to be drawn."""

    size: tuple[int, int]
    """Of the picture that the numbers are of, px."""
    tags: Sequence[TagSeen]
    refused: frozenset[int]
    """Ids that are not used."""
    regions: Sequence[Region]
    """Where robots are expected."""
    off_px: Mapping[int, tuple[float, float]]
    """Of fixed tags, how far they are from where they should be."""


def marked(jpeg: bytes, marks: Marks) -> bytes:
    """Return a picture with marks.

    Tags that are used have a green outline, those that are not an amber one, both with their id;
    where robots are expected is dashed; lines from the middle of fixed tags show 20 times how far
    these are from where they should be.

    Raises:
        OSError: If the picture cannot be read.
    """
    with Image.open(io.BytesIO(jpeg)) as source:
        picture = source.convert("RGB")
    scale = picture.width / marks.size[0]
    draw = ImageDraw.Draw(picture)
    for region in marks.regions:
        _dashed(draw, region, scale)
    for tag in marks.tags:
        _outline(draw, tag, scale, is_used=tag.id not in marks.refused)
        if tag.id in marks.off_px:
            _residual(draw, tag, marks.off_px[tag.id], scale)
    out = io.BytesIO()
    picture.save(out, "JPEG", quality=_QUALITY)
    return out.getvalue()


def _outline(draw: ImageDraw.ImageDraw, tag: TagSeen, scale: float, *, is_used: bool) -> None:
    colour = GREEN if is_used else AMBER
    corners = [_shown(corner, scale) for corner in tag.corners_px]
    draw.line([*corners, corners[0]], fill=colour, width=2)
    right, bottom = (max(corner[i] for corner in corners) for i in (0, 1))
    draw.text((right + 3, bottom + 1), str(tag.id), fill=colour)


def _residual(
    draw: ImageDraw.ImageDraw, tag: TagSeen, off_px: tuple[float, float], scale: float
) -> None:
    middle = [sum(corner[i] for corner in tag.corners_px) / 4.0 for i in (0, 1)]
    end = (middle[0] + ENLARGED * off_px[0], middle[1] + ENLARGED * off_px[1])
    draw.line([_shown((middle[0], middle[1]), scale), _shown(end, scale)], fill=WHITE, width=1)


def _dashed(draw: ImageDraw.ImageDraw, region: Region, scale: float) -> None:
    left, top = _shown((region.left, region.top), scale)
    right, bottom = _shown((region.right, region.bottom), scale)
    for x in range(int(left), int(right), 2 * _DASH_PX):
        for y in (top, bottom):
            draw.line([(x, y), (min(x + _DASH_PX, right), y)], fill=WHITE)
    for y in range(int(top), int(bottom), 2 * _DASH_PX):
        for x in (left, right):
            draw.line([(x, y), (x, min(y + _DASH_PX, bottom))], fill=WHITE)


def _shown(pixel: tuple[float, float], scale: float) -> tuple[float, float]:
    return (pixel[0] + 0.5) * scale - 0.5, (pixel[1] + 0.5) * scale - 0.5
