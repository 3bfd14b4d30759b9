"""Waters: added, changed and retired, with what proposals bring."""

import re
from collections.abc import Sequence, Set
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from sqlalchemy.orm import Session

from autonomy.chart import CHARTS
from autonomy.site import Box, Site
from db.query.fleet.waters import (
    WaterChangedError,
    WaterExistsError,
    WaterInUseError,
    WaterRecord,
    add_water,
    change_water,
    get_water,
    list_waters,
    robots_of,
)
from db.query.station.events import add_event
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, conflict, unprocessable
from server.base.worker import WORKER_FAILURES
from server.water.building_task import TASK as BUILDING
from server.water.building_task import BuildOrder, Confirmed
from server.water.event import WaterChanged
from server.water.on_board_task import TASK as ON_BOARD
from server.water.proposal import FOLDER as PROPOSAL_FOLDER
from server.water.view import NewWater, WaterChanges, WaterWords

CHART_FOLDER = "water_charts"
"""In the data folder; a copy of the data needs it beside the database."""
_WORDS = (
    "name",
    "kind",
    "variable",
    "radio_under_water",
    "depth_datum",
    "tide_offset_m",
    "surface_altitude_m",
)
Kept = tuple[WaterRecord, tuple[str, ...]]
"""A water with the robots that work there."""


class Waters:
    """Every water that robots work in. Belongs to one event loop."""

    def __init__(self, foundation: Foundation) -> None:
        self._foundation = foundation
        folder = foundation.settings.data_dir
        self.proposal_folder: Path = folder / PROPOSAL_FOLDER
        self._chart_folder: Path = folder / CHART_FOLDER
        CHARTS.open(self._chart_folder)

    async def list(self) -> list[Kept]:
        """Return every water in the order in which they were added."""

        def read(session: Session) -> list[Kept]:
            robots = robots_of(session)
            return [(water, tuple(robots.get(water.id, []))) for water in list_waters(session)]

        return await self._foundation.store.query(read)

    async def get(self, water: str) -> Kept:
        """Return one water.

        Raises:
            UnknownIdError: If there is none of this id.
        """

        def read(session: Session) -> Kept:
            return get_water(session, water), tuple(robots_of(session).get(water, []))

        return await self._foundation.store.query(read)

    async def add(self, wanted: NewWater, *, by: str) -> Kept:
        """Add a water by its document, by proposals, or by both.

        Raises:
            Problem: 422 with what is wrong, 409 if its id is taken, 503 if the working process
                ended; nothing was kept.
        """
        is_new = wanted.document is None
        if wanted.document is None and not wanted.proposals:
            message = "give a document, or proposals to make one of"
            raise unprocessable("1 field is wrong.", [FieldError(loc=["document"], msg=message)])
        if wanted.document is None and wanted.name is None:
            message = "a water needs a name"
            raise unprocessable("1 field is wrong.", [FieldError(loc=["name"], msg=message)])
        site = _worded(wanted.document or blank_site(), wanted)
        site = await self._with_proposals(site, wanted, is_new=is_new)
        water = wanted.id or await self._free_id(site.name)
        at = self._foundation.clock.now()

        def write(session: Session) -> WaterRecord:
            record = add_water(session, water, site, at=at, by=by)
            text = f"{by} added the water {water} ({site.name})."
            add_event(session, at, "water.added", text, data={"water": water})
            return record

        try:
            record = await self._foundation.store.write(write)
        except WaterExistsError as error:
            raise conflict(str(error)) from error
        return self._told(record, ())

    async def change(
        self, water: str, changes: WaterChanges, *, by: str, if_match: str | None
    ) -> Kept:
        """Change a water; robots that work there get its new document.

        Raises:
            UnknownIdError: If there is none of this id.
            Problem: 412 if ``if_match`` names another version, 409 if robots work in one that is
                to be retired, 422 with what is wrong; nothing was kept.
        """
        now, _ = await self.get(water)
        if if_match is not None and if_match not in {"*", etag(now)}:
            raise _outdated(water)
        site = _worded(changes.document or now.site, changes)
        site = await self._with_proposals(site, changes, is_new=False)
        at = self._foundation.clock.now()

        def write(session: Session) -> Kept:
            # Somebody may have put a robot there while the document was made.
            robots = tuple(robots_of(session).get(water, []))
            record = change_water(
                session,
                water,
                at=at,
                site=None if site == now.site else site,
                is_retired=changes.is_retired,
                version=now.version,
            )
            verb = {None: "changed", True: "retired", False: "brought back"}[changes.is_retired]
            text = f"{by} {verb} the water {water}."
            fields = sorted(changes.model_fields_set)
            data = {"water": water, "fields": fields, "robots": list(robots)}
            add_event(session, at, "water.changed", text, data=data)
            return record, robots

        try:
            record, robots = await self._foundation.store.write(write)
        except WaterChangedError as error:
            raise _outdated(water) from error
        except WaterInUseError as error:
            raise conflict(str(error)) from error
        return self._told(record, robots)

    async def on_board(self, water: str) -> Site:
        """Return what a robot takes of a water with it: its domain, without a chart.

        Raises:
            UnknownIdError: If there is none of this id.
            Problem: 503 if it could not be worked out.
        """
        record, _ = await self.get(water)
        if record.site.chart is None:
            return record.site
        try:
            return Site.model_validate(await self._foundation.workers.run(ON_BOARD, record.site))
        except WORKER_FAILURES as error:
            raise Problem(503, f"This could not be worked out: {error}") from error

    def _told(self, record: WaterRecord, robots: tuple[str, ...]) -> Kept:
        self._foundation.bus.publish(WaterChanged(record.id, robots))
        return record, robots

    async def _with_proposals(self, site: Site, wanted: WaterWords, *, is_new: bool) -> Site:
        """Return a document with what confirmed proposals bring."""
        if not wanted.proposals:
            if wanted.depth_max_m is None:
                return site
            box = site.water.model_copy(update={"depth_max_m": wanted.depth_max_m})
            depth = min(site.domain.depth_max_m, wanted.depth_max_m)
            domain = site.domain.model_copy(update={"depth_max_m": depth})
            return site.model_copy(update={"water": box, "domain": domain})
        order = BuildOrder(
            site,
            is_new,
            wanted.depth_max_m,
            tuple(Confirmed(one.proposal, one.are_heights, one.roles) for one in wanted.proposals),
            self.proposal_folder,
            self._chart_folder,
        )
        try:
            built = await self._foundation.workers.run(BUILDING, order)
        except WORKER_FAILURES as error:
            raise Problem(503, f"This could not be worked out: {error}") from error
        if "errors" in built:
            errors = [FieldError(loc=[f["place"]], msg=f["reason"]) for f in built["errors"]]
            raise unprocessable("The files make no water; nothing was kept.", errors)
        return Site.model_validate(built["site"])

    async def _free_id(self, name: str) -> str:
        return free_water_id(name, {water.id for water, _ in await self.list()})


