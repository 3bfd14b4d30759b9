"""Values that the station keeps about itself."""

from collections.abc import Mapping
from typing import Any, Final, cast

from sqlalchemy import Table, bindparam, update
from sqlalchemy.orm import Session

from db.tables import Setting

_TABLE: Final = cast("Table", Setting.__table__)
_REPLACE: Final = (
    update(_TABLE).where(_TABLE.c.name == bindparam("of")).values(value=bindparam("new"))
)
"""Made once, and no statement of the ORM: each batch of telemetry replaces a value."""


def put_setting(session: Session, name: str, value: Mapping[str, Any]) -> None:
    """Set a value."""
    session.merge(Setting(name=name, value=dict(value)))


def replace_setting(session: Session, name: str, value: Mapping[str, Any]) -> None:
    """Set a value that is there almost always, in one statement."""
    found: Any = session.execute(_REPLACE, {"of": name, "new": dict(value)})
    if not found.rowcount:
        session.add(Setting(name=name, value=dict(value)))
        session.flush()


def get_setting(session: Session, name: str) -> Mapping[str, Any] | None:
    """Return a value, ``None`` if it was never set."""
    row = session.get(Setting, name)
    return None if row is None else row.value
