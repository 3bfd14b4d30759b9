"""Packs one delivery of a deployment, in a worker process: all of it or nothing is kept."""

import hashlib
import secrets
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from sqlalchemy.orm import Session

from db.engine import reading
from server.base.worker import IsCancelled, Report, WorkCancelledError
from server.delivery.file_order import FileOrder
from server.delivery.file_task import PART, KeptFile, keep_file, kept_path, synced
from server.delivery.judged import Judged, add_rows, blocks_of, judged
from server.delivery.package.bag import Payload, write_bag
from server.delivery.package.content import write_content
from server.delivery.package.order import PackageOrder
from server.delivery.package.report import write_report
from server.delivery.package.row_table import RowTables
from server.delivery.package.sketch import Sketch

TASK = f"{__name__}:run"


@dataclass(frozen=True, slots=True)
class KeptPackage:
    """A delivery that is kept by its hash."""

    name: str
    sha256: str
    bytes: int
    file: KeptFile
    file_order: FileOrder
    """Of the file in it; of one that was written before with that one's moment."""
    is_new_file: bool
    """Whether the file was written now."""


def package_path(folder: Path, sha256: str) -> Path:
    """Return where a delivery of this content is kept."""
    return folder / f"{sha256}.zip"


def run(order: PackageOrder, report: Report, is_cancelled: IsCancelled) -> KeptPackage:
    """Pack a delivery; its file is the earlier one where not a row of it has changed.

    Raises:
        WorkCancelledError: If the work is not wanted any more.
        ValueError: If the disk does not take it.
    """
    folder = order.file.folder
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    work = folder / f".{secrets.token_hex(8)}{PART}"
    work.mkdir(mode=0o700)
    try:
        return _packed(order, work, report, is_cancelled)
    except OSError as error:
        raise ValueError(
            f"the disk did not take the delivery ({error}); make room and deliver it again"
        ) from error
    finally:
        shutil.rmtree(work, ignore_errors=True)


def _packed(
    order: PackageOrder, work: Path, report: Report, is_cancelled: IsCancelled
) -> KeptPackage:
    report((0.02, "Reading and judging"))
    with reading(order.file.wanted.database_url) as session:
        found = judged(session, order.file.wanted, is_cancelled)
        sketch = Sketch(found, order.file)
        tables, source = _tables(session, order.file, found, work, sketch, report, is_cancelled)
        file, file_order, is_new = _file(session, order, found, source, work, report, is_cancelled)
        report((0.72, "Writing log, plans and settings"))
        names = write_content(session, order, file_order, found, file, work)
        report((0.78, "Drawing the report"))
        names.append(write_report(session, file_order, found, file, sketch, work))
    del found, sketch
    if is_cancelled():
        raise WorkCancelledError
    netcdf = work / f"{file.sha256}.nc"
    payloads = [
        Payload(
            f"netcdf/{file.name}",
            netcdf if is_new else kept_path(order.file.folder, file.sha256),
            is_packed=True,
        ),
        *(Payload(f"csv/{name}", work / "csv" / name) for name in tables),
        *(Payload(name, work / name) for name in names),
    ]
    target = work / "delivery.zip"
    top = file.name.removesuffix(".nc")
    write_bag(
        target,
        top,
        payloads,
        _information(file_order),
        file_order.written_at,
        _progress(payloads, report, is_cancelled),
    )
    sha256, size = synced(target)
    if is_new:
        netcdf.replace(kept_path(order.file.folder, file.sha256))
    target.replace(package_path(order.file.folder, sha256))
    return KeptPackage(f"{top}.zip", sha256, size, file, file_order, is_new)


def _tables(
    session: Session,
    order: FileOrder,
    found: Judged,
    work: Path,
    sketch: Sketch,
    report: Report,
    is_cancelled: IsCancelled,
) -> tuple[list[str], str]:
    """Write the tables, and draw; return their names and the hash over all rows."""
    digest, offset, total = hashlib.sha256(), 0, max(1, len(found.at_us))
    with RowTables(work / "csv", order, found) as tables:
        for block in blocks_of(session, order.wanted, is_cancelled):
            tables.take(offset, block)
            sketch.take(offset, block)
            add_rows(digest, block)
            offset += len(block)
            report((0.1 + 0.15 * offset / total, f"Writing row {offset} of {total} as CSV"))
        return tables.finish(), digest.hexdigest()


def _file(
    session: Session,
    order: PackageOrder,
    found: Judged,
    source: str,
    work: Path,
    report: Report,
    is_cancelled: IsCancelled,
) -> tuple[KeptFile, FileOrder, bool]:
    """Return the file of a delivery, what it was made by, and whether it was written now."""
    earlier = order.earlier
    if (
        earlier is not None
        and earlier.kept.source_sha256 == source
        and kept_path(order.file.folder, earlier.kept.sha256).is_file()
    ):
        return earlier.kept, replace(order.file, written_at=earlier.written_at), False

    def part(news: tuple[float, str]) -> None:
        share, words = news
        report((0.25 + 1.1 * (share - 0.4), words))

    into_work = replace(order.file, folder=work)
    return keep_file(session, into_work, found, part, is_cancelled), order.file, True


def _information(order: FileOrder) -> dict[str, str]:
    person = order.metadata.principal_investigator
    return {
        "Source-Organization": order.metadata.operating_agency,
        "Contact-Name": person.name,
        "Contact-Email": person.email,
        "External-Identifier": order.identity,
        "Bag-Software-Agent": order.software,
        "Bagging-Date": f"{order.written_at:%Y-%m-%d}",
    }


def _progress(
    payloads: list[Payload], report: Report, is_cancelled: IsCancelled
) -> Callable[[int], None]:
    total, done = max(1, sum(one.path.stat().st_size for one in payloads)), 0

    def read(count: int) -> None:
        nonlocal done
        if is_cancelled():
            raise WorkCancelledError
        done += count
        report((0.82 + 0.16 * done / total, "Packing"))

    return read
