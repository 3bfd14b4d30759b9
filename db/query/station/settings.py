"""Values that the station keeps about itself."""

from collections.abc import Mapping
from typing import Any

from sqlalchemy.orm import Session

from db.tables import Setting


def put_setting(session: Session, name: str, value: Mapping[str, Any]) -> None:
    """Set a value."""
    session.merge(Setting(name=name, value=dict(value)))


def get_setting(session: Session, name: str) -> Mapping[str, Any] | None:
    """Return a value, ``None`` if it was never set."""
    row = session.get(Setting, name)
    return None if row is None else row.value
