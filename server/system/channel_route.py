"""The catalogue of channels: what the station knows, what a team adds, what it has otherwise."""

import math
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Literal

from fastapi import APIRouter
from pydantic import Field

from autonomy.channel import (
    KEY_PATTERN,
    OWN_WIRE_NUMBERS,
    AlarmLevel,
    AlarmLimit,
    Channel,
    ChannelKind,
    ColourMap,
    Scale,
)
from db.record import same
from robot_link.messages import STATE
from robot_link.report_field import Gauge
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.channels import KnownChannel
from server.base.dependency import FoundationDep
from server.base.text import Title
from server.base.view import Body, View

router = APIRouter(prefix="/api/channels", tags=["channels"], route_class=IdempotentRoute)

_HELP_LENGTH_MAX = 300


@dataclass(frozen=True, slots=True)
class AlarmLimitView(View):
    """Values beyond which a channel raises an alarm."""

    level: AlarmLevel
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class CatalogueChannelView(View):
    """One channel: everything that shows, maps, judges or exports a value of it takes it here."""

    key: str
    title: str
    unit: str
    """In the notation of UDUNITS; "1" without one."""
    display_unit: str | None
    """Unit on a screen where it differs."""
    kind: Literal["flight", "field", "housekeeping", "switch"]
    """How the robot flies, the water, the robot's own condition, or a condition on (1) or off."""
    origin: Literal["delivered", "own", "state"]
    """Delivered with the station, the team's own, or told in every state report."""
    is_derived: bool
    """Whether it is computed ashore, by `derived_from`."""
    derived_from: list[str]
    wire_number: int | None
    """Names it in messages; ``null`` for what has no number."""
    low: float | None
    """Least value that can be true; ``null`` without an end."""
    high: float | None
    scale: Scale
    can_map: bool
    standard_name: str | None
    """Name in the table of the Climate and Forecast conventions."""
    colour_map: ColourMap
    decimals: int
    """Digits after the point that a screen shows, in the unit on the screen."""
    alarms: list[AlarmLimitView]
    """The gravest first."""
    help: str
    switch_words: tuple[str, str] = ("off", "on")
    """What a switch is called at 0 and at 1."""
    is_retired: bool = False
    changed: list[str] = field(default_factory=list)
    """What this station has otherwise than it was delivered."""
    changed_at: datetime | None = None
    changed_by: str = ""


class AlarmLimitBody(Body):
    """Values beyond which a channel raises an alarm; one end at least."""

    level: AlarmLevel
    """How much it matters: info, watch, warning, severe, critical."""
    low: float | None = Field(default=None, allow_inf_nan=False)
    """Below it, in the channel's unit."""
    high: float | None = Field(default=None, allow_inf_nan=False)
    """Above it."""


class NewChannel(Body):
    """A channel of the team's own."""

    key: str = Field(pattern=KEY_PATTERN)
    """Lower-case letters, digits and underscores; names it in files and tables."""
    title: Title
    """What lists and gauges call it."""
    unit: str = Field(min_length=1, max_length=40)
    """In the notation of UDUNITS, such as ``umol/L`` or ``m s-1``; "1" without one."""
    kind: ChannelKind = "field"
    """Whether it is a field of the water, housekeeping or a switch."""
    wire_number: int | None = Field(default=None, ge=OWN_WIRE_NUMBERS[0], le=OWN_WIRE_NUMBERS[-1])
    """By which robots tell it; without one the first that is free."""
    low: float | None = Field(default=None, allow_inf_nan=False)
    """Least value that can be true."""
    high: float | None = Field(default=None, allow_inf_nan=False)
    """Greatest value that can be true."""
    scale: Scale = "linear"
    """Whether scales of it are linear or logarithmic."""
    can_map: bool = True
    """Whether field maps are grown of it."""
    standard_name: str | None = None
    """Name of the CF conventions for exported files; ``null`` for none."""
    colour_map: ColourMap = "viridis"
    """Colours of its maps."""
    decimals: int = 2
    """Digits after the point that are shown."""
    alarms: list[AlarmLimitBody] = Field(default_factory=list, max_length=10)
    """Limits beyond which it is an alarm, at most ten."""
    help: str = Field(default="", max_length=_HELP_LENGTH_MAX)
    """What it tells, in a sentence or two."""


