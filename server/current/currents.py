"""The currents of all waters, growing with every dive that a fix has ended.

What the dives told is kept as rows; a station that starts makes the same maps of them. Algebra runs
in a thread, learning in a process; who reads a map reads one that is never changed.
"""

import asyncio
import hashlib
import json
import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from autonomy.current.config import CurrentMapConfig
from autonomy.current.model import CurrentMap, Observation
from autonomy.estimation.config import EstimatorConfig
from db.column import moment
from db.fault import StoreError
from db.query.fleet.robots import RobotRecord
from db.query.measured.current_observations import (
    add_observation,
    fixes_between,
    newest_observations,
)
from db.query.measured.current_reports import believed_currents
from db.query.measured.smoothing import newest_fix, track_columns
from db.query.station.events import add_event
from db.query.station.settings import get_setting, put_setting
from robot_link.messages import RobotId
from server.base.decision.decisions import Cause
from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.current.decided import LEARNED_CURRENT
from server.current.event import CurrentChanged
from server.current.observing import Seen, Stay, dives_seen
from server.current.record import KeptObservation
from server.current.task import CurrentLearning
from server.current.told import FOLDER as TOLD_FOLDER
from server.current.told import read_told, told_current
from server.current.water_current import Taken, WaterCurrent
from server.fleet.event import FixTaken, RobotChanged
from server.fleet.fleet import Fleet
from server.fleet.water import Water, site_robots

log = logging.getLogger(__name__)

KIND = "current_map"
GATHER_S = 2.0
"""Tracks are looked at this long after a fix, by the wall, when what was said of it is stored."""
ROWS_PER_LOOK = 20_000
_PATIENCE_S = 30.0
"""A fix that is not in the database by then, by the wall, is waited for no longer."""


@dataclass(frozen=True, slots=True)
class _Piece:
    """What one look at a track found, and up to where it was looked at."""

    seen: Seen
    stays: tuple[Observation, ...]
    stay: Stay
    """The one that was under way at its end."""
    until: datetime
    is_whole: bool


