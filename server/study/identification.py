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
from autonomy.identification.result import CostPoint
from autonomy.vehicle.parameter_file import vehicle_document, vehicle_from_document
from db.query.fleet.deployments import get_deployment
from db.query.mission import studies as query
from db.query.mission.studies import StudyRecord
from db.query.station.events import add_event
from server.base.foundation import Foundation
from server.base.job import JobProgress
from server.base.problem import Problem, below, conflict
from server.base.study import Document, Refusal, Studies, study_as
from server.base.worker import WorkerPool
from server.fleet.fleet import Fleet
from server.study.flight_recording import find_deployment, read_flight
from server.study.identified import keep_offer, note_of, offsets_of
from server.study.task import (
    CHECKPOINT,
    IDENTIFY,
    IdentificationProblem,
    SearchNews,
)
from server.study.view import (
    AcceptedVehicleView,
    IdentificationAsked,
    IdentificationNews,
    IdentificationSummaryView,
    IdentificationView,
)
from server.study.whatif import vehicle_of
from server.vehicle.vehicles import Vehicles

log = logging.getLogger(__name__)


@dataclass(slots=True)
class _Live:
    """How far a search that runs is."""

    progress: float = 0.0
    message: str = ""
    convergence: list[CostPoint] = field(default_factory=list[CostPoint])

    def take(self, news: SearchNews) -> None:
        # A search that goes on repeats the iterations after its checkpoint.
        while self.convergence and self.convergence[-1].iteration >= news.iteration:
            self.convergence.pop()
        self.convergence.append(CostPoint(iteration=news.iteration, cost=news.best_cost))
        self.progress = news.iteration / max(news.iterations, 1)
        self.message = news.message

    def document(self) -> Document:
        return IdentificationNews(progress=self.progress, convergence=self.convergence).model_dump(
            mode="json"
        )


