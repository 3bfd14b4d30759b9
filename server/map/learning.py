"""Learning: the kernels of a map's model from its samples, asked for or between dives.

What was learned becomes a new version of the field's settings of every robot that shares the map,
all of them at once, and the map is made anew. Nothing is changed before the work is done, nor if
somebody changed the settings meanwhile.
"""

import asyncio
import logging
from collections.abc import Mapping
from typing import Any

from sqlalchemy.orm import Session

from autonomy.field.config import FieldConfig
from autonomy.field.learned import LearnedConfig
from autonomy.field.samples import FieldSamples
from db.fault import StoreError
from db.query.measured.samples import count_since
from db.query.station import configurations as query
from db.query.station.events import add_event
from server.base.configuration import CurrentConfiguration, current
from server.base.configuration_kind import find_kind
from server.base.decision.decisions import Cause
from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.base.job import JobError, JobPerKey, JobProgress
from server.base.problem import conflict
from server.base.study import answer_of
from server.base.worker import WorkerPool
from server.fleet.fleet import Fleet
from server.fleet.water import Water
from server.map.comparison import map_group
from server.map.decided import LEARNED_KERNELS
from server.map.event import DivesSmoothed
from server.map.field_maps import FieldMaps
from server.map.group import MapGroup
from server.map.samples import field_samples, in_moving_water, map_columns
from server.map.task import LearningProblem
from server.map.view import LearnedView

log = logging.getLogger(__name__)

LEARNER = "learning"
"""Who changed settings, where learning did."""
_LEAST_SAMPLES = 2
_SEED = 20261121


