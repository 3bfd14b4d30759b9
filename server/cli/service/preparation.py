"""What would keep a version from serving, found out beside the station that it takes over from."""

import asyncio
from datetime import UTC, datetime
from typing import Final

from db.engine import write_engine
from db.fault import StoreError
from db.migrate import NewerSchemaError, needs_migration
from server.backup.failure import BackupError
from server.backup.making import BackupOrder, make_backup
from server.base.settings import Settings
from server.cli.service.succession import SuccessionError
from server.system.certificate import CertificateError, ServedCertificate

FOLDER: Final = "before-upgrade"
"""In the data folder: backups from before upgrades that changed the schema."""


async def prepare(settings: Settings) -> None:
    """Try certificate and database; back up a database whose schema this version changes.

    Raises:
        SuccessionError: If this version cannot serve.
    """
    try:
        await asyncio.to_thread(_prepare, settings)
    except (NewerSchemaError, StoreError, CertificateError, BackupError, OSError) as error:
        raise SuccessionError(str(error).rstrip(".")) from error


def _prepare(settings: Settings) -> None:
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
    make_backup(BackupOrder(settings.data_dir, settings.resolved_database_url, target))
