"""Writes, checks and keeps one file of a deployment, in a worker process."""

import hashlib
import os
import secrets
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import netCDF4
import numpy as np
from sqlalchemy.orm import Session

from db.engine import reading
from server.base.worker import IsCancelled, Report
from server.delivery.field_check import field_checks
from server.delivery.file_order import FileOrder
from server.delivery.finding import CheckReport, Finding
from server.delivery.judged import Judged, blocks_of, judged
from server.delivery.og1_file import FileRows, Written, stored, write_file
from server.delivery.own_check import own_checks

TASK = f"{__name__}:run"
OWN_SUITE = "own"
PART = ".part"
"""Marks what is not whole yet."""
_CHUNK_CACHE_BYTES = 1 << 20


@dataclass(frozen=True, slots=True)
class KeptFile:
    """A file that is kept by its hash, with what the checks say of it."""

    name: str
    sha256: str
    bytes: int
    rows: int
    source_sha256: str
    raised: int
    """Depths just above the surface that stand as 0."""
    left_out: int
    """Further measurements of a channel at one moment."""
    checks: tuple[CheckReport, ...]


def kept_path(folder: Path, sha256: str) -> Path:
    """Return where a file of this content is kept."""
    return folder / f"{sha256}.nc"


def run(order: FileOrder, report: Report, is_cancelled: IsCancelled) -> KeptFile:
    """Judge a deployment, write its file, check it, and keep it whole or not at all.

    Raises:
        WorkCancelledError: If the work is not wanted any more.
        ValueError: If the disk does not take the file.
    """
    report((0.05, "Reading and judging"))
    with reading(order.wanted.database_url) as session:
        found = judged(session, order.wanted, is_cancelled)
        return keep_file(session, order, found, report, is_cancelled)


def keep_file(
    session: Session, order: FileOrder, found: Judged, report: Report, is_cancelled: IsCancelled
) -> KeptFile:
    """Write the file of rows that were judged in the same session; see ``run``."""
    # by default each variable keeps up to 64 MiB of chunks, which is all of most files
    netCDF4.set_chunk_cache(_CHUNK_CACHE_BYTES)
    order.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    part = order.folder / f".{secrets.token_hex(8)}{PART}.nc"
    try:
        rows = FileRows(order, found)
        written = _written(session, rows, part, report, is_cancelled)
        report((0.72, "Reading it back"))
        findings = own_checks(part, f"{order.identity}.nc")
        findings += list(_differences(session, rows, written, is_cancelled))
        if order.came_after:
            findings.append(_unsigned(order))
        own = CheckReport(
            OWN_SUITE, order.software, "findings" if findings else "passed", tuple(findings), "", 0
        )
        report((0.8, "Asking the checkers of the field"))
        checks = (own, *field_checks(part, is_cancelled))
        sha256, size = synced(part)
        part.replace(kept_path(order.folder, sha256))
    finally:
        part.unlink(missing_ok=True)
    return KeptFile(
        name=f"{order.identity}.nc",
        sha256=sha256,
        bytes=size,
        rows=written.rows,
        source_sha256=written.source_sha256,
        raised=written.raised,
        left_out=found.left_out,
        checks=checks,
    )


def _unsigned(order: FileOrder) -> Finding:
    came = "1 value" if order.came_after == 1 else f"{order.came_after} values"
    what = f"{came} came after the signature of {order.signed_by}."
    fix = "Reopen the deployment, check its data, and review it anew."
    return Finding("signature", "", what, fix)


def _written(
    session: Session,
    rows: FileRows,
    part: Path,
    report: Report,
    is_cancelled: IsCancelled,
) -> Written:
    try:
        return write_file(session, rows, part, report, is_cancelled)
    except (OSError, RuntimeError) as error:
        raise ValueError(
            f"the disk did not take the file ({error}); make room and write it again"
        ) from error


def _differences(
    session: Session, rows: FileRows, written: Written, is_cancelled: IsCancelled
) -> Iterator[Finding]:
    """Yield where a file, read again, is not what it was made of: every value of every row."""
    offset = 0
    different = Counter[str]()
    with netCDF4.Dataset(written.path) as file:
        file.set_auto_maskandscale(False)
        for block in blocks_of(session, rows.order.wanted, is_cancelled):
            for name, values in rows.of(offset, block).values.items():
                variable = file[name]
                expected = stored(variable, values)
                there = variable[offset : offset + len(block)]
                lacking = len(expected) - len(there)
                different[name] += lacking + count_different(there, expected[: len(there)])
            offset += len(block)
        different["TIME"] += max(0, len(file["TIME"]) - offset)
    for name, number in different.items():
        if number:
            what = f"{number} {'value is' if number == 1 else 'values are'} not what was kept."
            yield Finding("round_trip", name, what, "Write the file anew; look after the disk.")


def count_different(one: np.ndarray, other: np.ndarray) -> int:
    """Return how many values of two arrays of one shape differ; two that are none are the same."""
    # a number that is not one differs from itself
    same = (one == other) | ((one != one) & (other != other))
    return int(np.count_nonzero(~same))


def synced(part: Path) -> tuple[str, int]:
    """Have the disk keep a file; return the hash of its content and its size."""
    digest = hashlib.sha256()
    with part.open("rb") as file:
        os.fsync(file.fileno())
        while chunk := file.read(1 << 20):
            digest.update(chunk)
        return digest.hexdigest(), file.tell()
