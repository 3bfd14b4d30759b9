"""Imports a recording step by step: read, keep, map. Steps are plain functions of their input.

The station runs them as a job, with the map in a worker process; the command line runs them one
after another on a data folder that no station uses.
"""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import IO

import numpy as np
from sqlalchemy.orm import Session
from typing_extensions import TypedDict

from autonomy.channel import ChannelCatalogue
from db.fault import StoreError
from db.query.fleet.recordings import ImportedFile, note_on_deployment
from db.query.fleet.robots import get_robot
from db.query.measured.maps import MapRecord, add_map
from db.query.station.events import add_event
from db.store import Store
from robot_link.clock import Clock
from server.base.channels import catalogue_in
from server.base.job import JobError, JobProgress, ThreadWork
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.deployment.view import RecordedScores
from server.recording.keep import Held, Kept, hashed, hold, keep_recording, positions_ned, source_of
from server.recording.map_fit import TASK, FitFailure, FitProblem, FittedMap
from server.recording.table import (
    Policy,
    Progress,
    Recording,
    RecordingError,
    RowFault,
    read_recording,
)


class BrokenRow(TypedDict):
    """A row of a file that could not be taken in."""

    line: int
    reason: str


class WithoutMap(TypedDict):
    """A variable of which no map could be made."""

    variable: str
    reason: str


class ImportResult(TypedDict):
    """What came of an import."""

    deployment: str
    robot: str
    rows: int
    """New ones."""
    read: int
    """All of the file: new, duplicate, different, and left out."""
    duplicate: int
    differs: int
    skipped: list[BrokenRow]
    skipped_rows: int
    scores: list[RecordedScores]
    without_map: list[WithoutMap]


class ImportRefusal(TypedDict):
    """Why a file was refused."""

    errors: list[BrokenRow]


SHOWN_FAULTS = 100
"""So many broken rows are named in an answer; their number is always told."""
READ_SHARE = 0.2
"""Share of the work that is done when the file is read."""
KEPT_SHARE = 0.3
"""Share of the work that is done when the rows are kept; the rest is the maps."""
Outcomes = Sequence[FittedMap | FitFailure]


@dataclass(frozen=True, slots=True)
class ImportOrder:
    """What is to be imported."""

    file: IO[bytes]
    size: int
    title: str
    """Name of the file."""
    robot: str
    policy: Policy
    by: str
    channels: ChannelCatalogue
    """What can be measured."""


async def run_import(
    order: ImportOrder, store: Store, clock: Clock, progress: JobProgress
) -> ImportResult:
    """Import a recording into a running station.

    Raises:
        JobError: If the file was refused; the result names each broken row.
    """
    thread = ThreadWork(progress)

    def told(share: float) -> None:
        thread.report(share * READ_SHARE, "Reading the file")

    recording, file = await thread.result(asyncio.to_thread(read_order, order, told))
    progress.report(READ_SHARE, f"Keeping {len(recording.time_s)} rows")
    at = clock.now()
    held = await thread.result(store.query(lambda s: hold(s, order.robot, recording)))
    try:
        kept = await thread.result(
            store.write(lambda s: keep_order(s, order, recording, file, at, held, thread.go_on))
        )
    except StoreError as error:
        raise JobError(str(error)) from error
    outcomes = await learn_maps(
        store, clock, progress, robot=order.robot, kept=kept, recording=recording
    )
    left_out = len(recording.skipped)
    progress.report(1.0, f"Imported {kept.new} rows as {kept.deployment.id}; {left_out} left out")
    return import_result(kept, recording, outcomes)


async def learn_maps(
    store: Store,
    clock: Clock,
    progress: JobProgress,
    *,
    robot: str,
    kept: Kept,
    recording: Recording,
) -> Outcomes:
    """Learn the maps of a recording that is kept, and keep them."""
    progress.report(KEPT_SHARE, "Learning the maps")
    problem = await store.query(lambda session: fit_problem(session, robot, recording))
    outcomes = await _fit_in_worker(problem, progress)
    at = clock.now()
    await store.write(lambda s: keep_maps(s, robot, kept.deployment.id, outcomes, at))
    return outcomes


