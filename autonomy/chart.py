"""Charts: outlines and depth grids too large for a document, kept in files named by their content.

A document of a water (``autonomy.site.Site``) refers to a chart by its SHA-256. Whoever has the
file looks there; whoever has not, such as a robot, makes do with the coarser outline and floor of
the document itself, which leave the water of the chart nowhere.
"""

import os
import threading
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.content_file import content_of, find_content, head_of, keep_content
from autonomy.outline import Outline

FOLDERS_VARIABLE = "GRACE_CHARTS"
"""Environment variable with the folders of charts, which worker processes inherit."""
CORNERS_MAX = 20_000
LINES_MAX = 2_000
_SUFFIX = ".chart"
_MAGIC = b"GRACE chart 1\n"
_LOADED_MAX = 8
Depths = npt.NDArray[np.float32]


@dataclass(frozen=True)
class DepthGrid:
    """Depth of the floor at the crossings of evenly spaced lines, bilinear in between."""

    north_m: FloatArray
    """Northings of the lines, ascending, shape ``(rows,)``."""
    east_m: FloatArray
    """Eastings of the lines, ascending, shape ``(columns,)``."""
    depth_m: Depths
    """Depth below the chart's datum, 0 or less on land, shape ``(rows, columns)``."""

    def floor_m(self, north_m: npt.ArrayLike, east_m: npt.ArrayLike) -> FloatArray:
        """Return the floor's depth; beyond the outermost lines it goes on as it is there.

        Args:
            north_m: Northings, any shape.
            east_m: Eastings, of a shape that goes with it.
        """
        i, along = between_lines(self.north_m, np.asarray(north_m, float))
        j, across = between_lines(self.east_m, np.asarray(east_m, float))
        depth = self.depth_m
        south = depth[i, j] + across * (depth[i, j + 1] - depth[i, j])
        north = depth[i + 1, j] + across * (depth[i + 1, j + 1] - depth[i + 1, j])
        return np.asarray(south + along * (north - south), dtype=np.float64)


def between_lines(lines: FloatArray, values: FloatArray) -> tuple[npt.NDArray[np.intp], FloatArray]:
    """Return the line below each value, and how far (0..1) the value is on to the next."""
    below = np.clip(np.searchsorted(lines, values, side="right") - 1, 0, len(lines) - 2)
    part = (values - lines[below]) / (lines[below + 1] - lines[below])
    return below, np.clip(part, 0.0, 1.0)


@dataclass(frozen=True)
class Chart:
    """An outline with its islands, a depth grid, or both, in the frame of one water."""

    rings: tuple[FloatArray, ...] = ()
    """The shoreline, then the islands: corners north and east, each of shape ``(n, 2)``, m."""
    depths: DepthGrid | None = None

    @cached_property
    def shore(self) -> Outline | None:
        """The shoreline with its islands; None where the chart has depths alone."""
        return Outline(self.rings) if self.rings else None

    def content(self) -> bytes:
        """Return the chart as it is kept; equal charts give equal bytes."""
        grid = self.depths
        head = {
            "rings": [len(ring) for ring in self.rings],
            "rows": 0 if grid is None else len(grid.north_m),
            "columns": 0 if grid is None else len(grid.east_m),
        }
        arrays = [np.ascontiguousarray(ring, "<f8") for ring in self.rings]
        if grid is not None:
            arrays += [np.ascontiguousarray(axis, "<f8") for axis in (grid.north_m, grid.east_m)]
            arrays.append(np.ascontiguousarray(grid.depth_m, "<f4"))
        return content_of(_MAGIC, head, arrays)


class ChartError(ValueError):
    """A file holds no chart, or not the one that its name tells."""


def read_chart(content: bytes) -> Chart:
    """Return the chart that bytes of ``Chart.content`` hold.

    Raises:
        ChartError: If they hold none.
    """
    try:
        head, at = head_of(_MAGIC, content)
        rings: list[FloatArray] = []
        for count in head["rings"]:
            rings.append(np.frombuffer(content, "<f8", 2 * count, at).reshape(count, 2))
            at += 16 * count
        rows, columns = head["rows"], head["columns"]
        if not rows:
            return Chart(tuple(rings))
        north = np.frombuffer(content, "<f8", rows, at)
        east = np.frombuffer(content, "<f8", columns, at + 8 * rows)
        at += 8 * (rows + columns)
        depth = np.frombuffer(content, "<f4", rows * columns, at).reshape(rows, columns)
        return Chart(tuple(rings), DepthGrid(north, east, depth))
    except (KeyError, TypeError, ValueError) as error:
        raise ChartError(f"the file is no chart: {error}") from error


def keep_chart(folder: Path, chart: Chart) -> str:
    """Write a chart into a folder and return its SHA-256; one that is there already stays."""
    return keep_content(folder, chart.content(), _SUFFIX)


class ChartShelf:
    """Finds charts by their SHA-256 in the folders that it was told of; safe between threads.

    One for a whole process is enough, whatever stations run in it: a name tells the content.
    """

    def __init__(self) -> None:
        told = os.environ.get(FOLDERS_VARIABLE, "")
        self._folders = [Path(one) for one in told.split(os.pathsep) if one]
        self._loaded: OrderedDict[str, Chart] = OrderedDict()
        self._lock = threading.Lock()

    def open(self, folder: Path) -> None:
        """Look for charts in one more folder from now on."""
        with self._lock:
            if folder not in self._folders:
                self._folders.append(folder)

    @property
    def folders(self) -> Sequence[Path]:
        """The folders, as ``FOLDERS_VARIABLE`` of a process that is started tells them on."""
        return tuple(self._folders)

    def find(self, sha256: str) -> Chart | None:
        """Return a chart, None where no folder has it whole."""
        with self._lock:
            chart = self._loaded.get(sha256)
            if chart is not None:
                self._loaded.move_to_end(sha256)
                return chart
            chart = self._read(sha256)
            if chart is not None:
                self._loaded[sha256] = chart
                while len(self._loaded) > _LOADED_MAX:
                    self._loaded.popitem(last=False)
            return chart

    def _read(self, sha256: str) -> Chart | None:
        for folder in self._folders:
            content = find_content(folder, sha256, _SUFFIX)
            if content is not None:
                return read_chart(content)
        return None


CHARTS = ChartShelf()
"""The charts of this process."""
