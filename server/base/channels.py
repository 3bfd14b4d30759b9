"""The channels that a station knows: the delivered ones as its people changed them, and their own.

Whatever can meet a team's own channel asks here; a worker process is given the catalogue as data.
"""

import asyncio
import dataclasses
import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any, Literal

from sqlalchemy.orm import Session

from autonomy.channel import (
    ALARM_LEVELS,
    CHANNELS,
    OWN_WIRE_NUMBERS,
    AlarmLimit,
    Channel,
    ChannelCatalogue,
    faults_of_own,
    faults_of_shown,
)
from db.query.fleet import channels as query
from db.query.fleet.channels import ChannelRecord
from db.query.station.events import add_event
from db.store import Store
from robot_link.clock import Clock
from robot_link.messages import STATE
from server.base.event_bus import ChannelsChanged, EventBus
from server.base.problem import FieldError, conflict, not_found, unprocessable

logger = logging.getLogger(__name__)
CHANGEABLE = frozenset(
    ("title", "low", "high", "scale", "can_map", "standard_name", "colour_map", "decimals",
     "alarms", "help")
)  # fmt: skip
"""What may be changed of any channel; the rest says what stored numbers mean."""


@dataclass(frozen=True, slots=True)
class KnownChannel:
    """A channel, and where it comes from."""

    channel: Channel
    origin: Literal["delivered", "own"]
    is_retired: bool = False
    """Whether it is no longer offered; what was measured of it stays."""
    changed: tuple[str, ...] = ()
    """What the station has otherwise than it was delivered."""
    changed_at: datetime | None = None
    changed_by: str = ""


