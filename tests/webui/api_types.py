"""What the operator app's TypeScript says of REST: interfaces with their fields, read from text.

The sources are formatted by prettier, which is what makes so small a reader enough.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
_INTERFACE = re.compile(r"^export interface (\w+)(?: extends ([\w, ]+))? \{\n(.*?)^\}", re.M | re.S)
_ALIAS = re.compile(r"^export type (\w+)(?:<[^>]*>)? =\s*(.*?);$", re.M | re.S)
_FIELD = re.compile(r"^  (\w+)(\??):\s+(.*?);$", re.M | re.S)
_PLAIN = {"number", "string", "boolean", "null"}
_ANYTHING = frozenset({*_PLAIN, "array", "object"})


@dataclass(frozen=True, slots=True)
class Field:
    """One member of an interface."""

    kinds: frozenset[str]
    """JSON kinds that its type takes: ``number``, ``string``, ``boolean``, ``null``, ``array``,
    ``object``."""
    is_optional: bool


class AppTypes:
    """Every exported interface and alias of the app's REST client."""

    def __init__(self, folder: Path) -> None:
        text = "\n".join(
            _COMMENT.sub("", path.read_text()) for path in sorted(folder.glob("*types.ts"))
        )
        self._interfaces = {name: (bases, body) for name, bases, body in _INTERFACE.findall(text)}
        self._aliases: dict[str, str] = dict(_ALIAS.findall(text))

    @property
    def names(self) -> list[str]:
        """The interfaces."""
        return list(self._interfaces)

    def fields(self, name: str) -> dict[str, Field]:
        """Return the fields of an interface, those of its bases too."""
        bases, body = self._interfaces[name]
        found: dict[str, Field] = {}
        for base in filter(None, bases.split(", ")):
            found |= self.fields(base)
        for key, mark, text in _FIELD.findall(body):
            found[key] = Field(frozenset(self._kinds(text)), mark == "?")
        return found

    def _kinds(self, text: str) -> Iterator[str]:
        for part in _alternatives(text):
            if part in _PLAIN:
                yield part
            elif part.startswith(("'", '"')):
                yield "string"
            elif part.endswith("]") or part.startswith("readonly "):
                yield "array"
            elif (alias := part.partition("<")[0]) in self._aliases:
                yield from self._kinds(self._aliases[alias])
            elif part == "unknown":
                yield from _ANYTHING
            else:
                yield "object"


def _alternatives(text: str) -> list[str]:
    """Split a union at its own level: not inside of brackets."""
    parts, depth = [""], 0
    for letter in " ".join(text.split()):
        depth += (letter in "<([{") - (letter in ">)]}")
        if letter == "|" and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts if part.strip()]


def schema_kinds(schema: dict[str, Any], schemas: dict[str, Any]) -> frozenset[str]:
    """Return the JSON kinds that a schema lets the station send."""
    if "$ref" in schema:
        return schema_kinds(schemas[schema["$ref"].rsplit("/", 1)[-1]], schemas)
    if "anyOf" in schema:
        kinds = (schema_kinds(one, schemas) for one in schema["anyOf"])
        return frozenset(kind for some in kinds for kind in some)
    if "type" not in schema:
        return _ANYTHING
    kind: str = schema["type"]
    return frozenset({"number" if kind == "integer" else kind})
