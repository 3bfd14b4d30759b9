"""The shapes that the operator app expects are those that the station's OpenAPI document tells."""

from pathlib import Path
from typing import Any

import pytest

from server.app import create_app
from server.base.settings import Settings
from tests.webui.api_types import AppTypes, schema_kinds

OTHERWISE = {
    "CommandLevel": "LevelView",
    "Comparison": "ComparisonResult",
    "ComparisonRun": "ComparedRun",
    "ComparisonSummary": "RunSummary",
    "ConfigDocument": "ConfigurationView",
    "ConfigKind": "KindView",
    "EventPage": "EventsView",
    "IdentifiedParameter": "ParameterEstimate",
    "InheritedSetting": "InheritedView",
    "LeftOut": "Reason",
    "LogFile": "RobotLogView",
    "LogListing": "RobotLogsView",
    "MapListing": "MapEntryView",
    "MissionRound": "RoundView",
    "NextContact": "ContactView",
    "ObjectivePoint": "ObjectiveView",
    "ParameterTable": "ParametersView",
    "PlanLadder": "LadderView",
    "PlanProgress": "ProgressView",
    "QuoteMessage": "SatelliteMessageCostView",
    "Rehearsal": "DryRunView",
    "RobotState": "StateView",
    "SatelliteLog": "SatelliteView",
    "SceneView": "SceneStateView",
    "StationEvent": "EventView",
    "SteadyMotion": "SteadyView",
    "Track": "TrackView",
    "TrackPage": "TargetReportsView",
    "TrackPlan": "PlanView",
    "TrackView": "TargetReportView",
    "TrimAccepted": "TrimView",
    "TrimOffsets": "TrimConfig",
    "TrimRmse": "GlideError",
    "VehicleListing": "VehicleView",
    "Way": "AutoRouteView",
    "WhatIfListing": "WhatIfSummaryView",
}
"""Interfaces whose schema is neither their own name nor that with ``View`` behind it."""

SENT = {"ControllerWish": "ControllerBody", "GatewayChange": "AccountBody"}
"""What the app sends."""

OWN = {
    "ImportResult",
    "JsonObject",
    "Learned",
    "LiveTick",
    "RowFault",
}
"""Interfaces without a schema: results of jobs, and the live stream's batches."""


@pytest.fixture(scope="module")
def schemas(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    app = create_app(Settings(data_dir=tmp_path_factory.mktemp("station")))
    return app.openapi()["components"]["schemas"]


@pytest.fixture(scope="module")
def types() -> AppTypes:
    return AppTypes(Path(__file__).parents[2] / "webui" / "app" / "src" / "api")


def schema_of(name: str, schemas: dict[str, Any]) -> dict[str, Any] | None:
    for known in (OTHERWISE.get(name), SENT.get(name), f"{name}View", name):
        if known in schemas:
            return schemas[known]
    return None


def test_every_interface_has_a_schema_or_is_the_apps_own(types, schemas):
    without = {name for name in types.names if schema_of(name, schemas) is None}
    assert without == OWN


def test_every_field_that_the_app_names_is_one_of_the_stations(types, schemas):
    unknown = [
        f"{name}.{key}"
        for name in types.names
        if (schema := schema_of(name, schemas)) is not None
        for key in types.fields(name)
        if key not in schema["properties"]
    ]
    assert unknown == []


def test_the_app_takes_every_kind_of_value_that_the_station_may_send(types, schemas):
    refused: list[str] = []
    for name in {*types.names} - {*SENT}:
        properties = (schema_of(name, schemas) or {}).get("properties", {})
        for key, field in types.fields(name).items():
            if key not in properties:
                continue
            if more := schema_kinds(properties[key], schemas) - field.kinds:
                refused.append(f"{name}.{key}: {', '.join(sorted(more))}")
    assert sorted(refused) == []


def test_a_field_that_the_station_renames_is_noticed(tmp_path):
    (tmp_path / "types.ts").write_text(
        "/** A robot; its `mode: x` is no field. */\n"
        "export type Mode = 'idle' | null;\n"
        "export interface Base {\n  id: string;\n}\n"
        "export interface Robot extends Base {\n"
        "  mode?: Mode;\n"
        "  path:\n    | readonly [north: number, east: number][]\n    | null;\n"
        "}\n"
    )
    fields = AppTypes(tmp_path).fields("Robot")
    assert {key: set(field.kinds) for key, field in fields.items()} == {
        "id": {"string"},
        "mode": {"string", "null"},
        "path": {"array", "null"},
    }
    assert fields["mode"].is_optional
    assert schema_kinds({"anyOf": [{"type": "integer"}, {"$ref": "#/x/A"}]}, {"A": {}}) >= {
        "number",
        "null",
    }
