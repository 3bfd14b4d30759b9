"""Parameters of robots: read over radio, written with proof, and kept ashore as last heard."""

import asyncio
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from sqlalchemy.orm import Session

from db.query import onboard as query
from db.query.events import add_event
from db.query.onboard import ParameterRecord
from db.record import same
from robot_link.messages import RobotId
from robot_link.service.parameter_table import ParameterType, ParameterValue
from robot_link.station.error import NoAnswerError, ServiceError
from server.base.foundation import Foundation
from server.base.job import JobError, JobProgress
from server.base.job_per_key import JobPerKey
from server.base.problem import FieldError, Problem, conflict, not_found, unprocessable
from server.fleet.fleet import Fleet
from server.fleet.recorded import refuse_recording
from server.fleet.words import sentence
from server.link.onboard_view import ParametersView, ParameterView


class ParameterRadio(Protocol):
    """The part of the links to the robots that carries parameters; never a satellite."""

    async def read_parameters(self, robot: RobotId) -> Sequence[ParameterValue]:
        """Return every parameter."""
        ...

    async def write_parameter(self, robot: RobotId, name: str, value: float) -> ParameterValue:
        """Set a parameter and return it as the robot says that it is now."""
        ...


class Parameters:
    """Belongs to one event loop; a robot is asked one thing at a time."""

    def __init__(self, foundation: Foundation, fleet: Fleet, radio: ParameterRadio) -> None:
        self._store = foundation.store
        self._clock = foundation.clock
        self._readings = JobPerKey[str](foundation.jobs, "parameter reading")
        self._fleet = fleet
        self._radio = radio
        self._asking: dict[str, asyncio.Lock] = defaultdict(asyncio.Lock)
        self._writing: dict[str, set[str]] = defaultdict(set)

    async def view(self, robot: str) -> ParametersView:
        """Return what a robot said last of its parameters.

        Raises:
            Problem: 404 if there is no such robot.
        """
        self._fleet.status(robot)
        records = await self._store.query(lambda session: query.list_parameters(session, robot))
        writing = self._writing[robot]
        return ParametersView(
            read_at=max((record.read_at for record in records), default=None),
            parameters=[_view(record, is_pending=record.name in writing) for record in records],
        )

    async def read(self, robot: str, *, by: str) -> str:
        """Begin to read all of them; return the job's id, that of the one under way if any.

        Raises:
            Problem: 404 for an unknown robot, 409 for a recording.
        """
        refuse_recording(self._fleet.status(robot), "cannot be asked anything")
        return await self._readings.start(
            robot, lambda progress: self._read(robot, progress), by=by
        )

    async def write(self, robot: str, name: str, value: float, *, by: str) -> ParameterView:
        """Set one parameter and return it as the robot says that it is now.

        Raises:
            Problem: 404 for an unknown robot or parameter, 409 if the robot refuses or cannot be
                reached, 422 if the value cannot be one of this parameter.
        """
        refuse_recording(self._fleet.status(robot), "cannot be asked anything")
        known = await self._store.query(lambda session: query.list_parameters(session, robot))
        record = next((one for one in known if one.name == name), None)
        if record is None:
            raise not_found(f"{robot} has named no parameter {name!r}; read its parameters first.")
        _check_value(record, value)
        async with self._asking[robot]:
            self._writing[robot].add(name)
            try:
                kept = await self._radio.write_parameter(RobotId(robot), name, value)
            except NoAnswerError as error:
                raise conflict(
                    f"{sentence(error)} Whether {robot} took {name} is not known; read its "
                    "parameters again."
                ) from error
            except ServiceError as error:
                raise conflict(sentence(error)) from error
            except ValueError as error:
                raise _wrong_value(str(error)) from error
            finally:
                self._writing[robot].discard(name)
        return await self._keep(robot, record, kept, by)

    async def _keep(
        self, robot: str, before: ParameterRecord, kept: ParameterValue, by: str
    ) -> ParameterView:
        at = self._clock.now()
        record = ParameterRecord(kept.name, kept.value, kept.type.name.lower(), at)
        text = f"{by} set {kept.name} of {robot} from {before.value:g} to {kept.value:g}."

        def write(session: Session) -> None:
            query.keep_parameter(session, robot, record)
            add_event(
                session,
                at,
                "parameter.written",
                text,
                robot=robot,
                data={"name": kept.name, "value": kept.value, "by": by},
            )

        await self._store.write(write)
        return _view(record, is_pending=False)

    async def _read(self, robot: str, progress: JobProgress) -> Mapping[str, Any]:
        progress.report(0.0, f"Asking {robot} for its parameters.")
        try:
            async with self._asking[robot]:
                found = await self._radio.read_parameters(RobotId(robot))
        except ServiceError as error:
            raise JobError(sentence(error)) from error
        at = self._clock.now()
        records = [ParameterRecord(one.name, one.value, one.type.name.lower(), at) for one in found]
        await self._store.write(lambda session: query.keep_parameters(session, robot, records))
        return {"parameters": len(records)}


def _check_value(record: ParameterRecord, value: float) -> None:
    """Refuse what cannot be a value of the parameter, before any byte leaves."""
    if not math.isfinite(value):
        raise _wrong_value(f"{record.name} must be a finite number.")
    kind = ParameterType[record.type.upper()]
    if kind.is_integer and value != int(value):
        raise _wrong_value(f"{record.name} must be a whole number.")
    low, high = kind.limits
    if not low <= value <= high:
        raise _wrong_value(f"{record.name} lies between {low:g} and {high:g}.")


def _wrong_value(message: str) -> Problem:
    return unprocessable(message, [FieldError(loc=["body", "value"], msg=message)])


def _view(record: ParameterRecord, *, is_pending: bool) -> ParameterView:
    return same(
        ParameterView,
        record,
        is_integer=ParameterType[record.type.upper()].is_integer,
        pending=is_pending,
    )
