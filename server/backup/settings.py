"""When a station backs itself up, where to, and which of its backups stay.

They are an administrator's: whoever changes them decides where the station's secrets are written.
"""

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import AfterValidator, Field, model_validator
from sqlalchemy.orm import Session

from db.query.station.settings import get_setting, put_setting
from server.backup.key import KEY_LENGTH, PublicKey
from server.base.view import Body, one_of

_NAME: Final = "backup"
DAILY, EVERY_FEW_HOURS = "daily", "hours"


def _is_rhythm(rhythm: str) -> str:
    if rhythm not in (DAILY, EVERY_FEW_HOURS):
        raise ValueError(f"a rhythm is {DAILY} or {EVERY_FEW_HOURS}")
    return rhythm


def _is_public_key(text: str) -> str:
    return PublicKey.parse(text).text if text.strip() else ""


def _is_absolute(text: str) -> str:
    text = text.strip()
    if text and not Path(text).is_absolute():
        raise ValueError("a folder is written from the root, such as /mnt/backup")
    if not text.isprintable():
        raise ValueError("a folder has printable characters alone")
    return text


class BackupSettings(Body):
    """Schedule, place, rotation and encryption of backups."""

    is_scheduled: bool = False
    """Whether backups are made by themselves; by hand they can be made whenever there is a
    folder."""
    folder: Annotated[str, AfterValidator(_is_absolute)] = Field(default="", max_length=500)
    """Folder on the station's machine, best of another disk; it must be there."""
    rhythm: Annotated[str, one_of(DAILY, EVERY_FEW_HOURS), AfterValidator(_is_rhythm)] = DAILY
    """``daily``: once a day, at an hour; ``hours``: so many hours after the last one."""
    hour_utc: int = Field(default=2, ge=0, le=23)
    """Hour of the day, UTC, of daily backups."""
    every_hours: int = Field(default=6, ge=1, le=168)
    """Hours between two, where they are not daily."""
    keep_days: int = Field(default=7, ge=0, le=366)
    """Of so many days the newest backup stays."""
    keep_weeks: int = Field(default=4, ge=0, le=520)
    """Of so many weeks the newest backup stays."""
    keep_months: int = Field(default=12, ge=0, le=120)
    """Of so many months the newest backup stays."""
    public_key: Annotated[str, AfterValidator(_is_public_key)] = Field(
        default="", max_length=KEY_LENGTH + 10
    )
    """Key of `grace db backup-key` that backups are encrypted for; empty for plain files. The
    station cannot read what it encrypted."""

    @model_validator(mode="after")
    def _has_a_folder(self) -> "BackupSettings":
        if self.is_scheduled and not self.folder:
            raise ValueError("scheduled backups need a folder")
        return self

    @property
    def key(self) -> PublicKey | None:
        """The key that backups are encrypted for."""
        return PublicKey.parse(self.public_key) if self.public_key else None

    @property
    def period(self) -> timedelta:
        """Time between two scheduled backups."""
        return timedelta(hours=24 if self.rhythm == DAILY else self.every_hours)

    def next_after(self, last: datetime) -> datetime:
        """Return when the next backup is due after one of a moment; both UTC."""
        if self.rhythm != DAILY:
            return last + self.period
        last = last.astimezone(UTC)
        same_day = last.replace(hour=self.hour_utc, minute=0, second=0, microsecond=0)
        return same_day if same_day > last else same_day + self.period


def read_settings(session: Session) -> BackupSettings:
    """Return the settings as they were saved, or the presets."""
    return BackupSettings.model_validate(get_setting(session, _NAME) or {})


def save_settings(session: Session, settings: BackupSettings) -> None:
    """Save the settings."""
    document: dict[str, Any] = settings.model_dump(mode="json")
    put_setting(session, _NAME, document)
