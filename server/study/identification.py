"""Identifications: the parameters of a vehicle, sought in what a robot recorded.

A search runs for minutes in a process of its own. Every few seconds it leaves a checkpoint in the
database, from which it goes on after it was cancelled, or after the station was stopped or killed.
"""

import logging
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from autonomy.identification.config import IdentificationConfig
from autonomy.vehicle.parameter_file import vehicle_document, vehicle_from_document
from db.fault import StoreError
from db.query import identifications as query
from db.query.deployments import get_deployment
from db.query.events import add_event
from db.query.identifications import IdentificationRecord
from server.access.foundation import Foundation
from server.base.job import JobError, JobProgress
from server.base.problem import Problem, below, conflict
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.fleet.fleet import Fleet
from server.study.accepted import AcceptedIdentification, keep_offer
from server.study.flight_recording import find_deployment, read_flight
from server.study.identified import note_of, offsets_of
from server.study.study import STOPPED, RunningStudies
from server.study.task import (
    CHECKPOINT,
    IDENTIFY,
    Document,
    IdentificationNews,
    IdentificationProblem,
    Refusal,
)
from server.study.whatif import vehicle_of
from server.vehicle.vehicles import Vehicles

log = logging.getLogger(__name__)


@dataclass(slots=True)
class _Live:
    """How far a search that runs is."""

    progress: float = 0.0
    message: str = ""
    convergence: list[dict[str, Any]] = field(default_factory=list)

    def take(self, news: IdentificationNews) -> None:
        # A search that goes on repeats the iterations after its checkpoint.
        while self.convergence and self.convergence[-1]["iteration"] >= news.iteration:
            self.convergence.pop()
        self.convergence.append({"iteration": news.iteration, "cost": news.best_cost})
        self.progress = news.iteration / max(news.iterations, 1)
        self.message = news.message


