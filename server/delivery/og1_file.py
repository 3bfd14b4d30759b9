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
from server.delivery.judged import DEPTH, POSITION, Judged, add_rows, blocks_of, places_of
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
    order: FileOrder,
    found: Judged,
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
    total = max(1, len(found.at_us))
    with netCDF4.Dataset(path, "w", format="NETCDF4") as file:
        layout = _Layout(file, order, found)
        for block in blocks_of(session, order.wanted, is_cancelled):
            raised += layout.write(offset, block)
            add_rows(digest, block)
            offset += len(block)
            report((0.4 + 0.3 * offset / total, f"Writing row {offset} of {total}"))
        source = digest.hexdigest()
        write_header(file, order, layout.extent, source)
    return Written(path, offset, source, raised)


class _Layout:
    """The variables of one file that have a value for each row."""

    def __init__(self, file: Any, order: FileOrder, found: Judged) -> None:  # noqa: ANN401 - netCDF4 has no types
        self._file, self._order, self._found = file, order, found
        self.extent = Extent()
        file.createDimension(DIMENSION, None)
        self._chunk = (min(max(1, len(found.at_us)), CHUNK_ROWS),)
        self._names = {key: file_variable(channel) for key, channel in order.channels.items()}
        times_s = (found.at_us - found.at_us[:1]) / 1e6
        self._phase = self._phases(times_s)
        self._profile, self._direction = phases.profiles(self._phase)
        self._segment = phases.segments(found.has_fix)
        flags = (POSITION, DEPTH, *order.channels)
        self._flags = {key: found.og1(key, order.manual) for key in flags}
        self._make_places()
        self._make_channels()
        self._make_flight()

    def write(self, offset: int, block: RowBlock) -> int:
        """Write rows from one on; return how many depths were above the surface."""
        rows = slice(offset, offset + len(block))
        placed = places_of(block, self._order.wanted)
        places, known = placed.wgs84, placed.is_known
        times_s = block.measured_at_us / 1e6
        self.extent.take(times_s, places, block.has_fix)
        self._put("TIME", rows, times_s)
        for number, name in enumerate(("LATITUDE", "LONGITUDE", "DEPTH")):
            self._put(name, rows, places[:, number])
        fix = np.where(block.has_fix, 1.0, np.nan)
        self._put("TIME_GPS", rows, times_s * fix)
        self._put("LATITUDE_GPS", rows, places[:, 0] * fix)
        self._put("LONGITUDE_GPS", rows, places[:, 1] * fix)
        self._put("POSITION_STD", rows, np.where(known, block.position_std_m, np.nan))
        self._put_integers("POSITION_SOURCE", rows, self._source(block, known))
        level = fidelity_level(block.position_std_m, self._order.thresholds_m)
        is_told = known & np.isfinite(block.position_std_m)
        self._put_integers("FIDELITY_LEVEL", rows, np.where(is_told, level, OG1_FILL))
        for key, named in self._names.items():
            self._put(named.name, rows, block.value[key])
            self._put_integers(f"{named.name}_QC", rows, self._flags[key][rows])
        for one in STATE_VARIABLES:
            self._put(one.name, rows, state_values(block, one.key, self._order.wanted))
        self._put_flags(rows, block)
        return placed.raised

    def _put_flags(self, rows: slice, block: RowBlock) -> None:
        position, depth = self._flags[POSITION][rows], self._flags[DEPTH][rows]
        for name in ("LATITUDE", "LONGITUDE"):
            self._put_integers(f"{name}_QC", rows, position)
            at_fix = np.where(block.has_fix, position, OG1_FILL)
            self._put_integers(f"{name}_GPS_QC", rows, at_fix)
        self._put_integers("DEPTH_QC", rows, depth)
        late_us = np.int64(self._order.written_at.timestamp() * 1e6) + 60_000_000
        time = np.where(block.measured_at_us > late_us, 4, 1)
        self._put_integers("TIME_QC", rows, time)
        self._put_integers("TIME_GPS_QC", rows, np.where(block.has_fix, time, OG1_FILL))
        self._put_integers("PHASE", rows, self._phase[rows])
        self._put_integers("PHASE_QC", rows, np.zeros(len(block), dtype=np.int8))
        self._put_integers("SEGMENT_NUMBER", rows, self._segment[rows])
        profile = self._profile[rows]
        self._put_integers("PROFILE_NUMBER", rows, np.where(profile == 0, NO_NUMBER, profile))
        self._put_integers("PROFILE_DIRECTION", rows, self._direction[rows])

    def _source(self, block: RowBlock, known: np.ndarray) -> np.ndarray:
        reckoned = 0 if self._order.robot.kind == "recorded" else RECKONED
        source = np.where(block.has_fix, FIX, np.where(block.is_smoothed, SMOOTHED, reckoned))
        return np.where(known, source, OG1_FILL)

    def _phases(self, times_s: FloatArray) -> FlagArray:
        mode, depth = self._found.mode, self._found.depth_m
        if (mode == phases.NO_MODE).all():
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

    def _put(self, name: str, rows: slice, values: FloatArray) -> None:
        """Write numbers, with the fill value of the variable where there is none."""
        variable = self._file[name]
        fill = variable.getncattr("_FillValue")
        variable[rows] = np.where(np.isfinite(values), values, fill)

    def _put_integers(self, name: str, rows: slice, values: np.ndarray) -> None:
        variable = self._file[name]
        variable[rows] = values.astype(variable.dtype)

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
        for key, named in self._names.items():
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
            "from the depth alone: five-point mean, 0.02 m/s, surface above 1 m"
            if (self._found.mode == phases.NO_MODE).all()
            else "from the mode that the robot reported, and its vertical speed"
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