class Channels:
    """The catalogue of one station. Belongs to one event loop.

    ``catalogue`` is a value: it may be read from any thread and sent to other processes, and is
    another one after a change, of which ``ChannelsChanged`` tells.
    """

    def __init__(self, store: Store, clock: Clock, bus: EventBus) -> None:
        self._store = store
        self._clock = clock
        self._bus = bus
        self._records: dict[str, ChannelRecord] = {}
        self._changing = asyncio.Lock()
        """Held from the look at the catalogue until the change of it is kept."""
        self.catalogue: ChannelCatalogue = CHANNELS

    async def load(self) -> None:
        """Read what people added and changed.

        An own channel whose key or number belongs to another, as one that a later release brings
        along, is left out and said so in the log; what was measured of it stays.
        """
        records = {one.key: one for one in await self._store.query(query.list_channels)}
        taken = _taken(records)
        for record in taken:
            logger.warning("own channel %s is left out: its key or number is taken", record.key)
        self._records = {key: one for key, one in records.items() if one not in taken}
        self.catalogue = _catalogue_of(self._records)

    @property
    def entries(self) -> list[KnownChannel]:
        """Every channel, those that the station brings along first."""
        return [self._entry(channel) for channel in self.catalogue.values()]

    def get(self, key: str) -> KnownChannel:
        """Return a channel.

        Raises:
            Problem: 404 if there is none.
        """
        channel = self.catalogue.get(key)
        if channel is None:
            known = ", ".join(self.catalogue)
            raise not_found(f"There is no channel {key!r} in the catalogue; there are {known}.")
        return self._entry(channel)

    def check_mapped(self, key: str) -> None:
        """Refuse a channel of which no map can be made.

        Raises:
            Problem: 422 with those that can be.
        """
        channel = self.catalogue.get(key)
        if channel is None or not channel.can_map:
            mapped = ", ".join(one.key for one in self.catalogue.mapped())
            raise unprocessable(
                "1 field is wrong.",
                [FieldError(loc=["variable"], msg=f"variable must be one of {mapped}")],
            )

    def check_known(self, keys: Iterable[str], *path: str) -> None:
        """Refuse keys below a path of a document that are those of no channel.

        Raises:
            Problem: 422 with each of them, and the channels that there are.
        """
        unknown = [key for key in keys if key not in self.catalogue]
        if unknown:
            words = f"is no channel of the catalogue; there are {', '.join(self.catalogue)}"
            errors = [FieldError(loc=[*path, key], msg=f"{key} {words}") for key in unknown]
            count = "1 field is" if len(errors) == 1 else f"{len(errors)} fields are"
            raise unprocessable(f"{count} wrong.", errors)

    def _free_wire_number(self) -> int:
        free = (one for one in OWN_WIRE_NUMBERS if self.catalogue.numbered(one) is None)
        number = next(free, None)
        if number is None:
            raise conflict(f"All {len(OWN_WIRE_NUMBERS)} numbers of own channels are given.")
        return number

    async def add(self, channel: Channel, by: str) -> KnownChannel:
        """Add a channel of the team's own; without a number on the wire it gets the first free one.

        Raises:
            Problem: 422 with each wrong field and its limit; 409 if key or number is taken, or a
                team has given all numbers.
            StoreUnavailableError: Nothing was kept.
        """
        async with self._changing:
            return await self._add(channel, by)

    async def _add(self, channel: Channel, by: str) -> KnownChannel:
        number = channel.wire_number or self._free_wire_number()
        channel = _in_order(dataclasses.replace(channel, wire_number=number))
        _refuse(faults_of_own(channel))
        if channel.key in self.catalogue or channel.key in STATE.gauges:
            raise conflict(f"There is a channel {channel.key!r} already.")
        self._refuse_taken(channel)
        record = ChannelRecord(channel.key, _document(channel), True, None, self._clock.now(), by)

        def write(session: Session) -> None:
            query.save_channel(session, record)
            text = f"{by} added the channel {channel.title} ({channel.key}, {channel.unit})."
            data = {"channel": channel.key}
            add_event(session, record.changed_at, "channel.added", text, data=data)

        await self._store.write(write)
        return self._took(record)

    async def change(
        self, key: str, changes: Mapping[str, Any], by: str, *, is_retired: bool | None = None
    ) -> KnownChannel:
        """Change a channel; of a delivered one the station keeps what it has otherwise.

        Raises:
            Problem: 404 without such a channel, 422 with each wrong field, 409 for a change of
                what stored numbers mean, or a delivered channel that is to be retired.
            StoreUnavailableError: Nothing was kept.
        """
        async with self._changing:
            return await self._change(key, changes, by, is_retired)

    async def _change(
        self, key: str, changes: Mapping[str, Any], by: str, is_retired: bool | None
    ) -> KnownChannel:
        before = self.get(key)
        is_own = before.origin == "own"
        if is_retired is not None and not is_own:
            raise conflict(f"{before.channel.title} is delivered with the station and stays.")
        changed = {n: v for n, v in changes.items() if v != getattr(before.channel, n)}
        fixed = sorted(set(changed) - CHANGEABLE)
        if fixed:
            await self._refuse_fixed(before, fixed)
        channel = _in_order(dataclasses.replace(before.channel, **changed))
        _refuse(faults_of_own(channel) if is_own else faults_of_shown(channel))
        if "wire_number" in changed:
            self._refuse_taken(channel)
        at = self._clock.now()
        kept = self._records.get(key)
        retired_at = None if kept is None else kept.retired_at
        if is_retired is not None:
            retired_at = at if is_retired else None
        document = _document(channel) if is_own else _difference(CHANNELS[key], channel)
        record = ChannelRecord(key, document, is_own, retired_at, at, by)

        def write(session: Session) -> None:
            query.save_channel(session, record)
            what = ", ".join(changed)
            if is_retired is not None:
                what = "retired" if is_retired else "in use again"
            text = f"{by} changed the channel {channel.title}: {what}."
            add_event(session, at, "channel.changed", text, data={"channel": key})

        await self._store.write(write)
        return self._took(record)

    async def _refuse_fixed(self, entry: KnownChannel, names: list[str]) -> None:
        """Refuse to change what stored numbers mean, of a delivered channel or one in use."""
        key, title = entry.channel.key, entry.channel.title
        words = " and ".join(name.replace("_", " ") for name in names)
        if entry.origin == "delivered":
            raise conflict(f"The {words} of {title} is fixed: the channel is delivered.")
        if "key" in names or await self._store.query(lambda s: query.is_used(s, key)):
            raise conflict(
                f"The {words} of {title} is fixed: robots have told values of it, which would mean "
                "something else. Retire it and add another."
            )

    def _refuse_taken(self, channel: Channel) -> None:
        other = self.catalogue.numbered(channel.wire_number)
        if other is not None and other.key != channel.key:
            raise conflict(f"The number {channel.wire_number} is that of {other.title}.")

    def _took(self, record: ChannelRecord) -> KnownChannel:
        self._records[record.key] = record
        self.catalogue = _catalogue_of(self._records)
        self._bus.publish(ChannelsChanged(record.key))
        return self.get(record.key)

    def _entry(self, channel: Channel) -> KnownChannel:
        record = self._records.get(channel.key)
        if record is None:
            return KnownChannel(channel, "delivered")
        return KnownChannel(
            channel,
            "own" if record.is_own else "delivered",
            record.retired_at is not None,
            () if record.is_own else tuple(record.document),
            record.changed_at,
            record.changed_by,
        )


