"""The catalogue of vehicles, and what each of them does with its actuators held still."""

import asyncio
import re
from collections import OrderedDict
from collections.abc import Callable, Mapping
from typing import Any

from sqlalchemy.orm import Session

from autonomy.vehicle.config import VEHICLES, Vehicle
from autonomy.vehicle.parameter_file import (
    VehicleFileError,
    vehicle_document,
    vehicle_from_document,
)
from db.query.fleet.vehicles import VehicleExistsError, VehicleRecord, add_vehicle, list_vehicles
from db.query.station.events import add_event
from db.store import Store
from robot_link.clock import Clock
from server.base.problem import FieldError, Problem, conflict, not_found, unprocessable
from server.base.study import Refusal
from server.base.text import checked
from server.base.vehicle_catalogue import BUILT_IN, CatalogueEntry, entry_of, vehicle_digest
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.vehicle.task import CAPABILITY, POLAR, STEADY, CapabilityProblem, SteadyProblem

ANSWERS_KEPT = 64
"""So many polars and capabilities stay in memory, the last asked for."""


class Vehicles:
    """Every vehicle that a robot can be. Belongs to one event loop.

    The catalogue is small and read on every change of a gauge, so it is held in memory.
    """

    def __init__(self, store: Store, clock: Clock, workers: WorkerPool) -> None:
        self._store = store
        self._clock = clock
        self._workers = workers
        self._entries = {
            key: CatalogueEntry(vehicle, BUILT_IN) for key, vehicle in VEHICLES.items()
        }
        self._answers: OrderedDict[str, asyncio.Task[Any]] = OrderedDict()

    async def load(self) -> None:
        """Read the vehicles that people added.

        Raises:
            VehicleFileError: If another version of the station wrote one that does not fit.
        """
        for record in await self._store.query(list_vehicles):
            self._entries[record.key] = entry_of(record)

    @property
    def entries(self) -> list[CatalogueEntry]:
        """Every vehicle, those that the station brings along first."""
        return list(self._entries.values())

    def find(self, key: str) -> Vehicle | None:
        """Return a vehicle, ``None`` for a recording of something unknown."""
        entry = self._entries.get(key)
        return None if entry is None else entry.vehicle

    def origin(self, key: str) -> str:
        """Return where a vehicle comes from, "" for a recording of something unknown."""
        entry = self._entries.get(key)
        return "" if entry is None else entry.origin

    def get(self, key: str) -> CatalogueEntry:
        """Return a vehicle.

        Raises:
            Problem: 404 if there is none; the sentence lists those that there are.
        """
        if key not in self._entries:
            raise not_found(f"There is no vehicle {key!r}; there are {', '.join(self._entries)}.")
        return self._entries[key]

    def check_model(self, key: str) -> None:
        """Refuse a model that is not in the catalogue.

        Raises:
            Problem: 422 with the list.
        """
        if key not in self._entries:
            message = f"must be one of {', '.join(self._entries)}"
            raise unprocessable("1 field is wrong.", [FieldError(loc=["model"], msg=message)])

    def free_key(self, wish: str) -> str:
        """Return a key that no vehicle has, as near to a wish as it gets."""
        stem = re.sub(r"[^a-z0-9_-]+", "-", wish.lower()).strip("-_")[:36] or "vehicle"
        numbered = (f"{stem}-{number}" for number in range(2, len(self._entries) + 3))
        return next(key for key in (stem, *numbered) if key not in self._entries)

    async def add(
        self,
        document: Mapping[str, Any],
        *,
        origin: str,
        by: str,
        also: Callable[[Session], None] | None = None,
    ) -> CatalogueEntry:
        """Add a vehicle by its parameter document, with what else belongs to the same change.

        Raises:
            Problem: 422 with the path, the name and the allowed range of each wrong entry, 409 if
                the key is taken.
            StoreUnavailableError: Nothing was kept.
        """
        try:
            vehicle = vehicle_from_document(document)
        except VehicleFileError as error:
            raise _wrong_entries(error) from error
        _check_words(vehicle)
        if vehicle.key in self._entries:
            raise _taken(vehicle.key)
        record = VehicleRecord(
            key=vehicle.key,
            title=vehicle.title,
            note=vehicle.note,
            origin=origin,
            document=vehicle_document(vehicle),
            created_at=self._clock.now(),
            created_by=by,
        )

        def write(session: Session) -> None:
            add_vehicle(session, record)
            text = f"{by} added the vehicle {vehicle.key} ({vehicle.title})."
            data = {"vehicle": vehicle.key, "origin": origin}
            add_event(session, record.created_at, "vehicle.added", text, data=data)
            if also is not None:
                also(session)

        try:
            await self._store.write(write)
        except VehicleExistsError as error:
            raise _taken(vehicle.key) from error
        self._entries[vehicle.key] = entry_of(record)
        return self._entries[vehicle.key]

    async def polar(self, key: str) -> Mapping[str, Any]:
        """Return the polar of a vehicle as a JSON document, worked out once.

        Raises:
            Problem: 404 for an unknown vehicle, 503 if the working process ended.
        """
        vehicle = self.get(key).vehicle
        return await self._worked_out(f"{POLAR} {vehicle_digest(vehicle)}", POLAR, vehicle)

    async def capability(self, key: str, depth_m: float | None) -> Mapping[str, Any]:
        """Return which primitives a vehicle can fly and what they cost, worked out once.

        Args:
            key: Of the vehicle.
            depth_m: Depth of the water; None for as deep as it needs.

        Raises:
            Problem: 404 for an unknown vehicle, 422 in words for one that cannot glide, 503 if the
                working process ended.
        """
        vehicle = self.get(key).vehicle
        name = f"{CAPABILITY} {vehicle_digest(vehicle)} {depth_m}"
        found = await self._worked_out(name, CAPABILITY, CapabilityProblem(vehicle, depth_m))
        if isinstance(found, Refusal):
            raise unprocessable(found.message, [FieldError(loc=["query"], msg=found.message)])
        return found

    async def steady(
        self, key: str, m0_kg: float, rp1_m: float, delta_rad: float
    ) -> Mapping[str, Any]:
        """Return what a vehicle settles into with its actuators held, as a JSON document.

        Raises:
            Problem: 404 for an unknown vehicle, 422 in words where there is no such motion or an
                input is beyond its stop, 503 if the working process ended.
        """
        problem = SteadyProblem(self.get(key).vehicle, m0_kg, rp1_m, delta_rad)
        _check_stops(problem)
        try:
            found = await self._workers.run(STEADY, problem)
        except WORKER_FAILURES as error:
            raise not_worked_out(error) from error
        if isinstance(found, Refusal):
            raise unprocessable(found.message, [FieldError(loc=["query"], msg=found.message)])
        return found

    async def _worked_out(self, name: str, task_name: str, payload: object) -> Any:  # noqa: ANN401 - the task's own result
        """Return what a task makes of its payload, from memory if it was asked before."""
        task = self._answers.get(name)
        if task is None:
            task = asyncio.create_task(self._workers.run(task_name, payload), name=name)
            task.add_done_callback(_seen)
            self._answers[name] = task
            while len(self._answers) > ANSWERS_KEPT:
                self._answers.popitem(last=False)
        self._answers.move_to_end(name)
        try:
            # Shielded: one who does not wait any longer must not take it from the others.
            return await asyncio.shield(task)
        except WORKER_FAILURES as error:
            self._answers.pop(name, None)
            raise not_worked_out(error) from error

    async def stop(self) -> None:
        """Stop what is being worked out."""
        tasks = list(self._answers.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def _seen(task: asyncio.Task[Any]) -> None:
    """Look at a failure of which everyone who waited is gone."""
    if not task.cancelled():
        task.exception()


def _check_stops(problem: SteadyProblem) -> None:
    limits = problem.vehicle.limits
    ranges = {
        "m0_kg": (problem.m0_kg, limits.m0_min_kg, limits.m0_max_kg),
        "rp1_m": (problem.rp1_m, limits.rp1_min_m, limits.rp1_max_m),
        "delta_rad": (problem.delta_rad, -limits.delta_max_rad, limits.delta_max_rad),
    }
    errors = [
        FieldError(loc=["query", name], msg=f"is beyond its stop: {low:g} to {high:g}")
        for name, (value, low, high) in ranges.items()
        if not low <= value <= high
    ]
    if errors:
        count = "1 field is" if len(errors) == 1 else f"{len(errors)} fields are"
        raise unprocessable(f"{count} wrong.", errors)


def _wrong_entries(error: VehicleFileError) -> Problem:
    errors = [FieldError(loc=list(one.loc), msg=one.message) for one in error.errors]
    count = "1 entry is" if len(errors) == 1 else f"{len(errors)} entries are"
    return unprocessable(f"{count} wrong; nothing was kept.", errors)


def _taken(key: str) -> Problem:
    return conflict(
        f"There is a vehicle {key!r} already; vehicles are never changed, so take another key."
    )


def not_worked_out(error: Exception) -> Problem:
    """Return the 503 of a question that its working process could not answer."""
    return Problem(503, f"This could not be worked out: {error}", headers={"Retry-After": "5"})


def _check_words(vehicle: Vehicle) -> None:
    """Check what others read of a vehicle; a note may have lines.

    Raises:
        Problem: 422 if a word holds what cannot be seen.
    """
    for name, words in (("title", [vehicle.title]), ("note", vehicle.note.splitlines())):
        try:
            for one in words:
                checked(one)
        except ValueError as error:
            wrong = [FieldError(loc=[name], msg=str(error))]
            raise unprocessable("1 entry is wrong; nothing was kept.", wrong) from error
