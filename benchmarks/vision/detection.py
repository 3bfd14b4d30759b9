"""Which drawn tags are found and how well corners are placed, beside the libraries as they are.

Patches are drawn when this runs: blur 0.8 px, noise 3 of 255, gamma 2.2, tilt 20 deg, turned and
shifted at random, unless a row says otherwise. ``AprilTag as is`` is the library with its own
values and its own corners, as its Python package makes it; ``ArUco`` is OpenCV's detector on a
picture enlarged twice, with the smallest windows, bits and error rates opened up.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import cv2
import numpy as np
from pyapriltags import Detector

from autonomy.vision.corner import fit_corners
from autonomy.vision.tag import corners_from_apriltag, from_enlarged
from robot_link.camera.detector import TagDetector
from robot_link.camera.sighting import Region
from tests.robot_link.camera.drawn import patch, scene

PATCHES, PATCHES_BESIDE = 50, 30
"""A cell; of cells without a bar fewer."""
Finds = list[tuple[int, np.ndarray]]
OURS, AS_IS, ARUCO = "ours", "AprilTag as is", "ArUco tuned"


@dataclass
class Cell:
    name: str
    side_px: float
    share: float | None = None
    """The bar."""
    corner_px: float | None = None
    patch: dict[str, float] = field(default_factory=dict)


CELLS = (
    Cell("14 px", 14),
    Cell("16 px", 16, 0.60),
    Cell("20 px", 20, 0.95, 0.15),
    Cell("24 px", 24),
    Cell("32 px", 32),
    Cell("48 px", 48),
    Cell("24 px, noise 15", 24, 0.95, None, {"noise": 15.0}),
    Cell("24 px, blur 1.2 px", 24, None, None, {"blur_px": 1.2}),
    Cell("24 px, blur 1.6 px", 24, None, None, {"blur_px": 1.6}),
    Cell("24 px at 60 deg", 24, None, None, {"tilt_deg": 60.0}),
    Cell("32 px at 70 deg", 32, None, None, {"tilt_deg": 70.0}),
    Cell("24 px, caustics 50 %", 24, None, None, {"caustics": 0.5}),
    Cell("24 px, motion 4 px", 24, None, None, {"motion_px": 4.0}),
)


def measure() -> list[dict[str, Any]]:
    seed = int(np.random.default_rng().integers(2**31))
    finders = {OURS: ours(), AS_IS: as_is(), ARUCO: aruco()}
    rows: list[dict[str, Any]] = []
    wrong = dict.fromkeys(finders, 0)
    for i, cell in enumerate(CELLS):
        for who, finder in finders.items():
            share, corner_px, false = measured(cell, finder, np.random.default_rng([seed, i]))
            wrong[who] += false
            is_ours = who == OURS
            bar = cell.share if is_ours else None
            met = None if bar is None else bool(share >= bar)
            name = f"{cell.name}, {who}"
            rows.append({**row(f"Found at {name} (seed {seed})", share, "", bar), "met": met})
            corner_bar = cell.corner_px if is_ours else None
            rows.append(row(f"Corners at {name}: median rms", corner_px, "px", corner_bar))
    for who, count in wrong.items():
        rows.append(row(f"False ids, {who}", count, "", 0 if who == OURS else None))
    return rows + speed(seed)


def measured(
    cell: Cell, finder: Callable[[np.ndarray], Finds], rng: np.random.Generator
) -> tuple[float, float, int]:
    """Return share of patches found, median rms of their corners, and how many ids were wrong."""
    patches = PATCHES_BESIDE if cell.share is None else PATCHES
    off: list[float] = []
    wrong = 0
    for tag_id in rng.integers(0, 587, patches).tolist():
        grey, corners = patch(rng, tag_id, cell.side_px, **cell.patch)
        for found_id, found_px in finder(grey):
            if found_id == tag_id:
                off.append(float(np.sqrt(np.mean((found_px - corners) ** 2))))
            else:
                wrong += 1
    return len(off) / patches, float(np.median(off)) if off else float("nan"), wrong


def ours() -> Callable[[np.ndarray], Finds]:
    detector = TagDetector()

    def find(grey: np.ndarray) -> Finds:
        whole = Region(0, 0, grey.shape[1], grey.shape[0])
        return [(t.id, np.array(t.corners_px)) for t in detector.find(grey, [whole]).tags]

    return find


def as_is() -> Callable[[np.ndarray], Finds]:
    library = Detector(quad_decimate=1.0)

    def find(grey: np.ndarray) -> Finds:
        return [(t.tag_id, corners_from_apriltag(t.corners)) for t in library.detect(grey)]

    return find


def aruco() -> Callable[[np.ndarray], Finds]:
    values = cv2.aruco.DetectorParameters()
    values.adaptiveThreshWinSizeMin, values.adaptiveThreshWinSizeMax = 3, 43
    values.adaptiveThreshWinSizeStep = 4
    values.minMarkerPerimeterRate = 0.01
    values.perspectiveRemovePixelPerCell = 8
    values.errorCorrectionRate = 1.0
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    library = cv2.aruco.ArucoDetector(dictionary, values)

    def find(grey: np.ndarray) -> Finds:
        large = cv2.resize(grey, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
        corners, ids, _ = library.detectMarkers(large)
        numbers = [] if ids is None else np.ravel(ids).tolist()
        return [
            (n, from_enlarged(c.reshape(4, 2), 2)) for n, c in zip(numbers, corners, strict=True)
        ]

    return find


def speed(seed: int) -> list[dict[str, Any]]:
    rng = np.random.default_rng(seed)
    places = {i: (120.0 + 140.0 * i, 150.0 + 180.0 * (i % 3), 28.0) for i in range(8)}
    grey, corners = scene(rng, (1280, 720), places)
    detector = TagDetector()
    region = [Region(40, 70, 200, 230)]
    jpeg = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, 80])[1]
    rows = [
        row("Region of 160 px and its tag", ms(lambda: detector.find(grey, region)), "ms", 10),
        row("Line fit of a tag", ms(lambda: fit_corners(grey, corners[0] + 0.3)), "ms", 1),
        row("Reading a JPEG of 1280 x 720", ms(lambda: cv2.imdecode(jpeg, 0)), "ms", None),
    ]
    for decimate in (1.0, 1.5, 2.0):
        taken = ms(partial(detector.find, grey, (), decimate))
        rows.append(row(f"Whole picture 1280 x 720, decimate {decimate:g}", taken, "ms", None))
    return rows


def ms(work: Callable[[], object]) -> float:
    """Return the median of the time that something takes, of one thread."""
    cv2.setNumThreads(1)
    work()
    taken: list[float] = []
    for _ in range(30):
        begun = time.process_time()
        work()
        taken.append(time.process_time() - begun)
    return 1e3 * float(np.median(taken))


def row(name: str, value: float, unit: str, bar: float | None) -> dict[str, Any]:
    return {
        "area": "camera_detection",
        "name": name,
        "value": None if np.isnan(value) else float(value),
        "unit": unit,
        "bar": bar,
        "met": None if bar is None else bool(value <= bar),
    }
