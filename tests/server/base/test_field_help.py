"""Every field that a form is made of says what it is, and in which unit its numbers are."""

from collections.abc import Iterator
from typing import Any

import pytest

from server.base.configuration_kind import KINDS

Schema = dict[str, Any]
MODELS = {key: kind.model for key, kind in KINDS.items()}


def fields_of(root: Schema, schema: Schema, path: str = "") -> Iterator[tuple[str, Schema]]:
    """Give every field that holds a value, with its path; groups are entered."""
    schema = resolved(root, schema)
    for key, member in schema.get("properties", {}).items():
        inner, name = resolved(root, member), f"{path}{key}"
        yield name, inner
        yield from fields_of(root, inner, f"{name}.")


def resolved(root: Schema, schema: Schema) -> Schema:
    """Follow references, and what may be null to what it is otherwise."""
    while True:
        if "$ref" in schema:
            target: Schema = root
            for part in schema["$ref"].split("/")[1:]:
                target = target[part]
        else:
            kinds = [each for each in schema.get("anyOf", ()) if each.get("type") != "null"]
            if len(kinds) != 1:
                return schema
            (target,) = kinds
        rest = {key: value for key, value in schema.items() if key not in ("$ref", "anyOf")}
        schema = {**target, **rest}


def faults(root: Schema) -> list[str]:
    """Name each field without a title, a help of its own, or the unit of its numbers."""
    found: list[str] = []
    for name, field in fields_of(root, root):
        title, help_text = field.get("title", ""), field.get("description", "")
        is_number = field.get("type") in ("number", "integer") or holds_numbers(root, field)
        if not help_text or help_text.strip(" .").lower() == title.lower():
            found.append(f"{name}: no help")
        if is_number and "unit" not in field:
            found.append(f"{name}: no unit")
    return found


def holds_numbers(root: Schema, field: Schema) -> bool:
    first = field.get("items") or next(iter(field.get("prefixItems", ())), {})
    return resolved(root, first).get("type") in ("number", "integer")


@pytest.mark.parametrize("kind", MODELS)
def test_every_field_has_its_help_and_its_unit(kind: str) -> None:
    assert faults(MODELS[kind].model_json_schema()) == []


def test_a_field_that_says_nothing_is_found() -> None:
    schema = {
        "properties": {
            "good": {"type": "number", "title": "Good", "description": "Is.", "unit": "m"},
            "bare": {"type": "number", "title": "Bare", "description": "Bare."},
            "group": {"$ref": "#/$defs/Group"},
        },
        "$defs": {"Group": {"type": "object", "description": "All.", "properties": {
            "lists": {"anyOf": [{"type": "array", "items": {"type": "number"}}, {"type": "null"}],
                      "description": "Numbers."}}}},
    }  # fmt: skip
    assert faults(schema) == ["bare: no help", "bare: no unit", "group.lists: no unit"]
