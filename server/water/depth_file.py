"""Depths from GeoTIFF, NetCDF and XYZ text, as grids in the coordinates of their file.

Files are larger than what is kept: they are thinned as they are read, to the shallowest of what
falls together, so that nothing that is kept is deeper than the file.
"""

import math
import re
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.chart import LINES_MAX
from server.water.proposal import DepthField, Reading, ReadingError

Tick = Callable[[float], None]
"""Told how far the reading is, 0 .. 1; raises ``ReadingStoppedError`` to end it."""
_LINES_READ_MAX = 100_000
_POINTS_MAX = 20_000_000
_BYTES_MAX = 256 << 20
_BLOCK_CELLS = 8_000_000
_DEPTH_MAX_M = 12_000.0
_GEOGRAPHIC = "EPSG:4326"
_DEPTH_NAMES = re.compile(r"depth|deep|sound|bathy", re.IGNORECASE)
_HEIGHT_NAMES = re.compile(r"elev|height|altitude|topo|^z$", re.IGNORECASE)


def read_geotiff(path: Path, crs: str, tick: Tick) -> Reading:
    """Read the first band of a GeoTIFF.

    Args:
        path: The file.
        crs: What its coordinates are, where it does not tell; "" believes the file.
        tick: See ``Tick``.

    Raises:
        ReadingError: In words.
    """
    import rasterio
    from rasterio.errors import RasterioError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with rasterio.open(path, driver="GTiff") as raster:
                return _raster(raster, crs, tick)
    except (RasterioError, OSError) as error:
        raise ReadingError(("", f"no GeoTIFF that can be read: {error}")) from error


def _raster(raster: Any, crs: str, tick: Tick) -> Reading:  # noqa: ANN401 - rasterio has no types
    transform, told = raster.transform, raster.crs
    if not crs and told is None:
        raise ReadingError(("crs", "the file names no coordinate reference system; give it"))
    if transform.is_identity or transform.b != 0.0 or transform.d != 0.0:
        raise ReadingError(("", "the file's grid is turned or not placed; make it north-up"))
    if raster.dtypes[0].startswith("complex"):
        raise ReadingError(("", "the file's numbers are complex, no depths"))
    rows, columns = raster.height, raster.width
    if max(rows, columns) > _LINES_READ_MAX:
        raise ReadingError(("", f"{rows} x {columns} are more than {_LINES_READ_MAX} lines"))
    x = transform.c + transform.a * (np.arange(columns) + 0.5)
    y = transform.f + transform.e * (np.arange(rows) + 0.5)
    name = " ".join(filter(None, [raster.descriptions[0], raster.tags(1).get("long_name")]))

    def block(first: int, behind: int) -> FloatArray:
        window = ((first, behind), (0, columns))
        values = raster.read(1, window=window, masked=True).astype(np.float64)
        return np.ma.filled(values * raster.scales[0] + raster.offsets[0], np.nan)

    notes = [] if raster.count == 1 else [f"The first of {raster.count} bands was taken."]
    return _thinned("GeoTIFF", x, y, block, crs or told.to_wkt(), name, notes, tick)


def read_netcdf(path: Path, crs: str, tick: Tick) -> Reading:
    """Read a NetCDF grid as GEBCO distributes them: ``lat``, ``lon`` and ``elevation``.

    Args:
        path: The file.
        crs: What its coordinates are, where they are no degrees of WGS84.
        tick: See ``Tick``.

    Raises:
        ReadingError: In words.
    """
    import netCDF4

    if not path.stat().st_size:
        raise ReadingError(("", "the file is empty"))
    try:
        with netCDF4.Dataset(path) as data:
            return _grid_of(data, crs, tick)
    except (OSError, RuntimeError, ValueError, KeyError, IndexError) as error:
        if isinstance(error, ReadingError):
            raise
        raise ReadingError(
            ("", f"no NetCDF file that can be read: {getattr(error, 'strerror', None) or error}")
        ) from error


