"""What operators and ocean models tell of the current of a water, as it is kept and shown."""

import asyncio
from datetime import UTC, datetime
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AwareDatetime, Field, model_validator
from sqlalchemy.orm import Session

from autonomy.current.told import ToldCurrent, ToldField, ToldGrid, ToldProfile, find_grid
from autonomy.site import Site
from db.query.station.settings import get_setting, put_setting
from server.base.view import Body

FOLDER = "water_currents"
"""In the data folder: grids by their SHA-256; a copy of the data needs it beside the database."""
LEVELS_MAX = 500
_LOADED_MAX = 4
Speed = Annotated[float, Field(ge=-3.0, le=3.0, allow_inf_nan=False)]


class ToldLevel(Body):
    """The current at one depth."""

    depth_m: float = Field(ge=0.0, le=12_000.0, allow_inf_nan=False)
    """Depth, m; 0 to 12,000."""
    north_m_s: Speed
    """To the north, m/s."""
    east_m_s: Speed
    """To the east, m/s."""


class KeptTold(Body):
    """What is told of the current of a water."""

    kind: Literal["constant", "profile", "gridded"]
    levels: list[ToldLevel] = Field(default_factory=list, max_length=LEVELS_MAX)
    """Of a profile by ascending depth; of a constant one, whose depth does not matter."""
    std_m_s: float = Field(default=0.1, ge=0.005, le=1.0)
    """Standard deviation of what it tells, per axis."""
    source: str = Field(default="", max_length=200)
    """Who or what tells it."""
    made_at: AwareDatetime | None = None
    """When the model ran, or it was seen; null where nobody says."""
    valid_from: AwareDatetime | None = None
    valid_until: AwareDatetime | None = None
    """Beyond these it says nothing; null for always."""
    sha256: str = Field(default="", pattern=r"^([0-9a-f]{64})?$")
    """Name of the grid; empty without one."""

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        if self.kind == "constant" and len(self.levels) != 1:
            raise ValueError("a constant current has one level")
        if self.kind == "profile":
            depths = [level.depth_m for level in self.levels]
            if len(depths) < 2 or any(b <= a for a, b in pairwise(depths)):
                raise ValueError("a profile needs two levels or more, of ascending depths")
        if self.kind == "gridded" and (not self.sha256 or self.levels):
            raise ValueError("a gridded current comes from a proposal")
        if self.valid_from and self.valid_until and self.valid_until <= self.valid_from:
            raise ValueError("valid_until must be after valid_from")
        return self


def read_told(session: Session, water: str) -> KeptTold | None:
    """Return what is told of the current of a water, None where nothing is."""
    found = get_setting(session, _name(water))
    return KeptTold.model_validate(found["told"]) if found and found["told"] else None


def write_told(session: Session, water: str, told: KeptTold | None) -> None:
    """Keep what is told of the current of a water; None forgets it."""
    put_setting(
        session, _name(water), {"told": None if told is None else told.model_dump(mode="json")}
    )


async def told_current(folder: Path, told: KeptTold | None, site: Site) -> ToldCurrent | None:
    """Return a told current in the frame of a site, None where nothing is or its grid is lost."""
    if told is None:
        return None
    field = await asyncio.to_thread(_field, folder, told)
    if field is None:
        return None
    return ToldCurrent(field, (site.origin_latitude_deg, site.origin_longitude_deg), told.std_m_s)


def told_text(told: KeptTold, now: datetime) -> str:
    """Say where a told current comes from, how old it is, and until when it holds."""
    usual = {
        "constant": "a typed current",
        "profile": "a typed profile",
        "gridded": "an ocean model",
    }[told.kind]
    parts = [f"Told: {told.source or usual}"]
    if told.made_at is not None:
        parts.append(f"made {_span((now - told.made_at).total_seconds())} ago")
    if told.valid_from is not None and now < told.valid_from:
        parts.append(f"valid from {_moment(told.valid_from)}")
    if told.valid_until is not None:
        word = "valid until" if now <= told.valid_until else "not valid any more since"
        parts.append(f"{word} {_moment(told.valid_until)}")
    return ", ".join(parts) + f", give or take {100.0 * told.std_m_s:.0f} cm/s."


def _name(water: str) -> str:
    return f"current told: {water}"


def _field(folder: Path, told: KeptTold) -> ToldField | None:
    if told.kind == "gridded":
        return _grid(folder, told.sha256)
    return ToldProfile(
        np.array([level.depth_m for level in told.levels]),
        np.array([[level.north_m_s, level.east_m_s] for level in told.levels]),
        -np.inf if told.valid_from is None else told.valid_from.timestamp(),
        np.inf if told.valid_until is None else told.valid_until.timestamp(),
    )


@lru_cache(maxsize=_LOADED_MAX)
def _grid(folder: Path, sha256: str) -> ToldGrid | None:
    return find_grid(folder, sha256)


def _span(age_s: float) -> str:
    for unit_s, unit in ((86_400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if age_s >= 2.0 * unit_s:
            return f"{age_s / unit_s:.0f} {unit}"
    return f"{max(age_s, 0.0):.0f} s"


def _moment(at: datetime) -> str:
    return f"{at.astimezone(UTC):%Y-%m-%d %H:%MZ}"
