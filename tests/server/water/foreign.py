"""Files of waters as others write them, made when a test runs."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

Ring = list[list[float]]
"""Corners as longitude and latitude, degrees."""

CENTRE = (44.0, -85.0)
"""Latitude and longitude of the bay."""


def bay(corners: int = 40, radius_deg: float = 0.05, wobble: float = 0.0) -> Ring:
    """Return a round bay as a closed ring of longitude and latitude, counter-clockwise."""
    angle = np.linspace(0.0, 2.0 * math.pi, corners, endpoint=False)
    radius = radius_deg * (1.0 + wobble * np.sin(37.0 * angle))
    ring = [
        [round(CENTRE[1] + 1.4 * r * math.cos(a), 8), round(CENTRE[0] + r * math.sin(a), 8)]
        for a, r in zip(angle.tolist(), radius.tolist(), strict=True)
    ]
    return [*ring, ring[0]]


def square(north_deg: float = 0.0, east_deg: float = 0.0, side_deg: float = 0.01) -> Ring:
    """Return a closed ring about a place near the bay's middle, clockwise."""
    x, y, h = CENTRE[1] + east_deg, CENTRE[0] + north_deg, side_deg / 2.0
    return [[x - h, y - h], [x - h, y + h], [x + h, y + h], [x + h, y - h], [x - h, y - h]]


BOW_TIE = [[-85.0, 44.0], [-84.9, 44.1], [-84.9, 44.0], [-85.0, 44.1], [-85.0, 44.0]]
FIJI = [[179.9, -17.0], [-179.9, -17.0], [-179.9, -16.9], [179.9, -16.9], [179.9, -17.0]]
UTM = [[659_000.0, 4_873_000.0], [661_000.0, 4_873_000.0], [661_000.0, 4_875_000.0]]
UTM.append(UTM[0])


def feature(geometry: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": geometry, "coordinates": coordinates},
        "properties": properties,
    }


def geojson(*features: Any, **more: Any) -> bytes:
    return json.dumps({"type": "FeatureCollection", "features": features, **more}).encode()


def kml(*placemarks: str, head: str = "") -> bytes:
    return (
        '<?xml version="1.0" encoding="UTF-8"?>' + head + "\n"
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>\n'
        + "\n".join(placemarks)
        + "\n</Document></kml>\n"
    ).encode()


def placemark(ring: Ring, name: str = "Bay", holes: Sequence[Ring] = (), more: str = "") -> str:
    def boundary(which: str, corners: Ring) -> str:
        text = " ".join(f"{x},{y},0" for x, y in corners)
        coordinates = f"<coordinates>{text}</coordinates>"
        return f"<{which}><LinearRing>{coordinates}</LinearRing></{which}>"

    inner = "".join(boundary("innerBoundaryIs", hole) for hole in holes)
    shape = f"<Polygon>{boundary('outerBoundaryIs', ring)}{inner}</Polygon>"
    return f"<Placemark><name>{name}</name>{more}{shape}</Placemark>"


def pin(longitude: float, latitude: float, name: str = "Dock") -> str:
    coordinates = f"<coordinates>{longitude},{latitude}</coordinates>"
    return f"<Placemark><name>{name}</name><Point>{coordinates}</Point></Placemark>"


def gpx(*features: str) -> bytes:
    return (
        '<?xml version="1.0"?>\n<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1">\n'
        + "\n".join(features)
        + "\n</gpx>\n"
    ).encode()


def track(ring: Ring, name: str = "Shore") -> str:
    points = "".join(f'<trkpt lat="{y}" lon="{x}"/>' for x, y in ring)
    return f"<trk><name>{name}</name><trkseg>{points}</trkseg></trk>"


def geotiff(
    path: Path,
    values: np.ndarray,
    crs: str = "EPSG:4326",
    west: float = -85.1,
    north: float = 44.1,
    step: float = 0.002,
    **profile: Any,
) -> None:
    import rasterio
    from affine import Affine

    profile = {
        "driver": "GTiff",
        "height": values.shape[0],
        "width": values.shape[1],
        "count": 1,
        "dtype": values.dtype,
        "crs": crs,
        "transform": Affine(step, 0.0, west, 0.0, -step, north),
        **profile,
    }
    with rasterio.open(path, "w", **profile) as raster:
        raster.write(values, 1)


def netcdf(
    path: Path,
    values: np.ndarray,
    lat: np.ndarray,
    lon: np.ndarray,
    *,
    name: str = "elevation",
    axes: tuple[str, str] = ("lat", "lon"),
    units: str = "m",
    **words: Any,
) -> None:
    import netCDF4

    data: Any
    with netCDF4.Dataset(path, "w") as data:
        for axis, along in zip(axes, (lat, lon), strict=True):
            data.createDimension(axis, len(along))
            data.createVariable(axis, "f8", (axis,))[:] = along
            data[axis].units = {"lat": "degrees_north", "lon": "degrees_east"}.get(axis, "km")
        grid = data.createVariable(name, "f4", axes, fill_value=-32767.0)
        grid.setncatts({"units": units, **words})
        grid[:] = values


def bowl(rows: int = 100, columns: int = 100, deepest: float = 30.0) -> np.ndarray:
    """Return heights of a bowl: negative in its middle, land at its rim."""
    y, x = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    return (-deepest * (1.0 - 1.2 * (x**2 + y**2))).astype(np.float32)
