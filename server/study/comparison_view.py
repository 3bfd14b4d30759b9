"""Which what-if run each robot's 3D view shows, and what it draws of it."""

import logging

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.result import Result
from autonomy.whatif.result import ComparisonResult, Track
from db.query.mission import studies as query
from db.store import Store
from server.base.problem import Problem, conflict, not_found
from server.base.study import study_as
from server.fleet.fleet import Fleet
from webui.scene.source import ComparisonTrack, ComparisonView

log = logging.getLogger(__name__)

Position = tuple[float, float, float]


class _ShownRun(Result):
    id: str
    robot: str
    title: str
    result: ComparisonResult
    origin_ned: Position


class ShownWhatIfs:
    """At most one what-if run for each robot; remembered over a restart.

    Belongs to one event loop; ``view`` may be called from any thread.
    """

    def __init__(self, store: Store, fleet: Fleet) -> None:
        self._store = store
        self._fleet = fleet
        self._views: dict[str, ComparisonView] = {}
        self._ids: dict[str, str] = {}

    async def load(self) -> None:
        """Take up what was shown when the station stopped."""
        for record in await self._store.query(lambda s: query.used_studies(s, "whatif")):
            try:
                self._take(study_as(_ShownRun, record))
            except Problem as problem:
                log.warning("%s", problem.detail)

    async def show(self, robot: str, whatif: str | None) -> None:
        """Show a run, beginning where the robot is now, or none.

        Raises:
            Problem: 404 for an unknown robot or run, 409 for a run without a result.
            StoreError: What was shown stays.
        """
        state = self._fleet.status(robot).state
        origin = (0.0, 0.0, 0.0) if state is None else state.position_ned
        if whatif is None:
            await self._store.write(lambda s: query.use_only_study(s, "whatif", robot, None, None))
            self._views.pop(robot, None)
            self._ids.pop(robot, None)
            return
        record = await self._store.query(lambda s: query.get_study(s, "whatif", whatif))
        if record.robot != robot:
            raise not_found(f"There is no {whatif} of {robot}.")
        if record.result is None:
            raise conflict(f"{whatif} is {record.state}; it has nothing to show.")
        run = study_as(_ShownRun, record, origin_ned=origin)
        use = {"origin_ned": list(origin)}
        await self._store.write(lambda s: query.use_only_study(s, "whatif", robot, whatif, use))
        self._take(run)

    def view(self, robot: str) -> ComparisonView | None:
        """Return what to draw for a robot; the same object while it is the same run and place."""
        return self._views.get(robot)

    def id_of(self, robot: str) -> str | None:
        """Return the id of the run that is shown for a robot."""
        return self._ids.get(robot)

    def _take(self, run: _ShownRun) -> None:
        self._views[run.robot] = _comparison_view(run)
        self._ids[run.robot] = run.id


def _comparison_view(run: _ShownRun) -> ComparisonView:
    """Return the tracks of a run in the site's frame.

    North and east begin at its origin; depth is the run's own, for it begins at the surface.
    """
    origin = run.origin_ned
    return ComparisonView(
        version=f"{run.id} {origin[0]:.2f} {origin[1]:.2f}",
        title=run.title,
        reference_ned=_points(run.result.reference, origin),
        runs=tuple(ComparisonTrack(one.title, _points(one, origin)) for one in run.result.runs),
    )


def _points(track: Track, origin: Position) -> FloatArray:
    """Return the finite points of a track, shape ``(n, 3)``, m."""
    columns = [track.north_m, track.east_m, track.depth_m]
    points = np.array(columns, dtype=np.float64).T + np.array([origin[0], origin[1], 0.0])
    return points[np.isfinite(points).all(axis=1)]
