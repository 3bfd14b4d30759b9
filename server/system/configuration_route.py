"""Every tunable model: its value, its schema, its versions."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Header, Query, Response

from db.fault import UnknownIdError
from db.query.fleet.robots import list_robots
from db.query.station.configurations import configuration_history, get_configuration
from db.record import same
from server.access.caller import Caller
from server.access.dependency import InChargeOf, Pilot, Viewer
from server.access.role import Right
from server.base.configuration import CurrentConfiguration
from server.base.configuration_kind import KINDS, ConfigurationKind, find_kind, fits
from server.base.dependency import FoundationDep, StoreDep
from server.base.problem import FieldError, Problem, unprocessable
from server.base.view import JsonSchema, SettingsDocument, SettingsPatch, View

router = APIRouter(prefix="/api/config", tags=["config"])
RobotQuery = Annotated[
    str | None, Query(description="Robot that it is for; without one, all without their own.")
]


@dataclass(frozen=True, slots=True)
class KindView(View):
    """One tunable model."""

    kind: str
    title: str
    robots: list[str]
    """Robots that it can be set for."""


@dataclass(frozen=True, slots=True)
class ConfigurationView(View):
    """The value of one model that holds now."""

    kind: str
    robot: str | None
    id: str | None
    """Id of the version; null while the preset holds."""
    value: SettingsDocument
    preset: SettingsDocument
    """What a field returns to when it is set to null."""
    simulation_preset: SettingsDocument | None
    """Of a controller: its gains for exact states, which a what-if may begin with."""
    reach: Literal["station", "mission", "none"]
    """How far a change gets: the station uses it, the next mission brings it to the robot, or
    neither."""
    reach_text: str
    """The same in words."""
    changed_at: datetime | None
    changed_by: str | None


@dataclass(frozen=True, slots=True)
class VersionView(View):
    """One version of one model, as it was saved."""

    kind: str
    robot: str | None
    id: str
    value: SettingsDocument
    changed_at: datetime
    changed_by: str


@router.get("")
async def list_kinds(caller: Viewer, store: StoreDep) -> list[KindView]:
    """Return which models there are."""
    known = await store.query(list_robots)
    robots = [one for one in known if one.kind != "recorded" and caller.rights.sees(one.id)]
    return [
        KindView(kind.key, kind.title, [str(one.id) for one in robots if fits(kind.key, one)])
        for kind in KINDS.values()
    ]


@router.get("/versions/{version}")
async def get_version(caller: Viewer, version: str, store: StoreDep) -> VersionView:
    """Return one version, however old: a plan cites the one that it used."""
    record = await store.query(lambda session: get_configuration(session, version))
    if record.robot is not None and not caller.rights.sees(record.robot):
        raise UnknownIdError("config", version)
    return VersionView(
        record.kind,
        record.robot,
        record.id,
        dict(record.value),
        record.changed_at,
        record.changed_by,
    )


@router.get("/{kind}")
async def get_config(
    caller: Viewer,
    kind: str,
    foundation: FoundationDep,
    response: Response,
    robot: RobotQuery = None,
) -> ConfigurationView:
    """Return the value that holds; its version is the ``ETag``."""
    del caller
    found = await foundation.configurations.current(kind, robot)
    response.headers["ETag"] = found.etag
    return _view(found)


@router.get("/{kind}/schema", response_model=JsonSchema)
async def get_schema(caller: Viewer, kind: str) -> Any:  # noqa: ANN401 - see response_model
    """Return the JSON Schema with title, unit, bounds and help of every field."""
    del caller
    return find_kind(kind).model.model_json_schema()


@router.get("/{kind}/history")
async def get_history(
    caller: Viewer,
    kind: str,
    store: StoreDep,
    robot: RobotQuery = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> list[VersionView]:
    """Return the versions that were saved, the newest first."""
    del caller
    find_kind(kind)
    records = await store.query(lambda session: configuration_history(session, kind, robot, limit))
    return [
        VersionView(r.kind, r.robot, r.id, dict(r.value), r.changed_at, r.changed_by)
        for r in records
    ]


@router.patch("/{kind}")
async def patch_config(
    caller: Pilot,
    in_charge: InChargeOf,
    kind: str,
    patch: SettingsPatch,
    foundation: FoundationDep,
    response: Response,
    robot: RobotQuery = None,
    if_match: Annotated[str | None, Header()] = None,
) -> ConfigurationView:
    """Change some fields and save the whole as a new version; null returns one to its preset.

    In a map, such as rules by channel, null removes (RFC 7396): an entry, or what an entry says.
    Whoever changes what robots do must be in charge of them; not so for what is said of data. What
    is of the station as a whole, administrators change.
    """
    found = find_kind(kind)
    if found.is_of_station:
        _check_of_station(found, caller, robot)
    if not found.is_of_data:
        await in_charge([] if robot is None else [robot])
    changed = await foundation.configurations.patch(
        kind, robot, patch.root, by=caller.name, if_match=if_match
    )
    response.headers["ETag"] = changed.etag
    return _view(changed)


def _check_of_station(kind: ConfigurationKind, caller: Caller, robot: str | None) -> None:
    if robot is not None:
        message = f"{kind.title} is set for the station, not for a robot"
        raise unprocessable("1 field is wrong.", [FieldError(loc=["robot"], msg=message)])
    if not caller.rights.may(Right.ADMINISTER):
        raise Problem(403, f"{kind.title} is changed by administrators.")


def _view(found: CurrentConfiguration) -> ConfigurationView:
    kind = find_kind(found.kind)
    simulated = kind.simulation_preset
    return same(
        ConfigurationView,
        found,
        value=found.value.model_dump(mode="json"),
        preset=found.preset.model_dump(mode="json"),
        simulation_preset=None if simulated is None else simulated.model_dump(mode="json"),
        reach=kind.reach.key,
        reach_text=kind.reach.words,
    )
