"""The append-only versions of the station's tunable models."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from operator import itemgetter
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError
from sqlalchemy.orm import Session

from autonomy.configuration import Configuration
from autonomy.field.config import FieldConfig
from autonomy.quality.rules import KEPT, QualityRules
from db.query.fleet.robots import get_robot
from db.query.station import configurations as query
from db.query.station.configurations import ConfigurationRecord
from db.query.station.events import add_event
from db.store import Store
from robot_link.clock import Clock
from server.base.channels import Channels
from server.base.configuration_kind import ConfigurationKind, find_kind
from server.base.event_bus import EventBus, SettingsChanged
from server.base.problem import Problem, invalid
from server.base.vehicle_catalogue import preset_key

_Model = TypeVar("_Model", bound=Configuration)


@dataclass(frozen=True, slots=True)
class CurrentConfiguration:
    """The value that holds now, and where it comes from."""

    kind: str
    robot: str | None
    id: str | None
    """Id of the version, or ``None`` while the preset holds."""
    value: Configuration
    preset: Configuration
    changed_at: datetime | None
    changed_by: str | None

    @property
    def etag(self) -> str:
        """Name of this version for ``ETag`` and ``If-Match``, quotes included."""
        if self.id is not None:
            return f'"{self.id}"'
        digest = hashlib.sha256(self.value.model_dump_json().encode()).hexdigest()
        return f'"preset-{digest[:16]}"'

    def value_as(self, model: type[_Model]) -> _Model:
        """Return the value as what its kind's model makes it.

        Raises:
            TypeError: If it is of another kind.
        """
        if not isinstance(self.value, model):
            raise TypeError(f"the configuration {self.kind} is no {model.__name__}")
        return self.value


class ConfigurationBook:
    """Reads and adds versions of the tunable models.

    For a robot, its own newest version holds; else the newest that was saved for all robots; else
    the preset of its vehicle or site; of a vehicle that someone added, the preset of the built-in
    one that is nearest in mass.
    """

    def __init__(self, store: Store, clock: Clock, bus: EventBus, channels: Channels) -> None:
        self._store = store
        self._channels = channels
        self._bus = bus
        self._clock = clock

    async def current(self, kind: str, robot: str | None) -> CurrentConfiguration:
        """Return the value that holds for a robot, or for all where ``None``.

        Raises:
            Problem: 404 if there is no such kind.
            UnknownIdError: If there is no such robot.
        """
        found = find_kind(kind)
        return await self._store.query(lambda session: current(session, found, robot))

    async def newest_of(self, kind: str, robots: Sequence[str]) -> CurrentConfiguration:
        """Return, of the values that hold for some robots, the one that was saved last.

        Where none was saved it is the preset of the first. Robots without a version of their own
        are alike, so that one of them stands for all.

        Raises:
            Problem: 404 if there is no such kind.
            UnknownIdError: If there is no such robot.
        """
        found = find_kind(kind)

        def read(session: Session) -> CurrentConfiguration:
            own = query.robots_with_own(session, kind)
            others = [robot for robot in robots if robot not in own][:1]
            asked = [*others, *(robot for robot in robots if robot in own)]
            held = [current(session, found, robot) for robot in asked]
            saved = [(one.changed_at, one) for one in held if one.changed_at is not None]
            return max(saved, key=itemgetter(0))[1] if saved else held[0]

        return await self._store.query(read)

    async def merged(
        self, kind: str, robot: str | None, patch: Mapping[str, Any]
    ) -> CurrentConfiguration:
        """Return the value that holds with a patch on top, valid but not saved.

        Raises:
            Problem: 404 if there is no such kind, 422 with the path of each wrong field.
            UnknownIdError: If there is no such robot.
        """
        now = await self.current(kind, robot)
        if not patch:
            return now
        value = self._patched(find_kind(kind), now, patch)
        return CurrentConfiguration(kind, robot, None, value, now.preset, None, None)

    async def patch(
        self,
        kind: str,
        robot: str | None,
        patch: Mapping[str, Any],
        *,
        by: str,
        if_match: str | None = None,
        also: Callable[[Session], None] | None = None,
    ) -> CurrentConfiguration:
        """Merge a patch into the value that holds, validate it, and save it as a new version.

        A field set to null returns to its preset; in a map, such as rules by channel, null removes.
        ``also`` is what else belongs to the change.

        Raises:
            Problem: 404 if there is no such kind, 412 if ``if_match`` names another version,
                422 with the path of each wrong field.
            UnknownIdError: If there is no such robot.
        """
        found = find_kind(kind)
        at = self._clock.now()

        def change(session: Session) -> CurrentConfiguration:
            now = current(session, found, robot)
            if if_match is not None and if_match not in {"*", now.etag}:
                raise Problem(412, _changed_meanwhile(now))
            value = self._patched(found, now, patch)
            record = query.add_configuration(
                session, kind, robot, value.model_dump(mode="json"), at=at, by=by
            )
            add_event(
                session,
                at,
                "config.changed",
                f"{by} changed the {found.title} settings of {robot or 'all robots'}.",
                robot=robot,
                data={"kind": kind, "id": record.id},
            )
            if also is not None:
                also(session)
            return CurrentConfiguration(kind, robot, record.id, value, now.preset, at, by)

        changed = await self._store.write(change)
        self._bus.publish(SettingsChanged(kind, robot))
        return changed

    def _patched(
        self, kind: ConfigurationKind, now: CurrentConfiguration, patch: Mapping[str, Any]
    ) -> Configuration:
        value = merge(
            now.value.model_dump(mode="json"),
            patch,
            now.preset.model_dump(mode="json"),
            kind.model,
        )
        try:
            # From JSON, as a file or wire would bring it: lists become tuples, nothing else bends.
            checked = kind.model.model_validate_json(json.dumps(value))
        except ValidationError as error:
            raise invalid(error, kind.model) from error
        if isinstance(checked, FieldConfig):
            self._channels.check_mapped(checked.variable)
        if isinstance(checked, QualityRules):
            self._channels.check_known(checked.series, "series")
        return checked


def current(session: Session, kind: ConfigurationKind, robot: str | None) -> CurrentConfiguration:
    """Return the value that holds, read in a session of the caller's.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    preset = kind.default if robot is None else _preset(session, kind, robot)
    record = query.newest_configuration(session, kind.key, robot)
    if record is None and robot is not None:
        record = query.newest_configuration(session, kind.key, None)
    if record is None:
        return CurrentConfiguration(kind.key, robot, None, preset, preset, None, None)
    return CurrentConfiguration(
        kind=kind.key,
        robot=robot,
        id=record.id,
        value=_stored(kind, record),
        preset=preset,
        changed_at=record.changed_at,
        changed_by=record.changed_by,
    )


