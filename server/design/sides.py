"""What a design is compared with: its versions, plans, and what is on board."""

from dataclasses import dataclass

from autonomy.design.document import Design
from autonomy.planner.plan import Leg
from db.query.mission.plans import PlanRecord, get_plan, plan_by_hash
from server.base.foundation import Foundation
from server.base.problem import FieldError, conflict, unprocessable
from server.design.designs import Designs
from server.design.difference import field_changes, leg_changes
from server.design.outline import leg_views
from server.design.view import DifferenceView
from server.fleet.fleet import Fleet
from server.plan.document import legs_of


@dataclass(frozen=True, slots=True)
class Side:
    """One of two things that are compared."""

    title: str
    document: Design | None
    """None of a plan that was not made of a design."""
    legs: tuple[Leg, ...]
    waypoints: tuple[int, ...] | None
    has_legs: bool = True
    """Whether they could be laid out; if not, the title says why."""


class Sides:
    """Compares designs. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet, designs: Designs) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._designs = designs

    async def difference(self, design: str, first: str, second: str) -> DifferenceView:
        """Return how two sides differ.

        Raises:
            UnknownIdError: If there is no such design, version or plan.
            Problem: 422 for a side that is none, 409 if nothing is known to be on board.
        """
        return _compared(
            await self._side(design, first, "first"), await self._side(design, second, "second")
        )

    async def difference_with(self, design: str, document: Design) -> DifferenceView:
        """Return how a document differs from the working one, which is the first.

        Raises:
            UnknownIdError: If there is no such design.
        """
        record = await self._designs.get(design)
        working = await self._side(design, "working", "first")
        return _compared(working, await self._drawn(record.robot, "yours", document))

    async def _side(self, design: str, name: str, field: str) -> Side:
        kind, _, which = name.partition(":")
        record = await self._designs.get(design)
        if kind == "working" and not which:
            document = Design.model_validate(record.document)
            return await self._drawn(record.robot, "the working document", document)
        if kind == "version" and which.isascii() and which.isdigit() and len(which) < 10:
            version = await self._designs.version(design, int(which))
            document = Design.model_validate(version.document)
            return await self._drawn(record.robot, f"version {which}", document)
        if kind == "plan" and which:
            plan = await self._foundation.store.query(lambda session: get_plan(session, which))
            return await self._flown(which, plan)
        if kind == "on_board" and not which:
            return await self._on_board(record.robot)
        text = f"{name!r} is no side: say working, version:3, plan:plan-12 or on_board"
        raise unprocessable("1 field is wrong.", [FieldError(loc=[field], msg=text)])

    async def _drawn(self, robot: str, title: str, document: Design) -> Side:
        found, _ = await self._designs.laid(robot, document)
        if found.flaw is not None:
            title += ", which cannot be laid out: " + " ".join(found.flaw)
        legs, waypoints = tuple(found.laid_out.legs), tuple(found.laid_out.waypoint)
        return Side(title, document, legs, waypoints, has_legs=found.flaw is None)

    async def _flown(self, title: str, plan: PlanRecord) -> Side:
        document, cited = None, plan.document.get("design")
        if cited is not None:
            version = await self._designs.version(cited["id"], cited["version"])
            document = Design.model_validate(version.document)
        return Side(title, document, legs_of(plan.document), None)

    async def _on_board(self, robot: str) -> Side:
        """Return the plan that the robot said it has, by the hash that it echoed."""
        report = self._fleet.status(robot).plan_report
        sha256 = None if report is None else report.sha256
        if not sha256:
            raise conflict(f"{robot} has not said that it has a plan on board.")
        plan = await self._foundation.store.query(
            lambda session: plan_by_hash(session, robot, sha256)
        )
        if plan is None:
            raise conflict(f"{robot} has a plan on board that this station does not know.")
        return await self._flown(f"{plan.id}, on board", plan)


def _compared(first: Side, second: Side) -> DifferenceView:
    one, other = (leg_views(side.legs, side.waypoints) for side in (first, second))
    changes = (
        field_changes(first.document, second.document)
        if first.document is not None and second.document is not None
        else []
    )
    return DifferenceView(
        first=first.title,
        second=second.title,
        fields=changes,
        legs=leg_changes(one, other) if first.has_legs and second.has_legs else [],
        first_legs=one,
        second_legs=other,
    )