def read_order(order: ImportOrder, on_progress: Progress) -> tuple[Recording, ImportedFile]:
    """Read the file and return its rows, and its name with the hash of its content.

    Raises:
        JobError: If the file was refused; the result names each broken row.
    """
    try:
        file = hashed(order.file, order.title)
        return _recording(order, on_progress), file
    except RecordingError as error:
        raise JobError(str(error), ImportRefusal(errors=fault_documents(error.faults))) from error


def _recording(order: ImportOrder, on_progress: Progress) -> Recording:
    return read_recording(order.file, order.size, order.policy, order.channels, on_progress)


def keep_order(
    session: Session,
    order: ImportOrder,
    recording: Recording,
    file: ImportedFile,
    at: datetime,
    held: Held | None = None,
    go_on: Callable[[], None] = lambda: None,
) -> Kept:
    """Keep the rows, all of them or none.

    Raises:
        DeploymentExistsError: If this very file is there already.
        WorkStoppedError: If ``go_on`` says so.
    """
    source = source_of(order.title, (file,))
    return keep_recording(
        session, order.robot, recording, source, at=at, by=order.by, held=held, go_on=go_on
    )


def fit_problem(session: Session, robot: str, recording: Recording) -> FitProblem:
    """Return what the maps' fit needs of a recording that is kept."""
    points = positions_ned(get_robot(session, robot).site, recording)
    known = catalogue_in(session)
    channels = {key: known[key] for key in recording.values}
    mapped = {key: values for key, values in recording.values.items() if channels[key].can_map}
    return FitProblem(np.ascontiguousarray(points), mapped, channels)


def keep_maps(
    session: Session, robot: str, deployment: str, outcomes: Outcomes, at: datetime
) -> None:
    """Keep the maps and their scores."""
    for fitted in outcomes:
        if isinstance(fitted, FittedMap):
            add_map(
                session,
                MapRecord(
                    robot=robot,
                    variable=fitted.variable,
                    model=fitted.document["scores"]["model"],
                    at=at,
                    samples=fitted.samples,
                    document=fitted.document,
                    grid=fitted.grid,
                ),
            )
    note_on_deployment(session, deployment, {"scores": scores_of(outcomes)})
    add_event(
        session,
        at,
        "deployment.mapped",
        f"The maps of {robot} from {deployment} are ready.",
        robot=robot,
        data={"deployment": deployment},
    )


def import_result(kept: Kept, recording: Recording, outcomes: Outcomes) -> ImportResult:
    """Return what came of an import."""
    return {
        "deployment": kept.deployment.id,
        "robot": kept.deployment.robot,
        "rows": kept.new,
        "read": len(recording.time_s) + len(recording.skipped),
        "duplicate": kept.duplicate,
        "differs": kept.differs,
        "skipped": fault_documents(recording.skipped),
        "skipped_rows": len(recording.skipped),
        "scores": scores_of(outcomes),
        "without_map": without_map(outcomes),
    }


def without_map(outcomes: Outcomes) -> list[WithoutMap]:
    """Return the variables of which no map could be made."""
    return [
        {"variable": failure.variable, "reason": failure.reason}
        for failure in outcomes
        if isinstance(failure, FitFailure)
    ]


def fit_share(share: float) -> float:
    """Return the share of the whole import when a share of the maps is done."""
    return KEPT_SHARE + share * (1.0 - KEPT_SHARE)


def fault_documents(faults: Sequence[RowFault]) -> list[BrokenRow]:
    """Return the first broken rows as JSON."""
    return [{"line": fault.line, "reason": fault.reason} for fault in faults[:SHOWN_FAULTS]]


def scores_of(outcomes: Outcomes) -> list[RecordedScores]:
    """Return what the maps were worth on data that was held out."""
    return [
        RecordedScores(variable=fitted.variable, **fitted.document["scores"])
        for fitted in outcomes
        if isinstance(fitted, FittedMap)
    ]


async def _fit_in_worker(problem: FitProblem, progress: JobProgress) -> Outcomes:
    def told(news: tuple[float, str]) -> None:
        share, message = news
        progress.report(fit_share(share), message)

    pool = WorkerPool()
    try:
        return await pool.run(TASK, problem, on_progress=told)
    except WORKER_FAILURES as error:
        return [FitFailure(variable, str(error)) for variable in problem.values]
    finally:
        await pool.stop()
