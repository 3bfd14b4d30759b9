"""Models of pydantic, one for each schema of an OpenAPI document."""

import keyword
import re
from collections.abc import Iterable
from typing import Any

Schema = dict[str, Any]
HEAD = '''"""What the station takes and tells. Written by `make client`; changes are lost."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field


class Told(BaseModel):
    """What the station tells; what a newer one tells beyond that is left out."""

    model_config = ConfigDict(extra="ignore", frozen=True, protected_namespaces=())


class Asked(BaseModel):
    """What the station is asked; it knows no other fields."""

    model_config = ConfigDict(extra="forbid", frozen=True, protected_namespaces=())
'''
_TAIL = """
for _model in (*Told.__subclasses__(), *Asked.__subclasses__()):
    _model.model_rebuild()
"""
_SIMPLE = {
    "string": "str", "integer": "int", "number": "float", "boolean": "bool", "null": "None",
}  # fmt: skip
_TUPLE_MAX = 4


def module_of(schemas: dict[str, Schema]) -> str:
    """Return the module: classes, then the names that stand for other types."""
    names = {class_name(name): schema for name, schema in schemas.items()}
    if len(names) != len(schemas):
        raise ValueError("two schemas would have one name")
    classes = [_class(name, one) for name, one in names.items() if "properties" in one]
    others = {name: one for name, one in names.items() if "properties" not in one}
    aliases = [_alias(name, others[name]) for name in _in_order(others)]
    return "\n\n".join([HEAD.rstrip() + "\n", *classes, "\n".join(aliases), _TAIL])


def class_name(name: str) -> str:
    """Return the name of a schema's class, with the room where a plain name is taken twice."""
    parts = re.split(r"__|[^A-Za-z0-9]", name)
    if name.startswith("server__"):
        parts = [parts[1].title().replace("_", ""), parts[-1]]
    return "".join(part[:1].upper() + part[1:] for part in parts if part)


def type_of(schema: Schema, prefix: str = "") -> str:
    """Return the type of a schema; names of models begin with ``prefix``."""
    if "$ref" in schema:
        return prefix + class_name(schema["$ref"].rpartition("/")[2])
    if "const" in schema:
        return f"Literal[{schema['const']!r}]"
    if "enum" in schema and not any(isinstance(one, float) for one in schema["enum"]):
        return f"Literal[{', '.join(map(repr, schema['enum']))}]"
    for word in ("anyOf", "oneOf", "allOf"):
        if word in schema:
            return _union(schema, word, prefix)
    kind = schema.get("type")
    if kind == "array":
        return _array(schema, prefix)
    if kind == "object":
        more = schema.get("additionalProperties")
        return f"dict[str, {type_of(more, prefix) if isinstance(more, dict) else 'Any'}]"
    if schema.get("format") == "date-time":
        return "datetime"
    return _SIMPLE.get(str(kind), "Any")


def _union(schema: Schema, word: str, prefix: str) -> str:
    types = list(dict.fromkeys(type_of(one, prefix) for one in schema[word]))
    if "Any" in types:
        return "Any"
    union = " | ".join(types)
    told_by = schema.get("discriminator", {}).get("propertyName")
    if told_by is None or len(types) == 1:
        return union
    return f"Annotated[{union}, Field(discriminator={told_by!r})]"


def _array(schema: Schema, prefix: str) -> str:
    inner = [type_of(one, prefix) for one in schema.get("prefixItems", ())]
    if 0 < len(inner) <= _TUPLE_MAX:
        return f"tuple[{', '.join(inner)}]"
    item = inner[0] if inner else type_of(schema.get("items", {}), prefix)
    return f"list[{item}]"


def _class(name: str, schema: Schema) -> str:
    parent = "Asked" if schema.get("additionalProperties") is False else "Told"
    required = set(schema.get("required", ()))
    lines = [f"class {name}({parent}):", f'    """{_text(schema, name)}"""', ""]
    for field, one in schema["properties"].items():
        lines += _field(field, one, is_required=field in required)
    return "\n".join(lines).rstrip() + "\n"


def _field(field: str, schema: Schema, *, is_required: bool) -> Iterable[str]:
    kind = type_of(schema)
    name = f"{field}_" if keyword.iskeyword(field) else field
    options = [f"alias={field!r}"] if name != field else []
    if not is_required and "const" not in schema:  # what tells kinds apart is always sent
        default = schema.get("default")
        if isinstance(default, dict | list):
            default = None
        if default is None and "None" not in kind.split(" | ") and kind != "Any":
            kind = f"{kind} | None"
        options.insert(0, f"default={default!r}")
    value = f" = Field({', '.join(options)})" if options else ""
    yield f"    {name}: {kind}{value}"
    if "description" in schema:
        yield f'    """{_text(schema, "")}"""'


def _alias(name: str, schema: Schema) -> str:
    text = f'\n"""{_text(schema, "")}"""' if "description" in schema else ""
    return f"{name} = {type_of(schema)}{text}"


def _in_order(others: dict[str, Schema]) -> list[str]:
    """Return names so that each comes after those that it is made of."""
    ordered: list[str] = []

    def add(name: str) -> None:
        if name in ordered:
            return
        for word in re.findall(r"[A-Za-z0-9]+", type_of(others[name])):
            if word in others and word != name:
                add(word)
        ordered.append(name)

    for name in others:
        add(name)
    return ordered


def _text(schema: Schema, otherwise: str) -> str:
    text = str(schema.get("description") or otherwise).strip()
    text = text.replace("\\", "\\\\").replace('"""', "'''")
    text = text.replace("\n", "\n    ")
    return text + " " if text.endswith('"') else text
