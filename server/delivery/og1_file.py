"""Writes a deployment as a file of OG1.0 and CF-1.10, block by block.

Source: OG1.0 format manual (OceanGliders), with the right column of the table where manual and
checkers disagree: lower-case attributes, ``coordinates`` with blanks, dates without separators.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import netCDF4
import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray
from autonomy.channel import Channel
from autonomy.field.fidelity import fidelity_level
from autonomy.quality import phase as phases
from autonomy.quality.flag import OG1_FILL, FlagArray
from db.query.measured.merged_rows import RowBlock
from robot_link.messages import RobotMode
from server.base.worker import IsCancelled, Report
from server.delivery.file_order import FileOrder
from server.delivery.judged import (
    DEPTH,
    POSITION,
    Judged,
    Placed,
    add_rows,
    blocks_of,
    places_of,
)
from server.delivery.og1_channel import FileVariable, file_variable, vocabulary
from server.delivery.og1_header import Extent, write_header
from server.delivery.og1_state import STATE_VARIABLES, state_values

DIMENSION: Final = "N_MEASUREMENTS"
CHUNK_ROWS: Final = 65_536
NO_PLACE: Final = -9999.9
NO_TIME: Final = -1.0
NO_NUMBER: Final = -9999
FIX, RECKONED, SMOOTHED = 1, 2, 3
_DIVING = (RobotMode.DIVING, RobotMode.GLIDING, RobotMode.SPIRALLING)
_SURFACED = (RobotMode.IDLE, RobotMode.TURNING, RobotMode.SURFACED, RobotMode.HOLDING)
_PROPELLED = (RobotMode.SWIMMING, RobotMode.TRACKING, RobotMode.SEARCHING, RobotMode.DRIVEN)


@dataclass(frozen=True, slots=True)
class Written:
    """A file that was written."""

    path: Path
    rows: int
    source_sha256: str
    """Of the rows that it was made of."""
    raised: int
    """Depths above the surface that were set to 0."""


def write_file(
    session: Session,
    rows: "FileRows",
    path: Path,
    report: Report,
    is_cancelled: IsCancelled,
) -> Written:
    """Write the file of rows that were judged in the same session.

    Raises:
        WorkCancelledError: Between two blocks.
        OSError: If the disk has no room.
    """
    digest, raised, offset = hashlib.sha256(), 0, 0
    order, total = rows.order, max(1, len(rows.found.at_us))
    with netCDF4.Dataset(path, "w", format="NETCDF4") as file:
        layout = _Layout(file, rows)
        for block in blocks_of(session, order.wanted, is_cancelled):
            raised += layout.write(offset, block)
            add_rows(digest, block)
            offset += len(block)
            report((0.4 + 0.3 * offset / total, f"Writing row {offset} of {total}"))
        source = digest.hexdigest()
        write_header(file, order, layout.extent, source)
    return Written(path, offset, source, raised)


@dataclass(frozen=True, slots=True, eq=False)
class FileBlock:
    """What stands in a file of the rows of one block."""

    values: Mapping[str, np.ndarray]
    """By variable, shape ``(n,)`` each; a float that is not finite stands for none."""
    placed: Placed
    times_s: FloatArray


class FileRows:
    """What stands in a file for each row, whether it is written or held against what was read."""

    def __init__(self, order: FileOrder, found: Judged) -> None:
        self.order, self.found = order, found
        self.names = {key: file_variable(channel) for key, channel in order.channels.items()}
        times_s = (found.at_us - found.at_us[:1]) / 1e6
        self._phase = self._phases(times_s)
        self._profile, self._direction = phases.profiles(self._phase)
        self._segment = phases.segments(found.has_fix)
        flags = (POSITION, DEPTH, *order.channels)
        self._flags = {key: found.og1(key, order.manual) for key in flags}

    @property
    def has_modes(self) -> bool:
        """Whether the robot told what it did."""
        return not (self.found.mode == phases.NO_MODE).all()

    def of(self, offset: int, block: RowBlock) -> FileBlock:
        """Return what stands there of a block whose first row is the one of this number."""
        rows = slice(offset, offset + len(block))
        placed = places_of(block, self.order.wanted)
        places, known = placed.wgs84, placed.is_known
        times_s = block.measured_at_us / 1e6
        fix = np.where(block.has_fix, 1.0, np.nan)
        level = fidelity_level(block.position_std_m, self.order.thresholds_m)
        is_told = known & np.isfinite(block.position_std_m)
        values: dict[str, np.ndarray] = {
            "TIME": times_s,
            "LATITUDE": places[:, 0],
            "LONGITUDE": places[:, 1],
            "DEPTH": places[:, 2],
            "TIME_GPS": times_s * fix,
            "LATITUDE_GPS": places[:, 0] * fix,
            "LONGITUDE_GPS": places[:, 1] * fix,
            "POSITION_STD": np.where(known, block.position_std_m, np.nan),
            "POSITION_SOURCE": self._source(block, known),
            "FIDELITY_LEVEL": np.where(is_told, level, OG1_FILL),
        }
        for key, named in self.names.items():
            values[named.name] = block.value[key]
            values[f"{named.name}_QC"] = self._flags[key][rows]
        for one in STATE_VARIABLES:
            values[one.name] = state_values(block, one.key, self.order.wanted)
        return FileBlock({**values, **self._numbers(rows, block)}, placed, times_s)

    def _numbers(self, rows: slice, block: RowBlock) -> dict[str, np.ndarray]:
        """Return the flags of place and time, and where in the flight rows are."""
        position, profile = self._flags[POSITION][rows], self._profile[rows]
        late_us = np.int64(self.order.written_at.timestamp() * 1e6) + 60_000_000
        time = np.where(block.measured_at_us > late_us, 4, 1)
        at_fix = np.where(block.has_fix, position, OG1_FILL)
        return {
            "LATITUDE_QC": position,
            "LATITUDE_GPS_QC": at_fix,
            "LONGITUDE_QC": position,
            "LONGITUDE_GPS_QC": at_fix,
            "DEPTH_QC": self._flags[DEPTH][rows],
            "TIME_QC": time,
            "TIME_GPS_QC": np.where(block.has_fix, time, OG1_FILL),
            "PHASE": self._phase[rows],
            "PHASE_QC": np.zeros(len(block), dtype=np.int8),
            "SEGMENT_NUMBER": self._segment[rows],
            "PROFILE_NUMBER": np.where(profile == 0, NO_NUMBER, profile),
            "PROFILE_DIRECTION": self._direction[rows],
        }

    def _source(self, block: RowBlock, known: np.ndarray) -> np.ndarray:
        reckoned = 0 if self.order.robot.kind == "recorded" else RECKONED
        source = np.where(block.has_fix, FIX, np.where(block.is_smoothed, SMOOTHED, reckoned))
        return np.where(known, source, OG1_FILL)

    def _phases(self, times_s: FloatArray) -> FlagArray:
        mode, depth = self.found.mode, self.found.depth_m
        if not self.has_modes:
            return phases.phase_by_depth(depth, times_s)
        return phases.phase_by_mode(
            mode,
            depth,
            times_s,
            diving=tuple(map(int, _DIVING)),
            surfaced=tuple(map(int, _SURFACED)),
            propelled=tuple(map(int, _PROPELLED)),
            aborting=int(RobotMode.ABORTING),
        )


def stored(variable: Any, values: np.ndarray) -> np.ndarray:  # noqa: ANN401 - netCDF4 has no types
    """Return values as a variable has them, with its fill value where there is none."""
    if values.dtype.kind == "f":
        fill = variable.getncattr("_FillValue")
        values = np.where(np.isfinite(values), values, fill)
    return values.astype(variable.dtype)


class _Layout:
    """The variables of one file that have a value for each row."""

    def __init__(self, file: Any, rows: FileRows) -> None:  # noqa: ANN401 - netCDF4 has no types
        self._file, self._rows, self._order = file, rows, rows.order
        self.extent = Extent()
        file.createDimension(DIMENSION, None)
        self._chunk = (min(max(1, len(rows.found.at_us)), CHUNK_ROWS),)
        self._make_places()
        self._make_channels()
        self._make_flight()

    def write(self, offset: int, block: RowBlock) -> int:
        """Write rows from one on; return how many depths were above the surface."""
        found = self._rows.of(offset, block)
        self.extent.take(found.times_s, found.placed.wgs84, block.has_fix)
        for name, values in found.values.items():
            variable = self._file[name]
            variable[offset : offset + len(block)] = stored(variable, values)
        return found.placed.raised

    def _make(self, name: str, kind: str, fill: float, attributes: Mapping[str, Any]) -> None:
        variable = self._file.createVariable(
            name,
            kind,
            (DIMENSION,),
            zlib=True,
            complevel=4,
            shuffle=True,
            chunksizes=self._chunk,
            fill_value=fill,
        )
        variable.set_auto_maskandscale(False)
        variable.setncatts({key: value for key, value in attributes.items() if value is not None})

    def _make_flags(self, name: str, rules: Mapping[str, Any] | None = None) -> None:
        attributes = {
            "long_name": f"quality flag of {name}",
            "standard_name": "status_flag",
            "flag_values": np.array([0, 1, 2, 3, 4], dtype=np.int8),
            "flag_meanings": "no_qc_applied good_data probably_good_data probably_bad_data"
            " bad_data",
            "valid_range": np.array([0, 4], dtype=np.int8),
            **(rules or {}),
        }
        self._make(f"{name}_QC", "i1", OG1_FILL, attributes)

    def _rules(self, rule: str | None) -> dict[str, Any]:
        rules = self._order.wanted.rules
        return {
            "rtqc_methodology": f"IOOS QARTOD tests, rule set {rules.name} {rules.version}",
            "rtqc_rules": rule,
            "rtqc_rule_set_sha256": rules.sha256,
        }

    def _make_places(self) -> None:
        rules = self._order.wanted.rules
        position, depth = (
            self._rules(one.model_dump_json()) for one in (rules.position, rules.depth)
        )
        time = {
            "units": "seconds since 1970-01-01T00:00:00Z",
            "calendar": "gregorian",
            "standard_name": "time",
        }
        places = "POSITION_STD POSITION_SOURCE FIDELITY_LEVEL"
        self._make(
            "TIME",
            "f8",
            NO_TIME,
            {
                **time,
                "long_name": "time of measurement",
                "axis": "T",
                "vocabulary": vocabulary("TIME"),
                "ancillary_variables": "TIME_QC",
            },
        )
        self._make(
            "TIME_GPS",
            "f8",
            NO_TIME,
            {**time, "long_name": "time of each fix", "ancillary_variables": "TIME_GPS_QC"},
        )
        for name, short in (("LATITUDE", "LAT"), ("LONGITUDE", "LON")):
            word = name.lower()
            unit = "degrees_north" if short == "LAT" else "degrees_east"
            limit = 90.0 if short == "LAT" else 180.0
            common = {
                "units": unit,
                "standard_name": word,
                "valid_range": np.array([-limit, limit]),
            }
            self._make(
                name,
                "f8",
                NO_PLACE,
                {
                    **common,
                    "long_name": f"{word} of measurement",
                    "vocabulary": vocabulary(short),
                    "ancillary_variables": f"{name}_QC {places}",
                },
            )
            self._make(
                f"{name}_GPS",
                "f8",
                NO_PLACE,
                {
                    **common,
                    "long_name": f"{word} of each fix",
                    "vocabulary": vocabulary(f"{short}_GPS"),
                    "ancillary_variables": f"{name}_GPS_QC",
                },
            )
            self._make_flags(name, position)
            self._make_flags(f"{name}_GPS", position)
        self._make(
            "DEPTH",
            "f8",
            NO_PLACE,
            {
                "units": "m",
                "standard_name": "depth",
                "long_name": "depth of measurement",
                "positive": "down",
                "axis": "Z",
                "vocabulary": vocabulary("DEPTH"),
                "ancillary_variables": "DEPTH_QC",
            },
        )
        self._make_flags("DEPTH", depth)
        self._make_flags("TIME")
        self._make_flags("TIME_GPS")
        self._make_uncertainty()

    def _make_uncertainty(self) -> None:
        thresholds = self._order.thresholds_m
        self._make(
            "POSITION_STD",
            "f4",
            np.nan,
            {
                "units": "m",
                "long_name": "standard deviation of the horizontal position",
                "comment": "the larger axis of the ellipse, one sigma",
                "coordinates": _COORDINATES,
            },
        )
        self._make(
            "POSITION_SOURCE",
            "i1",
            OG1_FILL,
            {
                "long_name": "where the position comes from",
                "flag_values": np.arange(6, dtype=np.int8),
                "flag_meanings": "unknown fix dead_reckoning smoothed_between_fixes interpolated"
                " simulated_truth",
                "coordinates": _COORDINATES,
            },
        )
        self._make(
            "FIDELITY_LEVEL",
            "i1",
            OG1_FILL,
            {
                "units": "1",
                "long_name": "fidelity level by the uncertainty of the position",
                "comment": "the greatest level is the best located",
                "thresholds_m": np.array(thresholds, dtype=np.float64) if thresholds else None,
                "coordinates": _COORDINATES,
            },
        )

    def _make_channels(self) -> None:
        for key, named in self._rows.names.items():
            channel, rule = self._order.channels[key], self._order.wanted.rules.series.get(key)
            sensor = self._order.metadata.sensors.get(key)
            told = _data(channel, named) | {"sensor": (sensor and sensor.variable) or None}
            if key in self._order.wanted.derived:
                told["comment"] = _COMPUTED
            self._make(named.name, "f4", np.nan, told)
            self._make_flags(
                named.name, self._rules(None if rule is None else rule.model_dump_json())
            )

    def _make_flight(self) -> None:
        for one in STATE_VARIABLES:
            attributes = {
                "units": one.unit,
                "standard_name": one.standard_name,
                "long_name": f"{one.title.lower()} of the robot",
                "comment": one.help,
                "coordinates": _COORDINATES,
            }
            self._make(one.name, "f4", np.nan, attributes)
        how = (
            "from the mode that the robot reported, and its vertical speed"
            if self._rows.has_modes
            else "from the depth alone: five-point mean, 0.02 m/s, surface above 1 m"
        )
        self._make(
            "PHASE",
            "i1",
            OG1_FILL,
            {
                "long_name": "behaviour of the glider",
                "flag_values": np.array(phases.VALUES, dtype=np.int8),
                "flag_meanings": phases.MEANINGS,
                "phase_calculation_method": how,
                "ancillary_variables": "PHASE_QC",
                "coordinates": _COORDINATES,
            },
        )
        self._make_flags("PHASE")
        for name, title in (
            ("SEGMENT_NUMBER", "number of the stretch between two fixes"),
            ("PROFILE_NUMBER", "number of the ascent or descent"),
        ):
            self._make(
                name,
                "i4",
                NO_NUMBER,
                {"units": "1", "long_name": title, "coordinates": _COORDINATES},
            )
        self._make(
            "PROFILE_DIRECTION",
            "i1",
            OG1_FILL,
            {
                "long_name": "direction of the profile",
                "flag_values": np.array([-1, 0, 1], dtype=np.int8),
                "flag_meanings": "ascending neither descending",
                "coordinates": _COORDINATES,
            },
        )


_COMPUTED: Final = (
    "computed by TEOS-10 at the times of temperature, to which what else it needs is interpolated"
)
_COORDINATES: Final = "TIME LATITUDE LONGITUDE DEPTH"


def _data(channel: Channel, named: FileVariable) -> dict[str, Any]:
    return {
        "units": named.units,
        "standard_name": named.standard_name,
        "long_name": channel.title.lower(),
        "comment": channel.help or None,
        "vocabulary": vocabulary(named.name) if named.has_term else None,
        "coordinates": _COORDINATES,
        "ancillary_variables": f"{named.name}_QC",
    }
