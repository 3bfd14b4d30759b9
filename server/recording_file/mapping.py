"""What each column of a recording is to become: proposed of the file, confirmed by the operator."""

from collections.abc import Mapping as AnyMapping
from typing import Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from autonomy.channel import ChannelCatalogue
from autonomy.described import Described
from robot_link.messages import STATE
from server.recording_file.moment import TimeFormat, has_zone, is_in_milliseconds, kind_of
from server.recording_file.raw import COLUMNS_MAX, Column, RawRecording, Role
from server.recording_file.unit import UnitError, converted

SHOWN_ROWS: Final = 5
FLIGHT: Final = {one.key: one for one in STATE.channels if one.recorded is not None}
"""Channels of a state that a recording may tell."""
CANONICAL: Final[AnyMapping[Role, str]] = {
    "latitude": "deg",
    "longitude": "deg",
    "fix_latitude": "deg",
    "fix_longitude": "deg",
    "depth": "m",
    "altitude": "m",
    "pressure": "dbar",
}
DDMM: Final = "DDMM.mm"
"""The unit of places written as degrees and minutes without a separator."""
_TEXT_MAX: Final = 200


class ColumnMapping(Described, BaseModel):
    """What one column becomes."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field(max_length=_TEXT_MAX)
    """As in the file."""
    role: Role
    """What it tells."""
    target: str = Field(default="", max_length=60)
    """Key of the channel, for a ``variable``, or of how the vehicle flew, for ``flight``."""
    unit: str = Field(default="", max_length=60)
    """What its values have."""


class Mapping(Described, BaseModel):
    """What the columns of a recording become, and what its times mean."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    columns: tuple[ColumnMapping, ...] = Field(max_length=COLUMNS_MAX)
    """Columns that are not named are left out; the report names them."""
    time_format: TimeFormat = ""
    """How times are written; "" is refused where it matters."""
    is_utc: bool = False
    """Confirms that times without a zone are UTC."""
    water: Literal["sea", "fresh"] = "sea"
    """For the depth of a pressure."""
    latitude_deg: float | None = Field(default=None, ge=-90.0, le=90.0)
    """Where rows were taken that tell no place, as a person says; with ``longitude_deg``. A
    Slocum's science file tells none, and a mooring's table may not."""
    longitude_deg: float | None = Field(default=None, ge=-180.0, le=180.0)
    """As ``latitude_deg``."""


class Question(BaseModel):
    """What the file leaves open and a person has to say."""

    field: str
    """Of the mapping: ``time_format`` or ``is_utc``."""
    text: str


class MappingError(Exception):
    """A mapping that cannot be followed; each fault names its column or field."""

    def __init__(self, faults: list[tuple[str, str]]) -> None:
        super().__init__("; ".join(f"{place}: {reason}" for place, reason in faults))
        self.faults = faults


def proposed(raw: RawRecording, channels: ChannelCatalogue) -> Mapping:
    """Return what the columns most probably mean: one column for each role and channel."""
    taken: set[tuple[Role, str]] = set()
    columns: list[ColumnMapping] = []
    for column in raw.columns.values():
        role, target = column.role, column.target
        is_free = (role, target) not in taken and (role != "variable" or target in channels)
        if role == "pressure" and _has(raw, "depth"):
            role, target, is_free = "variable", "pressure", ("variable", "pressure") not in taken
        if role == "altitude" and (_has(raw, "depth") or _has(raw, "pressure")):
            is_free = False
        is_empty = column.texts is None and not np.isfinite(column.values).any()
        if role == "ignore" or is_empty or not is_free:
            role, target = "ignore", ""
        else:
            taken.add((role, target))
        columns.append(ColumnMapping(name=column.name, role=role, target=target, unit=column.unit))
    return Mapping(columns=tuple(columns), time_format=_format(raw), is_utc=_says_zone(raw))


def questions(raw: RawRecording, mapping: Mapping) -> list[Question]:
    """Return what a person has to say before the mapping can be followed."""
    asked: list[Question] = []
    times = _time_texts(raw, mapping)
    if times and not mapping.time_format:
        text = f"Times are written like {times[0]!r}: is the day first, or the month?"
        asked.append(Question(field="time_format", text=text))
    if times and not mapping.is_utc and not has_zone(times):
        text = f"Times like {times[0]!r} say no zone: are they UTC?"
        asked.append(Question(field="is_utc", text=text))
    return asked


