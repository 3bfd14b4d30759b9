"""Files that were written of deployments: which there are, and what checks said of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.delivery_tables import DeliveryFileRow
from db.fault import UnknownIdError
from db.identity import key_of, public_id
from db.query.change import row_of
from db.query.fleet.deployments import get_deployment
from db.record import same

_FILE = "file"


@dataclass(frozen=True, slots=True)
class DeliveryFile:
    """One file as it was written."""

    id: str
    name: str
    mode: str
    sha256: str
    bytes: int
    rows: int
    document: Mapping[str, Any]
    at: datetime
    by: str


def add_delivery_file(
    session: Session,
    deployment: str,
    *,
    name: str,
    mode: str,
    sha256: str,
    size: int,
    rows: int,
    document: Mapping[str, Any],
    at: datetime,
    by: str,
) -> DeliveryFile:
    """Note that a file was written; earlier ones stay.

    Raises:
        UnknownIdError: If there is no such deployment.
    """
    get_deployment(session, deployment)
    row = DeliveryFileRow(
        deployment_key=key_of("deployment", deployment),
        name=name,
        mode=mode,
        sha256=sha256,
        bytes=size,
        rows=rows,
        document=dict(document),
        at=at,
        by=by,
    )
    session.add(row)
    session.flush()
    return _record(row)


def delivery_files(session: Session, deployment: str, limit: int) -> list[DeliveryFile]:
    """Return the files of a deployment, the newest first."""
    rows = session.scalars(
        select(DeliveryFileRow)
        .where(DeliveryFileRow.deployment_key == key_of("deployment", deployment))
        .order_by(DeliveryFileRow.key.desc())
        .limit(limit)
    )
    return [_record(row) for row in rows]


def get_delivery_file(session: Session, deployment: str, file: str) -> DeliveryFile:
    """Return one file of a deployment.

    Raises:
        UnknownIdError: If the deployment has no such file.
    """
    row = row_of(session, DeliveryFileRow, _FILE, file)
    if row.deployment_key != key_of("deployment", deployment):
        raise UnknownIdError(_FILE, file)
    return _record(row)


def kept_files(session: Session) -> set[str]:
    """Return the hashes of all files that were written."""
    return set(session.scalars(select(DeliveryFileRow.sha256)))


def _record(row: DeliveryFileRow) -> DeliveryFile:
    return same(DeliveryFile, row, id=public_id(_FILE, row.key))