class MapLearning:
    """Learning for all maps, one at a time. Belongs to one event loop."""

    def __init__(
        self, foundation: Foundation, fleet: Fleet, maps: FieldMaps, workers: WorkerPool
    ) -> None:
        self._foundation = foundation
        self._store = foundation.store
        self._fleet = fleet
        self._maps = maps
        self._workers = workers
        self._jobs = JobPerKey[MapGroup](foundation.jobs, "map learning")
        self._learned_at: dict[tuple[Water, str], int] = {}
        """Samples of a variable that a water's map had when its kernels were last learned."""
        self._is_beginning = False
        foundation.bus.subscribe(DivesSmoothed, self._dive_ended)

    @property
    def is_busy(self) -> bool:
        """Whether kernels are being learned, or it is being decided whether to."""
        return bool(self._jobs) or self._is_beginning

    async def start(self, robot: str, variable: str, *, by: str) -> str:
        """Begin to learn; return the id of the job, the one under way if there is one.

        Raises:
            Problem: 404 for an unknown robot or map, 409 for a recording or too few samples.
            StoreError: Nothing was begun.
        """
        group = map_group(self._maps, self._fleet, robot, variable)
        if group.live is None or group.live.total < _LEAST_SAMPLES:
            raise conflict(f"The map of {robot} needs {_LEAST_SAMPLES} samples to learn from.")
        return await self._begin(robot, group, by)

    def _dive_ended(self, event: DivesSmoothed) -> None:
        """Learn in the background if a map says so and enough samples came since the last time."""
        robot = event.robot
        group = self._maps.group(robot)
        if group is None or not group.config.learning.online or self.is_busy:
            return
        self._is_beginning = True
        self._foundation.background.start(f"learn for {robot}", self._begin_if_due(robot, group))

    async def _begin_if_due(self, robot: str, group: MapGroup) -> None:
        try:
            new = await self._new_samples(robot, group)
            if new >= group.config.learning.least_new_samples:
                await self._begin(robot, group, "the station")
        except StoreError as error:
            log.warning("the kernels of %s's map are learned later: %s", robot, error)
        finally:
            self._is_beginning = False

    async def _new_samples(self, robot: str, group: MapGroup) -> int:
        """Return how many samples were taken since a map's kernels were last learned."""
        total = 0 if group.live is None else group.live.total
        key = _key(group)
        if key not in self._learned_at:
            held = await self._foundation.configurations.current("field", robot)
            learned_at = held.changed_at if held.changed_by == LEARNER else None
            new = total
            if learned_at is not None:
                new = await self._store.query(
                    lambda session: count_since(
                        session, group.robots, group.config.variable, learned_at
                    )
                )
            self._learned_at[key] = total - min(new, total)
        return total - self._learned_at[key]

    async def _begin(self, robot: str, group: MapGroup, by: str) -> str:
        if group.live is not None:
            self._learned_at[_key(group)] = group.live.total
        return await self._jobs.start(
            group, lambda progress: self._learn(robot, group, progress), by=by, robot=robot
        )

    async def _learn(self, robot: str, group: MapGroup, progress: JobProgress) -> Mapping[str, Any]:
        progress.wait_for_process()
        members = sorted(group.members | {robot})
        held = {one: await self._foundation.configurations.current("field", one) for one in members}
        for one, found in held.items():
            if self._maps.version(one) != (found.id or "preset"):
                raise JobError(f"The map of {one} is being made with other settings; learn again.")
        columns = await self._store.query(
            lambda session: map_columns(session, group.robots, group.channel, group.spans)
        )
        carrier = self._maps.carrier(group)

        def prepared() -> FieldSamples:
            samples = field_samples(columns)
            return in_moving_water(samples, group.config, carrier, group.domain)

        samples = await asyncio.to_thread(prepared)
        problem = LearningProblem(group.config, samples, _SEED)
        learned: LearnedConfig = await answer_of(
            self._foundation.decisions.make(
                LEARNED_KERNELS,
                problem,
                Cause(robot, versions={"field": held[robot].id}),
                self._workers,
                on_progress=lambda news: progress.report(*news),
            )
        )
        view = await self._keep(robot, held, group.config, learned, len(samples))
        return view.model_dump()

    async def _keep(
        self,
        robot: str,
        held: Mapping[str, CurrentConfiguration],
        asked: FieldConfig,
        found: LearnedConfig,
        samples: int,
    ) -> LearnedView:
        """Keep what was learned as new versions, in one transaction; tell the robot's.

        Raises:
            JobError: Somebody changed the settings meanwhile; nothing was kept.
        """
        patch = _difference(asked, found.config) if found.is_changed else {}
        at = self._foundation.clock.now()
        kind = find_kind("field")

        def write(session: Session) -> LearnedView:
            text = f"Learned the map of {robot} from {samples} samples: {found.message}"
            version: str | None = None
            for one, was in held.items() if patch else ():
                if current(session, kind, one).etag != was.etag:
                    raise JobError(
                        f"The settings of {one}'s map were changed meanwhile; learn again."
                    )
                value = FieldConfig.model_validate(was.value.model_dump() | patch)
                kept = query.add_configuration(
                    session, kind.key, one, value.model_dump(mode="json"), at=at, by=LEARNER
                )
                version = kept.id if one == robot else version
                add_event(
                    session,
                    at,
                    "config.changed",
                    f"{LEARNER} changed the {kind.title} settings of {one}.",
                    robot=one,
                    data={"kind": kind.key, "id": kept.id},
                )
            view = LearnedView(
                **found.model_dump(exclude={"config", "is_changed"}),
                is_changed=version is not None,
                variable=asked.variable,
                samples=samples,
                config=version,
            )
            data = view.model_dump(exclude={"is_changed", "message"})
            add_event(session, at, "map.learned", text, robot=robot, data=data)
            return view

        version = await self._store.write(write)
        for one in held if patch else ():
            self._foundation.bus.publish(SettingsChanged(kind.key, one))
        return version


def _key(group: MapGroup) -> tuple[Water, str]:
    return group.water, group.config.variable


def _difference(before: FieldConfig, after: FieldConfig) -> dict[str, Any]:
    """Return the fields that learning changed."""
    old, new = before.model_dump(), after.model_dump()
    return {name: value for name, value in new.items() if value != old[name]}
