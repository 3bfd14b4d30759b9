"""The field maps of every robot, growing while samples arrive.

Robots of one water share the map of its variable by the configured model; ``server.map.samples``
finds theirs. Maps are made from the stored samples when the station starts or a setting changes,
fed in pieces, and made anew when a dive was smoothed, all in a thread, so that the event loop never
waits for algebra. The memory of a map is bounded by ``FieldConfig.max_samples``: a full one keeps
an evenly spread part of its samples (see ``LiveMap``); that of all of them by letting maps rest
(see ``server.map.rest``). The maps of a recording were fitted when it was imported and are only
shown.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Iterator, Mapping
from datetime import timedelta

from prometheus_client.core import Metric
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray
from autonomy.field.carriage import Carrier
from autonomy.field.live.live_map import Prediction
from autonomy.seawater import DERIVED, MEASURED
from db.fault import StoreError, StoreUnavailableError
from db.query.fleet.deployments import joint_spans
from db.query.fleet.robots import RobotRecord
from db.query.measured.maps import add_map, newest_maps
from db.store import Store
from robot_link.clock import Clock
from robot_link.messages import Sample
from server.base.channels import Channels
from server.base.event_bus import EventBus
from server.fleet.event import FixTaken
from server.fleet.water import site_robots
from server.link.event import SamplesStored
from server.map.event import DivesSmoothed, MapChanged
from server.map.group import MapGroup, MapKey, MapSettings
from server.map.record import Comparison, newest_comparison, record_of, scores_of, view_of
from server.map.rest import MapRest, figures_of
from server.map.samples import map_columns
from server.map.site_map import SiteMap
from server.map.smoothing import Smoothing
from server.map.view import ScoresView
from webui.scene.source import MapView, SampleView

log = logging.getLogger(__name__)

GATHER_S = 0.25
"""Samples are fed to the maps in pieces of about this length."""
QUIET_S = 1.0
"""A finished dive is smoothed when no sample of its robot came for this long, by the wall."""
QUIET_LIMIT_S = 5.0
"""It is smoothed anyway after this long, and again with samples that come later."""
SNAPSHOT_PERIOD = timedelta(minutes=10)
"""A map that changed is kept in the database this often, by the robots' clock."""


