"""Recordings of any maker come in: a mapping is proposed, confirmed, and all is kept or nothing.

read -> proposed -> confirmed -> converted -> held against what is kept -> kept -> maps
"""

import asyncio
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final, cast

import numpy as np
from pydantic import JsonValue
from sqlalchemy.orm import Session
from typing_extensions import TypedDict

from db.fault import StoreError, UnknownIdError
from db.query.fleet.recordings import ImportedFile, refuse_closed, refuse_known
from db.query.measured.other_series import add_other_series
from db.query.measured.quality import add_manual_flag
from db.store import Store
from robot_link.clock import Clock
from server.base.job import JobError, JobProgress, ThreadWork
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.deployment.view import RecordedScores
from server.recording.card import CardOrder, CardRefusedError, KeptCard, keep_card
from server.recording.foreign_task import CONVERT, PROPOSE, ReadOrder
from server.recording.intake import (
    SHOWN_FAULTS,
    Outcomes,
    WithoutMap,
    learn_maps,
    scores_of,
    without_map,
)
from server.recording.keep import Held, Kept, Source, hashed, hold, keep_recording, source_of
from server.recording.kept_mapping import keep_mapping
from server.recording.table import Policy, Recording, RowFault
from server.recording.upload import forget_upload
from server.recording_file.card import Card
from server.recording_file.conversion import Converted
from server.recording_file.mapping import Mapping
from server.recording_file.raw import FileFault, FlagArray

FOLDER: Final = "imports"
"""Of the data folder."""
_FLAGGED: Final = (2, 3, 4)
_STRETCHES_MAX: Final = 1000
"""So many stretches of flags of a channel are taken over from files."""
_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
_CONVERTED_SHARE: Final = 0.25


class FaultDocument(TypedDict):
    """What cannot be used of a file."""

    place: str
    """Line, record, variable or column."""
    reason: str


class ProposedColumn(TypedDict):
    """A column of a file, and what it is taken for."""

    name: str
    is_text: bool
    role: str
    target: str
    unit: str
    time_format: str
    """How its times are written, should it tell them; "" where a person has to say."""
    has_zone: bool
    """Whether its times say their zone, should it tell them."""
    cells: list[str]
    """Of the first rows."""


class RecordingProposal(TypedDict):
    """What was read of an upload; nothing of it is kept yet."""

    upload: str
    """Names it where it is confirmed, within a week."""
    format: str
    files: list[str]
    rows: int
    faults: int
    """Rows that cannot be read at all."""
    mapping: dict[str, JsonValue]
    columns: list[ProposedColumn]
    missing: list[FaultDocument]
    """What keeps the mapping from being followed as it is; of what the file leaves open and a
    person has to say, the place is the field of the mapping."""
    notes: list[str]
    flight: list[str]
    """Keys that a column of the role ``flight`` may have."""
    template: str
    """The kept mapping that was proposed, "" for a guess."""
    template_at: str
    """When it was kept, "" for a guess."""
    is_simulated: bool


class ImportReport(TypedDict):
    """What came of an import; the four kinds of rows sum up to those that were read."""

    deployment: str
    """A card may tell of several, or of none."""
    robot: str
    read: int
    new: int
    duplicate: int
    differs: int
    """Measured at a moment of which another value is kept; both are."""
    faults: int
    named_faults: list[FaultDocument]
    """The first of them."""
    notes: list[str]
    scores: list[RecordedScores]
    without_map: list[WithoutMap]


class ImportFaults(TypedDict):
    """Why an upload was refused."""

    named_faults: list[FaultDocument]
    faults: int


@dataclass(frozen=True, slots=True)
class Confirmed:
    """What an operator wants of an upload."""

    order: ReadOrder
    files: Sequence[ImportedFile]
    """Of the order, with their hashes."""
    robot: str
    policy: Policy
    into: str
    template: str
    by: str
    clock_offset_s: float | None = None
    """How far the recorder's clock was ahead, as a person said; None where nobody did."""
    template_at: str = ""
    """When the mapping of this name was kept that is to be replaced, "" for a new name."""


async def read_upload(
    order: ReadOrder, upload: str, pool: WorkerPool, progress: JobProgress
) -> RecordingProposal:
    """Read an upload and propose a mapping.

    Raises:
        JobError: If it cannot be read.
    """
    progress.wait_for_process()
    try:
        found = await pool.run(PROPOSE, order, on_progress=lambda news: progress.report(*news))
    except WORKER_FAILURES as error:
        raise JobError(str(error)) from error
    if "refused" in found:
        raise JobError(found["refused"])
    found["upload"] = upload
    return cast("RecordingProposal", found)


