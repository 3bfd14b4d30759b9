"""Trim advice: what the last dives say of a robot's ballast, accepted by a person in steps."""

from datetime import datetime

from sqlalchemy.orm import Session

from autonomy.identification.config import IdentificationConfig
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.trim import TrimAdvice, TrimConfig, trim_flaw
from db.query.fleet.robots import get_robot
from db.query.mission import studies as query
from db.query.mission.studies import StudyRecord
from db.query.station.events import add_event
from server.base.foundation import Foundation
from server.base.job import JobProgress
from server.base.problem import Problem, conflict, not_found
from server.base.study import Document, study_as, worked_out
from server.base.vehicle_catalogue import vehicle_digest
from server.base.worker import WorkerPool
from server.fleet.fleet import Fleet
from server.study.flight_recording import find_deployment, read_last_dives
from server.study.task import ADVISE_TRIM, TrimProblem
from server.study.view import AdviceAsked, TrimAdviceView, TrimView
from server.study.whatif import vehicle_of
from server.vehicle.vehicles import Vehicles

STEPS = {0.5: "half a trim step", 1.0: "a whole trim step"}
"""Shares of an advice that can be taken, in words."""
_KIND = "advice"
_ON_THE_WAY = {"sent": "on its way", "on_board": "on board", "running": "running"}


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
        asked = AdviceAsked(
            deployment=found.id,
            trim_version=present.etag,
            vehicle=vehicle.key,
            vehicle_digest=vehicle_digest(vehicle),
        )

        async def work(progress: JobProgress) -> Document:
            progress.report(0.0, "Holding the last dives against the model")
            advice: TrimAdvice = await worked_out(self._workers, ADVISE_TRIM, problem)
            kept = await self._store.write(
                lambda session: self._keep(session, robot, asked, advice, by)
            )
            return kept.model_dump(mode="json")

        job = await self._foundation.jobs.start("trim advice", work, by=by, robot=robot)
        return job.id

    async def accept(self, robot: str, advice: str, share: float, *, by: str) -> TrimView:
        """Change a robot's trim by a share of an advice.

        Raises:
            Problem: 404 if it is no advice for this robot; 409 if it was accepted already, the trim
                or the vehicle changed since, or no draft could hold the trim.
            UnknownIdError: If there is none of this id.
            StoreError: Nothing was changed.
        """
        vehicle = vehicle_of(robot, self._fleet, self._vehicles)
        record = _view(await self._store.query(lambda s: query.get_study(s, _KIND, advice)))
        if record.robot != robot:
            raise not_found(f"There is no {advice} for {robot}.")
        if record.accepted_by is not None:
            raise conflict(f"{record.accepted_by} accepted {advice} already; ask for a new one.")
        wanted, name = record.full_step if share == 1.0 else record.half_step, STEPS[share]
        _refuse_flaw(wanted, vehicle)
        at = self._foundation.clock.now()

        def also(session: Session) -> None:
            model = get_robot(session, robot).model
            if model != vehicle.key or record.vehicle_digest != vehicle_digest(vehicle):
                raise conflict(_other_vehicle(record))
            use = {"accepted_at": at.isoformat(), "accepted_by": by, "accepted_share": share}
            query.use_study(session, _KIND, advice, use)
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
        trim = held.value_as(TrimConfig)
        return TrimView(
            config_id=held.id,
            net_buoyancy_offset_kg=trim.net_buoyancy_offset_kg,
            mass_position_offset_m=trim.mass_position_offset_m,
            reaches_robot=self._reaches(robot),
        )

    def _keep(
        self, session: Session, robot: str, asked: AdviceAsked, advice: TrimAdvice, by: str
    ) -> TrimAdviceView:
        at = self._foundation.clock.now()
        view = add_advice(session, robot, asked, advice, at=at, by=by)
        text = f"{by} asked for trim advice for {robot}: {advice.message}"
        data = {"advice": view.id, "deployment": asked.deployment}
        add_event(session, at, "trim.advised", text, robot=robot, data=data)
        return view

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


def _other_vehicle(advice: TrimAdviceView) -> str:
    vehicle = advice.vehicle or "of another version of the station"
    return (
        f"{advice.id} is for the vehicle {vehicle}, which {advice.robot} is not now; change the "
        "robot's model, or ask for a new advice."
    )


def add_advice(
    session: Session, robot: str, asked: AdviceAsked, advice: TrimAdvice, *, at: datetime, by: str
) -> TrimAdviceView:
    """Keep an advice that nobody has taken yet."""
    record = query.add_study(
        session,
        _KIND,
        robot,
        asked=asked.model_dump(mode="json"),
        result=advice.model_dump(mode="json"),
        at=at,
        by=by,
    )
    return _view(record)


def _view(record: StudyRecord) -> TrimAdviceView:
    return study_as(TrimAdviceView, record, **(record.result or {}))


def in_words(trim: TrimConfig) -> str:
    """Say a trim as pilots do, in grams and millimetres."""
    buoyancy_g = trim.net_buoyancy_offset_kg * 1e3
    position_mm = trim.mass_position_offset_m * 1e3
    return f"net buoyancy {buoyancy_g:+.1f} g, mass position {position_mm:+.1f} mm"
