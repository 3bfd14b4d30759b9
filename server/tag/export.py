"""Detections as CSV with the columns of VUE, and what the water was like where each was heard.

Behind the ten columns stand, for every variable that was mapped, its mean, standard deviation and
the time of the map: of all maps the one nearest in time to the detection.
"""

from collections.abc import Generator, Sequence

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.frames import wgs84_from_ned
from autonomy.site import Site
from db.query.measured.detections import DetectionRecord
from server.tag.heard import Heard
from server.tag.maps import MappedVariable
from server.tag.vue import VueRow, header, written
from webui.scene.source import MapView

_LINES_AT_ONCE = 1000
_DOUBTFUL = "Doubtful"


def _columns(variable: MappedVariable) -> tuple[str, str, str]:
    return (
        f"{variable.title} mean [{variable.unit}]",
        f"{variable.title} std [{variable.unit}]",
        f"{variable.title} map (UTC)",
    )


def csv_blocks(
    found: Heard, variables: Sequence[MappedVariable], site: Site, *, is_simulation: bool
) -> Generator[str]:
    """Yield the file in pieces; simulated data says so in the name of its station."""
    more = [_DOUBTFUL, *(name for variable in variables for name in _columns(variable))]
    yield header(more)
    for first in range(0, len(found.records), _LINES_AT_ONCE):
        records = found.records[first : first + _LINES_AT_ONCE]
        doubts = found.doubtful[first : first + _LINES_AT_ONCE].tolist()
        told = [_told(records, variable) for variable in variables]
        lines: list[str] = []
        for index, (record, is_doubtful) in enumerate(zip(records, doubts, strict=True)):
            cells = [cell for column in told for cell in column[index]]
            row = _row(record, site, is_simulation=is_simulation)
            lines.append(written(row, ["yes" if is_doubtful else "no", *cells]))
        yield "".join(lines)


def _row(record: DetectionRecord, site: Site, *, is_simulation: bool) -> VueRow:
    place = None
    if record.north_m is not None and record.east_m is not None:
        north_east = np.array([record.north_m, record.east_m])
        latitude, longitude = wgs84_from_ned(
            north_east, site.origin_latitude_deg, site.origin_longitude_deg
        )
        place = float(latitude), float(longitude)
    station = record.station or record.robot
    return VueRow(
        line=0,
        measured_at=record.measured_at,
        receiver=record.receiver,
        tag=record.tag,
        tag_name=record.tag_name,
        tag_serial=record.tag_serial,
        sensor=record.sensor,
        sensor_unit=record.sensor_unit,
        station=f"SIMULATION {station}" if is_simulation else station,
        place_deg=place,
    )


def _told(
    records: Sequence[DetectionRecord], variable: MappedVariable
) -> list[tuple[str, str, str]]:
    """Return the cells of one variable for each detection."""
    cells = [("", "", "")] * len(records)
    by_map: dict[int, list[int]] = {}
    for index, record in enumerate(records):
        if record.north_m is not None and record.east_m is not None:
            by_map.setdefault(variable.nearest(record.measured_at), []).append(index)
    for which, indices in by_map.items():
        view = variable.maps[which]
        points = np.array(
            [(records[i].north_m, records[i].east_m, records[i].depth_m or 0.0) for i in indices]
        )
        at = f"{variable.times[which]:%Y-%m-%d %H:%M:%S}"
        means, stds = _in_unit(view, _at_points(view, view.mean, points), points)
        for index, mean, std in zip(indices, means.tolist(), stds.tolist(), strict=True):
            if np.isfinite(mean) and np.isfinite(std):
                cells[index] = (f"{mean:.5g}", f"{std:.3g}", at)
    return cells


def _in_unit(view: MapView, mean: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard deviation in the variable's unit; of a logarithm the log-normal."""
    std = _at_points(view, view.std, points)
    if view.variable.scale != "log":
        return mean, std
    middle = np.exp(mean + 0.5 * std**2)
    return middle, middle * np.sqrt(np.expm1(std**2))


def _at_points(view: MapView, values: FloatArray, points: FloatArray) -> FloatArray:
    """Return the grid's value nearest to each point; NaN outside it by more than a cell."""
    places: list[IntArray] = []
    outside = np.zeros(len(points), dtype=np.bool_)
    for axis, at in zip((view.x_m, view.y_m, view.z_m), points.T, strict=True):
        index = np.clip(np.searchsorted(axis, at), 1, max(1, len(axis) - 1))
        if len(axis) == 1:
            places.append(np.zeros(len(points), dtype=np.int64))
            continue
        index = index - (at - axis[index - 1] < axis[index] - at)
        places.append(index)
        cell = float(np.max(np.diff(axis)))
        outside |= (at < axis[0] - cell) | (at > axis[-1] + cell)
    found = values[tuple(places)]
    return np.where(outside, np.nan, found)
