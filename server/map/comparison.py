"""Comparisons: all field models on the samples of one map, side by side with their scores."""

import asyncio
from dataclasses import asdict
from datetime import datetime
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray
from autonomy.field.carriage import Carrier
from autonomy.field.grid import grid_of
from autonomy.field.score import Scores
from db.column import moment
from db.query.measured.samples import SampleColumns
from db.query.station.events import add_event
from server.base.decision.decisions import Cause
from server.base.foundation import Foundation
from server.base.job import JobError, JobPerKey, JobProgress
from server.base.problem import conflict, not_found
from server.base.study import answer_of
from server.base.worker import WorkerPool
from server.fleet.fleet import Fleet
from server.map.decided import COMPARED_MODELS
from server.map.field_maps import FieldMaps
from server.map.field_model import MODEL_TITLES
from server.map.group import MapGroup
from server.map.record import Comparison, axes_of, comparison_arrays, keep_comparison
from server.map.samples import field_samples, in_moving_water, map_columns, usable
from server.map.seen import places_seen
from server.map.site_map import basis_of, view_on_grid
from server.map.task import Compared, ComparisonProblem
from server.map.view import (
    AxesView,
    ComparedModelScores,
    ComparedModelView,
    ComparedSamples,
    ComparedView,
    KeptComparison,
    MapComparisonView,
)


class MapComparisons:
    """Comparisons of all maps. Belongs to one event loop."""

    def __init__(
        self, foundation: Foundation, fleet: Fleet, maps: FieldMaps, workers: WorkerPool
    ) -> None:
        self._foundation = foundation
        self._store = foundation.store
        self._fleet = fleet
        self._maps = maps
        self._workers = workers
        self._jobs = JobPerKey[MapGroup](foundation.jobs, "map comparison")

    async def start(self, robot: str, variable: str, *, by: str) -> str:
        """Begin to compare; return the id of the job, the one under way if there is one.

        Raises:
            Problem: 404 for an unknown robot or map, 409 for a recording or a map of no sample.
            StoreError: Nothing was begun.
        """
        group = map_group(self._maps, self._fleet, robot, variable)
        if group.live is None or not group.live.total:
            raise conflict(f"The map of {robot} has no sample yet; compare when it has some.")
        return await self._jobs.start(
            group, lambda progress: self._compare(robot, group, progress, by), by=by, robot=robot
        )

    def view(self, robot: str, variable: str) -> MapComparisonView:
        """Return the newest comparison of a map, and whether there is one under way.

        Raises:
            Problem: 404 for an unknown robot or map, 409 for a recording.
        """
        group = map_group(self._maps, self._fleet, robot, variable)
        kept = group.comparison
        found = ComparedSamples() if kept is None else kept.found
        job = self._jobs.get(group)
        state = "none" if kept is None else "ready"
        return MapComparisonView(
            state=state if job is None else "working",
            job=job,
            compared_at=None if kept is None else kept.compared_at,
            is_outdated=kept is not None and kept.found.basis != group.basis,
            models=[]
            if kept is None
            else [
                ComparedModelView(
                    title=MODEL_TITLES[one.model],
                    is_default=one.model == group.config.model,
                    **one.model_dump(),
                )
                for one in kept.found.models
            ],
            **found.model_dump(include=set(ComparedSamples.model_fields)),
        )

    async def _compare(
        self, robot: str, group: MapGroup, progress: JobProgress, by: str
    ) -> dict[str, Any]:
        progress.wait_for_process()

        def read(session: Session) -> tuple[SampleColumns, FloatArray]:
            found = usable(map_columns(session, group.robots, group.channel, group.spans))
            return found, places_seen(session, group.robots, found)

        columns, seen = await self._store.query(read)
        carrier = self._maps.carrier(group)
        problem = await asyncio.to_thread(_problem, group, columns, seen, carrier)
        found: Compared = await answer_of(
            self._foundation.decisions.make(
                COMPARED_MODELS,
                problem,
                Cause(robot, versions={"field": self._maps.version(robot)}),
                self._workers,
                on_progress=lambda news: progress.report(*news),
            )
        )
        if not found.models:
            raise JobError(f"No model could be made of the samples. {found.message}")
        comparison = _comparison(group, problem, columns, found, self._foundation.clock.now())
        arrays = await asyncio.to_thread(comparison_arrays, comparison)
        data = ComparedView(
            variable=group.config.variable,
            samples=comparison.found.samples,
            against=comparison.found.against,
        ).model_dump()

        def keep(session: Session) -> None:
            keep_comparison(session, robot, group.config.variable, comparison, arrays, by)
            text = f"The field models of {robot} were compared on {data['samples']} samples."
            event = {name: data[name] for name in ("variable", "against")}
            add_event(
                session, comparison.compared_at, "map.compared", text, robot=robot, data=event
            )

        await self._store.write(keep)
        self._maps.set_comparison(robot, comparison)
        return data


