"""Turns the columns of a file into a recording, by a mapping; every row is right or named."""

from collections.abc import Mapping as AnyMapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.channel import ChannelCatalogue
from server.recording_file.depth import depth_of_pressure
from server.recording_file.mapping import (
    DDMM,
    FLIGHT,
    ColumnMapping,
    Mapping,
    faults_of,
    wanted_unit,
)
from server.recording_file.moment import seconds_of
from server.recording_file.place_text import degrees_of, from_ddmm
from server.recording_file.raw import FileFault, FlagArray, RawRecording, Role, UnreadableError
from server.recording_file.unit import converted

FIX_STD_M: Final = 10.0
"""What the fix of another maker's satellite receiver is taken to be good to."""
BAD: Final = 4
SILENT: Final = -127
_ABOVE_M: Final = 1.0
"""Depths so far above the surface count as 0: what is deeper than that is a fault."""
_DEPTH_MAX_M: Final = 11_000.0
_TIME_MAX_S: Final = 4_102_444_800.0
_DEPTH_GAP_S: Final = 300.0
_PLACE_GAP_S: Final = 6 * 3600.0
"""Between two depths, or two places, that are no farther apart, those of other rows are found."""
_NAMED_MAX: Final = 20
_LIE_SHARE: Final = 0.5
"""With more values than this outside of what can be true, the unit is doubted, not the rows."""


@dataclass(frozen=True, slots=True, eq=False)
class OtherColumn:
    """A column that is no channel."""

    unit: str
    """As a person confirmed it, "" for none."""
    values: FloatArray
    """Shape ``(n,)``, NaN where a row does not tell."""


@dataclass(frozen=True, slots=True, eq=False)
class Converted:
    """Rows that are right, strictly ascending in time, shape ``(n,)`` each."""

    time_s: FloatArray
    """Whole microseconds from the epoch, as seconds."""
    latitude_deg: FloatArray
    longitude_deg: FloatArray
    depth_m: FloatArray
    values: AnyMapping[str, FloatArray]
    """By channel, in its unit, NaN where a row does not tell."""
    flight: AnyMapping[str, FloatArray]
    """By channel of a state, SI, NaN where a row does not tell; a place with a ``position_std_m``
    is a fix."""
    flags: AnyMapping[str, FlagArray]
    """By channel, in the flags of OG1: what the file says."""
    read: int
    """Rows of the files, right and wrong, and their fixes."""
    faults: tuple[FileFault, ...]
    """Of each row that is not here; ``read`` is their number and that of the rows."""
    notes: tuple[str, ...]
    is_simulated: bool = False
    """Whether the files are marked so."""
    other: AnyMapping[str, OtherColumn] = field(default_factory=dict[str, OtherColumn])
    """By name: what is no channel, and kept as the file has it."""


class _Rows:
    """Columns under conversion, and the first fault of each row."""

    def __init__(self, raw: RawRecording) -> None:
        self.raw = raw
        self.is_right: BoolArray = np.ones(len(raw), dtype=np.bool_)
        self.reasons: dict[int, str] = {}
        self.notes: list[str] = list(raw.notes)

    def fault(self, index: int, reason: str) -> None:
        if self.is_right[index]:
            self.is_right[index] = False
            self.reasons[index] = reason

    def fault_where(self, where: BoolArray, reason: str, values: FloatArray | None = None) -> None:
        """Name rows; ``{}`` in the reason stands for the value."""
        for index in np.flatnonzero(where & self.is_right).tolist():
            self.fault(index, reason if values is None else reason.format(f"{values[index]:g}"))


