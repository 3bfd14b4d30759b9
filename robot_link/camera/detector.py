"""Finding tags in a picture: the AprilTag library searches, our own line fit places corners.

The library searches a copy in which light greys are spread (``SEARCH_GAMMA``), and of a region one
that is enlarged twice: small, tilted and noisy tags are then found far more often. It is C code
that fails on pictures of a few rows, and when it is made or destroyed among others of its kind;
it is made once in a process, used by one thread, and never destroyed.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt
from pyapriltags import Detector

from autonomy.arrays import FloatArray
from autonomy.vision.corner import area_px2, fit_corners, light_of_grey
from autonomy.vision.corner_kernel import Picture
from autonomy.vision.tag import FAMILY, corners_from_apriltag, from_enlarged
from robot_link.camera.sighting import Pixel, Region, TagSeen

SEARCH_GAMMA: Final = 1.5
HAMMING_MOST: Final = 1
MARGIN_LEAST: Final = 10.0
SHARPENING: Final = 0.25
"""The library's own value; its Python wrapper takes whole numbers alone and would make it 0, which
loses tags of 14 px and blurred ones."""
LEAST_SIDE_PX: Final = 16
"""Of a picture that is handed to the library."""
LEAST_AREA_PX2: Final = 64.0
ENLARGED: Final = 2
ENLARGED_MOST_PX: Final = 400
"""A region of a longer side is searched as it is: what it waits for is large, or anywhere."""
_SAME: Final = 0.5
"""Two finds of one id are one tag if their middles are closer than this part of its side."""
_SIGMA_MOST_PX = 100.0


@dataclass(frozen=True, slots=True)
class Found:
    """What is in one picture."""

    tags: list[TagSeen]
    twice: list[int]
    """Ids that are in it more than once; none of them is among the tags."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A tag as the library found it."""

    id: int
    corners_px: FloatArray
    """In order and in pixels of the whole picture, shape ``(4, 2)``."""
    margin: float
    hamming: int

    def is_same(self, other: "Candidate") -> bool:
        """Tell whether two finds of one id are of one tag."""
        apart = np.linalg.norm(self.corners_px.mean(axis=0) - other.corners_px.mean(axis=0))
        return float(apart) < _SAME * float(np.sqrt(abs(area_px2(self.corners_px))))


class TagDetector:
    """Finds tags in grey pictures of one camera."""

    def __init__(self, gamma: float = 2.2) -> None:
        """Get ready.

        Args:
            gamma: The camera's response curve.
        """
        self._light = light_of_grey(gamma)

    def find(
        self, grey: Picture, regions: Sequence[Region] = (), decimate: float | None = None
    ) -> Found:
        """Find the tags of one picture.

        Args:
            grey: The picture, shape ``(rows, columns)``.
            regions: Where tags are expected; what lies outside of the picture is cut off.
            decimate: How many times smaller the whole picture is made for the search; ``None``
                searches the regions alone.
        """
        candidates = [one for region in regions for one in search_region(grey, region)]
        if decimate is not None:
            candidates += search(grey, decimate)
        once, twice = apart(candidates)
        return Found([self._fitted(grey, one) for one in once if _is_possible(one)], twice)

    def _fitted(self, grey: Picture, found: Candidate) -> TagSeen:
        fit = fit_corners(grey, found.corners_px, self._light)
        return TagSeen(
            found.id,
            _pixels(fit.corners_px),
            min(fit.sigma_px, _SIGMA_MOST_PX),
            found.margin,
            found.hamming,
            min(fit.blur_px, _SIGMA_MOST_PX),
            fit.is_fitted,
        )


def search(grey: Picture, decimate: float = 1.0) -> list[Candidate]:
    """Return what the library finds in a picture, in the picture's pixels.

    Args:
        grey: Shape ``(rows, columns)``; nothing is found in one of fewer than 16 px a side.
        decimate: How many times smaller it is made for the search of squares.
    """
    if min(grey.shape) < LEAST_SIDE_PX:
        return []
    return _candidates(cv2.LUT(grey, _table()), decimate)


def search_region(grey: Picture, region: Region) -> list[Candidate]:
    """Return what the library finds in a part of a picture, enlarged twice."""
    left, top = max(region.left, 0), max(region.top, 0)
    part = grey[top : max(region.bottom, top), left : max(region.right, left)]
    if min(part.shape) < LEAST_SIDE_PX:
        return []
    copy = cv2.LUT(part, _table())
    scale = ENLARGED if max(part.shape) <= ENLARGED_MOST_PX else 1
    if scale > 1:
        copy = cv2.resize(copy, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    begin = np.array([left, top])
    return [
        replace(one, corners_px=begin + from_enlarged(one.corners_px, scale))
        for one in _candidates(copy, 1.0)
    ]


def apart(candidates: Iterable[Candidate]) -> tuple[list[Candidate], list[int]]:
    """Return the tags that are there once, and the ids that are there more than once.

    Of one tag that was found several times, the first find is taken.
    """
    kept: dict[int, Candidate] = {}
    twice: set[int] = set()
    for one in candidates:
        first = kept.setdefault(one.id, one)
        if first is not one and not first.is_same(one):
            twice.add(one.id)
    return [one for one in kept.values() if one.id not in twice], sorted(twice)


class _Library(Detector):
    def __del__(self) -> None:
        """Leave what the library holds to the end of the process."""


@cache
def _library() -> _Library:
    library = _Library(families=FAMILY, nthreads=1, quad_decimate=1.0)
    _set(library, decode_sharpening=SHARPENING)
    return library


def _set(library: _Library, **values: float) -> None:
    """Set numbers of the library itself."""
    settings = library.tag_detector_ptr.contents  # pyright: ignore[reportOptionalMemberAccess]
    for name, value in values.items():
        setattr(settings, name, value)


@cache
def _table() -> Picture:
    return np.round(255.0 * light_of_grey(SEARCH_GAMMA)).astype(np.uint8)


def _candidates(copy: npt.ArrayLike, decimate: float) -> list[Candidate]:
    library = _library()
    _set(library, quad_decimate=decimate)
    return [
        Candidate(
            int(one.tag_id),
            corners_from_apriltag(one.corners),
            float(one.decision_margin),
            int(one.hamming),
        )
        for one in library.detect(np.ascontiguousarray(copy, dtype=np.uint8))
        if one.hamming <= HAMMING_MOST and one.decision_margin > MARGIN_LEAST
    ]


def _is_possible(found: Candidate) -> bool:
    """Tell whether four corners are those of a square that faces the camera, and not tiny."""
    sides = np.roll(found.corners_px, -1, axis=0) - found.corners_px
    ahead = np.roll(sides, -1, axis=0)
    turns = sides[:, 0] * ahead[:, 1] - sides[:, 1] * ahead[:, 0]
    return bool((turns > 0.0).all()) and area_px2(found.corners_px) >= LEAST_AREA_PX2


def _pixels(corners_px: FloatArray) -> tuple[Pixel, Pixel, Pixel, Pixel]:
    (a, b), (c, d), (e, f), (g, h) = corners_px.tolist()
    return (a, b), (c, d), (e, f), (g, h)
