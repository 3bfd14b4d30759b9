"""Records: what leaves the database of a row, free of it."""

from dataclasses import fields
from typing import Any, TypeVar, cast

from db.tables import Base

_Record = TypeVar("_Record")


def same(record: type[_Record], row: Base, **others: Any) -> _Record:  # noqa: ANN401 - the fields differ in type
    """Return a record (a dataclass) with the fields of a row by the same names, and others."""
    names = (field.name for field in fields(cast("Any", record)) if field.name not in others)
    return record(**{name: getattr(row, name) for name in names}, **others)