class ChannelChanges(Body):
    """What is to be changed of a channel; what is left out stays."""

    title: Title | None = None
    """What lists and gauges call it."""
    unit: str | None = Field(default=None, min_length=1, max_length=40)
    """Unit of its values, such as ``degC``."""
    kind: ChannelKind | None = None
    """Whether it is a field of the water, housekeeping or a switch."""
    wire_number: int | None = Field(default=None, ge=OWN_WIRE_NUMBERS[0], le=OWN_WIRE_NUMBERS[-1])
    """Its number on the wire; of an own channel."""
    low: float | None = Field(default=None, allow_inf_nan=False)
    """``null`` takes the end away."""
    high: float | None = Field(default=None, allow_inf_nan=False)
    """Largest value that can be true, in its unit; ``null`` takes the end away."""
    scale: Scale | None = None
    """Whether scales of it are linear or logarithmic."""
    can_map: bool | None = None
    """Whether field maps are grown of it."""
    standard_name: str | None = None
    """Name of the CF conventions for exported files; ``null`` for none."""
    colour_map: ColourMap | None = None
    """Colours of its maps."""
    decimals: int | None = None
    """Digits after the point that are shown."""
    alarms: list[AlarmLimitBody] | None = Field(default=None, max_length=10)
    """Limits beyond which it is an alarm, at most ten."""
    help: str | None = Field(default=None, max_length=_HELP_LENGTH_MAX)
    """What it tells, in a sentence or two."""
    is_retired: bool | None = None
    """Of an own one: whether it is no longer offered. What was measured of it stays."""


@router.get("")
async def list_channels(caller: Viewer, foundation: FoundationDep) -> list[CatalogueChannelView]:
    """Return every channel: those of the state report, the delivered ones, the team's own."""
    del caller
    told = [_state_view(key, gauge) for key, gauge in STATE.gauges.items()]
    return told + [_view(entry) for entry in foundation.channels.entries]


@router.post("", status_code=201)
async def add_channel(
    caller: Pilot, channel: NewChannel, foundation: FoundationDep
) -> CatalogueChannelView:
    """Add a channel of the team's own.

    422 names each wrong field with its limit; 409 says whose the key or the number is.
    """
    values = _values(channel.model_dump())
    values["wire_number"] = channel.wire_number or 0
    return _view(await foundation.channels.add(Channel(**values), caller.name))


@router.patch("/{key}")
async def change_channel(
    caller: Pilot, key: str, changes: ChannelChanges, foundation: FoundationDep
) -> CatalogueChannelView:
    """Change a channel, retire an own one, or bring it back.

    Of a delivered one the station keeps what it has otherwise. Unit, kind and number of a channel
    of which values are stored are fixed: 409.
    """
    given = changes.model_dump(exclude_unset=True)
    is_retired = given.pop("is_retired", None)
    emptied = {"low", "high", "standard_name"}
    given = {name: value for name, value in given.items() if value is not None or name in emptied}
    changed = await foundation.channels.change(
        key, _values(given), caller.name, is_retired=is_retired
    )
    return _view(changed)


def _values(given: dict[str, Any]) -> dict[str, Any]:
    for name, end in (("low", -math.inf), ("high", math.inf)):
        if name in given and given[name] is None:
            given[name] = end
    if "alarms" in given:
        given["alarms"] = tuple(AlarmLimit(**one) for one in given["alarms"])
    return given


def _view(entry: KnownChannel) -> CatalogueChannelView:
    channel = entry.channel
    return same(
        CatalogueChannelView,
        channel,
        display_unit=None,
        origin=entry.origin,
        derived_from=list(channel.derived_from),
        wire_number=channel.wire_number or None,
        low=_end(channel.low),
        high=_end(channel.high),
        alarms=[same(AlarmLimitView, limit) for limit in channel.alarms],
        is_retired=entry.is_retired,
        changed=list(entry.changed),
        changed_at=entry.changed_at,
        changed_by=entry.changed_by,
    )


def _state_view(key: str, gauge: Gauge) -> CatalogueChannelView:
    row = STATE[key]
    return CatalogueChannelView(
        key=key,
        title=gauge.title,
        unit=row.unit,
        display_unit=row.display_unit,
        kind="flight",
        origin="state",
        is_derived=False,
        derived_from=[],
        wire_number=None,
        low=None if row.possible is None else _end(row.possible.low),
        high=None if row.possible is None else _end(row.possible.high),
        scale="linear",
        can_map=False,
        standard_name=row.standard_name,
        colour_map="viridis",
        decimals=gauge.decimals,
        alarms=[],
        help=gauge.help,
    )


def _end(value: float) -> float | None:
    return value if math.isfinite(value) else None
