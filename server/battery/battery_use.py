"""What each robot draws from its battery, growing with what its flights took.

What was learned is kept as a setting of the station, with the moment up to which the robot's words
were looked at; a station that starts goes on from there.
"""

import asyncio
import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray
from autonomy.estimation.energy_use import EnergyUse, Use
from autonomy.planner.config import PlannerConfig
from autonomy.planner.work import powers_of_uses
from autonomy.vehicle.battery import BatteryConfig
from autonomy.vehicle.config import Vehicle
from db.column import microseconds, moment
from db.deployment_span import Period
from db.fault import StoreError
from db.query.measured.battery import battery_readings, first_place
from db.query.mission.plans import flown_plans
from db.query.station.settings import get_setting, put_setting
from server.base.foundation import Foundation
from server.base.wakeups import Wakeups
from server.battery.flown import SLACK, FlownPlan
from server.battery.interval import DrawnInterval, IntervalCutter
from server.fleet.fleet import Fleet
from server.fleet.status import RobotStatus
from server.link.event import ValuesStored

log = logging.getLogger(__name__)

_REST_S = 5.0
"""Wall time between two looks at what robots said of their batteries."""
_ROWS = 20_000
_PLANS = 50
"""Newest plans that a silence may belong to."""
_FLOWN = ("running", "done", "failed")
_DAY_H = 24


@dataclass(frozen=True, slots=True)
class Battery:
    """A robot's battery as it is known now."""

    config: BatteryConfig
    use: EnergyUse
    day_h: FloatArray
    """Hours in each use of the last day that was told of, shape ``(5,)``."""
    left: float | None
    measured_at: datetime | None


@dataclass(slots=True)
class _Known:
    """What is known of one robot's use, and where the look at its words stands."""

    vehicle: str
    use: EnergyUse
    looked: datetime | None = None
    """Everything until then is learned."""
    hours: dict[int, list[float]] = field(default_factory=dict[int, list[float]])
    """Hours in each use by the hour of the clock, of about a day."""
    cutter: IntervalCutter = field(default_factory=IntervalCutter)
    read: datetime | None = None
    """Everything until then went through the cutter."""