async def run_confirmed(
    wanted: Confirmed, store: Store, clock: Clock, pool: WorkerPool, progress: JobProgress
) -> ImportReport:
    """Import an upload as it was confirmed, whole or not at all.

    Raises:
        JobError: If it was refused; the result names the faults.
    """

    def told(news: tuple[float, str]) -> None:
        progress.report(news[0] * _CONVERTED_SHARE, news[1])

    progress.wait_for_process()
    try:
        converted = await pool.run(CONVERT, wanted.order, on_progress=told)
    except WORKER_FAILURES as error:
        raise JobError(str(error)) from error
    if isinstance(converted, str):
        raise JobError(converted)
    if isinstance(converted, list):
        faults = [FileFault(place, reason) for place, reason in converted]
        words = "; ".join(f"{one.place}: {one.reason}" for one in faults[:3])
        raise JobError(f"The mapping cannot be followed: {words}.", refusal(faults))
    if isinstance(converted, Card):
        return await _run_card(wanted, converted, store, clock, progress)
    converted = dated(converted, wanted)
    refuse(converted, wanted.policy)
    thread = ThreadWork(progress)
    progress.report(_CONVERTED_SHARE, f"Keeping {len(converted.time_s):,} rows")
    recording, at = recording_of(converted), clock.now()
    held = await thread.result(store.query(lambda s: hold(s, wanted.robot, recording)))
    try:
        kept = await thread.result(
            store.write(
                lambda s: keep_confirmed(s, wanted, converted, at=at, held=held, go_on=thread.go_on)
            )
        )
    except StoreError as error:
        raise JobError(str(error)) from error
    outcomes = await learn_maps(
        store, clock, progress, robot=wanted.robot, kept=kept, recording=recording
    )
    await asyncio.to_thread(forget_upload, wanted.order.folder)
    return report_of(kept, converted, outcomes)


async def _run_card(
    wanted: Confirmed, card: Card, store: Store, clock: Clock, progress: JobProgress
) -> ImportReport:
    thread = ThreadWork(progress)
    progress.report(_CONVERTED_SHARE, f"Holding {card.read:,} lines against telemetry")
    order = card_order(wanted, card, clock.now(), clock.speed)
    try:
        kept = await thread.result(store.write(lambda s: keep_card(s, order, thread.go_on)))
    except CardRefusedError as error:
        raise JobError(str(error), refusal(error.faults)) from error
    except StoreError as error:
        raise JobError(str(error)) from error
    await asyncio.to_thread(forget_upload, wanted.order.folder)
    return card_report(kept, card)


def card_order(wanted: Confirmed, card: Card, at: datetime, speed: float) -> CardOrder:
    """Return what is to become of a card that was confirmed."""
    return CardOrder(
        wanted.robot,
        card,
        wanted.files,
        wanted.by,
        at,
        wanted.policy is Policy.SKIP,
        wanted.clock_offset_s,
        speed,
    )


def card_report(kept: KeptCard, card: Card) -> ImportReport:
    """Return what came of a card; maps are made of all that a robot measured, not of it alone."""
    return {
        "deployment": ", ".join(kept.deployments),
        "robot": kept.robot,
        "read": card.read,
        "new": kept.new,
        "duplicate": kept.duplicate,
        "differs": kept.differs,
        "faults": len(kept.faults),
        "named_faults": _documents(kept.faults),
        "notes": list(kept.notes),
        "scores": [],
        "without_map": [],
    }


def dated(converted: Converted, wanted: Confirmed) -> Converted:
    """Return rows dated by the right clock, if a person said how far the recorder's was ahead."""
    if not wanted.clock_offset_s:
        return converted
    return replace(
        converted,
        time_s=np.round(converted.time_s - wanted.clock_offset_s, 6),
        notes=(
            *converted.notes,
            f"Every time was moved by {-wanted.clock_offset_s:+.3f} s, as {wanted.by} said.",
        ),
    )


def refuse(converted: Converted, policy: Policy) -> None:
    """Refuse rows that are wrong if the policy says so, or if none is right.

    Raises:
        JobError: With the first faults.
    """
    faults = converted.faults
    if not len(converted.time_s):
        raise JobError("No row of the files can be used.", refusal(faults))
    if faults and policy is Policy.REFUSE:
        first = faults[0]
        raise JobError(
            f"{len(faults):,} of {converted.read:,} rows cannot be used, the first is "
            f"{first.place}: {first.reason}. Nothing was imported.",
            refusal(faults),
        )


def recording_of(converted: Converted) -> Recording:
    """Return converted rows as every recording is kept."""
    return Recording(
        converted.time_s,
        converted.latitude_deg,
        converted.longitude_deg,
        converted.depth_m,
        dict(converted.values),
        dict(converted.flight),
        tuple(RowFault(0, f"{one.place}: {one.reason}") for one in converted.faults),
    )


def hashes(order: ReadOrder) -> list[ImportedFile]:
    """Return the files of an upload with the hashes of their contents."""
    found: list[ImportedFile] = []
    for place, name in enumerate(order.names):
        if not name.lower().endswith((".cac", ".ccc")):
            with (order.folder / str(place)).open("rb") as file:
                found.append(hashed(file, name))
    return found