class Identifications(Studies[IdentificationProblem]):
    """Identifications of all robots. Belongs to one event loop."""

    kind = "identification"
    task = IDENTIFY
    event_key = "id"
    can_resume = True

    def __init__(
        self, foundation: Foundation, fleet: Fleet, vehicles: Vehicles, workers: WorkerPool
    ) -> None:
        super().__init__(foundation.store, foundation.jobs, foundation.clock, workers)
        self._configurations = foundation.configurations
        self._fleet = fleet
        self._vehicles = vehicles
        self._live: dict[str, _Live] = {}

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
            found = await self._configurations.merged("identification", robot, patch)
        except Problem as problem:
            raise below(problem, "config") from problem
        config = found.value_as(IdentificationConfig)
        flight = await read_flight(
            self._store,
            await find_deployment(self._store, robot, deployment),
            start,
            end,
            by_cameras=config.by_cameras,
        )
        asked = IdentificationAsked(
            deployment=deployment,
            base_vehicle=vehicle.key,
            vehicle_document=vehicle_document(vehicle),
            config=config,
            data_start_at=flight.start_at,
            data_end_at=flight.end_at,
        )
        record = await self._add(robot, asked, by)
        problem = IdentificationProblem(vehicle, flight.recording(), config, None)
        self._live[record.id] = _Live()
        return record.id, await self._begin(record, problem, by)

    async def resume(self, identification: str, *, by: str) -> tuple[str, str]:
        """Let a search go on from its last checkpoint, or anew if it had none yet.

        Raises:
            Problem: 409 if it runs or is done.
            UnknownIdError: If there is none of this id.
            StoreError: Nothing was begun.
        """
        await self._settle(identification)
        record = await self._record(identification)
        if record.state in {"running", "done"}:
            raise conflict(f"{identification} is {record.state}; it cannot go on.")
        asked = study_as(IdentificationAsked, record)
        checkpoint = await self._store.query(
            lambda s: query.get_checkpoint(s, self.kind, identification)
        )
        deployment = await self._store.query(lambda s: get_deployment(s, asked.deployment))
        flight = await read_flight(
            self._store,
            deployment,
            asked.data_start_at,
            asked.data_end_at,
            by_cameras=asked.config.by_cameras,
        )
        problem = IdentificationProblem(
            vehicle_from_document(asked.vehicle_document),
            flight.recording(),
            asked.config,
            checkpoint,
        )
        if not await self._store.write(lambda s: query.reopen_study(s, self.kind, identification)):
            raise conflict(f"{identification} is running already.")
        self._live[record.id] = _Live()
        if checkpoint is not None:
            news = study_as(IdentificationNews, record)
            self._live[record.id] = _Live(news.progress, "", list(news.convergence))
        return record.id, await self._begin(record, problem, by)

    async def cancel(self, identification: str) -> IdentificationView:
        """Call a search off and wait until it has stopped; it can be resumed.

        Raises:
            Problem: 409 if it does not run.
            UnknownIdError: If there is none of this id.
        """
        record = await self.get(identification)
        if not await self._call_off(identification):
            raise conflict(f"{identification} is {record.state} already.")
        return await self.get(identification)

    async def accept(
        self, identification: str, *, key: str | None, title: str | None, by: str
    ) -> AcceptedVehicleView:
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
        if record.vehicle is not None:
            raise conflict(_accepted_already(identification, record.vehicle))
        wish = key or self._vehicles.free_key(f"{record.robot}-identified")
        base = vehicle_from_document(record.vehicle_document)
        offsets = offsets_of(record.result)
        found = replace(
            record.result.vehicle,
            key=wish,
            title=title or f"{base.title} of {record.robot}, identified",
            note=note_of(identification, record.deployment, offsets),
        )
        accepted: list[AcceptedVehicleView] = []

        def also(session: Session) -> None:
            use = query.get_study(session, self.kind, identification).use
            if use is not None:
                raise conflict(_accepted_already(identification, use["vehicle"]))
            query.use_study(session, self.kind, identification, {"vehicle": wish})
            at, data = self._clock.now(), {"id": identification, "vehicle": wish}
            accepted.append(keep_offer(session, record, offsets, found, at=at, by=by))
            text = f"{by} accepted {identification} of {record.robot} as the vehicle {wish}."
            kind = "identification.accepted"
            add_event(session, at, kind, text, robot=record.robot, data=data)

        await self._vehicles.add(vehicle_document(found), origin="identified", by=by, also=also)
        return accepted[-1]

    async def get(self, identification: str) -> IdentificationView:
        """Return one search as it stands now.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        return study_as(IdentificationView, await self._record(identification))

    async def of_robot(
        self, robot: str, before: str | None, limit: int
    ) -> list[IdentificationSummaryView]:
        """Return the searches of a robot without their results, the newest first."""
        self._fleet.status(robot)
        return [_summary(record) for record in await self._records(robot, before, limit)]

    def _said(self, record: StudyRecord, state: str) -> str:
        return f"{record.id} of {record.robot} from {record.asked['deployment']} is {state}."

    def _as_it_stands(self, record: StudyRecord) -> StudyRecord:
        record = super()._as_it_stands(record)
        live = self._live.get(record.id)
        if live is None or record.state != "running":
            return record
        return replace(record, message=live.message, news=live.document())

    def _news(self, study: str, *, is_done: bool) -> Document | None:
        live = self._live.get(study)
        if live is not None and is_done:
            live.progress = 1.0
        return None if live is None else live.document()

    def _ended(self, study: str) -> None:
        super()._ended(study)
        self._live.pop(study, None)

    def _take(self, record: StudyRecord, news: SearchNews, progress: JobProgress) -> None:
        live = self._live[record.id]
        live.take(news)
        progress.report(live.progress, news.message)
        checkpoint = news.checkpoint
        if checkpoint is None:
            return
        document, message = live.document(), news.message
        kept = self._store.change(
            lambda session: query.keep_checkpoint(
                session,
                self.kind,
                record.id,
                checkpoint=checkpoint,
                news=document,
                message=message,
            )
        )
        kept.add_done_callback(_seen)

    def _write_refusal(
        self, session: Session, record: StudyRecord, refusal: Refusal, news: Document | None
    ) -> None:
        if refusal.loc != CHECKPOINT:
            super()._write_refusal(session, record, refusal, news)
            return
        # It fits no longer, so it would stop every further try.
        message = f"{refusal.message} Resume it to begin anew."
        query.keep_checkpoint(
            session, self.kind, record.id, checkpoint=None, news={}, message=message
        )
        self._write_end(session, record, "failed", message, None)


def _accepted_already(identification: str, vehicle: str) -> str:
    return f"{identification} was accepted already, as {vehicle}."


def _summary(record: StudyRecord) -> IdentificationSummaryView:
    curve = study_as(IdentificationNews, record).convergence
    return study_as(
        IdentificationSummaryView,
        record,
        method=record.asked["config"]["method"],
        best_cost=curve[-1].cost if curve else None,
    )


def _seen(kept: "Future[None]") -> None:
    error = None if kept.cancelled() else kept.exception()
    if error is not None:
        log.warning("a checkpoint was not kept; the next one will be: %s", error)