def convert(raw: RawRecording, mapping: Mapping, channels: ChannelCatalogue) -> Converted:
    """Follow a mapping.

    Raises:
        MappingError: If it cannot be followed.
        UnreadableError: If most values of a channel cannot be true in the unit that it says.
    """
    wrong = faults_of(raw, mapping, channels)
    if wrong.faults:
        raise wrong
    by_role: dict[Role, ColumnMapping] = {one.role: one for one in mapping.columns}
    rows = _Rows(raw)
    time_s = _times(rows, by_role, mapping)
    latitude, longitude, is_fix = _places(rows, by_role, mapping, time_s)
    depth = _depths(rows, by_role, mapping, time_s, latitude)
    values = _values(rows, mapping, channels)
    flags = _flags(rows, mapping, values)
    _check_values(rows, values, flags, channels)
    flight = _flight(rows, mapping, is_fix)
    _check_places(rows, latitude, longitude, depth)
    _note_left_out(rows, mapping)
    other = {
        one.name: OtherColumn(one.unit, raw.columns[one.name].values)
        for one in mapping.columns
        if one.role == "other"
    }
    return _ordered(rows, time_s, (latitude, longitude, depth), values, flight, flags, other)


def _times(rows: _Rows, by_role: AnyMapping[Role, ColumnMapping], mapping: Mapping) -> FloatArray:
    column = rows.raw.columns[(by_role.get("time") or by_role["date"]).name]
    if column.texts is None:
        if mapping.time_format not in ("", "unix_s", "unix_ms"):
            raise UnreadableError(f"{column.name} has numbers, not times in words.")
        factor = 1e-3 if mapping.time_format == "unix_ms" else 1.0
        times = column.values * factor
    else:
        texts = column.texts
        if "time" not in by_role:
            clock = rows.raw.columns[by_role["clock"].name].texts or ()
            texts = tuple(f"{day} {hour}" for day, hour in zip(texts, clock, strict=True))
        times = np.full(len(texts), np.nan)
        for index, text in enumerate(texts):
            try:
                times[index] = seconds_of(text, mapping.time_format) if text else np.nan
            except ValueError as error:
                rows.fault(index, str(error))
    rows.fault_where(~np.isfinite(times), "the time is missing")
    outside = (times < 0.0) | (times > _TIME_MAX_S)
    rows.fault_where(outside, "the time {} s lies outside of the years 1970 to 2099", times)
    return np.round(times, 6)