class Identifications:
    """Identifications of all robots. Belongs to one event loop."""

    def __init__(
        self, foundation: Foundation, fleet: Fleet, vehicles: Vehicles, workers: WorkerPool
    ) -> None:
        self._foundation = foundation
        self._store = foundation.store
        self._fleet = fleet
        self._vehicles = vehicles
        self._workers = workers
        self._running = RunningStudies(foundation.store, foundation.jobs)
        self._live: dict[str, _Live] = {}

    async def load(self) -> None:
        """Mark the searches that the station left behind; they can go on from their checkpoint."""
        at = self._foundation.clock.now()
        message = f"{STOPPED} Resume it."
        await self._store.write(lambda s: query.interrupt_identifications(s, at, message))

    async def stop(self) -> None:
        """Interrupt every search."""
        await self._running.stop()

    async def start(
        self,
        robot: str,
        deployment: str,
        patch: Mapping[str, Any],
        *,
        start: datetime | None,
        end: datetime | None,
        by: str,
    ) -> tuple[str, str]:
        """Begin a search; return its id and the id of its job.

        Raises:
            Problem: 404 for an unknown robot, 409 for one without a vehicle or a recording that
                cannot be used, with what it lacks, 422 with the path of each wrong field.
            UnknownIdError: If there is no such deployment.
            StoreError: Nothing was begun.
        """
        vehicle = vehicle_of(robot, self._fleet, self._vehicles)
        try:
            found = await self._foundation.configurations.merged("identification", robot, patch)
        except Problem as problem:
            raise below(problem, "config") from problem
        config = found.value_as(IdentificationConfig)
        flight = await read_flight(
            self._store, await find_deployment(self._store, robot, deployment), start, end
        )
        at = self._foundation.clock.now()
        record = await self._store.write(
            lambda session: query.add_identification(
                session,
                robot,
                deployment,
                vehicle=vehicle.key,
                vehicle_document=vehicle_document(vehicle),
                config=config.model_dump(mode="json"),
                data_start_at=flight.start_at,
                data_end_at=flight.end_at,
                at=at,
                by=by,
            )
        )
        problem = IdentificationProblem(vehicle, flight.recording(), config, None)
        return record.id, await self._begin(record, problem, by)

    async def resume(self, identification: str, *, by: str) -> tuple[str, str]:
        """Let a search go on from its last checkpoint, or anew if it had none yet.

        Raises:
            Problem: 409 if it runs or is done.
            UnknownIdError: If there is none of this id.
            StoreError: Nothing was begun.
        """
        await self._running.settle(identification)
        record = await self.get(identification)
        if record.state in {"running", "done"}:
            raise conflict(f"{identification} is {record.state}; it cannot go on.")
        checkpoint = await self._store.query(lambda s: query.get_checkpoint(s, identification))
        deployment = await self._store.query(lambda s: get_deployment(s, record.deployment))
        flight = await read_flight(
            self._store, deployment, record.data_start_at, record.data_end_at
        )
        problem = IdentificationProblem(
            vehicle_from_document(record.vehicle_document),
            flight.recording(),
            IdentificationConfig.model_validate(record.config),
            checkpoint,
        )
        if not await self._store.write(lambda s: query.reopen_identification(s, identification)):
            raise conflict(f"{identification} is running already.")
        return record.id, await self._begin(record, problem, by)

    async def cancel(self, identification: str) -> IdentificationRecord:
        """Call a search off and wait until it has stopped; it can be resumed.

        Raises:
            Problem: 409 if it does not run.
            UnknownIdError: If there is none of this id.
        """
        record = await self.get(identification)
        if not await self._running.cancel(identification):
            raise conflict(f"{identification} is {record.state} already.")
        return await self.get(identification)

    async def accept(
        self, identification: str, *, key: str | None, title: str | None, by: str
    ) -> AcceptedIdentification:
        """Keep what a search found as a vehicle of the catalogue, and offer the trim it needs.

        Raises:
            Problem: 409 if it has no result, was accepted already, or the key is taken; 422 for a
                key or title that cannot be one.
            UnknownIdError: If there is none of this id.
            StoreError: Nothing was kept.
        """
        record = await self.get(identification)
        if record.result is None:
            raise conflict(f"{identification} is {record.state}; there is nothing to accept.")
        if record.accepted_vehicle is not None:
            raise conflict(f"{identification} was accepted already, as {record.accepted_vehicle}.")
        wish = key or self._vehicles.free_key(f"{record.robot}-identified")
        base = vehicle_from_document(record.vehicle_document)
        offsets = offsets_of(record.result)
        document = {
            **record.result["vehicle"],
            "key": wish,
            "title": title or f"{base.title} of {record.robot}, identified",
            "note": note_of(identification, record.deployment, offsets),
        }
        accepted: list[AcceptedIdentification] = []

        def also(session: Session) -> None:
            query.accept_identification(session, identification, wish)
            at, data = self._foundation.clock.now(), {"id": identification, "vehicle": wish}
            vehicle = vehicle_from_document(document)
            accepted.append(keep_offer(session, record, offsets, vehicle, at=at, by=by))
            text = f"{by} accepted {identification} of {record.robot} as the vehicle {wish}."
            kind = "identification.accepted"
            add_event(session, at, kind, text, robot=record.robot, data=data)

        try:
            await self._vehicles.add(document, origin="identified", by=by, also=also)
        except query.AcceptedAlreadyError as error:
            raise conflict(str(error)) from error
        return accepted[-1]

    async def get(self, identification: str) -> IdentificationRecord:
        """Return one search as it stands now.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        record = await self._store.query(lambda s: query.get_identification(s, identification))
        return self._with_news(record)

    async def of_robot(
        self, robot: str, before: str | None, limit: int
    ) -> list[IdentificationRecord]:
        """Return the searches of a robot without their results, the newest first."""
        self._fleet.status(robot)
        records = await self._store.query(
            lambda session: query.list_identifications(session, robot, before=before, limit=limit)
        )
        return [self._with_news(record) for record in records]

    def _with_news(self, record: IdentificationRecord) -> IdentificationRecord:
        record = self._running.as_it_stands(record)
        live = self._live.get(record.id)
        if live is None or record.state != "running":
            return record
        return replace(
            record,
            progress=live.progress,
            message=live.message,
            convergence=list(live.convergence),
        )

    async def _begin(
        self, record: IdentificationRecord, problem: IdentificationProblem, by: str
    ) -> str:
        done = [dict(point) for point in record.convergence] if problem.resume else []
        self._live[record.id] = _Live(record.progress if done else 0.0, "", done)
        try:
            job = await self._foundation.jobs.start(
                "identification", lambda progress: self._work(record, problem, progress), by=by
            )
        except StoreError:
            await self._end(record, "failed", "The storage failed; resume it.")
            self._live.pop(record.id, None)
            raise
        await self._running.begun(
            record.id, job.id, lambda s: query.set_identification_job(s, record.id, job.id)
        )
        return job.id

    async def _work(
        self, record: IdentificationRecord, problem: IdentificationProblem, progress: JobProgress
    ) -> Document:
        progress.report(0.0, "Waiting for a free process")
        try:
            result = await self._workers.run(
                IDENTIFY, problem, on_progress=lambda news: self._take(record, news, progress)
            )
            await self._running.keep(
                record.id, lambda session: self._write_result(session, record, result), progress
            )
        except WORKER_FAILURES as error:
            await self._end(record, "failed", f"{error} Resume it.")
            raise JobError(str(error)) from error
        except BaseException:
            # Cancelled: whoever did it waits until this is noted.
            state = self._running.state_when_cancelled
            message = f"{STOPPED} Resume it." if state == "interrupted" else "Cancelled."
            await self._end(record, state, message)
            raise
        finally:
            self._running.ended(record.id)
            self._live.pop(record.id, None)
        if isinstance(result, Refusal):
            raise JobError(result.message)
        return {"identification": record.id}

    def _take(
        self, record: IdentificationRecord, news: IdentificationNews, progress: JobProgress
    ) -> None:
        live = self._live[record.id]
        live.take(news)
        progress.report(live.progress, news.message)
        checkpoint = news.checkpoint
        if checkpoint is None:
            return
        curve, share, message = list(live.convergence), live.progress, news.message
        kept = self._store.change(
            lambda session: query.keep_checkpoint(
                session,
                record.id,
                checkpoint=checkpoint,
                convergence=curve,
                progress=share,
                message=message,
            )
        )
        kept.add_done_callback(_seen)

    async def _end(self, record: IdentificationRecord, state: str, message: str) -> None:
        live = self._live.get(record.id, _Live())
        await self._running.keep_end(
            record.id,
            state,
            message,
            lambda session: self._write_end(session, record, live, state, message),
        )

    def _write_result(
        self, session: Session, record: IdentificationRecord, result: Document | Refusal
    ) -> None:
        live = self._live.get(record.id, _Live())
        if not isinstance(result, Refusal):
            self._write_end(session, record, live, "done", "", result)
        elif result.loc == CHECKPOINT:
            # It fits no longer, so it would stop every further try.
            query.drop_checkpoint(session, record.id)
            message = f"{result.message} Resume it to begin anew."
            self._write_end(session, record, _Live(), "failed", message)
        else:
            self._write_end(session, record, live, "failed", result.message)

    def _write_end(
        self,
        session: Session,
        record: IdentificationRecord,
        live: _Live,
        state: str,
        message: str,
        result: Document | None = None,
    ) -> None:
        at = self._foundation.clock.now()
        query.end_identification(
            session,
            record.id,
            state,
            at=at,
            message=message,
            convergence=live.convergence,
            result=result,
        )
        add_event(
            session,
            at,
            f"identification.{state}",
            f"{record.id} of {record.robot} from {record.deployment} is {state}.",
            level="warning" if state == "failed" else "info",
            robot=record.robot,
            data={"id": record.id, "message": message},
        )


def _seen(kept: "Future[None]") -> None:
    error = None if kept.cancelled() else kept.exception()
    if error is not None:
        log.warning("a checkpoint was not kept; the next one will be: %s", error)