def _grid_of(data: Any, crs: str, tick: Tick) -> Reading:  # noqa: ANN401 - netCDF4 has no types
    grids = [v for v in data.variables.values() if v.ndim == 2 and v.dtype != str]
    grids = [v for v in grids if all(name in data.variables for name in v.dimensions)]
    named = [v for v in grids if _DEPTH_NAMES.search(_words(v)) or _HEIGHT_NAMES.search(_words(v))]
    if not grids:
        raise ReadingError(("", "the file has no grid over latitude and longitude"))
    if len(named or grids) > 1:
        names = ", ".join(v.name for v in named or grids)
        raise ReadingError(("", f"the file has several grids ({names}); leave one"))
    grid = (named or grids)[0]
    axes = [data.variables[name] for name in grid.dimensions]
    is_turned = bool(re.match(r"lon|x|east", axes[0].name, re.IGNORECASE))
    y_axis, x_axis = (axes[1], axes[0]) if is_turned else axes
    if not crs and not re.match("degree", getattr(x_axis, "units", "degrees_east")):
        raise ReadingError(("crs", f"{x_axis.name} is in {x_axis.units}; give the crs of the file"))
    x, y = (np.ma.filled(axis[:].astype(np.float64), np.nan) for axis in (x_axis, y_axis))
    if not crs and x.max() > 180.0:
        x = np.where(x > 180.0, x - 360.0, x)
        if (np.diff(x) < 0.0).any() and x[0] < 0.0 < x[-1]:
            raise ReadingError(("", "the grid crosses the antimeridian (longitude 180)"))

    def block(first: int, behind: int) -> FloatArray:
        values = grid[:, first:behind].T if is_turned else grid[first:behind]
        return np.ma.filled(np.ma.asarray(values).astype(np.float64), np.nan)

    unit = getattr(grid, "units", "m")
    if unit not in ("m", "meter", "meters", "metre", "metres"):
        raise ReadingError((grid.name, f"is in {unit}, not in m"))
    said = _words(grid)
    if getattr(grid, "positive", "") == "down":
        said = "depth"
    return _thinned("NetCDF", x, y, block, crs or _GEOGRAPHIC, said, [], tick)


def _words(variable: Any) -> str:  # noqa: ANN401 - netCDF4 has no types
    told = [
        variable.name,
        getattr(variable, "standard_name", ""),
        getattr(variable, "long_name", ""),
    ]
    return " ".join(map(str, told))