class Currents:
    """Owns the map of every water's current. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet, workers: WorkerPool) -> None:
        self._foundation = foundation
        self._store = foundation.store
        self._fleet = fleet
        self._workers = workers
        self._waters: dict[Water, WaterCurrent] = {}
        self._of: dict[str, Water] = {}
        self._told: dict[str, tuple[datetime, float]] = {}
        """Newest fix of a robot that is to be looked at, and when it was told of, by the wall."""
        self._looked: dict[str, datetime | None] = {}
        self._stays: dict[str, Stay] = {}
        self._turn = asyncio.Lock()
        self._news = asyncio.Event()
        self._is_learning = False

    def of(self, robot: str) -> WaterCurrent | None:
        """Return what is known of the current of a robot's water, ``None`` before it is read."""
        water = self._of.get(robot)
        return None if water is None else self._waters.get(water)

    def usable(self, robot: str) -> CurrentMap | None:
        """Return the map of a robot's water if a plan may rely on it now; nobody changes it."""
        found = self.of(robot)
        if found is None or not found.is_usable(self._foundation.clock.now().timestamp()):
            return None
        return found.known

    def carrier(self, robot: str) -> CurrentMap | None:
        """Return the map of a robot's water if its dives tell how it moved until now."""
        found = self.of(robot)
        if found is None or not found.is_carrier(self._foundation.clock.now().timestamp()):
            return None
        return found.known

    def belief(self, water: str) -> float | None:
        """Return how far the dives of a water's robots let one believe what is told of it."""
        robots = (one.record.id for one in self._fleet.statuses if one.record.water == water)
        found = [here for here in map(self.of, robots) if here is not None]
        return min((one.known.belief for one in found), default=None)

    async def retell(self, water: str) -> None:
        """Take that something else is told of the current of a water.

        Raises:
            StoreError: It is taken at the station's next start.
        """
        for status in list(self._fleet.statuses):
            record = status.record
            if record.water == water and record.kind != "recorded":
                await self._open(record)

    def take_fix(self, event: FixTaken) -> None:
        """Take that a robot reported a fix: a dive may have ended."""
        began_s = self._told.get(event.robot, (event.at, time.monotonic()))[1]
        self._told[event.robot] = (event.at, began_s)
        self._news.set()

    def take_robot(self, event: RobotChanged) -> None:
        """Take that a robot was added, or works elsewhere."""
        self._foundation.background.start(
            f"current of {event.record.id}", self._open_and_look(event.record)
        )

    def take_settings(self, event: SettingsChanged) -> None:
        """Take that settings changed: maps are made anew of the stored dives."""
        if event.kind == KIND:
            for status in list(self._fleet.statuses):
                self._foundation.background.start(
                    f"current of {status.record.id}", self._open_and_look(status.record)
                )

    async def start(self) -> None:
        """Make the maps of all waters of what is stored, and look for dives that nobody saw."""
        for status in list(self._fleet.statuses):
            await self._open_and_look(status.record)

    async def run(self) -> None:
        """Look at the tracks of robots that took a fix, until cancelled."""
        while True:
            await self._news.wait()
            await asyncio.sleep(GATHER_S)
            self._news.clear()
            for robot in list(self._told):
                try:
                    await self.look(RobotId(robot))
                except StoreError as error:
                    log.warning("the dives of %s are looked at later: %s", robot, error)
                    self._news.set()

    async def look(self, robot: RobotId) -> None:
        """Look at the track of a robot since the last look, and take in what it tells.

        Raises:
            StoreError: Nothing of the piece under way was kept; look again.
        """
        fix = await self._store.query(lambda session: newest_fix(session, robot))
        told, here = self._told.get(robot), self.of(robot)
        if fix is not None and here is not None and here.config.enabled:
            is_whole = False
            while not is_whole:
                since = self._looked.get(robot)
                if since is not None and fix <= since:
                    break
                piece = await self._piece(robot, since, fix)
                await self._take(robot, piece)
                is_whole = piece.is_whole
        if told is None or self._told.get(robot) != told:
            return
        if (fix is not None and fix >= told[0]) or time.monotonic() - told[1] > _PATIENCE_S:
            del self._told[robot]
        else:
            self._news.set()

    async def _open_and_look(self, record: RobotRecord) -> None:
        """Make the map of a robot's water, and let its track be looked at up to its newest fix."""
        if record.kind == "recorded":
            return
        try:
            await self._open(record)
            fix = await self._store.query(lambda session: newest_fix(session, record.id))
        except StoreError as error:
            log.warning("the current of %s's water was not read: %s", record.id, error)
            return
        if fix is not None:
            self._told.setdefault(record.id, (fix, time.monotonic()))
            self._news.set()

    async def _open(self, record: RobotRecord) -> None:
        """Make the map of a robot's water of what is stored, if it is not that already."""
        water, robot = Water.of(record), record.id
        async with self._turn:
            config = await self._config(record)
            robots = await self._store.query(lambda session: site_robots(session, robot))
            here = self._waters.get(water)
            name = record.water
            told = None
            if name is not None:
                told = await self._store.query(lambda session: read_told(session, name))
            if here is None or here.config != config or here.robots != robots:
                here = await self._made(water, robots, config)
                self._waters[water] = here
            if here.told != told:
                folder = self._foundation.settings.data_dir / TOLD_FOLDER
                field = await told_current(folder, told, record.site)
                known = here.known.copy()
                await asyncio.to_thread(known.tell, field)
                self._waters[water] = replace(here, told=told, known=known)
            self._of[robot] = water
            if robot not in self._looked:
                said = await self._store.query(lambda s: get_setting(s, _looked_name(robot)))
                self._looked[robot] = None if said is None else moment(said["us"])
        self._tell(water)

    async def _config(self, record: RobotRecord) -> CurrentMapConfig:
        """Return the settings of a water: the newest that was saved for any of its robots."""
        robots = await self._store.query(lambda session: site_robots(session, record.id))
        newest = await self._foundation.configurations.newest_of(KIND, robots)
        return newest.value_as(CurrentMapConfig)

    async def _made(
        self, water: Water, robots: tuple[str, ...], config: CurrentMapConfig
    ) -> WaterCurrent:
        def read(session: Session) -> tuple[list[KeptObservation], Mapping[str, Any] | None]:
            rows = newest_observations(session, robots, config.dives_max, _digest(water))
            return [KeptObservation.of(row) for row in rows], get_setting(session, _name(water))

        kept, said = await self._store.query(read)
        learned, until_s = None, 0.0
        if said is not None and said["config"] == config.model_dump(mode="json"):
            learned = CurrentMapConfig.model_validate(said["learned"])
            until_s = float(said["until_s"])
        return await asyncio.to_thread(
            WaterCurrent.of, water, robots, config, kept, learned, until_s
        )

    async def _piece(self, robot: RobotId, since: datetime | None, fix: datetime) -> _Piece:
        estimator = (await self._foundation.configurations.current("estimator", robot)).value_as(
            EstimatorConfig
        )
        stay = self._stays.get(robot, Stay())

        def read(session: Session) -> _Piece:
            track = track_columns(session, robot, since, fix, ROWS_PER_LOOK)
            is_whole = len(track) < ROWS_PER_LOOK
            until = fix if is_whole else moment(int(track.measured_at_us[-1]))
            fixes = fixes_between(session, robot, since, until, ROWS_PER_LOOK)
            seen = dives_seen(
                robot,
                track,
                fixes,
                believed_currents(session, robot, since, until),
                drift_m_sqrt_s=estimator.drift_m_sqrt_s,
                subtracts_silently=estimator.method == "model",
            )
            # a dive that was under way at the end of a piece is looked at with the next
            fixed = [one.measured_at for one in fixes if one.has_fix]
            if not is_whole and fixed and (since is None or fixed[-1] > since):
                until = fixed[-1]
            left, stays = stay.with_reports(robot, fixes, estimator)
            return _Piece(seen, stays, left, until, is_whole)

        return await self._store.query(read)

    async def _take(self, robot: RobotId, piece: _Piece) -> None:
        """Take in what a piece of track told, and keep it with the moment up to which it goes."""
        observations = sorted(
            (*piece.seen.observations, *piece.stays), key=lambda one: float(one.time_s[-1])
        )
        async with self._turn:
            here = self._waters[self._of[robot]]
            grown, taken = await asyncio.to_thread(here.with_observations, observations)
            if piece.seen.left_out:
                grown.left_out = here.left_out | {robot: piece.seen.left_out[-1]}
            elif piece.seen.observations:
                grown.left_out = {k: v for k, v in here.left_out.items() if k != robot}
            await self._keep(robot, taken, piece)
            self._looked[robot], self._stays[robot] = piece.until, piece.stay
            self._waters[here.water] = grown
        if observations or piece.seen.left_out:
            self._tell(here.water)
        if grown.is_learning_due and not self._is_learning:
            self._is_learning = True
            self._foundation.background.start(
                f"learn the current of {robot}", self._learn(robot, grown)
            )

    async def _keep(self, robot: RobotId, taken: Taken, piece: _Piece) -> None:
        at, water = self._foundation.clock.now(), _digest(self._of[robot])

        def write(session: Session) -> None:
            for one in taken.kept:
                add_observation(session, one.record(water))
            for whose, appended in taken.told:
                kind = f"current.dive_{appended.taking.value}"
                add_event(session, at, kind, f"{whose}: {appended.text}", robot=whose)
            us = round(piece.until.timestamp() * 1e6)
            put_setting(session, _looked_name(robot), {"us": us})

        await self._store.write(write)

    async def _learn(self, robot: str, asked: WaterCurrent) -> None:
        """Learn the settings of a water's map from its observations, and keep what was found."""
        observations = asked.known.observations
        problem = CurrentLearning(asked.config, observations, asked.water.latitude_deg)
        try:
            learned: CurrentMapConfig = await self._foundation.decisions.make(
                LEARNED_CURRENT, problem, Cause(robot), self._workers
            )
            async with self._turn:
                here = self._waters.get(asked.water)
                if here is None or here.config != asked.config:
                    return  # somebody typed other settings meanwhile
                document = {
                    "config": asked.config.model_dump(mode="json"),
                    "learned": learned.model_dump(mode="json"),
                    "until_s": asked.known.newest_s,
                    "water": asdict(asked.water),
                }
                await self._store.write(
                    lambda session: put_setting(session, _name(asked.water), document)
                )
                later = _after(here.known.observations, asked.known.newest_s)
                here = await asyncio.to_thread(here.relearned, learned)
                here.new = later
                self._waters[asked.water] = here
            self._tell(asked.water)
        except (*WORKER_FAILURES, StoreError) as error:
            log.warning("the current of %s is learned later: %s", asked.water.name, error)
        finally:
            self._is_learning = False

    def _tell(self, water: Water) -> None:
        for robot, its in self._of.items():
            if its == water:
                self._foundation.bus.publish(CurrentChanged(robot))


def _after(observations: Sequence[Observation], moment_s: float) -> int:
    return sum(float(one.time_s[-1]) > moment_s for one in observations)


def _looked_name(robot: str) -> str:
    return f"current looked at: {robot}"


def _name(water: Water) -> str:
    return f"current learned: {_digest(water)}"


def _digest(water: Water) -> str:
    return hashlib.sha256(json.dumps(asdict(water)).encode()).hexdigest()[:16]
