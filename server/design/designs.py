"""Designs: kept with every change, compared, and made plans of."""

import asyncio
from collections.abc import Mapping
from datetime import datetime
from typing import Any

from pydantic import ValidationError
from sqlalchemy.orm import Session

from autonomy.design.document import Design
from db.query.mission import design_templates as templates
from db.query.mission import designs as query
from db.query.mission.design_templates import TemplateRecord
from db.query.mission.designs import DesignRecord, DesignVersion
from db.query.mission.plans import PlanRecord, get_plan
from db.query.station.events import add_event
from server.base.foundation import Foundation
from server.base.problem import FieldError, below, conflict, invalid, unprocessable
from server.design.moving import design_of_legs, shifted
from server.design.outline import Outline, Surroundings, lay, outline_view, patient
from server.design.surroundings import surroundings
from server.design.template import check_parameters, filled
from server.design.view import NewDesign, NewTemplate, OutlineView, TemplateParameter
from server.fleet.dependency import refuse_recording
from server.fleet.fleet import Fleet
from server.plan.document import legs_of
from server.plan.flow import PlannedCurrent
from server.plan.planning import Planning

PLAN_KIND = "design"
"""Kind of the plans that are made of designs."""
_MARKED = "designs"
_TEMPLATES = "design_templates"


