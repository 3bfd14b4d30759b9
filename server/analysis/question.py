"""What is asked of a deployment's rows: which series, which dives, which values."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Final, Literal

from sqlalchemy.orm import Session

from autonomy.vehicle.battery import BatteryConfig
from db.query.fleet.deployments import get_deployment
from db.query.measured.samples import sampled_variables
from server.base.channels import catalogue_in
from server.base.configuration import current
from server.base.configuration_kind import find_kind
from server.base.problem import FieldError, unprocessable
from server.delivery.judged import DEPTH, Wanted
from server.delivery.og1_channel import file_variable
from server.delivery.og1_state import STATE_VARIABLES
from server.delivery.quality import wanted_of

SERIES_MAX: Final = 6
"""So many columns of a million rows are held at once."""
SALINITY, TEMPERATURE = "absolute_salinity", "temperature"
CONSERVATIVE: Final = "conservative_temperature"
"""Worked out here for T-S diagrams; no channel."""
Kind = Literal["sampled", "derived", "state", "computed"]
Spans = tuple[tuple[int, int], ...]
"""First and last dive of each stretch, both included."""
_SPAN = re.compile(r"(\d{1,6})(?:-(\d{1,6}))?")


@dataclass(frozen=True, slots=True)
class Series:
    """Something that has a value at many moments of a deployment."""

    key: str
    title: str
    unit: str
    kind: Kind
    variable: str
    """Its name in the NetCDF file of a delivery; empty where the file does not have it."""
    decimals: int = 2


@dataclass(frozen=True, slots=True)
class Question:
    """What is read of a deployment, and how much of it is told."""

    wanted: Wanted
    """Which rows, with all channels that are read."""
    offered: tuple[Series, ...]
    """Everything that could be asked for; what a state tells only if it does."""
    series: tuple[Series, ...]
    pace: str | None
    """The channel with most values: with the states it gives the depths that dives are found in."""
    capacity_wh: float
    """Of the robot's battery."""
    size: int
    """Measurements of all channels in the deployment."""
    spans: Spans | None = None
    """Which dives; all rows if ``None``."""
    flag_max: int = 4
    """Values with a greater flag of OG1.0 are left out."""
    limit: int | None = None
    """Most rows that are told; all if ``None``."""
    asked_at: datetime | None = None
    """Until when there can be rows of a deployment that lasts."""
    kept_in: Path | None = None
    """Folder in which columns that were read are kept; nothing is kept without."""


def question_of(
    session: Session,
    deployment: str,
    database_url: str,
    channels: Sequence[str] = (),
    dives: str = "",
    *,
    flag_max: int = 4,
    limit: int | None = None,
) -> Question:
    """Return what is to be read.

    Raises:
        UnknownIdError: If there is no such deployment.
        Problem: 409 if it has not begun; 422 with the field that does not fit.
    """
    wanted = wanted_of(session, deployment, database_url)
    record = get_deployment(session, deployment)
    start, end = record.begun_at, record.last_at
    counts = sampled_variables(session, record.robot, start=start, end=end, log=record.log)
    pace = min(
        (key for key in wanted.channels if key in counts),
        key=lambda key: (-counts[key], key),
        default=None,
    )
    offered = _offered(session, wanted)
    series = _chosen(offered, channels)
    battery = current(session, find_kind("battery"), record.robot).value_as(BatteryConfig)
    return Question(
        wanted=_reading(wanted, series, pace),
        offered=tuple(offered.values()),
        series=series,
        pace=pace,
        capacity_wh=battery.capacity_wh,
        size=sum(counts.values()),
        spans=spans_of(dives),
        flag_max=flag_max,
        limit=limit,
    )


def about_dives(question: Question) -> Question:
    """Return the question for the dives alone, with all that states can tell."""
    states = tuple(one for one in question.offered if one.kind == "state")
    return replace(question, series=states)


def spans_of(dives: str) -> Spans | None:
    """Return which dives a text such as ``1-5,9`` names, ``None`` for an empty one.

    Raises:
        Problem: 422 if it names none.
    """
    if not dives.strip():
        return None
    spans: list[tuple[int, int]] = []
    for part in dives.split(","):
        found = _SPAN.fullmatch(part.strip())
        first, last = (0, 0) if found is None else (int(found[1]), int(found[2] or found[1]))
        if not 1 <= first <= last:
            message = f"must be numbers of dives such as 1-5,9; {part.strip()!r:.40} is none"
            raise unprocessable("1 field is wrong.", [FieldError(loc=["dives"], msg=message)])
        spans.append((first, last))
    return tuple(spans)


def _offered(session: Session, wanted: Wanted) -> dict[str, Series]:
    known = catalogue_in(session)
    found = {DEPTH: Series(DEPTH, "Depth", "m", "state", "DEPTH")}
    for key in wanted.channels:
        channel = known[key]
        kind: Kind = "derived" if key in wanted.derived else "sampled"
        name = file_variable(channel).name
        found[key] = Series(key, channel.title, channel.unit, kind, name, channel.decimals)
    if SALINITY in found and TEMPERATURE in found:
        title = "Conservative temperature"
        found[CONSERVATIVE] = Series(CONSERVATIVE, title, "degC", "computed", "", 3)
    for one in STATE_VARIABLES:
        found[one.key] = Series(one.key, one.title, one.unit, "state", one.name)
    return found


def _chosen(offered: dict[str, Series], channels: Sequence[str]) -> tuple[Series, ...]:
    errors: list[str] = []
    wanted = list(dict.fromkeys(channels))
    if unknown := [key for key in wanted if key not in offered]:
        errors.append(f"{', '.join(unknown):.100}: must be of {', '.join(offered)}")
    if len(wanted) > SERIES_MAX:
        errors.append(f"at most {SERIES_MAX} at once; are {len(wanted)}")
    if errors:
        fields = [FieldError(loc=["channels"], msg=one) for one in errors]
        raise unprocessable("1 field is wrong.", fields)
    return tuple(offered[key] for key in wanted)


def _reading(wanted: Wanted, series: Sequence[Series], pace: str | None) -> Wanted:
    """Return what is read for some series: they, what they are computed of, and the pace."""
    keys = {one.key for one in series} | ({pace} if pace else set())
    if CONSERVATIVE in keys:
        keys |= {SALINITY, TEMPERATURE}
    return replace(
        wanted,
        believable={key: span for key, span in wanted.believable.items() if key in keys},
        derived=tuple(key for key in wanted.derived if key in keys),
    )
