"""What would keep a version from serving, found out beside the station that it takes over from."""

import asyncio
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from db.engine import write_engine
from db.fault import StoreError
from db.migrate import NewerSchemaError, needs_migration
from server.backup.failure import BackupError
from server.backup.making import STAGING, BackupOrder, Tell, clear_staging, make_backup
from server.base.settings import Settings
from server.cli.service.succession import SuccessionError
from server.system.certificate import CertificateError, ServedCertificate

FOLDER: Final = "before-upgrade"
"""In the data folder: backups from before upgrades that changed the schema."""


def clear_killed_work(data_dir: Path) -> None:
    """Remove what backups and restores that were killed have left in a data folder."""
    for folder in (data_dir, data_dir / FOLDER):
        clear_staging(folder, STAGING)


async def prepare(settings: Settings, tell: Tell = lambda _share, _words: None) -> None:
    """Try certificate and database; back up a database whose schema this version changes.

    Args:
        settings: Of this version.
        tell: Told in a thread how far the backup is.

    Raises:
        SuccessionError: If this version cannot serve.
    """
    try:
        await asyncio.to_thread(_prepare, settings, tell)
    except EOFError as error:
        raise SuccessionError("the running station has ended") from error
    except (NewerSchemaError, StoreError, CertificateError, BackupError, OSError) as error:
        raise SuccessionError(str(error).rstrip(".")) from error


def _prepare(settings: Settings, tell: Tell) -> None:
    if settings.tls_certificate is not None and settings.tls_key is not None:
        ServedCertificate(settings.tls_certificate, settings.tls_key)
    engine = write_engine(settings.resolved_database_url)
    try:
        if not needs_migration(engine):
            return
    finally:
        engine.dispose()
    folder = settings.data_dir / FOLDER
    folder.mkdir(mode=0o700, exist_ok=True)
    target = folder / f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}.tar.gz"
    make_backup(BackupOrder(settings.data_dir, settings.resolved_database_url, target), tell)
