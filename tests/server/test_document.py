"""The OpenAPI document tells what every answer is made of: the app's types come from it."""

from collections.abc import Iterator
from typing import Any

import pytest

from server.base.live_feed import SECTIONS
from tests.server.conftest import application

OPEN = {
    "EventData", "JsonSchema", "RecordingProposal", "SettingsDocument", "SettingsPatch",
    "VehicleUpload",
}  # fmt: skip
"""Documents whose fields a schema of their own tells; their values are any JSON."""


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    return application().openapi()


def free_objects(node: object, path: tuple[str, ...] = ()) -> Iterator[str]:
    if isinstance(node, list):
        for number, one in enumerate(node):
            yield from free_objects(one, (*path, str(number)))
    if isinstance(node, dict):
        more = node.get("additionalProperties", True)
        if node.get("type") == "object" and not node.get("properties") and more in (True, {}):
            yield "/".join(path)
        for key, one in node.items():
            yield from free_objects(one, (*path, key))


def test_no_answer_or_request_holds_a_free_object(document):
    assert list(free_objects(document)) == []


def test_only_documents_with_a_schema_of_their_own_hold_any_json(document):
    of_json = {
        name
        for name, schema in document["components"]["schemas"].items()
        if "components/schemas/JsonValue'" in str(schema) and name != "JsonValue"
    }
    assert of_json == OPEN


def test_a_free_object_is_noticed():
    schema = {"anyOf": [{"type": "object"}, {"type": "object", "additionalProperties": True}]}
    assert list(free_objects(schema)) == ["anyOf/0", "anyOf/1"]


def test_the_live_stream_is_described(document):
    batch = document["components"]["schemas"]["LiveBatchView"]
    assert {*SECTIONS, "events", "alarms"} <= set(batch["required"])
    assert "101" in document["paths"]["/api/live"]["get"]["responses"]


def names_in(node: object) -> Iterator[str]:
    """Tell the schemas that a part of the document names."""
    if isinstance(node, list):
        for one in node:
            yield from names_in(one)
    if isinstance(node, dict):
        if "$ref" in node:
            yield str(node["$ref"]).rsplit("/", 1)[-1]
        for one in node.values():
            yield from names_in(one)


def undescribed(document: dict[str, Any]) -> Iterator[str]:
    """Tell the fields of request bodies, however deep, of which nobody says what they are."""
    schemas, seen = document["components"]["schemas"], set[str]()
    bodies = [
        operation["requestBody"]
        for path in document["paths"].values()
        for operation in path.values()
        if "requestBody" in operation
    ]
    waiting = list(names_in(bodies))
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        waiting += names_in(schemas[name])
        for field, told in schemas[name].get("properties", {}).items():
            if not str(told.get("description", "")).strip():
                yield f"{name}.{field}"


def test_every_field_of_every_request_body_says_what_it_is(document):
    assert sorted(undescribed(document)) == []


def test_a_field_without_a_description_is_noticed():
    fields = {"a": {"description": "Known."}, "b": {"$ref": "#/components/schemas/Inner"}}
    body = {"requestBody": {"content": {"x": {"schema": {"$ref": "#/components/schemas/Outer"}}}}}
    inner = {"properties": {"c": {"type": "string"}}}
    document = {
        "paths": {"/a": {"post": body}},
        "components": {"schemas": {"Outer": {"properties": fields}, "Inner": inner}},
    }
    assert sorted(undescribed(document)) == ["Inner.c", "Outer.b"]


STATES = {"state", "mode", "level", "phase", "status", "stage"}
"""Names of fields that tell how things stand."""


def free_states(document: dict[str, Any]) -> Iterator[str]:
    """Tell the fields of a state that may be any text."""
    for name, schema in document["components"]["schemas"].items():
        for field, told in schema.get("properties", {}).items():
            kinds = [
                document["components"]["schemas"].get(
                    str(one.get("$ref", "")).rsplit("/", 1)[-1], one
                )
                for one in told.get("anyOf", [told])
            ]
            if field in STATES and {"type": "string"} in [
                {key: one[key] for key in one.keys() & {"type", "enum", "const"}} for one in kinds
            ]:
                yield f"{name}.{field}"


def test_every_state_names_the_words_that_it_can_be(document):
    assert list(free_states(document)) == []


def test_a_state_that_may_be_any_text_is_noticed():
    fields = {"state": {"type": "string"}, "level": {"enum": ["high"], "type": "string"}}
    schemas = {"JobView": {"properties": fields}}
    assert list(free_states({"components": {"schemas": schemas}})) == ["JobView.state"]