def free_water_id(name: str, taken: Set[str]) -> str:
    """Return an id that no water has, as near to a name as it gets."""
    stem = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:36] or "water"
    numbered = (f"{stem}-{number}" for number in range(2, len(taken) + 3))
    return next(one for one in (stem, *numbered) if one not in taken)


def etag(water: WaterRecord) -> str:
    """Return the name of a version for ``ETag`` and ``If-Match``, quotes included."""
    return f'"{water.version}"'


def _outdated(water: str) -> Problem:
    return Problem(412, f"{water} was changed meanwhile; read it again.")


def blank_site() -> Site:
    """Return the document of a water of which nothing is known yet but what files will tell."""
    box = Box(x_min_m=-1.0, x_max_m=1.0, y_min_m=-1.0, y_max_m=1.0, depth_max_m=1.0)
    return Site(
        name="Water",
        kind="sea",
        water=box,
        domain=box,
        origin_latitude_deg=0.0,
        origin_longitude_deg=0.0,
        radio_under_water=False,
        variable="chlorophyll",
    )


def _worded(site: Site, words: WaterWords) -> Site:
    """Return a document with what was said in words.

    Raises:
        Problem: 422 with what is wrong.
    """
    given = {name: getattr(words, name) for name in _WORDS}
    said: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    try:
        return Site.model_validate({**dict(site), **said})
    except ValidationError as error:
        raise unprocessable("The document is wrong.", _field_errors(error)) from error


def _field_errors(error: ValidationError) -> Sequence[FieldError]:
    return [FieldError(loc=list(one["loc"]), msg=one["msg"]) for one in error.errors()]
