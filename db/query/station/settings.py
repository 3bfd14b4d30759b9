"""Values that the station keeps about itself."""

from collections.abc import Mapping
from typing import Any

from sqlalchemy import update
from sqlalchemy.orm import Session

from db.tables import Setting


def put_setting(session: Session, name: str, value: Mapping[str, Any]) -> None:
    """Set a value."""
    session.merge(Setting(name=name, value=dict(value)))


def replace_setting(session: Session, name: str, value: Mapping[str, Any]) -> None:
    """Set a value that is there almost always, in one statement."""
    change = update(Setting).where(Setting.name == name).values(value=dict(value))
    found: Any = session.execute(change, execution_options={"synchronize_session": False})
    if not found.rowcount:
        session.add(Setting(name=name, value=dict(value)))
        session.flush()


def get_setting(session: Session, name: str) -> Mapping[str, Any] | None:
    """Return a value, ``None`` if it was never set."""
    row = session.get(Setting, name)
    return None if row is None else row.value