def _thinned(
    form: str,
    x: FloatArray,
    y: FloatArray,
    block: Callable[[int, int], FloatArray],
    crs: str,
    name: str,
    notes: list[str],
    tick: Tick,
) -> Reading:
    """Read a grid block by block, to at most ``LINES_MAX`` lines a side."""
    for axis, title in ((x, "x"), (y, "y")):
        steps = np.diff(axis)
        if (
            len(axis) < 2
            or not np.isfinite(axis).all()
            or not ((steps > 0).all() or (steps < 0).all())
        ):
            raise ReadingError((title, "needs at least two coordinates that ascend or descend"))
    are_heights = _are_heights(name, block, len(y))
    step_y, step_x = (math.ceil(len(axis) / LINES_MAX) for axis in (y, x))
    rows_at_once = max(step_y, _BLOCK_CELLS // len(x) // step_y * step_y)
    parts: list[npt.NDArray[np.float32]] = []
    for first in range(0, len(y), rows_at_once):
        behind = min(first + rows_at_once, len(y))
        values = block(first, behind)
        values[np.abs(values) > _DEPTH_MAX_M] = np.nan
        parts.append(_shallowest(values, step_y, step_x, are_heights).astype(np.float32))
        tick(behind / len(y))
    values = np.concatenate(parts)
    x, y = _middles(x, step_x), _middles(y, step_y)
    if x[0] > x[-1]:
        x, values = x[::-1].copy(), values[:, ::-1].copy()
    if y[0] > y[-1]:
        y, values = y[::-1].copy(), values[::-1].copy()
    if max(step_x, step_y) > 1:
        notes.append(
            f"Of every {step_y} x {step_x} points of the file the shallowest is kept"
            f" ({LINES_MAX} lines a side are the most)."
        )
    return _reading(form, DepthField(x, y, values, crs, are_heights), notes)


def _shallowest(values: FloatArray, step_y: int, step_x: int, are_heights: bool) -> FloatArray:
    if max(step_y, step_x) == 1:
        return values
    worst = -np.inf if are_heights else np.inf
    pick = np.fmax if are_heights else np.fmin
    rows = pick.reduceat(values, np.arange(0, len(values), step_y), axis=0)
    thin = pick.reduceat(rows, np.arange(0, values.shape[1], step_x), axis=1)
    return np.where(thin == worst, np.nan, thin)


def _middles(axis: FloatArray, step: int) -> FloatArray:
    starts = np.arange(0, len(axis), step)
    return np.add.reduceat(axis, starts) / np.diff(np.append(starts, len(axis)))


def _are_heights(name: str, block: Callable[[int, int], FloatArray], rows: int) -> bool:
    """Guess whether numbers are heights: by what the file calls them, else by their signs."""
    if _DEPTH_NAMES.search(name) and not _HEIGHT_NAMES.search(name):
        if not re.search("bathy", name, re.IGNORECASE):
            return False
    elif _HEIGHT_NAMES.search(name):
        return True
    seen = np.concatenate(
        [block(k, k + 1).ravel() for k in np.linspace(0, rows - 1, 16, dtype=int)]
    )
    known = seen[np.isfinite(seen)]
    return bool(len(known)) and bool(np.median(known) < 0.0)


def read_xyz(path: Path, crs: str, tick: Tick) -> Reading:
    """Read text with x, y and depth in three columns; x and y are longitude and latitude.

    Args:
        path: The file; columns are parted by spaces, tabs, commas or semicolons, a first line may
            name them, and lines that begin with ``#`` are left out.
        crs: What x and y are, where they are no degrees of WGS84.
        tick: See ``Tick``.

    Raises:
        ReadingError: With the line at fault.
    """
    size = path.stat().st_size
    if size > _BYTES_MAX:
        raise ReadingError(
            ("", f"{size / 2**20:.0f} MB are more than the {_BYTES_MAX >> 20} taken")
        )
    with path.open("rb") as file:
        points, name = _points(file, size, tick)
    if len(points) < 4:
        raise ReadingError(("", "needs four points at least"))
    if not crs:
        beyond = (np.abs(points[:, 0]) > 180.0) | (np.abs(points[:, 1]) > 90.0)
        if beyond.any():
            x, y = points[int(beyond.argmax()), :2]
            raise ReadingError(
                ("crs", f"{x:g}, {y:g} are no longitude and latitude; give the crs of the file")
            )
    notes: list[str] = []
    x, y, values, are_spread = _gridded(points)
    are_heights = bool(_HEIGHT_NAMES.search(name)) if name else bool(np.median(points[:, 2]) < 0.0)
    if are_spread:
        notes.append(
            "The points lie on no grid; each cell has the mean of its own, or its nearest's."
        )
    return _reading("XYZ text", DepthField(x, y, values, crs or _GEOGRAPHIC, are_heights), notes)


def _points(file: Any, size: int, tick: Tick) -> tuple[FloatArray, str]:  # noqa: ANN401 - a file
    rows: list[tuple[float, float, float]] = []
    name = ""
    for number, line in enumerate(_lines(file), start=1):
        words = line.replace(",", " ").replace(";", " ").split()
        if not words or words[0].startswith("#"):
            continue
        try:
            x, y, z = map(float, words[:3])
        except ValueError as error:
            if not rows and not name:
                name = words[2] if len(words) > 2 else words[-1]
                continue
            raise ReadingError(
                (f"line {number}", f"needs x, y and depth: {line[:40]!r}")
            ) from error
        if not (math.isfinite(x) and math.isfinite(y)):
            raise ReadingError((f"line {number}", "x and y must be finite"))
        if abs(z) > _DEPTH_MAX_M:
            raise ReadingError((f"line {number}", f"{z:g} m is no depth on earth"))
        rows.append((x, y, z))
        if len(rows) > _POINTS_MAX:
            raise ReadingError((f"line {number}", f"more than the {_POINTS_MAX} points taken"))
        if len(rows) % 50_000 == 0:
            tick(min(file.tell() / size, 0.9))
    return np.array(rows, dtype=np.float64).reshape(-1, 3), name


def _lines(file: Any) -> Iterator[str]:  # noqa: ANN401 - a file
    for number, line in enumerate(file, start=1):
        if b"\0" in line or len(line) > 10_000:
            raise ReadingError((f"line {number}", "is no text"))
        try:
            yield line.decode("utf-8-sig" if number == 1 else "utf-8").strip()
        except UnicodeDecodeError as error:
            raise ReadingError((f"line {number}", "is no UTF-8 text")) from error


def _gridded(
    points: FloatArray,
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.float32], bool]:
    """Lay points on the grid that they are of, or on one that has about one in each cell."""
    axes = [np.unique(points[:, k]) for k in (0, 1)]
    are_spread = len(axes[0]) * len(axes[1]) > 4 * len(points)
    if are_spread or max(map(len, axes)) > LINES_MAX:
        spans = np.ptp(points[:, :2], axis=0)
        if spans.min() <= 0.0:
            raise ReadingError(("", "all points lie on one line"))
        cell = max(math.sqrt(spans[0] * spans[1] / len(points)), spans.max() / (LINES_MAX - 1))
        axes = [
            points[:, k].min() + cell * np.arange(max(math.ceil(spans[k] / cell - 1e-9) + 1, 2))
            for k in (0, 1)
        ]
    if min(map(len, axes)) < 2:
        raise ReadingError(("", "all points lie on one line"))
    at = [_nearest(axes[k], points[:, k]) for k in (0, 1)]
    shape = (len(axes[1]), len(axes[0]))
    total, count = np.zeros(shape), np.zeros(shape)
    np.add.at(total, (at[1], at[0]), points[:, 2])
    np.add.at(count, (at[1], at[0]), 1.0)
    with np.errstate(invalid="ignore"):
        values = total / count
    if are_spread and np.isnan(values).any():
        from scipy.ndimage import distance_transform_edt

        nearest: Any = distance_transform_edt(
            np.isnan(values), return_distances=False, return_indices=True
        )
        values = values[tuple(nearest)]
    return axes[0], axes[1], values.astype(np.float32), are_spread