class Designs:
    """Keeps designs, and makes plans of them. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet, planning: Planning) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._planning = planning

    async def of_robot(self, robot: str, *, archived: bool = False) -> list[DesignRecord]:
        """Return the designs of a robot, those that were changed last first.

        Raises:
            UnknownIdError: If there is no such robot.
        """
        return await self._foundation.store.query(
            lambda session: query.list_designs(session, robot, archived=archived)
        )

    async def count_versions(self, robot: str) -> dict[str, int]:
        """Return how many versions each design of a robot has; those without one are left out.

        Raises:
            UnknownIdError: If there is no such robot.
        """
        return await self._foundation.store.query(
            lambda session: query.count_versions(session, robot)
        )

    async def get(self, design: str) -> DesignRecord:
        """Return one design.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        return await self._foundation.store.query(lambda session: query.get_design(session, design))

    async def versions(self, design: str) -> list[DesignVersion]:
        """Return the versions of a design, the newest first.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        return await self._foundation.store.query(
            lambda session: query.list_versions(session, design)
        )

    async def version(self, design: str, number: int) -> DesignVersion:
        """Return one version of a design.

        Raises:
            UnknownIdError: If there is none of this number.
        """
        return await self._foundation.store.query(
            lambda session: query.get_version(session, design, number)
        )

    async def add(self, robot: str, wanted: NewDesign, *, by: str) -> DesignRecord:
        """Add a design.

        Raises:
            UnknownIdError: If there is no such robot, design, plan or template.
            Problem: 409 for a recording, 422 if it is to begin from two things at once, or from
                what is none.
        """
        status = self._fleet.status(robot)
        refuse_recording(status, "flies no missions")
        document, what = await self._first_document(wanted)
        at = self._foundation.clock.now()

        def write(session: Session) -> DesignRecord:
            design = query.add_design(
                session,
                robot,
                wanted.name,
                document.model_dump(mode="json"),
                water=status.record.water,
                what=what,
                at=at,
                by=by,
            )
            text = f"{by} began the design {design.id} ({design.name}): {what}."
            _log(session, design, "design.begun", text, at)
            return design

        return self._told(await self._foundation.store.write(write))

    async def change(
        self, design: str, document: Design, what: str, *, revision: int, by: str
    ) -> DesignRecord:
        """Change the working document; it is one step that can be undone.

        Raises:
            UnknownIdError: If there is none of this id.
            DesignChangedError: If its revision is another.
        """
        at = self._foundation.clock.now()
        values = document.model_dump(mode="json")
        return self._told(
            await self._foundation.store.write(
                lambda session: query.change_document(
                    session, design, values, what, revision=revision, at=at, by=by
                )
            )
        )

    async def move(self, design: str, step: int, *, revision: int, by: str) -> DesignRecord:
        """Undo (``step`` -1) or do again (1) one change.

        Raises:
            UnknownIdError: If there is none of this id.
            DesignChangedError: If its revision is another.
            Problem: 409 if there is nothing to undo or to do again.
        """
        at = self._foundation.clock.now()
        try:
            return self._told(
                await self._foundation.store.write(
                    lambda session: query.move_cursor(
                        session, design, step, revision=revision, at=at, by=by
                    )
                )
            )
        except query.NoSuchStepError as error:
            raise conflict(f"{design} has {error}.") from error

    async def save(self, design: str, comment: str, *, revision: int, by: str) -> DesignRecord:
        """Save the working document as a version.

        Raises:
            UnknownIdError: If there is none of this id.
            DesignChangedError: If its revision is another.
        """
        at = self._foundation.clock.now()

        def write(session: Session) -> DesignRecord:
            record = query.get_design(session, design)
            version = query.save_version(session, design, comment, revision=revision, at=at, by=by)
            said = f": {comment}" if comment else "."
            text = f"{by} saved version {version.number} of {design} ({record.name}){said}"
            _log(session, record, "design.saved", text, at, version=version.number)
            return record

        return self._told(await self._foundation.store.write(write))

    async def rename(
        self, design: str, *, name: str | None, is_archived: bool | None, by: str
    ) -> DesignRecord:
        """Name a design otherwise, put it away, or bring it back.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        at = self._foundation.clock.now()

        def write(session: Session) -> DesignRecord:
            record = query.rename_design(
                session, design, name=name, is_archived=is_archived, at=at, by=by
            )
            if is_archived is not None:
                verb = "put away" if is_archived else "brought back"
                text = f"{by} {verb} the design {design} ({record.name})."
                _log(session, record, "design.archived", text, at)
            return record

        return self._told(await self._foundation.store.write(write))

    async def outline(self, robot: str, document: Design) -> OutlineView:
        """Return a document laid out for a robot as it is now; nothing is kept.

        Raises:
            Problem: 404 for an unknown robot, 409 for one that flies no plans.
        """
        _, around = await self._around(robot)
        return await asyncio.to_thread(outline_view, document, around)

    async def laid(self, robot: str, document: Design) -> tuple[Outline, Surroundings]:
        """Return a document laid out for a robot, and with what.

        Raises:
            Problem: 404 for an unknown robot, 409 for one that flies no plans.
        """
        _, around = await self._around(robot)
        return await asyncio.to_thread(lay, document, around), around

    async def plan(self, design: str, number: int | None, *, by: str) -> PlanRecord:
        """Make a plan of a version; of the working document where none is named.

        Raises:
            UnknownIdError: If there is no such design or version.
            Problem: 422 with the field that keeps it from being laid out, 409 for a robot that
                flies no plans, 503 while storage fails.
            DesignChangedError: If somebody changed it in this moment.
        """
        record = await self.get(design)
        version = await self._version_to_fly(record, number, by=by)
        config_id, around = await self._around(record.robot)
        document = Design.model_validate(version.document)
        found = await asyncio.to_thread(lay, document, around)
        if found.flaw is not None:
            loc: list[str | int] = [*found.flaw[0].split(".")]
            raise unprocessable(
                f"{design} cannot be laid out.", [FieldError(loc=loc, msg=found.flaw[1])]
            )
        if not found.laid_out.legs:
            nothing = [FieldError(loc=["content"], msg="it has no legs yet")]
            raise unprocessable(f"{design} has nothing to fly.", nothing)
        cited = {"id": design, "version": version.number, "name": record.name}
        plan = await self._planning.plan_legs(
            record.robot,
            PLAN_KIND,
            PlannedCurrent(patient(found, around), around.current_text),
            config_id,
            found.laid_out.legs,
            by=by,
            document={"design": cited},
            rules=found.order,
        )
        await self._foundation.store.write(
            lambda session: query.note_plan(session, design, version.number, plan.id)
        )
        self._told(record)
        return plan

    async def add_template(self, wanted: NewTemplate, *, by: str) -> TemplateRecord:
        """Add a template.

        Raises:
            Problem: 422 with each parameter that the document does not have.
        """
        check_parameters(wanted.document, wanted.parameters)
        at = self._foundation.clock.now()
        values = wanted.document.model_dump(mode="json")
        parameters = [one.model_dump(mode="json") for one in wanted.parameters]
        record = await self._foundation.store.write(
            lambda session: templates.add_template(
                session, wanted.name, values, parameters, at=at, by=by
            )
        )
        self._foundation.feed.mark(_TEMPLATES)
        return record

    async def templates(self) -> list[TemplateRecord]:
        """Return the templates, the newest first."""
        return await self._foundation.store.query(templates.list_templates)

    async def archive_template(self, template: str) -> TemplateRecord:
        """Put a template away.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        record = await self._foundation.store.write(
            lambda session: templates.archive_template(session, template)
        )
        self._foundation.feed.mark(_TEMPLATES)
        return record

    async def _version_to_fly(
        self, record: DesignRecord, number: int | None, *, by: str
    ) -> DesignVersion:
        """Return a version, saved now where the newest is not what is being worked on."""
        if number is not None:
            return await self.version(record.id, number)
        kept = await self.versions(record.id)
        if not kept or dict(kept[0].document) != dict(record.document):
            await self.save(record.id, "", revision=record.revision, by=by)
            kept = await self.versions(record.id)
        return kept[0]

    async def _around(self, robot: str) -> tuple[str | None, Surroundings]:
        return await surroundings(self._foundation, self._fleet, self._planning, robot)

    async def _first_document(self, wanted: NewDesign) -> tuple[Design, str]:
        """Return what a design begins with, and what to say of that."""
        sources = ("document", "design", "plan", "template")
        named = [name for name in sources if getattr(wanted, name) is not None]
        if len(named) > 1:
            text = f"a design begins from one of {', '.join(sources)}, not from {len(named)}"
            raise unprocessable("1 field is wrong.", [FieldError(loc=[named[1]], msg=text)])
        if wanted.template is not None:
            return await self._from_template(wanted.template, wanted.values)
        if wanted.design is not None:
            document, what = await self._copied(wanted.design, wanted.version)
        elif wanted.plan is not None:
            document, what = await self._reopened(wanted.plan)
        else:
            document = wanted.document or Design()
            what = "as it was given" if wanted.document else "empty"
        try:
            return shifted(document, wanted.shift_north_m, wanted.shift_east_m), what
        except ValidationError as error:
            raise below(invalid(error, Design), "document") from error

    async def _copied(self, design: str, number: int | None) -> tuple[Design, str]:
        record = await self.get(design)
        values: Mapping[str, Any] = record.document
        if number is not None:
            values = (await self.version(design, number)).document
        which = design if number is None else f"version {number} of {design}"
        return Design.model_validate(values), f"a copy of {which}"

    async def _reopened(self, plan: str) -> tuple[Design, str]:
        """Return the design of a plan: what it was made of, else waypoints along its legs."""
        record = await self._foundation.store.query(lambda session: get_plan(session, plan))
        cited = record.document.get("design")
        if cited is not None:
            kept = await self.version(cited["id"], cited["version"])
            return Design.model_validate(kept.document), f"{plan} opened again"
        try:
            return design_of_legs(legs_of(record.document)), f"the surfacings of {plan}"
        except ValueError as error:
            raise unprocessable(
                f"{plan} cannot be opened as a design.", [FieldError(loc=["plan"], msg=str(error))]
            ) from error

    async def _from_template(
        self, template: str, values: Mapping[str, float]
    ) -> tuple[Design, str]:
        record = await self._foundation.store.query(
            lambda session: templates.get_template(session, template)
        )
        parameters = [TemplateParameter.model_validate(one) for one in record.parameters]
        return filled(record.document, parameters, values), f"from the template {record.name}"

    def _told(self, record: DesignRecord) -> DesignRecord:
        self._foundation.feed.mark(_MARKED, record.robot)
        return record


def _log(
    session: Session,
    design: DesignRecord,
    event: str,
    text: str,
    at: datetime,
    **data: object,
) -> None:
    data = {"design": design.id, **data}
    add_event(session, at, event, text, robot=design.robot, data=data)