class BatteryUse:
    """Learns what robots draw, and says it. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._foundation = foundation
        self._store = foundation.store
        self._fleet = fleet
        self._looks = Wakeups(foundation.clock, _REST_S)
        self._known: dict[str, _Known] = {}
        self._turn = asyncio.Lock()
        self._homes: dict[tuple[str, datetime], tuple[float, float]] = {}
        """By deployment."""

    async def of(self, robot: str) -> Battery | None:
        """Return a robot's battery, ``None`` where its vehicle is not known.

        Raises:
            Problem: 404 if there is no such robot.
        """
        status = self._fleet.status(robot)
        known = await self._open(status)
        if known is None:
            return None
        config = (await self._foundation.configurations.current("battery", robot)).value_as(
            BatteryConfig
        )
        state = status.state
        left = None if state is None else state.battery_fraction
        told = state is not None and left is not None and 0.0 <= left <= 1.01
        hours = np.array(list(known.hours.values()), dtype=np.float64).reshape(-1, len(Use))
        return Battery(
            config,
            known.use,
            hours.sum(axis=0),
            left if told else None,
            state.measured_at if told and state is not None else None,
        )

    async def home_ne_m(self, robot: str) -> tuple[float, float] | None:
        """Return where a robot was put into the water of this deployment, ``None`` if unknown."""
        deployment = self._fleet.status(robot).deployment
        if deployment is None or deployment.started_at is None:
            return None
        since = deployment.started_at
        key = deployment.id, since
        if key not in self._homes:
            found = await self._store.query(lambda session: first_place(session, robot, since))
            if found is None:
                return None
            self._homes[key] = found
        return self._homes[key]

    def take(self, event: ValuesStored) -> None:
        """Take that a robot's words were stored."""
        self._looks.wake(event.robot)

    async def start(self) -> None:
        """Look at what was said while the station did not run."""
        for status in list(self._fleet.statuses):
            self._looks.wake(status.record.id)

    async def run(self) -> None:
        """Learn from what robots say, until cancelled."""
        while True:
            for robot in await self._looks.next():
                try:
                    await self.look(robot)
                except StoreError as error:
                    log.warning("the battery of %s is looked at later: %s", robot, error)
                    self._looks.wake(robot)

    async def look(self, robot: str) -> None:
        """Learn from everything that a robot said since the last look.

        Raises:
            StoreError: What was read until then is learned; look again.
        """
        if not self._fleet.knows(robot):
            return
        status = self._fleet.status(robot)
        known = await self._open(status)
        if known is None or status.record.kind == "recorded" or status.record.is_foreign:
            return
        capacity_wh = (
            (await self._foundation.configurations.current("battery", robot))
            .value_as(BatteryConfig)
            .capacity_wh
        )
        async with self._turn:
            while await self._learn_piece(robot, known, capacity_wh):
                pass

    async def _learn_piece(self, robot: str, known: _Known, capacity_wh: float) -> bool:
        """Learn from the next piece of a robot's words; tell whether there are more."""
        after = known.read

        def read(session: Session) -> tuple[list[Any], list[FlownPlan]]:
            words = battery_readings(session, robot, after, _ROWS)
            if not words:
                return words, []
            first, last = known.cutter.last or words[0], words[-1]
            around = Period(first.measured_at - SLACK, last.measured_at + SLACK)
            plans = flown_plans(session, robot, _FLOWN, around, _PLANS)
            return words, [one for one in map(FlownPlan.of, plans) if one is not None]

        words, flown = await self._store.query(read)
        if not words:
            return False

        def hours(start: datetime, end: datetime) -> FloatArray | None:
            found = (plan.hours(start, end) for plan in flown)
            return next((one for one in found if one is not None), None)

        cutter = known.cutter
        found = await asyncio.to_thread(
            lambda: [one for one in (cutter.take(word, hours) for word in words) if one]
        )
        known.read = words[-1].measured_at
        for one in found:
            _learn(known, one, capacity_wh)
        if found:
            document = _document(known)
            await self._store.write(lambda session: put_setting(session, _name(robot), document))
            self._foundation.feed.mark("battery", robot)
        return len(words) == _ROWS

    async def _open(self, status: RobotStatus) -> _Known | None:
        """Return what is known of a robot, from the database or from its vehicle's model."""
        robot, vehicle = status.record.id, self._fleet.vehicle(status.record.id)
        if vehicle is None:
            return None
        known = self._known.get(robot)
        if known is None or known.vehicle != vehicle.key:
            said = await self._store.query(lambda session: get_setting(session, _name(robot)))
            if said is not None and said["vehicle"] == vehicle.key:
                known = _of_document(said)
            else:
                # What was said before was of another vehicle, and teaches nothing of this one.
                read = None if said is None else _of_document(said).read
                known = _Known(vehicle.key, await self._prior(robot, vehicle), read=read)
            known = self._known.setdefault(robot, known)
            if known.vehicle != vehicle.key:
                known = self._known[robot] = _Known(
                    vehicle.key, await self._prior(robot, vehicle), known.looked, read=known.read
                )
        return known

    async def _prior(self, robot: str, vehicle: Vehicle) -> EnergyUse:
        book = self._foundation.configurations
        planner = (await book.current("planner", robot)).value_as(PlannerConfig)
        # The first of these loads an optimiser, which would hold up everybody for half a second.
        powers = await asyncio.to_thread(powers_of_uses, vehicle, planner.primitives)
        return EnergyUse.of_model(powers)


def _learn(known: _Known, one: DrawnInterval, capacity_wh: float) -> None:
    energy_wh, reading_wh = one.fraction * capacity_wh, one.reading_std * capacity_wh
    known.use = known.use.taken(one.hours, energy_wh, reading_wh)
    known.looked = one.ended_at
    number = int(one.ended_at.timestamp() // 3600)
    before = np.array(known.hours.get(number, [0.0] * len(Use)))
    known.hours[number] = (before + one.hours).tolist()
    known.hours = {key: spent for key, spent in known.hours.items() if key > number - _DAY_H}


def _document(known: _Known) -> dict[str, Any]:
    looked = known.looked
    return {
        "vehicle": known.vehicle,
        "use": known.use.document(),
        "looked_us": None if looked is None else microseconds(looked),
        "hours": {str(key): spent for key, spent in known.hours.items()},
    }


def _of_document(said: Mapping[str, Any]) -> _Known:
    looked = None if said["looked_us"] is None else moment(said["looked_us"])
    hours = {int(key): list(spent) for key, spent in said["hours"].items()}
    # the words after it go through the cutter once more; the one that ended it begins the next
    again = None if looked is None else looked - timedelta(microseconds=1)
    use = EnergyUse.of_document(said["use"])
    return _Known(said["vehicle"], use, looked, hours, read=again)


def _name(robot: str) -> str:
    return f"battery use: {robot}"
