"""Docstrings below fields as descriptions of the JSON Schema, read when somebody asks for one."""

import ast
import inspect
import sys
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from types import MappingProxyType
from typing import Any

from pydantic import GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema


class Described:
    """Parent of models and dataclasses whose fields are described by the docstrings below them.

    pydantic's ``use_attribute_docstrings`` says the same, but parses the source of every class when
    it is imported: most of a second of a start, for what most processes never show.
    """

    __slots__ = ()

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Return the schema with the description of each field."""
        schema = handler(core_schema)
        properties: dict[str, Any] = handler.resolve_ref_schema(schema).get("properties", {})
        for name, text in _field_docstrings(cls):
            if name in properties:
                properties[name]["description"] = text
        return schema


def _field_docstrings(model: type) -> Iterator[tuple[str, str]]:
    """Yield name and docstring of each field, those of parents first."""
    for parent in reversed(model.__mro__):
        if parent is not Described and issubclass(parent, Described):
            yield from _docstrings_of(parent.__module__).get(parent.__qualname__, {}).items()


@cache
def _docstrings_of(module: str) -> MappingProxyType[str, dict[str, str]]:
    """Read which docstrings the fields of each class of a module have, by its qualified name."""
    tree = ast.parse(inspect.getsource(sys.modules[module]))
    return MappingProxyType(dict(_classes(tree.body, "")))


def _classes(body: list[ast.stmt], prefix: str) -> Iterator[tuple[str, dict[str, str]]]:
    for statement in body:
        if isinstance(statement, ast.ClassDef):
            name = prefix + statement.name
            yield name, dict(_fields(statement.body))
            yield from _classes(statement.body, f"{name}.")
        elif isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from _classes(statement.body, f"{prefix}{statement.name}.<locals>.")


def _fields(body: list[ast.stmt]) -> Iterator[tuple[str, str]]:
    for statement, below in pairwise(body):
        match statement, below:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(text))),
            ):
                yield name, inspect.cleandoc(text)
            case _:
                pass
