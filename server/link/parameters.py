"""Parameters of robots: read over radio, written with proof, and kept ashore as last heard."""

import asyncio
import json
import logging
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from sqlalchemy.orm import Session

from db.query.fleet import onboard as query
from db.query.fleet.onboard import ParameterRecord
from db.query.station.events import add_event
from db.record import same
from robot_link.messages import RobotId
from robot_link.service.parameter_file import (
    ParameterDescription,
    ParameterFileError,
    descriptions,
    saved_values,
)
from robot_link.service.parameter_table import ParameterType, ParameterValue
from robot_link.station.error import NoAnswerError, ServiceError
from robot_link.whole_file import replace_file
from server.base.foundation import Foundation
from server.base.job import JobError, JobPerKey, JobProgress
from server.base.problem import FieldError, Problem, conflict, not_found, unprocessable
from server.fleet.dependency import refuse_recording
from server.fleet.fleet import Fleet
from server.fleet.words import sentence
from server.link.onboard_view import (
    ParameterChoiceView,
    ParameterDifference,
    ParametersView,
    ParameterView,
)

log = logging.getLogger(__name__)


class ParameterRadio(Protocol):
    """The part of the links to the robots that carries parameters; never a satellite."""

    async def read_parameters(self, robot: RobotId) -> Sequence[ParameterValue]:
        """Return every parameter."""
        ...

    async def write_parameter(self, robot: RobotId, name: str, value: float) -> ParameterValue:
        """Set a parameter and return it as the robot says that it is now."""
        ...

    async def describe_parameters(self, robot: RobotId) -> Mapping[str, ParameterDescription]:
        """Return what a vehicle says of its own parameters."""
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
        self._folder = foundation.settings.data_dir / "parameters"
        """Of what makers say of parameters, a file for each robot."""
        self._described: dict[str, Mapping[str, ParameterDescription]] = {}

    async def view(self, robot: str, against: str | None = None) -> ParametersView:
        """Return what a robot said last of its parameters, beside those of another one.

        Raises:
            Problem: 404 if there is no such robot, or no such other one.
        """
        self._fleet.status(robot)
        others: dict[str, float] = {}
        if against is not None:
            self._fleet.status(against)
            other = await self._store.query(lambda session: query.list_parameters(session, against))
            others = {one.name: one.value for one in other}
        records = await self._store.query(lambda session: query.list_parameters(session, robot))
        writing, known = self._writing[robot], await self._descriptions(robot)
        return ParametersView(
            read_at=max((record.read_at for record in records), default=None),
            is_described=bool(known),
            parameters=[
                _view(
                    record,
                    known.get(record.name),
                    is_pending=record.name in writing,
                    other=others.get(record.name),
                )
                for record in records
            ],
        )

    async def describe(self, robot: str, content: bytes, *, by: str) -> int:
        """Keep what a file says of a robot's parameters; return how many it describes.

        Raises:
            Problem: 404 for an unknown robot, 422 with what is wrong in the file.
        """
        refuse_recording(self._fleet.status(robot), "has no parameters")
        try:
            found = await asyncio.to_thread(descriptions, content)
        except ParameterFileError as error:
            raise _wrong_file(str(error)) from error
        await self._keep_descriptions(robot, found)
        at, text = self._clock.now(), f"{by} described {len(found)} parameters of {robot}."
        await self._store.write(
            lambda session: add_event(session, at, "parameter.described", text, robot=robot)
        )
        return len(found)

    async def compare(
        self, robot: str, text: str, *, with_defaults: bool = False
    ) -> list[ParameterDifference]:
        """Return where a saved file differs from what a robot said last, or from the defaults.

        Raises:
            Problem: 404 for an unknown robot, 422 with the line of the file that is wrong.
        """
        self._fleet.status(robot)
        try:
            saved = await asyncio.to_thread(saved_values, text)
        except ParameterFileError as error:
            raise _wrong_file(str(error)) from error
        records = await self._store.query(lambda session: query.list_parameters(session, robot))
        here = {one.name: one.value for one in records}
        if with_defaults:
            known = (await self._descriptions(robot)).values()
            here = {one.name: one.default for one in known if one.default is not None}
            saved = {name: value for name, value in saved.items() if name in here}
        return [
            ParameterDifference(name, here.get(name), saved.get(name))
            for name in sorted(here.keys() | saved.keys())
            if not _is_same(here.get(name), saved.get(name))
        ]

    async def _descriptions(self, robot: str) -> Mapping[str, ParameterDescription]:
        if robot not in self._described:
            file = self._folder / f"{robot}.json"
            try:
                content = await asyncio.to_thread(file.read_bytes)
                self._described[robot] = await asyncio.to_thread(descriptions, content)
            except (OSError, ParameterFileError):
                self._described[robot] = {}
        return self._described[robot]

    async def _keep_descriptions(
        self, robot: str, found: Mapping[str, ParameterDescription]
    ) -> None:
        rows = [
            {
                "name": one.name,
                "shortDesc": one.title,
                "longDesc": one.help,
                "units": one.unit,
                "default": one.default,
                "min": one.minimum,
                "max": one.maximum,
                "values": [{"value": value, "description": text} for value, text in one.values],
                "rebootRequired": one.needs_reboot,
            }
            for one in found.values()
        ]
        content = json.dumps({"version": 1, "parameters": rows}).encode()

        def write() -> None:
            self._folder.mkdir(exist_ok=True)
            replace_file(self._folder / f"{robot}.json", content)

        await asyncio.to_thread(write)
        self._described[robot] = found

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
        known = await self._descriptions(robot)
        return _view(record, known.get(record.name), is_pending=False)

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
        described = await self._ask_for_descriptions(robot, progress)
        return {"parameters": len(records), "described": described}

    async def _ask_for_descriptions(self, robot: str, progress: JobProgress) -> int:
        """Ask a vehicle of another maker what its parameters mean; most do not say."""
        if not self._fleet.status(robot).record.is_foreign:
            return 0
        progress.report(0.6, f"Asking {robot} what they mean.")
        try:
            async with self._asking[robot]:
                found = await self._radio.describe_parameters(RobotId(robot))
        except ServiceError as error:
            log.info("%s does not describe its parameters: %s", robot, error)
            return 0
        await self._keep_descriptions(robot, found)
        return len(found)


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


def _wrong_file(message: str) -> Problem:
    return unprocessable(message, [FieldError(loc=["body"], msg=message)])


def _is_same(here: float | None, there: float | None) -> bool:
    """Tell whether two values are one, to the wire's single precision."""
    if here is None or there is None:
        return here is there
    return math.isclose(here, there, rel_tol=1e-6, abs_tol=1e-9)


def _view(
    record: ParameterRecord,
    known: ParameterDescription | None,
    *,
    is_pending: bool,
    other: float | None = None,
) -> ParameterView:
    told = known or ParameterDescription(record.name)
    return same(
        ParameterView,
        record,
        is_integer=ParameterType[record.type.upper()].is_integer,
        pending=is_pending,
        title=told.title,
        help=told.help,
        unit=told.unit,
        default=told.default,
        minimum=told.minimum,
        maximum=told.maximum,
        values=[ParameterChoiceView(value, text) for value, text in told.values],
        needs_reboot=told.needs_reboot,
        is_default=None if told.default is None else _is_same(record.value, told.default),
        other=other,
    )