def faults_of(raw: RawRecording, mapping: Mapping, channels: ChannelCatalogue) -> MappingError:
    """Return everything that is wrong with a mapping; empty ``faults`` if it can be followed."""
    faults: list[tuple[str, str]] = []
    seen: dict[tuple[Role, str], str] = {}
    for one in mapping.columns:
        if one.role == "ignore":
            continue
        column = raw.columns.get(one.name)
        if column is None:
            faults.append((one.name, "the file has no such column"))
            continue
        target = one.name if one.role == "other" else one.target
        other = seen.setdefault((one.role, target), one.name)
        if other != one.name:
            faults.append((one.name, f"tells the same as column {other!r}"))
        faults += [(one.name, reason) for reason in _column_faults(one, column, channels)]
    roles: set[Role] = {role for role, _ in seen}
    faults += _missing(roles, mapping)
    faults += [(one.field, one.text) for one in questions(raw, mapping)]
    return MappingError(faults)


def _column_faults(one: ColumnMapping, column: Column, channels: ChannelCatalogue) -> list[str]:
    if one.role == "variable" and one.target not in channels:
        return [f"there is no channel {one.target!r}; Settings, Channels adds one"]
    if one.role == "variable" and channels[one.target].is_derived:
        return [f"{one.target} is computed of others and cannot be imported"]
    if one.role == "flight" and one.target not in FLIGHT:
        return [f"{one.target!r} is none of {', '.join(FLIGHT)}"]
    is_place = one.role in CANONICAL and CANONICAL[one.role] == "deg"
    if one.role in ("time", "date", "clock") or (is_place and column.texts is not None):
        return []
    if column.texts is not None:
        return ["it has words where numbers are needed"]
    if one.role == "other":
        return []
    if is_place and one.unit == DDMM:
        return []
    try:
        converted(np.empty(0), one.unit, wanted_unit(one, channels))
    except UnitError as error:
        return [str(error)]
    return []


def wanted_unit(one: ColumnMapping, channels: ChannelCatalogue) -> str:
    """Return the unit that a column's values are turned into."""
    if one.role == "variable":
        return channels[one.target].unit
    if one.role == "flight":
        return FLIGHT[one.target].unit
    return CANONICAL[one.role]


def _missing(roles: set[Role], mapping: Mapping) -> list[tuple[str, str]]:
    faults: list[tuple[str, str]] = []
    if "time" not in roles and not {"date", "clock"} <= roles:
        faults.append(("time", "no column tells the time"))
    said = {"latitude": mapping.latitude_deg, "longitude": mapping.longitude_deg}
    faults += [
        (role, f"no column tells the {role}; say the place of all rows, or add what tells it")
        for role, place in said.items()
        if place is None and not roles & {role, f"fix_{role}"}
    ]
    if not roles & {"depth", "pressure", "altitude"}:
        faults.append(("depth", "no column tells the depth, nor a pressure or an altitude"))
    return faults


def _has(raw: RawRecording, role: Role) -> bool:
    """Tell whether a column tells something of a role."""
    return any(
        one.role == role and (one.texts is not None or bool(np.isfinite(one.values).any()))
        for one in raw.columns.values()
    )


def _time_texts(raw: RawRecording, mapping: Mapping) -> list[str]:
    for one in mapping.columns:
        column = raw.columns.get(one.name)
        if one.role in ("time", "date") and column is not None and column.texts is not None:
            return [text for text in column.texts if text]
    return []


def _time_column(raw: RawRecording) -> Column | None:
    found = [one for one in raw.columns.values() if one.role in ("time", "date")]
    return found[0] if found else None


def time_format_of(column: Column) -> TimeFormat:
    """Return how a column's times are written, if it tells them; "" where a person has to say."""
    if column.texts is not None:
        return kind_of(column.texts)
    return "unix_ms" if is_in_milliseconds(column.values) else "unix_s"


def says_zone(column: Column) -> bool:
    """Tell whether every time of a column, if it tells them, says its zone."""
    return column.texts is None or has_zone(column.texts)


def _format(raw: RawRecording) -> TimeFormat:
    column = _time_column(raw)
    return "" if column is None else time_format_of(column)


def _says_zone(raw: RawRecording) -> bool:
    column = _time_column(raw)
    return column is not None and column.texts is not None and has_zone(column.texts)