def catalogue_in(session: Session) -> ChannelCatalogue:
    """Return the catalogue as a database has it, for who has no running station."""
    records = {record.key: record for record in query.list_channels(session)}
    taken = _taken(records)
    return _catalogue_of({key: one for key, one in records.items() if one not in taken})


def _taken(records: Mapping[str, ChannelRecord]) -> list[ChannelRecord]:
    """Return own channels whose key or number a delivered one has, or an earlier own one."""
    keys, numbers = set(CHANNELS), {channel.wire_number for channel in CHANNELS.values()}
    taken: list[ChannelRecord] = []
    for record in records.values():
        if not record.is_own:
            continue
        number = record.document["wire_number"]
        if record.key in keys or number in numbers:
            taken.append(record)
        else:
            numbers.add(number)
    return taken


def _catalogue_of(records: Mapping[str, ChannelRecord]) -> ChannelCatalogue:
    changed = {
        key: dataclasses.replace(CHANNELS[key], **_values(record.document))
        for key, record in records.items()
        if not record.is_own and key in CHANNELS
    }
    own = [Channel(**_values(one.document)) for one in records.values() if one.is_own]
    return CHANNELS.changed(changed).with_own(own)


def _document(channel: Channel) -> dict[str, Any]:
    """Return a channel as JSON; an end of its range that is not there is ``null``."""
    return {field.name: _told(getattr(channel, field.name)) for field in fields(channel)}


def _difference(delivered: Channel, channel: Channel) -> dict[str, Any]:
    before, now = _document(delivered), _document(channel)
    return {name: value for name, value in now.items() if value != before[name]}


def _told(value: Any) -> Any:  # noqa: ANN401 - whatever a channel's field holds
    match value:
        case float():
            return value if abs(value) < float("inf") else None
        case tuple():
            return [
                dataclasses.asdict(one) if isinstance(one, AlarmLimit) else one for one in value
            ]
        case _:
            return value


def _values(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a channel that a document tells."""
    values = dict(document)
    for name, end in (("low", float("-inf")), ("high", float("inf"))):
        if name in values and values[name] is None:
            values[name] = end
    if "alarms" in values:
        values["alarms"] = tuple(AlarmLimit(**one) for one in values["alarms"])
    for name in ("derived_from", "switch_words"):
        if name in values:
            values[name] = tuple(values[name])
    return values


def _in_order(channel: Channel) -> Channel:
    alarms = sorted(channel.alarms, key=lambda limit: -ALARM_LEVELS.index(limit.level))
    return dataclasses.replace(channel, alarms=tuple(alarms))


def _refuse(faults: list[tuple[str, str]]) -> None:
    if faults:
        count = "1 field is" if len(faults) == 1 else f"{len(faults)} fields are"
        errors = [FieldError(loc=[name], msg=message) for name, message in faults]
        raise unprocessable(f"{count} wrong.", errors)
