"""The field maps of every robot, growing while samples arrive.

A robot has one map of its site's variable for each model. They are rebuilt from the stored samples
when the station starts or a setting changes, and fed in pieces by a thread, so that the event loop
never waits for algebra. Memory is bounded by ``FieldConfig.max_samples``: a full map keeps an
evenly spread part of its samples (see ``LiveMap``). The maps of a recording were fitted when it was
imported and are only shown.
"""

import asyncio
import logging
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from autonomy.field.config import FieldConfig
from autonomy.field.grid import Grid
from autonomy.site import Box
from db.fault import StoreUnavailableError
from db.query.maps import add_map, newest_maps
from db.query.samples import sample_columns
from db.store import Store
from robot_link.clock import Clock
from robot_link.messages import Sample
from server.service.live_maps import LiveMaps
from server.service.map_record import record_of, scores_of, view_of
from server.service.view.mission import ScoresView
from webui.scene.source import MapView

log = logging.getLogger(__name__)

GATHER_S = 0.25
"""Samples are fed to the maps in pieces of about this length."""
SNAPSHOT_PERIOD = timedelta(minutes=10)
"""A map that changed is kept in the database this often, by the robots' clock."""

MapKey = tuple[str, str]
"""Variable and model."""


@dataclass(slots=True)
class _RobotMaps:
    views: dict[MapKey, MapView] = field(default_factory=dict)
    """The default model of the site's variable first."""
    scores: dict[MapKey, ScoresView] = field(default_factory=dict)
    live: LiveMaps | None = None
    saved_version: int = 0
    saved_at: datetime | None = None


class FieldMaps:
    """Owns all maps. Belongs to one event loop; the algebra runs in one thread at a time."""

    def __init__(self, store: Store, clock: Clock) -> None:
        self._store = store
        self._clock = clock
        self._robots: dict[str, _RobotMaps] = defaultdict(_RobotMaps)
        self._waiting: dict[str, list[Sample]] = defaultdict(list)
        self._fed_s: dict[str, float] = {}
        self._algebra = asyncio.Lock()
        self._news = asyncio.Event()
        self.listeners: list[Callable[[str], None]] = []
        """Called with a robot's id when its maps changed."""

    async def open(self, robot: str, config: FieldConfig, domain: Box) -> None:
        """Make the maps of a robot from its stored samples; again only if settings changed."""
        maps = self._robots[robot]
        grid = Grid.over(domain, config.grid)
        if maps.live is not None and maps.live.is_of(config, grid):
            return
        async with self._algebra:
            columns = await self._store.query(
                lambda session: sample_columns(session, robot, config.variable)
            )
            live = await asyncio.to_thread(LiveMaps.from_columns, config, grid, columns)
            if maps.live is None:
                maps.scores = await self._saved_scores(robot)
            maps.live, maps.views = live, live.views
        self._tell(robot)

    async def show_saved(self, robot: str) -> None:
        """Show the maps of a recording as they were kept."""
        saved = await self._store.query(lambda session: newest_maps(session, robot))
        maps = self._robots[robot]
        maps.views = {(record.variable, record.model): view_of(record) for record in saved}
        maps.scores = scores_of(saved)
        self._tell(robot)

    def feed(self, samples: Sequence[Sample]) -> None:
        """Take committed samples; those that are in the maps already change nothing."""
        now_s = time.monotonic()
        for sample in samples:
            self._waiting[sample.robot].append(sample)
            self._fed_s[sample.robot] = now_s
        self._news.set()

    async def quiet(self, robot: str, for_s: float, at_most_s: float) -> None:
        """Wait until no sample of a robot came for a while of the wall from now on."""
        begin_s = time.monotonic()
        while True:
            wait_s = max(begin_s, self._fed_s.get(robot, 0.0)) + for_s - time.monotonic()
            if wait_s <= 0.0 or time.monotonic() > begin_s + at_most_s:
                return
            await asyncio.sleep(wait_s)

    async def run(self) -> None:
        """Feed and save the maps until cancelled."""
        while True:
            await self._news.wait()
            await asyncio.sleep(GATHER_S)
            self._news.clear()
            for robot in list(self._waiting):
                await self._feed(robot)
                try:
                    await self._save_if_due(robot)
                except StoreUnavailableError as error:
                    log.warning(
                        "the maps of %s are kept in memory until storage works: %s", robot, error
                    )

    async def settle(self, robot: str) -> None:
        """Bring everything that was fed into the maps of a robot and keep a snapshot."""
        await self._feed(robot)
        await self._save(robot)

    def views(self, robot: str) -> Mapping[MapKey, MapView]:
        """Return every map of a robot, the default first; empty while they are being made."""
        return self._robots[robot].views if robot in self._robots else {}

    def scores(self, robot: str) -> Mapping[MapKey, ScoresView]:
        """Return the scores that are known of the maps of a robot."""
        return self._robots[robot].scores if robot in self._robots else {}

    def set_scores(self, robot: str, scores: Mapping[MapKey, ScoresView]) -> None:
        """Attach scores to the maps of a robot."""
        self._robots[robot].scores.update(scores)
        self._tell(robot)

    async def _feed(self, robot: str) -> None:
        async with self._algebra:
            maps = self._robots[robot]
            waiting = self._waiting.pop(robot, [])
            if not waiting or maps.live is None:
                return
            await asyncio.to_thread(maps.live.append, waiting)
            maps.views = maps.live.views
        self._tell(robot)

    async def _save_if_due(self, robot: str) -> None:
        maps = self._robots[robot]
        now = self._clock.now()
        if maps.saved_at is None:
            maps.saved_at = now
        if now - maps.saved_at >= SNAPSHOT_PERIOD:
            await self._save(robot)

    async def _save(self, robot: str) -> None:
        maps = self._robots[robot]
        if maps.live is None or maps.live.version == maps.saved_version:
            return
        version, at = maps.live.version, self._clock.now()
        records = [
            record_of(robot, view, maps.scores.get(key), at) for key, view in maps.views.items()
        ]

        def write(session: Session) -> None:
            for record in records:
                add_map(session, record)

        await self._store.write(write)
        maps.saved_version, maps.saved_at = version, at

    async def _saved_scores(self, robot: str) -> dict[MapKey, ScoresView]:
        return scores_of(await self._store.query(lambda session: newest_maps(session, robot)))

    def _tell(self, robot: str) -> None:
        for listener in self.listeners:
            listener(robot)
