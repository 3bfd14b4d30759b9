"""Setting some fields of a row by name."""

from collections.abc import Collection, Mapping
from typing import Any

from db.tables import Base


def set_fields(
    row: Base, what: str, changes: Mapping[str, Any], changeable: Collection[str]
) -> None:
    """Set fields of a row.

    Args:
        row: The row.
        what: Name of its kind with an article, for the error.
        changes: New values by field.
        changeable: Fields that may be set.

    Raises:
        ValueError: If a field may not be set.
    """
    for field, value in changes.items():
        if field not in changeable:
            raise ValueError(f"{field} of {what} cannot be changed")
        setattr(row, field, value)
