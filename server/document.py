"""The station's OpenAPI document, with the live stream and the results of jobs.

The operator app's types are generated from it, so what a browser is told stands there in full.
"""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from fastapi import FastAPI
from fastapi.routing import APIRoute
from pydantic import TypeAdapter
from pydantic.json_schema import JsonSchemaMode

from server.access.dependency import sends_of
from server.access.idempotency import IdempotentRoute
from server.backup.backups import BackupResult
from server.base.problem import ERROR_FAMILIES, MEDIA_TYPE
from server.base.view import CURSOR_MAX, View
from server.base.work.job_view import JobView
from server.command.view import CommandView
from server.current.ocean_task import CurrentProposal
from server.delivery.files import FileResult
from server.delivery.package.packages import PackageResult
from server.delivery.quality import QualityResult
from server.fleet.view import LiveRobotView
from server.map.view import LearnedView
from server.plan.view import LivePlanView, TransferView
from server.recording.decision_replays import DecisionReplayResult
from server.recording.foreign import ImportFaults, ImportReport, RecordingProposal
from server.recording.intake import ImportRefusal, ImportResult
from server.replay.film.films import FilmResult
from server.station import ROUTERS
from server.storage.result import StoragePassResult, StoragePreviewResult
from server.study.view import TrimAdviceView
from server.survey.view import LiveMissionView
from server.system.event_route import EventView
from server.tag.importing import DetectionsImported
from server.water.proposal import ImportProposal

JOB_RESULTS: tuple[type[Any], ...] = (
    ImportResult,
    ImportRefusal,
    RecordingProposal,
    ImportReport,
    ImportFaults,
    DetectionsImported,
    ImportProposal,
    CurrentProposal,
    LearnedView,
    TrimAdviceView,
    QualityResult,
    FileResult,
    PackageResult,
    DecisionReplayResult,
    FilmResult,
    StoragePassResult,
    StoragePreviewResult,
    BackupResult,
)
"""What jobs leave, of those that a program may want to read."""
_REF = "#/components/schemas/{model}"
_JSON = {
    "description": "Any value of JSON.",
    "anyOf": [
        {"type": "null"},
        {"type": "boolean"},
        {"type": "number"},
        {"type": "string"},
        {"type": "array", "items": {"$ref": _REF.format(model="JsonValue")}},
        {"type": "object", "additionalProperties": {"$ref": _REF.format(model="JsonValue")}},
    ],
}
_OPEN = ("EventData", "JsonSchema", "SettingsDocument", "SettingsPatch", "VehicleUpload")
"""Objects whose fields another document tells."""


@dataclass(frozen=True, slots=True)
class AlarmCountView(View):
    """How many alarms nobody has seen yet."""

    unacknowledged: int


@dataclass(frozen=True, slots=True)
class LiveBatchView(View):
    """One message of the live stream: what changed since the one before; the first has all."""

    at: datetime
    cursor: int
    """Cursor of the newest event; send it as ``after`` to go on."""
    events: list[EventView]
    alarms: AlarmCountView
    robots: dict[str, LiveRobotView]
    plans: dict[str, LivePlanView]
    missions: dict[str, LiveMissionView]
    jobs: dict[str, JobView]
    commands: dict[str, CommandView]
    transfers: dict[str, TransferView]
    changed: dict[str, int]
    """Resources that REST describes anew, as ``name`` or ``name/robot``, each with a revision that
    grows with every change while the station runs: read again what you show of them."""


class DocumentedApp(FastAPI):
    """An application whose document tells everything that a browser is told."""

    def openapi(self) -> dict[str, Any]:
        """Return the OpenAPI document, made once."""
        if self.openapi_schema is None:
            _complete(super().openapi())
            _mark(self.openapi_schema or {})
        return self.openapi_schema or {}


def _mark(document: dict[str, Any]) -> None:
    """Say of each operation what a client must know before it repeats it, or lets it go."""
    for route in (one for router in ROUTERS for one in router.routes):
        if not isinstance(route, APIRoute) or not route.include_in_schema:
            continue
        for method in route.methods or ():
            operation = document["paths"][route.path_format][method.lower()]
            if isinstance(route, IdempotentRoute) and method == "POST":
                operation["x-idempotency-key"] = True
            if (sends := sends_of(route.dependant)) is not None and method != "GET":
                operation["x-sends"] = sends


def _parameter(name: str, description: str, schema: dict[str, Any]) -> dict[str, Any]:
    return {
        "name": name,
        "in": "query",
        "required": False,
        "description": description,
        "schema": schema,
    }


def _complete(document: dict[str, Any]) -> None:
    schemas: dict[str, Any] = document["components"]["schemas"]
    models: tuple[type[Any], ...] = (LiveBatchView, *JOB_RESULTS)
    told: list[tuple[type[Any], JsonSchemaMode, TypeAdapter[Any]]] = [
        (one, "serialization", TypeAdapter(one)) for one in models
    ]
    _, found = TypeAdapter.json_schemas(told, ref_template=_REF)
    for name, schema in found.get("$defs", {}).items():
        schemas.setdefault(name, schema)
    schemas["JsonValue"] = _JSON
    for name in _OPEN:
        schemas[name]["additionalProperties"] = {"$ref": _REF.format(model="JsonValue")}
    results = [{"$ref": _REF.format(model=one.__name__)} for one in JOB_RESULTS]
    schemas["JobView"]["properties"]["result"] = {"anyOf": [*results, {"type": "null"}]}
    for operation in (one for item in document["paths"].values() for one in item.values()):
        for family in ERROR_FAMILIES:
            content = operation["responses"][family]["content"]
            content[MEDIA_TYPE] = content.pop("application/json")
    document["paths"]["/api/live"] = {
        "get": {
            "tags": ["live"],
            "summary": "Live stream",
            "operationId": "live",
            "description": (
                "A WebSocket. Each message is one `LiveBatchView` as JSON. It is opened by a "
                "bearer token, by the cookie from a page of the station, or by a ticket of "
                "`POST /api/session/ticket`; it is closed with 1008 when that sign-in ends and "
                "with 1001 when the station stops."
            ),
            "parameters": [
                _parameter("robots", "Ids, separated by commas.", {"type": "string"}),
                _parameter(
                    "after",
                    "Cursor of the last event seen; one that this log does not reach begins now.",
                    {"type": "integer", "minimum": 0, "maximum": CURSOR_MAX},
                ),
                _parameter("ticket", "Opens the stream, once.", {"type": "string"}),
            ],
            "responses": {
                **{
                    family: document["paths"]["/api/health"]["get"]["responses"][family]
                    for family in ERROR_FAMILIES
                },
                "101": {
                    "description": "The stream begins.",
                    "content": {
                        "application/json": {"schema": {"$ref": _REF.format(model="LiveBatchView")}}
                    },
                },
            },
        }
    }