def refuse_same(session: Session, robot: str, files: Sequence[ImportedFile]) -> None:
    """Refuse files that a robot has already, before they are read.

    Raises:
        DeploymentExistsError: With the deployment that has them.
    """
    with suppress(UnknownIdError):
        refuse_known(session, robot, source_of("", files).log, files)


def keep_confirmed(
    session: Session,
    wanted: Confirmed,
    converted: Converted,
    *,
    at: datetime,
    held: Held | None = None,
    go_on: Callable[[], None] = lambda: None,
) -> Kept:
    """Keep the rows, the flags of the files and the template, all of it or nothing.

    Raises:
        StoreError: If the files are there already, or the deployment takes no more rows.
    """
    names = [one.name for one in wanted.files]
    title = names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
    source: Source = source_of(
        title,
        wanted.files,
        is_simulated=converted.is_simulated,
        into=wanted.into,
        clock_offset_s=wanted.clock_offset_s,
    )
    recording = recording_of(converted)
    kept = keep_recording(
        session, wanted.robot, recording, source, at=at, by=wanted.by, held=held, go_on=go_on
    )
    for channel, flags in converted.flags.items():
        told = np.isfinite(converted.values[channel])
        _keep_flags(session, kept, channel, converted.time_s[told], flags[told], title, at, wanted)
    for name, column in converted.other.items():
        refuse_closed(session, kept.deployment)
        add_other_series(
            session,
            kept.deployment.id,
            name=name,
            unit=column.unit,
            at_us=np.round(converted.time_s * 1e6).astype(np.int64),
            value=column.values,
        )
    if wanted.template and wanted.order.mapping is not None:
        keep_mapping(
            session, wanted.template, wanted.order.mapping, wanted.template_at, wanted.by, at
        )
    return kept


def _keep_flags(
    session: Session,
    kept: Kept,
    channel: str,
    time_s: np.ndarray,
    flags: FlagArray,
    title: str,
    at: datetime,
    wanted: Confirmed,
) -> None:
    """Take over what a file says of its values: stretches of doubtful ones, as people give them."""
    if not kept.new:
        return
    for first, last in _doubtful(flags)[:_STRETCHES_MAX]:
        add_manual_flag(
            session,
            kept.deployment.id,
            series=channel,
            first_at=_EPOCH + timedelta(seconds=float(time_s[first])),
            last_at=_EPOCH + timedelta(seconds=float(time_s[last])),
            flag=int(flags[first]),
            reason=f"As {title} says.",
            at=at,
            by=wanted.by,
        )


def _doubtful(flags: FlagArray) -> list[tuple[int, int]]:
    """Return the first and last place of each stretch of equal flags that say of a doubt."""
    if not len(flags):
        return []
    begins = np.flatnonzero(np.diff(flags, prepend=-1) != 0)
    ends = np.append(begins[1:], len(flags)) - 1
    return [
        (first, last)
        for first, last in zip(begins.tolist(), ends.tolist(), strict=True)
        if flags[first] in _FLAGGED
    ]


def _flags_left_out(kept: Kept, converted: Converted) -> list[str]:
    """Return a sentence for each channel of which not every flag was taken over."""
    notes: list[str] = []
    for channel, flags in converted.flags.items() if kept.new else ():
        told = np.isfinite(converted.values[channel])
        left_out = len(_doubtful(flags[told])) - _STRETCHES_MAX
        if left_out > 0:
            notes.append(
                f"{channel}: the first {_STRETCHES_MAX:,} stretches of flags were taken over, "
                f"{left_out:,} were not."
            )
    return notes


def _others(converted: Converted) -> list[str]:
    if not converted.other:
        return []
    named = ", ".join(converted.other)
    return [f"{len(converted.other):,} columns are kept as other series: {named}."]


def report_of(kept: Kept, converted: Converted, outcomes: Outcomes) -> ImportReport:
    """Return what came of an import."""
    return {
        "deployment": kept.deployment.id,
        "robot": kept.deployment.robot,
        "read": converted.read,
        "new": kept.new,
        "duplicate": kept.duplicate,
        "differs": kept.differs,
        "faults": len(converted.faults),
        "named_faults": _documents(converted.faults),
        "notes": [*converted.notes, *_flags_left_out(kept, converted), *_others(converted)],
        "scores": scores_of(outcomes),
        "without_map": without_map(outcomes),
    }


def with_mapping(order: ReadOrder, mapping: Mapping) -> ReadOrder:
    """Return an order whose mapping was confirmed."""
    return replace(order, mapping=mapping)


def refusal(faults: Sequence[FileFault]) -> ImportFaults:
    """Return why an upload was refused."""
    return {"named_faults": _documents(faults), "faults": len(faults)}


def _documents(faults: Sequence[FileFault]) -> list[FaultDocument]:
    return [{"place": one.place, "reason": one.reason} for one in faults[:SHOWN_FAULTS]]


def folder_of(data_dir: Path) -> Path:
    """Return where uploads lie."""
    return data_dir / FOLDER
