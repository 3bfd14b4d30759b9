"""Reads files of moved rows back into the database."""

from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import Final

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.query.storage.prunable import PRUNABLE
from db.query.storage.rows import put_back
from db.query.storage.taking import Row
from db.storage_tables import ArchiveFileRow
from db.store import Store
from server.storage.archive import (
    FOLDER,
    ArchiveError,
    Header,
    check_archive,
    read_header,
    read_rows,
)

_ROWS_AT_ONCE: Final = 500


def restore_file(store: Store, data_dir: Path, file: Path, now: datetime) -> int:
    """Read a file back; the rows stay in it, too. Return how many were not there already.

    What was noted of the file is held against it first. One that this database knows nothing of,
    such as one of a station that is no more, is read as it is.

    Args:
        store: The station's memory.
        data_dir: Where the folder of archives is.
        file: Of rows.
        now: By the station's clock; for a while from then on nothing of that day is pruned.

    Raises:
        ArchiveError: If the file is damaged, or of a robot that the station does not know.
        StoreError: If the database does not answer; reading it once more goes on.
    """
    try:
        path = str(file.resolve().relative_to((data_dir / FOLDER).resolve()))
    except ValueError:
        path = ""
    with store.read() as session:
        noted = session.scalar(select(ArchiveFileRow).where(ArchiveFileRow.path == path))
    if noted is not None:
        check_archive(file, noted.sha256)
    header = read_header(file)
    kind = PRUNABLE.get(header.kind)
    if kind is None:
        raise ArchiveError(f"{file} holds {header.kind}, which this station does not know.")
    if noted is not None:
        _hold_day(store, noted.key, now)
    rows = read_rows(file, header)
    back = 0
    while piece := list(islice(rows, _ROWS_AT_ONCE)):
        back += _put(store, file, header, piece)
    return back


def _hold_day(store: Store, key: int, now: datetime) -> None:
    """Have passes leave the day of a file alone; said before its first row is back."""

    def change(session: Session) -> None:
        row = session.get(ArchiveFileRow, key)
        if row is not None:
            row.state, row.restored_at = "restored", now

    store.change(change).result()


def _put(store: Store, file: Path, header: Header, rows: list[Row]) -> int:
    kind = PRUNABLE[header.kind]
    try:
        return store.change(lambda session: put_back(session, kind, rows, header.names)).result()
    except LookupError as error:
        raise ArchiveError(f"{file}: {error.args[0]}") from error
