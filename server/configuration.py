"""The tunable models of the station: which there are, and their append-only versions."""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from types import MappingProxyType
from typing import Any

from pydantic import ValidationError
from sqlalchemy.orm import Session

from autonomy.configuration import Configuration
from autonomy.control.config import (
    BACKSTEPPING_PRESETS,
    PID_PRESETS,
    BacksteppingConfig,
    PidConfig,
)
from autonomy.estimation.config import ESTIMATOR_PRESETS, EstimatorConfig
from autonomy.field.config import FIELD_PRESETS, FieldConfig
from autonomy.planner.config import PLANNER_PRESETS, PlannerConfig
from autonomy.vehicle.trim import TRIM_PRESETS, TrimConfig
from db.query import configurations as query
from db.query.configurations import ConfigurationRecord
from db.query.events import add_event
from db.query.robots import RobotRecord, get_robot
from db.store import Store
from robot_link.clock import Clock
from server.problem import Problem, invalid, not_found


@dataclass(frozen=True, slots=True)
class ConfigurationKind:
    """One tunable model."""

    key: str
    title: str
    model: type[Configuration]
    preset: Callable[[RobotRecord], Configuration]
    """The value for a robot for which nobody has saved one."""


def _by_vehicle(
    presets: Mapping[str, Configuration], default: Configuration
) -> Callable[[RobotRecord], Configuration]:
    return lambda robot: presets.get(robot.model, default)


def _by_variable(robot: RobotRecord) -> FieldConfig:
    return FIELD_PRESETS.get(robot.site.variable, FieldConfig())


KINDS: Mapping[str, ConfigurationKind] = MappingProxyType(
    {
        kind.key: kind
        for kind in (
            ConfigurationKind(
                "planner", "Planner", PlannerConfig, _by_vehicle(PLANNER_PRESETS, PlannerConfig())
            ),
            ConfigurationKind("field", "Field map", FieldConfig, _by_variable),
            ConfigurationKind(
                "estimator",
                "Estimator",
                EstimatorConfig,
                _by_vehicle(ESTIMATOR_PRESETS, EstimatorConfig()),
            ),
            ConfigurationKind("trim", "Trim", TrimConfig, _by_vehicle(TRIM_PRESETS, TrimConfig())),
            ConfigurationKind(
                "controller.backstepping",
                "Backstepping controller",
                BacksteppingConfig,
                _by_vehicle(BACKSTEPPING_PRESETS, BacksteppingConfig()),
            ),
            ConfigurationKind(
                "controller.pid", "PID controller", PidConfig, _by_vehicle(PID_PRESETS, PidConfig())
            ),
        )
    }
)
"""Every tunable model by its key."""


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


class ConfigurationBook:
    """Reads and adds versions of the tunable models.

    For a robot, its own newest version holds; else the newest that was saved for all robots; else
    the preset of its vehicle or site.
    """

    def __init__(self, store: Store, clock: Clock) -> None:
        self._store = store
        self._clock = clock

    async def current(self, kind: str, robot: str | None) -> CurrentConfiguration:
        """Return the value that holds for a robot, or for all where ``None``.

        Raises:
            Problem: 404 if there is no such kind.
            UnknownIdError: If there is no such robot.
        """
        found = find_kind(kind)
        return await self._store.query(lambda session: current(session, found, robot))

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
        value = _patched(find_kind(kind), now, patch)
        return CurrentConfiguration(kind, robot, None, value, now.preset, None, None)

    async def patch(
        self,
        kind: str,
        robot: str | None,
        patch: Mapping[str, Any],
        *,
        by: str,
        if_match: str | None = None,
    ) -> CurrentConfiguration:
        """Merge a patch into the value that holds, validate it, and save it as a new version.

        A field set to null returns to its preset.

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
            value = _patched(found, now, patch)
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
            return CurrentConfiguration(kind, robot, record.id, value, now.preset, at, by)

        return await self._store.write(change)


def find_kind(kind: str) -> ConfigurationKind:
    """Return a kind by its key.

    Raises:
        Problem: 404 if there is no such kind; the sentence lists those that there are.
    """
    if kind not in KINDS:
        raise not_found(f"There is no configuration {kind!r}; there are {', '.join(KINDS)}.")
    return KINDS[kind]


def current(session: Session, kind: ConfigurationKind, robot: str | None) -> CurrentConfiguration:
    """Return the value that holds, read in a session of the caller's.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    preset = kind.model() if robot is None else kind.preset(get_robot(session, robot))
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


def _stored(kind: ConfigurationKind, record: ConfigurationRecord) -> Configuration:
    """Load a version."""
    try:
        return kind.model.model_validate(record.value)
    except ValidationError as error:
        raise Problem(
            409,
            f"{record.id} was saved by another version of the station and does not fit this one: "
            f"{error.errors()[0]['msg']}.",
        ) from error


def _patched(
    kind: ConfigurationKind, now: CurrentConfiguration, patch: Mapping[str, Any]
) -> Configuration:
    value = merge(now.value.model_dump(mode="json"), patch, now.preset.model_dump(mode="json"))
    try:
        # From JSON, as a file or a wire would bring it: lists become tuples, nothing else bends.
        return kind.model.model_validate_json(json.dumps(value))
    except ValidationError as error:
        raise invalid(error) from error


def merge(
    value: Mapping[str, Any], patch: Mapping[str, Any], preset: Mapping[str, Any]
) -> dict[str, Any]:
    """Return ``value`` with a patch on top (RFC 7396), where null stands for the preset."""
    merged = dict(value)
    for field, new in patch.items():
        old, default = merged.get(field), preset.get(field)
        if isinstance(new, Mapping) and isinstance(old, Mapping):
            inner = default if isinstance(default, Mapping) else {}
            merged[field] = merge(old, new, inner)
        elif new is None:
            merged[field] = default
        else:
            merged[field] = new
    return merged


def _changed_meanwhile(now: CurrentConfiguration) -> str:
    if now.changed_by is None or now.changed_at is None:
        return "This is not the version that holds; load it again."
    return (
        f"{now.changed_by} changed it at {now.changed_at:%H:%MZ}; load it again, "
        "then repeat your change."
    )