class FieldMaps:
    """Owns all maps. Belongs to one event loop; the algebra runs in one thread at a time."""

    def __init__(
        self,
        store: Store,
        clock: Clock,
        bus: EventBus,
        channels: Channels,
        carrier_of: Callable[[str], Carrier | None] = lambda _: None,
    ) -> None:
        self._store = store
        self._channels = channels
        self._carrier_of = carrier_of
        """Map of the current of a robot's water, where one may be relied upon."""
        self._bus = bus
        self._clock = clock
        self._groups: list[MapGroup] = []
        self._of: dict[str, MapGroup] = {}
        self._versions: dict[str, str] = {}
        """Version of the field's settings of the map that a robot shows."""
        self._thresholds: dict[str, float | None] = {}
        self._recorded: dict[str, tuple[dict[MapKey, MapView], dict[MapKey, ScoresView]]] = {}
        self._fed_s: dict[str, float] = {}
        self._fixed: dict[str, float] = {}
        """When robots got their first fix since their samples were last looked at, by the wall."""
        self._smoothing = Smoothing(store, clock)
        self._rest = MapRest()
        self._algebra = asyncio.Lock()
        self._news = asyncio.Event()

    async def open(self, record: RobotRecord, settings: MapSettings) -> None:
        """Make the map of a robot from its stored samples; again only if something changed."""
        robot = record.id
        robots = await self._store.query(lambda session: site_robots(session, robot))
        group = next((one for one in self._groups if one.fits(record, settings)), None)
        if group is None:
            group = MapGroup.of(record, settings, robots)
            self._groups.append(group)
        # From here on samples wait for it; what the robot had is shown until it is ready.
        group.members.add(robot)
        for other in list(self._groups):
            is_here = other.water == group.water
            if is_here or robot in other.robots:
                pool = tuple(one for one in other.robots if one != robot)
                await self._make(other, robots if is_here else pool)
        if group.comparison is None:
            await self._load_comparison(group)
        self._join(robot, group, settings.version)
        self._thresholds[robot] = settings.threshold
        # Dives may have ended that nobody looked at before the station stopped.
        self._look_at_dives(robot)
        self._tell(group)

    async def show_saved(self, robot: str) -> None:
        """Show the maps of a recording as they were kept."""
        saved = await self._store.query(lambda session: newest_maps(session, robot))
        known = self._channels.catalogue
        views = {
            (record.variable, record.model): view_of(record, known[record.variable])
            for record in saved
            if record.variable in known
        }
        self._recorded[robot] = (views, scores_of(saved))
        self._tell_robot(robot)

    def feed(self, stored: SamplesStored) -> None:
        """Take committed samples; those that are in the maps already change nothing."""
        samples = stored.samples
        now_s = time.monotonic()
        self._smoothing.feed(samples)
        for sample in samples:
            self._fed_s[sample.robot] = now_s
            for group in self._groups:
                if not group.takes(sample):
                    continue
                if group.is_fed_by(sample.variable):
                    group.waiting.append(sample)
                elif group.channel.key in DERIVED and sample.variable in MEASURED:
                    group.is_stale = True
        for robot in {sample.robot for sample in samples}:
            if self._smoothing.has_ended_dive(robot) or self._smoothing.is_behind(robot):
                # the fix that ended their dive was told before they were committed
                self._look_at_dives(robot)
        self._news.set()

    def take_fix(self, fix: FixTaken) -> None:
        """Take that a robot reported a fix: it may have ended a dive."""
        self._smoothing.take_fix(fix.robot, fix.at)
        self._look_at_dives(fix.robot)

    async def quiet(self, robot: str, for_s: float, at_most_s: float) -> None:
        """Wait until no sample of a robot came for a while of the wall from now on."""
        begin_s = time.monotonic()
        while True:
            wait_s = max(begin_s, self._fed_s.get(robot, 0.0)) + for_s - time.monotonic()
            if wait_s <= 0.0 or time.monotonic() > begin_s + at_most_s:
                return
            await asyncio.sleep(wait_s)

    async def run(self) -> None:
        """Feed, smooth and save the maps until cancelled."""
        while True:
            await self._news.wait()
            await asyncio.sleep(GATHER_S)
            self._news.clear()
            for group in list(self._groups):
                await self._feed(group)
            try:
                await self._smooth_what_is_quiet()
                for group in self._rest.due(self._groups):
                    await self._make_anew(group)
                for group in list(self._groups):
                    await self._save_if_due(group)
            except StoreUnavailableError as error:
                log.warning("maps are kept in memory until storage works: %s", error)
            if self._fixed or any(group.is_stale for group in self._groups):
                self._news.set()

    def figures(self) -> Iterator[Metric]:
        """Yield what a monitoring system is told of the maps."""
        return figures_of(self._groups)

    async def settle(self, robot: str) -> None:
        """Bring everything that was fed into the map of a robot, smoothed, and keep a snapshot."""
        group = self._of.get(robot)
        if group is None:
            return
        await self._smooth(robot)
        await self._feed(group)
        if group.is_stale:
            await self._make_anew(group)
        await self._save(group)

    def group(self, robot: str) -> MapGroup | None:
        """Return the map of a robot with whom it shares it, ``None`` for a recording."""
        return self._of.get(robot)

    def version(self, robot: str) -> str | None:
        """Return the version of the field's settings that the map of a robot is made with."""
        return self._versions.get(robot)

    def threshold(self, robot: str) -> float | None:
        """Return what the map of a robot is held against, in the unit of its variable."""
        return self._thresholds.get(robot)

    async def predict(self, group: MapGroup, points: FloatArray) -> Prediction:
        """Return the live map of a group at any points, shape ``(q, 3)``, with its covariance.

        Raises:
            ValueError: If there is no map, or it states none.
        """
        async with self._algebra:
            if group.live is None:
                raise ValueError("the map is being made")
            self._rest.look(group)
            try:
                return await asyncio.to_thread(group.live.predict, points)
            finally:
                self._rest.let(self._groups)

    def views(self, robot: str) -> Mapping[MapKey, MapView]:
        """Return every map of a robot, the live one first; empty while it is being made.

        A map that rested is made anew of the samples that came meanwhile, and told of then.
        """
        group = self._of.get(robot)
        if group is not None:
            self._rest.look(group)
            return group.views
        return self._recorded[robot][0] if robot in self._recorded else {}

    def samples(self, robot: str) -> SampleView | None:
        """Return the samples behind the live map of a robot, ``None`` while it is being made."""
        group = self._of.get(robot)
        return None if group is None or group.live is None else group.live.samples

    def carrier(self, group: MapGroup) -> Carrier | None:
        """Return the map of the current of a group's water, where one may be relied upon."""
        return next(filter(None, map(self._carrier_of, sorted(group.members))), None)

    def carriage(self, robot: str) -> str:
        """Return whether the samples of a robot's live map are carried along with the water."""
        group = self._of.get(robot)
        return "still" if group is None else group.config.carriage

    def water_moved(self, robot: str) -> str:
        """Return a sentence on how far the water moved during the live map of a robot, or ""."""
        group = self._of.get(robot)
        return "" if group is None or group.live is None else group.live.water_moved

    def scores(self, robot: str) -> Mapping[MapKey, ScoresView]:
        """Return the scores that are known of the maps of a robot."""
        if robot in self._of:
            return self._of[robot].scores
        return self._recorded[robot][1] if robot in self._recorded else {}

    def set_scores(self, robot: str, scores: Mapping[MapKey, ScoresView]) -> None:
        """Attach scores to the maps of a robot."""
        group = self._of.get(robot)
        if group is not None:
            group.scores.update(scores)
            self._tell(group)

    def set_comparison(self, robot: str, comparison: Comparison) -> None:
        """Show a comparison beside the live map of a robot."""
        group = self._of.get(robot)
        if group is not None:
            group.comparison = comparison
            self._tell(group)

    def _join(self, robot: str, group: MapGroup, version: str) -> None:
        """Let a robot show the map of a group, and forget a map that nobody shows any more."""
        self._versions[robot] = version
        for other in self._groups:
            other.members.discard(robot)
        group.members.add(robot)
        self._of[robot] = group
        if group not in self._groups:
            # Its robot was given another map meanwhile; samples may have passed it by.
            self._groups.append(group)
            group.is_stale = True
        self._groups = [one for one in self._groups if one.members]

    async def _make(self, group: MapGroup, robots: tuple[str, ...]) -> None:
        """Make the map of a group of the samples of these robots, if it is not that already."""
        grid = group.grid()
        spans = await self._store.query(lambda session: joint_spans(session, robots))
        async with self._algebra:
            is_of = group.live is not None and group.live.is_of(group.config, grid, robots)
            if is_of and group.spans == spans:
                return
            group.robots, group.spans = robots, spans
            if group.live is None:
                group.scores |= await self._saved_scores(robots)
            await self._condition(group)
        self._tell(group)

    async def _make_anew(self, group: MapGroup) -> None:
        """Make a map of what its samples are now; it rests afterwards, the longer it took."""
        async with self._algebra:
            group.is_stale = False
            began_s = time.monotonic()
            try:
                await self._condition(group)
            except StoreError:
                group.is_stale = True
                raise
            except ValueError as error:
                log.error("the map of %s stays as it was: %s", _names(group), error)  # noqa: TRY400 - told, not unforeseen
            self._rest.made(group, began_s)
        self._tell(group)

    async def _condition(self, group: MapGroup) -> None:
        """Make a group's map of its stored samples; call it with the lock held."""
        config, robots, grid, spans = group.config, group.robots, group.grid(), group.spans
        version = 0 if group.live is None else group.live.version
        columns = await self._store.query(
            lambda session: map_columns(session, robots, group.channel, spans)
        )
        carrier = self.carrier(group)
        if group.live is not None:
            group.live.rest()  # the factors of one map at a time
        try:
            group.live = await asyncio.to_thread(
                SiteMap.from_columns,
                config,
                group.channel,
                grid,
                robots,
                columns,
                version,
                carrier,
                group.domain,
            )
        finally:
            self._rest.let(self._groups)

    async def _feed(self, group: MapGroup) -> None:
        async with self._algebra:
            if not group.waiting or group.live is None:
                return
            waiting, group.waiting = group.waiting, []
            if group.live.is_at_rest:
                # They are in the database. Who has the map on screen asks again, and so wakes it.
                was_stale, group.is_stale = group.is_stale, True
            else:
                was_stale = False
                await self._append(group, group.live, waiting)
        if not was_stale:
            self._tell(group)

    async def _append(self, group: MapGroup, live: SiteMap, samples: list[Sample]) -> None:
        """Let samples into a map that is awake; call it with the lock held."""
        try:
            await asyncio.to_thread(live.append, samples)
        except ValueError as error:
            # They are in the database: the map is made of all, or stays as it was.
            log.warning("the map of %s is made anew: %s", _names(group), error)
            group.is_stale = True
        self._rest.let(self._groups)

    async def _smooth_what_is_quiet(self) -> None:
        now_s = time.monotonic()
        for robot, fixed_s in list(self._fixed.items()):
            is_quiet = now_s - self._fed_s.get(robot, 0.0) >= QUIET_S
            if is_quiet or now_s - fixed_s >= QUIET_LIMIT_S:
                await self._smooth(robot)

    def _look_at_dives(self, robot: str) -> None:
        if robot in self._of and self._smoothing.is_pending(robot):
            self._fixed.setdefault(robot, time.monotonic())
            self._news.set()

    async def _smooth(self, robot: str) -> None:
        """Smooth the dives that ended; the maps with samples that moved are made anew later."""
        fixed_s = self._fixed.pop(robot, time.monotonic())
        try:
            moved = await self._smoothing.look(robot)
        except StoreError:
            self._fixed.setdefault(robot, fixed_s)
            raise
        if self._smoothing.is_behind(robot):
            self._fixed.setdefault(robot, fixed_s)
        if moved:
            for group in self._groups:
                group.is_stale = group.is_stale or robot in group.robots
        self._bus.publish(DivesSmoothed(robot))

    async def _save_if_due(self, group: MapGroup) -> None:
        now = self._clock.now()
        if group.saved_at is None:
            group.saved_at = now
        if now - group.saved_at >= SNAPSHOT_PERIOD:
            await self._save(group)

    async def _save(self, group: MapGroup) -> None:
        live = group.live
        if live is None or live.version == group.saved_version:
            return
        version, at, view = live.version, self._clock.now(), live.view
        scores = group.scores.get((view.variable.key, view.model))
        records = [record_of(robot, view, scores, at) for robot in group.members]

        def write(session: Session) -> None:
            for record in records:
                add_map(session, record)

        await self._store.write(write)
        group.saved_version, group.saved_at = version, at

    async def _saved_scores(self, robots: tuple[str, ...]) -> dict[MapKey, ScoresView]:
        def read(session: Session) -> dict[MapKey, ScoresView]:
            return scores_of(one for robot in robots for one in newest_maps(session, robot))

        return await self._store.query(read)

    async def _load_comparison(self, group: MapGroup) -> None:
        """Show the newest comparison that was kept for any robot of the map."""
        group.comparison = await self._store.query(
            lambda session: newest_comparison(session, group.robots, group.channel)
        )

    def _tell(self, group: MapGroup) -> None:
        for robot in group.members:
            self._tell_robot(robot)

    def _tell_robot(self, robot: str) -> None:
        self._bus.publish(MapChanged(robot))


def _names(group: MapGroup) -> str:
    return ", ".join(sorted(group.members))
