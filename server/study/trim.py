"""Trim advice: what the last dives say of a robot's ballast, accepted by a person in steps."""

from dataclasses import dataclass

from sqlalchemy.orm import Session

from autonomy.identification.config import IdentificationConfig
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.trim import TrimConfig, trim_flaw
from db.query import trim as query
from db.query.events import add_event
from db.query.robots import get_robot
from db.query.trim import TrimAdviceRecord
from server.access.foundation import Foundation
from server.base.configuration import CurrentConfiguration
from server.base.job import JobError, JobProgress
from server.base.problem import Problem, conflict, not_found
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.fleet.fleet import Fleet
from server.study.flight_recording import find_deployment, read_last_dives
from server.study.task import ADVISE_TRIM, Document, Refusal, TrimProblem
from server.study.trim_advice import advice_document, fits, for_vehicle, in_words
from server.study.whatif import vehicle_of
from server.vehicle.vehicles import Vehicles

STEPS = {0.5: ("half_step", "half a trim step"), 1.0: ("full_step", "a whole trim step")}
"""Shares of an advice that can be taken: their names in its document, and in words."""
_ON_THE_WAY = {"sent": "on its way", "on_board": "on board", "running": "running"}


@dataclass(frozen=True, slots=True)
class AcceptedTrim:
    """The trim of a robot after someone took an advice."""

    trim: TrimConfig
    config_id: str
    reaches_robot: str
    """When the robot will have it, in words."""


class TrimAdvices:
    """Trim advice for all robots. Belongs to one event loop."""

    def __init__(
        self, foundation: Foundation, fleet: Fleet, vehicles: Vehicles, workers: WorkerPool
    ) -> None:
        self._foundation = foundation
        self._store = foundation.store
        self._fleet = fleet
        self._vehicles = vehicles
        self._workers = workers

    async def start(self, robot: str, deployment: str | None, dives: int, *, by: str) -> str:
        """Begin to work an advice out; return the id of the job whose result it will be.

        Raises:
            Problem: 404 for an unknown robot, 409 for one without a vehicle or a recording that
                cannot be used, 422 for a deployment of another robot.
            UnknownIdError: If there is no such deployment.
            StoreError: Nothing was begun.
        """
        vehicle = vehicle_of(robot, self._fleet, self._vehicles)
        found = await find_deployment(self._store, robot, deployment)
        settings = await self._foundation.configurations.current("identification", robot)
        rules = settings.value_as(IdentificationConfig).rules
        flight = await read_last_dives(self._store, found, dives, rules)
        present = await self._foundation.configurations.current("trim", robot)
        problem = TrimProblem(vehicle, flight.recording(), present.value_as(TrimConfig), dives)

        async def work(progress: JobProgress) -> Document:
            progress.report(0.0, "Holding the last dives against the model")
            return await self._advise(robot, found.id, problem, present, by)

        job = await self._foundation.jobs.start("trim advice", work, by=by)
        return job.id

    async def accept(self, robot: str, advice: str, share: float, *, by: str) -> AcceptedTrim:
        """Change a robot's trim by a share of an advice.

        Raises:
            Problem: 404 if it is no advice for this robot; 409 if it was accepted already, the trim
                or the vehicle changed since, or no draft could hold the trim.
            UnknownIdError: If there is none of this id.
            StoreError: Nothing was changed.
        """
        vehicle = vehicle_of(robot, self._fleet, self._vehicles)
        record = await self._store.query(lambda session: query.get_advice(session, advice))
        if record.robot != robot:
            raise not_found(f"There is no {advice} for {robot}.")
        if record.accepted_by is not None:
            raise conflict(f"{record.accepted_by} accepted {advice} already; ask for a new one.")
        step, name = STEPS[share]
        wanted = TrimConfig.model_validate(record.document[step])
        _refuse_flaw(wanted, vehicle)
        at = self._foundation.clock.now()

        def also(session: Session) -> None:
            if get_robot(session, robot).model != vehicle.key or not fits(record, vehicle):
                raise conflict(_other_vehicle(record))
            query.accept_advice(session, advice, share, at=at, by=by)
            text = f"{by} accepted {name} for {robot}: {in_words(wanted)}."
            data = {"advice": advice, "share": share, "trim": wanted.model_dump()}
            add_event(session, at, "trim.accepted", text, robot=robot, data=data)

        patch = wanted.model_dump(mode="json")
        book, version = self._foundation.configurations, record.trim_version
        try:
            held = await book.patch("trim", robot, patch, by=by, if_match=version, also=also)
        except Problem as problem:
            if problem.status != 412:
                raise
            raise conflict(
                f"The trim of {robot} was changed since {advice} was worked out; "
                "ask for a new advice."
            ) from problem
        if held.id is None:
            raise TypeError("a kept version has an id")
        return AcceptedTrim(held.value_as(TrimConfig), held.id, self._reaches(robot))

    async def _advise(
        self,
        robot: str,
        deployment: str,
        problem: TrimProblem,
        present: CurrentConfiguration,
        by: str,
    ) -> Document:
        try:
            found = await self._workers.run(ADVISE_TRIM, problem)
        except WORKER_FAILURES as error:
            raise JobError(str(error)) from error
        if isinstance(found, Refusal):
            raise JobError(found.message)
        at = self._foundation.clock.now()

        def write(session: Session) -> TrimAdviceRecord:
            record = query.add_advice(
                session,
                robot,
                deployment,
                trim_version=present.etag,
                document=for_vehicle(found, problem.vehicle),
                at=at,
                by=by,
            )
            text = f"{by} asked for trim advice for {robot}: {found['message']}"
            data = {"advice": record.id, "deployment": deployment}
            add_event(session, at, "trim.advised", text, robot=robot, data=data)
            return record

        record = await self._store.write(write)
        return advice_document(record)

    def _reaches(self, robot: str) -> str:
        plan = self._fleet.status(robot).plan
        if plan is not None and plan.state in _ON_THE_WAY:
            return (
                f"It reaches {robot} with the next plan; {plan.plan_id}, which is "
                f"{_ON_THE_WAY[plan.state]}, keeps the trim that it was made with."
            )
        if plan is not None and plan.state == "draft":
            return (
                f"It reaches {robot} with the next plan that is made; the draft {plan.plan_id} has "
                "the old trim, so plan again."
            )
        return f"It reaches {robot} with the next plan."


def _refuse_flaw(trim: TrimConfig, vehicle: Vehicle) -> None:
    flaw = trim_flaw(trim.net_buoyancy_offset_kg, trim.mass_position_offset_m, vehicle.limits)
    if flaw:
        raise conflict(f"No plan could hold this: {flaw}. Mend the ballast first.")


def _other_vehicle(record: TrimAdviceRecord) -> str:
    vehicle = record.document.get("vehicle", "of another version of the station")
    return (
        f"{record.id} is for the vehicle {vehicle}, which {record.robot} is not now; change the "
        "robot's model, or ask for a new advice."
    )
