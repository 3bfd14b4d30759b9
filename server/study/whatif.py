"""What-if runs: controllers in one scenario on the same seeds, before anybody flies it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy.orm import Session

from autonomy.control.catalogue import CONTROLLERS
from autonomy.vehicle.config import Vehicle
from autonomy.whatif.config import TrialConfig
from db.fault import StoreError
from db.query import whatifs as query
from db.query.events import add_event
from db.query.whatifs import WhatIfRecord
from server.access.foundation import Foundation
from server.base.configuration_kind import KINDS
from server.base.job import JobError, JobProgress
from server.base.problem import FieldError, Problem, below, conflict, unprocessable
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.fleet.fleet import Fleet
from server.study.comparison_view import ShownWhatIfs
from server.study.study import STOPPED, RunningStudies
from server.study.task import (
    CHECK_WHATIF,
    WHATIF,
    Document,
    Refusal,
    WhatIfController,
    WhatIfProblem,
)
from server.vehicle.vehicles import Vehicles, not_worked_out


@dataclass(frozen=True, slots=True)
class ControllerRequest:
    """A controller that is to be compared."""

    kind: str
    title: str | None
    config: Mapping[str, Any]


class WhatIfs:
    """What-if runs of all robots. Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        vehicles: Vehicles,
        quick: WorkerPool,
        workers: WorkerPool,
    ) -> None:
        self._foundation = foundation
        self._store = foundation.store
        self._fleet = fleet
        self._vehicles = vehicles
        self._quick = quick
        self._workers = workers
        self._running = RunningStudies(foundation.store, foundation.jobs)
        self.shown = ShownWhatIfs(foundation.store, fleet)

    async def load(self) -> None:
        """Close the runs that the station left behind, and show again what was shown."""
        at = self._foundation.clock.now()
        await self._store.write(lambda session: query.interrupt_whatifs(session, at, STOPPED))
        await self.shown.load()

    async def stop(self) -> None:
        """Interrupt every run."""
        await self._running.stop()

    async def start(
        self,
        robot: str,
        scenario: Mapping[str, Any],
        controllers: Sequence[ControllerRequest],
        *,
        by: str,
    ) -> tuple[str, str]:
        """Begin a run; return its id and the id of its job.

        Fields that are not given have the values that hold for the robot.

        Raises:
            Problem: 404 for an unknown robot, 409 for one without a vehicle, 422 with the path of
                each wrong field or with the limit that the reference breaks, 503 if nothing can
                be worked out.
            StoreError: Nothing was begun.
        """
        vehicle = vehicle_of(robot, self._fleet, self._vehicles)
        problem = await self._problem(robot, vehicle, scenario, controllers)
        await self._check(problem)
        at = self._foundation.clock.now()
        record = await self._store.write(
            lambda session: query.add_whatif(
                session,
                robot,
                title=_title(problem),
                vehicle=vehicle.key,
                scenario=problem.scenario.model_dump(mode="json"),
                controllers=[_controller_document(one) for one in problem.controllers],
                at=at,
                by=by,
            )
        )
        try:
            job = await self._foundation.jobs.start(
                "whatif", lambda progress: self._work(record, problem, progress), by=by
            )
        except StoreError:
            await self._end(record, "failed", "The storage failed; start it again.")
            raise
        await self._running.begun(
            record.id, job.id, lambda session: query.set_whatif_job(session, record.id, job.id)
        )
        return record.id, job.id

    async def get(self, whatif: str) -> WhatIfRecord:
        """Return one run with its result.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        record = await self._store.query(lambda session: query.get_whatif(session, whatif))
        return self._running.as_it_stands(record)

    async def of_robot(self, robot: str, before: str | None, limit: int) -> list[WhatIfRecord]:
        """Return the runs of a robot without their results, the newest first."""
        self._fleet.status(robot)
        records = await self._store.query(
            lambda session: query.list_whatifs(session, robot, before=before, limit=limit)
        )
        return [self._running.as_it_stands(record) for record in records]

    async def _problem(
        self,
        robot: str,
        vehicle: Vehicle,
        scenario: Mapping[str, Any],
        controllers: Sequence[ControllerRequest],
    ) -> WhatIfProblem:
        book = self._foundation.configurations
        errors: list[FieldError] = []
        config = TrialConfig()
        try:
            config = (await book.merged("trial", robot, scenario)).value_as(TrialConfig)
        except Problem as problem:
            errors += below(problem, "scenario").errors or _reraise(problem)
        choices: list[WhatIfController] = []
        for number, one in enumerate(controllers):
            if one.kind not in CONTROLLERS:
                message = f"must be one of {', '.join(CONTROLLERS)}"
                errors.append(FieldError(loc=["controllers", number, "kind"], msg=message))
                continue
            try:
                value = (await book.merged(one.kind, robot, one.config)).value
            except Problem as problem:
                prefixed = below(problem, "controllers", number, "config")
                errors += prefixed.errors or _reraise(problem)
                continue
            title = one.title or _free_title(KINDS[one.kind].title, choices)
            choices.append(WhatIfController(one.kind, title, value))
        if errors:
            count = "1 field is" if len(errors) == 1 else f"{len(errors)} fields are"
            raise unprocessable(f"{count} wrong.", errors)
        return WhatIfProblem(vehicle, config, tuple(choices))

    async def _check(self, problem: WhatIfProblem) -> None:
        try:
            refusal = await self._quick.run(CHECK_WHATIF, problem)
        except WORKER_FAILURES as error:
            raise not_worked_out(error) from error
        if isinstance(refusal, Refusal):
            error = FieldError(loc=list(refusal.loc), msg=refusal.message)
            raise unprocessable(refusal.message, [error])

    async def _work(
        self, record: WhatIfRecord, problem: WhatIfProblem, progress: JobProgress
    ) -> Document:
        progress.report(0.0, "Waiting for a free process")
        try:
            result = await self._workers.run(
                WHATIF, problem, on_progress=lambda news: progress.report(*news)
            )
            await self._running.keep(
                record.id, lambda session: self._write_result(session, record, result), progress
            )
        except WORKER_FAILURES as error:
            await self._end(record, "failed", str(error))
            raise JobError(str(error)) from error
        except BaseException:
            # Cancelled: whoever did it waits until this is noted.
            state = self._running.state_when_cancelled
            message = STOPPED if state == "interrupted" else "Cancelled."
            await self._end(record, state, message)
            raise
        finally:
            self._running.ended(record.id)
        if isinstance(result, Refusal):
            raise JobError(result.message)
        return {"whatif": record.id}

    def _write_result(
        self, session: Session, record: WhatIfRecord, result: Document | Refusal
    ) -> None:
        if isinstance(result, Refusal):
            self._write_end(session, record, "failed", result.message)
        else:
            self._write_end(session, record, "done", "", result)

    async def _end(self, record: WhatIfRecord, state: str, message: str) -> None:
        await self._running.keep_end(
            record.id,
            state,
            message,
            lambda session: self._write_end(session, record, state, message),
        )

    def _write_end(
        self,
        session: Session,
        record: WhatIfRecord,
        state: str,
        message: str,
        result: Document | None = None,
    ) -> None:
        at = self._foundation.clock.now()
        query.end_whatif(session, record.id, state, at=at, message=message, result=result)
        text = f"{record.id} of {record.robot} is {state}: {record.title}."
        level = "warning" if state == "failed" else "info"
        add_event(
            session,
            at,
            f"whatif.{state}",
            text,
            level=level,
            robot=record.robot,
            data={"whatif": record.id, "message": message},
        )


def vehicle_of(robot: str, fleet: Fleet, vehicles: Vehicles) -> Vehicle:
    """Return the vehicle that a robot is.

    Raises:
        Problem: 404 for an unknown robot, 409 for a recording of something unknown.
    """
    model = fleet.status(robot).record.model
    vehicle = vehicles.find(model)
    if vehicle is None:
        raise conflict(
            f"It is not known what vehicle {robot} is; say so first "
            f"(PATCH /api/robots/{robot} with a model of the catalogue)."
        )
    return vehicle


def _title(problem: WhatIfProblem) -> str:
    names = ", ".join(controller.title for controller in problem.controllers)
    return f"{names}: {problem.scenario.reference.replace('_', ' ')}"


def _free_title(title: str, others: Sequence[WhatIfController]) -> str:
    taken = {other.title for other in others}
    numbered = (f"{title} {number}" for number in range(2, len(taken) + 3))
    return next(one for one in (title, *numbered) if one not in taken)


def _controller_document(controller: WhatIfController) -> dict[str, Any]:
    return {
        "kind": controller.kind,
        "title": controller.title,
        "config": controller.config.model_dump(mode="json"),
    }


def _reraise(problem: Problem) -> list[FieldError]:
    """Pass on a refusal that is about something else than a field."""
    raise problem
