"""Records: what leaves the database of a row, free of it."""

from collections.abc import Iterable
from dataclasses import MISSING, fields
from functools import cache
from typing import Any, TypeVar, cast

_Record = TypeVar("_Record")


def same(record: type[_Record], source: object, /, **others: Any) -> _Record:  # noqa: ANN401 - the fields differ in type
    """Return a record (a dataclass) with the fields of a row by the same names, and others.

    Views are made of records in the same way. A field with a default that the source does not have
    keeps it.
    """
    found = {
        name: getattr(source, name)
        for name, has_default in _fields(record)
        if name not in others and not (has_default and not hasattr(source, name))
    }
    return record(**found, **others)


@cache
def _fields(record: type) -> tuple[tuple[str, bool], ...]:
    """Return the names of a dataclass's fields, and which have a default."""
    return tuple(
        (field.name, field.default is not MISSING or field.default_factory is not MISSING)
        for field in fields(cast("Any", record))
    )


def values(record: object, but: Iterable[str] = ()) -> dict[str, Any]:
    """Return the fields of a record (a dataclass) by name, for the row that keeps it."""
    return {name: getattr(record, name) for name, _ in _fields(type(record)) if name not in but}