def map_group(maps: FieldMaps, fleet: Fleet, robot: str, variable: str) -> MapGroup:
    """Return the live map of a robot's variable.

    Raises:
        Problem: 404 for an unknown robot or map, 409 for a recording.
    """
    if fleet.status(robot).record.kind == "recorded":
        raise conflict(f"{robot} is a recording, whose map was fitted when it was imported.")
    group = maps.group(robot)
    if group is None:
        raise not_found(f"The map of {robot} is still being made.")
    if group.config.variable != variable:
        raise not_found(f"There is no such map of {robot}; there is {group.config.variable}.")
    return group


def _problem(
    group: MapGroup, columns: SampleColumns, seen: FloatArray, carrier: Carrier | None
) -> ComparisonProblem:
    """Return the problem; a map that is carried along with the water has no other places."""
    samples = field_samples(columns)
    is_placed = group.config.carriage == "still" and bool(np.isfinite(seen).any())
    return ComparisonProblem(
        field=group.config,
        domain=group.domain,
        site=group.site,
        samples=in_moving_water(samples, group.config, carrier, group.domain),
        is_simulated=group.is_simulated,
        places_seen=seen if is_placed else None,
    )


def _comparison(
    group: MapGroup,
    problem: ComparisonProblem,
    columns: SampleColumns,
    found: Compared,
    at: datetime,
) -> Comparison:
    """Return what a worker found as it is shown, about the samples that the worker was given."""
    config, domain = problem.field, problem.domain
    grid = grid_of(config, domain, group.site)
    good = usable(columns)
    smoothed = int(good.is_smoothed.sum())
    updated_at = moment(int(good.measured_at_us[-1])) if len(good) else None
    views = {
        (config.variable, one.model): view_on_grid(
            config.model_copy(update={"model": one.model}),
            group.channel,
            grid,
            one.mean,
            one.std,
            samples_per_level=found.samples_per_level,
            version=round(at.timestamp() * 1e6),
            updated_at=updated_at,
        )
        for one in found.models
        if one.mean is not None and one.std is not None
    }
    first = next(iter(views.values()))
    return Comparison(
        at,
        KeptComparison(
            samples=len(good),
            against=found.against,
            message=found.message,
            basis=basis_of(config, domain, len(good), smoothed),
            models=[
                ComparedModelScores(
                    model=one.model,
                    log_marginal_likelihood=one.log_marginal_likelihood,
                    **_scores(one.scores),
                )
                for one in found.models
            ],
            axes=AxesView(**axes_of(first)),
            samples_per_level=list(first.samples_per_level),
            updated_at=first.updated_at,
            scale=first.variable.scale,
        ),
        views,
    )


def _scores(scores: Scores | None) -> dict[str, float]:
    if scores is None:
        return {}
    known = asdict(scores)
    return {"coverage": known.pop("coverage_90"), **known}