def _preset(session: Session, kind: ConfigurationKind, robot: str) -> Configuration:
    record = get_robot(session, robot)
    return kind.preset(record, preset_key(session, record.model))


def _stored(kind: ConfigurationKind, record: ConfigurationRecord) -> Configuration:
    """Load a version."""
    try:
        return kind.model.model_validate(record.value, context=KEPT)
    except ValidationError as error:
        raise Problem(
            409,
            f"{record.id} was saved by another version of the station and does not fit this one: "
            f"{error.errors()[0]['msg']}.",
        ) from error


def merge(
    value: Mapping[str, Any],
    patch: Mapping[str, Any],
    preset: Mapping[str, Any],
    model: type[BaseModel] | None = None,
) -> dict[str, Any]:
    """Return ``value`` with a patch on top (RFC 7396), where null stands for the preset.

    In a map of a model, whose keys are data, null removes, as the standard has it: an entry, or
    what an entry says.
    """
    merged = dict(value)
    for field, new in patch.items():
        old, default = merged.get(field), preset.get(field)
        inner, is_map = _inner(model, field)
        if isinstance(new, Mapping) and is_map:
            merged[field] = _laid_over(old, new)
        elif isinstance(new, Mapping) and isinstance(old, Mapping):
            below = default if isinstance(default, Mapping) else {}
            merged[field] = merge(old, new, below, inner)
        elif new is None:
            merged[field] = default
        else:
            merged[field] = new
    return merged


def _laid_over(value: object, patch: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a merge patch makes of a value, to the letter of RFC 7396."""
    merged: dict[str, Any] = dict(value) if isinstance(value, Mapping) else {}
    for key, new in patch.items():
        if new is None:
            merged.pop(key, None)
        else:
            merged[key] = _laid_over(merged.get(key), new) if isinstance(new, Mapping) else new
    return merged


def _inner(model: type[BaseModel] | None, field: str) -> tuple[type[BaseModel] | None, bool]:
    """Return the model of a field's value, if it has one, and whether the field is a map."""
    known = None if model is None else model.model_fields.get(field)
    if known is None:
        return None, False
    parts = (known.annotation, *get_args(known.annotation))
    if any(get_origin(one) is dict or one is dict for one in parts):
        return None, True
    models = [one for one in parts if isinstance(one, type) and issubclass(one, BaseModel)]
    return (models[0] if len(models) == 1 else None), False


def _changed_meanwhile(now: CurrentConfiguration) -> str:
    if now.changed_by is None or now.changed_at is None:
        return "This is not the version that holds; load it again."
    return (
        f"{now.changed_by} changed it at {now.changed_at:%H:%MZ}; load it again, "
        "then repeat your change."
    )
