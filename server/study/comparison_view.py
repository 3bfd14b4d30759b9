"""Which what-if run each robot's 3D view shows, and what it draws of it."""

import numpy as np

from autonomy.arrays import FloatArray
from db.query import whatifs as query
from db.query.whatifs import Position, WhatIfRecord
from db.store import Store
from server.base.problem import conflict, not_found
from server.fleet.fleet import Fleet
from server.study.task import Document
from webui.scene.source import ComparisonTrack, ComparisonView


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
        for record in await self._store.query(query.shown_whatifs):
            if record.shown_from is not None:
                self._take(record, record.shown_from)

    async def show(self, robot: str, whatif: str | None) -> None:
        """Show a run, beginning where the robot is now, or none.

        Raises:
            Problem: 404 for an unknown robot or run, 409 for a run without a result.
            StoreError: What was shown stays.
        """
        state = self._fleet.status(robot).state
        origin = (0.0, 0.0, 0.0) if state is None else state.position_ned
        if whatif is None:
            await self._store.write(lambda session: query.show_whatif(session, robot, None, None))
            self._views.pop(robot, None)
            self._ids.pop(robot, None)
            return
        record = await self._store.query(lambda session: query.get_whatif(session, whatif))
        if record.robot != robot:
            raise not_found(f"There is no {whatif} of {robot}.")
        if record.result is None:
            raise conflict(f"{whatif} is {record.state}; it has nothing to show.")
        await self._store.write(lambda session: query.show_whatif(session, robot, whatif, origin))
        self._take(record, origin)

    def view(self, robot: str) -> ComparisonView | None:
        """Return what to draw for a robot; the same object while it is the same run and place."""
        return self._views.get(robot)

    def id_of(self, robot: str) -> str | None:
        """Return the id of the run that is shown for a robot."""
        return self._ids.get(robot)

    def _take(self, record: WhatIfRecord, origin: Position) -> None:
        if record.result is not None:
            self._views[record.robot] = comparison_view(record, record.result, origin)
            self._ids[record.robot] = record.id


def comparison_view(record: WhatIfRecord, result: Document, origin: Position) -> ComparisonView:
    """Return the tracks of a run in the site's frame.

    North and east begin at ``origin``; depth is the run's own, for it begins at the surface.
    """
    return ComparisonView(
        version=f"{record.id} {origin[0]:.2f} {origin[1]:.2f}",
        title=record.title,
        reference_ned=_track(result["reference"], origin),
        runs=tuple(ComparisonTrack(run["title"], _track(run, origin)) for run in result["runs"]),
    )


def _track(document: Document, origin: Position) -> FloatArray:
    """Return the finite points of a track, shape ``(n, 3)``, m."""
    columns = [document["north_m"], document["east_m"], document["depth_m"]]
    points = np.array(columns, dtype=np.float64).T + np.array([origin[0], origin[1], 0.0])
    return points[np.isfinite(points).all(axis=1)]
