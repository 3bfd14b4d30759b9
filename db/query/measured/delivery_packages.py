"""Deliveries that were packed of deployments: which there are, and until when they are kept."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from db.delivery_tables import DeliveryFileRow, DeliveryPackageRow
from db.fault import UnknownIdError
from db.identity import key_of, public_id
from db.query.change import row_of
from db.record import same

_PACKAGE, _FILE = "package", "file"


@dataclass(frozen=True, slots=True)
class DeliveryPackage:
    """One delivery as it was packed."""

    id: str
    file: str
    """The NetCDF file in it."""
    name: str
    sha256: str
    bytes: int
    has_journal: bool
    at: datetime
    by: str
    expires_at: datetime


def add_delivery_package(
    session: Session,
    file: str,
    *,
    name: str,
    sha256: str,
    size: int,
    has_journal: bool,
    at: datetime,
    by: str,
    expires_at: datetime,
) -> DeliveryPackage:
    """Note that a delivery was packed around a file; earlier ones stay until they expire.

    Raises:
        UnknownIdError: If there is no such file.
    """
    row = DeliveryPackageRow(
        file_key=row_of(session, DeliveryFileRow, _FILE, file).key,
        name=name,
        sha256=sha256,
        bytes=size,
        has_journal=has_journal,
        at=at,
        by=by,
        expires_at=expires_at,
    )
    session.add(row)
    session.flush()
    return _record(row)


def delivery_packages(session: Session, deployment: str, limit: int) -> list[DeliveryPackage]:
    """Return the deliveries of a deployment, the newest first, expired ones too."""
    rows = session.scalars(_of(deployment).order_by(DeliveryPackageRow.key.desc()).limit(limit))
    return [_record(row) for row in rows]


def get_delivery_package(session: Session, deployment: str, package: str) -> DeliveryPackage:
    """Return one delivery of a deployment, also one that expired.

    Raises:
        UnknownIdError: If the deployment has no such delivery.
    """
    key = row_of(session, DeliveryPackageRow, _PACKAGE, package).key
    row = session.scalar(_of(deployment).where(DeliveryPackageRow.key == key))
    if row is None:
        raise UnknownIdError(_PACKAGE, package)
    return _record(row)


def kept_packages(session: Session, at: datetime) -> set[str]:
    """Return the hashes of the deliveries that have not expired."""
    return set(
        session.scalars(select(DeliveryPackageRow.sha256).where(DeliveryPackageRow.expires_at > at))
    )


def _of(deployment: str) -> Select[DeliveryPackageRow]:
    return (
        select(DeliveryPackageRow)
        .join(DeliveryFileRow, DeliveryFileRow.key == DeliveryPackageRow.file_key)
        .where(DeliveryFileRow.deployment_key == key_of("deployment", deployment))
    )


def _record(row: DeliveryPackageRow) -> DeliveryPackage:
    return same(
        DeliveryPackage, row, id=public_id(_PACKAGE, row.key), file=public_id(_FILE, row.file_key)
    )