def _nearest(axis: FloatArray, values: FloatArray) -> npt.NDArray[np.intp]:
    middles = 0.5 * (axis[1:] + axis[:-1])
    return np.searchsorted(middles, values)


def _reading(form: str, grid: DepthField, notes: list[str]) -> Reading:
    """Return a grid that holds something, with its reference system in words."""
    if not np.isfinite(grid.values).any():
        raise ReadingError(("", "the file holds no depths: every point is empty"))
    crs, datum = describe_crs(grid.crs)
    unknown = float(np.isnan(grid.values).mean())
    if unknown > 0.0:
        notes.append(f"{unknown:.1%} of the points are empty; they are taken as land.")
    if grid.are_heights:
        notes.append("Depths are given as negative heights; they are turned to depths.")
    if "World Geodetic System 1984" not in datum and "WGS 84" not in datum:
        notes.append(f"The file's datum is {datum}; its positions are converted to WGS 84.")
    elif crs != describe_crs(_GEOGRAPHIC)[0]:
        notes.append(f"The file is in {crs}; its positions are converted to WGS 84 degrees.")
    return Reading(form, crs, datum, depths=grid, warnings=notes)


def describe_crs(crs: str) -> tuple[str, str]:
    """Return a reference system and its datum in words.

    Raises:
        ReadingError: If it is none, or not one of places on the earth.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        found = CRS.from_user_input(crs)
    except CRSError as error:
        raise ReadingError(
            ("crs", f"{crs[:60]!r} is no reference system, such as EPSG:32617")
        ) from error
    if not (found.is_geographic or found.is_projected) or found.geodetic_crs is None:
        raise ReadingError(("crs", f"{found.name} places nothing on the earth"))
    code = found.to_epsg()
    datum = found.geodetic_crs.datum
    name = found.name if code is None else f"{found.name} (EPSG:{code})"
    return name, "unknown" if datum is None else datum.name
