"""Mappings that people keep by a name; nobody overwrites another one than they began with."""

from collections.abc import Mapping as AnyMapping
from datetime import datetime
from typing import Any, Final

from sqlalchemy.orm import Session

from db.fault import StoreError
from db.query.station.settings import get_setting, put_setting
from server.recording.foreign_task import Template
from server.recording_file.mapping import Mapping

TEMPLATES: Final = "import_templates"
"""The setting that has them, by name."""


class MappingTakenError(StoreError):
    """Another mapping is kept by this name; the sentence says whose."""


def templates_in(session: Session) -> dict[str, Template]:
    """Return the mappings that were kept, by name."""
    return {
        name: Template(Mapping.model_validate(one["mapping"]), one["at"])
        for name, one in _kept(session).items()
    }


def refuse_taken(session: Session, name: str, mapping: Mapping, replaced_at: str) -> None:
    """Refuse a name by which another mapping is kept than the one that is to be replaced.

    Args:
        session: A session.
        name: Under which a mapping is to be kept.
        mapping: The mapping.
        replaced_at: When the one was kept that it is to replace, "" for none.

    Raises:
        MappingTakenError: If there is another.
    """
    kept = _kept(session).get(name)
    if kept is None or kept["at"] == replaced_at:
        return
    if Mapping.model_validate(kept["mapping"]) != mapping:
        raise MappingTakenError(
            f"{kept['by']} keeps another mapping as {name!r}, since "
            f"{datetime.fromisoformat(kept['at']):%Y-%m-%d %H:%M:%S}Z. Choose another name, or "
            "read the files again to change that one."
        )


def keep_mapping(
    session: Session, name: str, mapping: Mapping, replaced_at: str, by: str, at: datetime
) -> None:
    """Keep a mapping by a name.

    Raises:
        MappingTakenError: As ``refuse_taken``.
    """
    refuse_taken(session, name, mapping, replaced_at)
    new = {"mapping": mapping.model_dump(mode="json"), "by": by, "at": at.isoformat()}
    put_setting(session, TEMPLATES, {**_kept(session), name: new})


def _kept(session: Session) -> AnyMapping[str, Any]:
    return get_setting(session, TEMPLATES) or {}
