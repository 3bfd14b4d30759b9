"""What a station does when nobody acknowledges, and how others notice that it fell silent."""

from typing import Annotated, Any, Final

from pydantic import AfterValidator, Field
from sqlalchemy.orm import Session

from db.query.station.settings import get_setting, put_setting
from server.base.alarm_board import LEVELS
from server.base.text import Name
from server.base.view import Body, one_of

_NAME: Final = "notices"


def _is_level(level: str) -> str:
    if level not in LEVELS:
        raise ValueError(f"a level is one of {', '.join(LEVELS)}")
    return level


class EscalationStep(Body):
    """Who is told next if nobody has acknowledged by then."""

    people: list[Name] = Field(min_length=1, max_length=20)
    """Names of 1 to 20 people who are told."""
    after_minutes: int = Field(default=10, ge=1, le=1440)
    """After the step before, by the station's clock."""


class NoticeSettings(Body):
    """Escalation and heartbeat of one station."""

    steps: list[EscalationStep] = Field(default=[], max_length=10)
    """After everyone who wants to hear of the alarm. A step at which nobody can be told, being
    off duty or without a contact, is left out at once."""
    escalate_from: Annotated[str, one_of(*LEVELS), AfterValidator(_is_level)] = "warning"
    """Alarms below this level are told once and not again."""
    repeat_minutes: int = Field(default=0, ge=0, le=1440)
    """Time after which the last step is told again, until somebody acknowledges; 0: never."""
    heartbeat_minutes: float = Field(default=5.0, ge=0.1, le=1440)
    """Time between two signs of life to who watches the station, by the wall."""


def read_settings(session: Session) -> NoticeSettings:
    """Return the settings as they were saved, or the presets."""
    return NoticeSettings.model_validate(get_setting(session, _NAME) or {})


def save_settings(session: Session, settings: NoticeSettings) -> None:
    """Save the settings."""
    document: dict[str, Any] = settings.model_dump(mode="json")
    put_setting(session, _NAME, document)