def _places(
    rows: _Rows, by_role: AnyMapping[Role, ColumnMapping], mapping: Mapping, time_s: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return latitude, longitude, and which rows have them of a satellite receiver."""
    empty = np.full(len(rows.raw), np.nan)
    found = {
        role: _angles(rows, by_role[role]) if role in by_role else empty.copy()
        for role in ("latitude", "longitude", "fix_latitude", "fix_longitude")
    }
    is_fix = np.isfinite(found["fix_latitude"]) & np.isfinite(found["fix_longitude"])
    latitude = np.where(is_fix, found["fix_latitude"], found["latitude"])
    longitude = np.where(is_fix, found["fix_longitude"], found["longitude"])
    longitude = np.where(longitude > 180.0, longitude - 360.0, longitude)
    if rows.raw.is_scattered:
        was = np.isfinite(latitude) & np.isfinite(longitude)
        latitude = _between(time_s, latitude, was, _PLACE_GAP_S)
        longitude = _between(time_s, longitude, was, _PLACE_GAP_S)
        _note_found(rows, was, latitude, "places")
    missing = ~(np.isfinite(latitude) & np.isfinite(longitude))
    if mapping.latitude_deg is not None and mapping.longitude_deg is not None and missing.any():
        latitude = np.where(missing, mapping.latitude_deg, latitude)
        longitude = np.where(missing, mapping.longitude_deg, longitude)
        place = f"{mapping.latitude_deg:.5f}, {mapping.longitude_deg:.5f}"
        rows.notes.append(f"{int(missing.sum()):,} rows tell no place and have the said {place}.")
        return latitude, longitude, is_fix
    rows.fault_where(missing, "no place is told for this time")
    return latitude, longitude, is_fix


def _angles(rows: _Rows, one: ColumnMapping) -> FloatArray:
    column = rows.raw.columns[one.name]
    if column.texts is None:
        if one.unit == DDMM:
            return from_ddmm(column.values)
        return converted(column.values, one.unit, "deg")
    angles = np.full(len(column.texts), np.nan)
    for index, text in enumerate(column.texts):
        try:
            angles[index] = degrees_of(text, is_ddmm=one.unit == DDMM) if text else np.nan
        except ValueError as error:
            rows.fault(index, f"{one.role}: {error}")
    return angles


def _depths(
    rows: _Rows,
    by_role: AnyMapping[Role, ColumnMapping],
    mapping: Mapping,
    time_s: FloatArray,
    latitude: FloatArray,
) -> FloatArray:
    depth = np.full(len(rows.raw), np.nan)
    if one := by_role.get("depth"):
        depth = converted(rows.raw.columns[one.name].values, one.unit, "m").copy()
    elif one := by_role.get("altitude"):
        depth = -converted(rows.raw.columns[one.name].values, one.unit, "m")
    if one := by_role.get("pressure"):
        pressure = converted(rows.raw.columns[one.name].values, one.unit, "dbar")
        found = depth_of_pressure(pressure, latitude, mapping.water)
        missing = ~np.isfinite(depth) & np.isfinite(found)
        depth = np.where(missing, found, depth)
        if missing.any():
            count = int(missing.sum())
            rows.notes.append(f"{count:,} depths are computed of the pressure ({mapping.water}).")
    if rows.raw.is_scattered:
        was = np.isfinite(depth)
        depth = _between(time_s, depth, was, _DEPTH_GAP_S)
        _note_found(rows, was, depth, "depths")
    rows.fault_where(~np.isfinite(depth), "no depth is told for this time")
    above = (depth < 0.0) & (depth >= -_ABOVE_M)
    if above.any():
        rows.notes.append(f"{int(above.sum()):,} depths just above the surface became 0.")
    return np.where(above, 0.0, depth)


def _between(
    time_s: FloatArray, values: FloatArray, is_known: BoolArray, gap_s: float
) -> FloatArray:
    """Fill what is missing from the values before and after it, which lie near each other."""
    known = is_known & np.isfinite(time_s)
    if known.sum() < 2:
        return values
    order = np.argsort(time_s[known], kind="stable")
    at, told = time_s[known][order], values[known][order]
    after = np.clip(np.searchsorted(at, time_s), 1, len(at) - 1)
    is_near = (at[after] - at[after - 1] <= gap_s) & (time_s >= at[0]) & (time_s <= at[-1])
    return np.where(known, values, np.where(is_near, np.interp(time_s, at, told), np.nan))


def _note_found(rows: _Rows, was: BoolArray, values: FloatArray, what: str) -> None:
    count = int((np.isfinite(values) & ~was).sum())
    if count:
        rows.notes.append(f"{count:,} {what} lie between those that other rows tell.")


def _values(rows: _Rows, mapping: Mapping, channels: ChannelCatalogue) -> dict[str, FloatArray]:
    return {
        one.target: converted(
            rows.raw.columns[one.name].values, one.unit, wanted_unit(one, channels)
        ).copy()
        for one in mapping.columns
        if one.role == "variable"
    }


def _flags(
    rows: _Rows, mapping: Mapping, values: AnyMapping[str, FloatArray]
) -> dict[str, FlagArray]:
    found: dict[str, FlagArray] = {}
    for one in mapping.columns:
        flags = rows.raw.columns[one.name].flags if one.name in rows.raw.columns else None
        if one.role == "variable" and flags is not None and one.target in values:
            found[one.target] = flags
    return found


def _check_values(
    rows: _Rows,
    values: dict[str, FloatArray],
    flags: AnyMapping[str, FlagArray],
    channels: ChannelCatalogue,
) -> None:
    """Name values that cannot be true; those that the file itself calls bad are left out."""
    for key, column in values.items():
        channel = channels[key]
        told = np.isfinite(column)
        least = np.nextafter(0.0, 1.0) if channel.scale == "log" and channel.low >= 0.0 else None
        low = channel.low if least is None else max(channel.low, least)
        wrong = told & ~((column >= low) & (column <= channel.high))
        if key in flags:
            is_bad = wrong & (flags[key] == BAD)
            column[is_bad] = np.nan
            wrong &= ~is_bad
            if is_bad.any():
                said = f"{int(is_bad.sum()):,} values of {channel.title.lower()}"
                rows.notes.append(f"{said} that the file calls bad, and nobody believes, are out.")
        if wrong.sum() > _LIE_SHARE * max(1, told.sum()):
            first = float(column[np.flatnonzero(wrong)[0]])
            raise UnreadableError(
                f"{int(wrong.sum()):,} of {int(told.sum()):,} values of {channel.title.lower()} "
                f"lie outside of {channel.low:g} to {channel.high:g} {channel.unit}, the first is "
                f"{first:g}: the file's unit cannot be right."
            )
        for index in np.flatnonzero(wrong & rows.is_right).tolist():
            value = float(column[index])
            rows.fault(index, channel.fault(value) or f"{key} is {value:g}, but must exceed 0")


def _flight(rows: _Rows, mapping: Mapping, is_fix: BoolArray) -> dict[str, FloatArray]:
    found: dict[str, FloatArray] = {}
    for one in mapping.columns:
        if one.role != "flight":
            continue
        field = FLIGHT[one.target]
        told = converted(rows.raw.columns[one.name].values, one.unit, field.unit).copy()
        if field.recorded is not None:
            shown = told / field.display_factor
            wrong = np.isfinite(told) & (
                (shown < field.recorded.low) | (shown > field.recorded.high)
            )
            reason = (
                f"{one.name} is {{}}, outside {field.recorded.low:g} .. {field.recorded.high:g}"
            )
            rows.fault_where(wrong, reason, shown)
        found[one.target] = told
    if is_fix.any():
        std = found.get("position_std_m", np.full(len(is_fix), np.nan))
        found["position_std_m"] = np.where(is_fix & ~np.isfinite(std), FIX_STD_M, std)
    return found


def _check_places(
    rows: _Rows, latitude: FloatArray, longitude: FloatArray, depth: FloatArray
) -> None:
    wrong = np.isfinite(latitude) & (np.abs(latitude) > 90.0)
    rows.fault_where(wrong, "the latitude is {}, outside -90 .. 90", latitude)
    wrong = np.isfinite(longitude) & (np.abs(longitude) > 180.0)
    rows.fault_where(wrong, "the longitude is {}, outside -180 .. 180", longitude)
    wrong = depth < -_ABOVE_M
    rows.fault_where(wrong, "the depth is {} m, above the surface", depth)
    rows.fault_where(depth > _DEPTH_MAX_M, "the depth is {} m, below any sea floor", depth)


def _note_left_out(rows: _Rows, mapping: Mapping) -> None:
    """Name the columns that tell something and become nothing."""
    used = {one.name for one in mapping.columns if one.role != "ignore"}
    left = [
        one.name
        for one in rows.raw.columns.values()
        if one.name not in used and (one.texts is not None or np.isfinite(one.values).any())
    ]
    if left:
        named = ", ".join(left[:_NAMED_MAX])
        more = f" and {len(left) - _NAMED_MAX:,} more" if len(left) > _NAMED_MAX else ""
        rows.notes.append(f"{len(left):,} columns are left out: {named}{more}.")


def _ordered(
    rows: _Rows,
    time_s: FloatArray,
    place: tuple[FloatArray, FloatArray, FloatArray],
    values: AnyMapping[str, FloatArray],
    flight: AnyMapping[str, FloatArray],
    flags: AnyMapping[str, FlagArray],
    other: AnyMapping[str, OtherColumn],
) -> Converted:
    raw = rows.raw
    back = int((np.diff(time_s[rows.is_right]) < 0.0).sum())
    if back:
        rows.notes.append(f"The time goes back at {back:,} places; the rows were put in order.")
    right = np.flatnonzero(rows.is_right)
    order: IntArray = right[np.argsort(time_s[right], kind="stable")]
    same = np.flatnonzero(np.diff(time_s[order]) == 0.0)
    for later in same.tolist():
        rows.fault(int(order[later + 1]), f"the time is that of {raw.place(int(order[later]))}")
    order = order[rows.is_right[order]]
    faults = [
        *raw.faults,
        *(FileFault(raw.place(i), rows.reasons[i]) for i in sorted(rows.reasons)),
    ]
    read = len(raw) + len(raw.faults)
    columns = [*(part[order] for part in (time_s, *place)), order.astype(np.float64)]
    kept_flight = {key: column[order] for key, column in flight.items()}
    kept_values = {key: column[order] for key, column in values.items()}
    kept_flags = {key: column[order] for key, column in flags.items()}
    if raw.fixes is not None:
        read += len(raw.fixes.time_s)
        columns, kept_flight, kept_values, kept_flags = _with_fixes(
            raw, columns, kept_flight, kept_values, kept_flags, faults
        )
    row = columns.pop().astype(np.int64)
    return Converted(
        *columns,
        values=kept_values,
        flight=kept_flight,
        flags=kept_flags,
        read=read,
        faults=tuple(faults),
        notes=tuple(rows.notes),
        is_simulated=raw.is_simulated,
        other={
            name: OtherColumn(one.unit, np.where(row >= 0, one.values[row], np.nan))
            for name, one in other.items()
        },
    )


def _with_fixes(
    raw: RawRecording,
    columns: list[FloatArray],
    flight: dict[str, FloatArray],
    values: dict[str, FloatArray],
    flags: dict[str, FlagArray],
    faults: list[FileFault],
) -> tuple[list[FloatArray], dict[str, FloatArray], dict[str, FloatArray], dict[str, FlagArray]]:
    """Put fixes between the rows; one that cannot be used is a fault.

    The last of the columns says which row each is of, -1 for a fix.
    """
    fixes = raw.fixes
    if fixes is None:
        return columns, flight, values, flags
    at = np.round(fixes.time_s, 6)
    is_right = np.isfinite(at) & (np.abs(fixes.latitude_deg) <= 90.0)
    is_right &= np.abs(fixes.longitude_deg) <= 180.0
    is_first = np.zeros(len(at), dtype=np.bool_)
    is_first[np.unique(at, return_index=True)[1]] = True
    for index in range(len(at)):
        if is_right[index] and (not is_first[index] or np.isin(at[index], columns[0])):
            is_right[index] = False
            faults.append(FileFault(f"fix {index}", "another row has its time"))
        elif not is_right[index]:
            faults.append(FileFault(f"fix {index}", "it has no time or no place"))
    count = int(is_right.sum())
    no_row = np.full(len(at), -1.0)
    added = (at, fixes.latitude_deg, fixes.longitude_deg, np.zeros(len(at)), no_row)
    joined = [np.concatenate([one, new[is_right]]) for one, new in zip(columns, added, strict=True)]
    order = np.argsort(joined[0], kind="stable")
    std = flight.setdefault("position_std_m", np.full(len(columns[0]), np.nan))
    nothing, silent = np.full(count, np.nan), np.full(count, SILENT, dtype=np.int8)
    new_flight = {key: np.concatenate([one, nothing])[order] for key, one in flight.items()}
    new_flight["position_std_m"] = np.concatenate([std, np.full(count, FIX_STD_M)])[order]
    return (
        [one[order] for one in joined],
        new_flight,
        {key: np.concatenate([one, nothing])[order] for key, one in values.items()},
        {key: np.concatenate([one, silent])[order] for key, one in flags.items()},
    )
