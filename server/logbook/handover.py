"""What the next watch has to know: alarms, what is overdue, open checklists, plans, batteries.

Everything is as the station knows it at one moment; what it does not know it leaves open.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Annotated, Final

from sqlalchemy.orm import Session

from db.query.mission.plans import PlanRecord, list_plans
from db.query.mission.scheduled_sends import ScheduledSend, open_scheduled_sends
from server.base.foundation import Foundation
from server.base.view import RobotLevel, View, one_of
from server.battery.battery_use import BatteryUse
from server.battery.lasting import battery_view
from server.checklist.checklists import Checklists, ListStanding
from server.fleet.fleet import Fleet
from server.fleet.panel import FleetViews
from server.lease.leases import Leases
from server.schedule.condition import condition_of, text_of

OVERDUE: Final = ("overdue", "contact")
"""Causes of alarms about robots that were to be heard by now."""
_ON_BOARD: Final = ("sent", "waiting", "on_board", "running")
_IN_WORK: Final = ("planning", "draft")


@dataclass(frozen=True, slots=True)
class OpenAlarmView(View):
    """An alarm that is not closed."""

    id: str
    robot: str | None
    level: RobotLevel
    text: str
    raised_at: datetime
    acknowledged_by: str | None
    assigned_to: str | None
    """Who looks after it; ``null`` too on a page that was signed before pages told of it."""
    is_normal_again: bool


@dataclass(frozen=True, slots=True)
class RobotStandView(View):
    """How one robot stands."""

    robot: str
    name: str
    deployment: str | None
    """Title of the one that it is in."""
    activity: str
    in_charge: str
    """Who is; empty for nobody."""
    is_overdue: bool
    next_contact: str
    """When it is expected, in words; empty where nobody knows."""
    battery: float | None
    """Part of the full battery, as it said last."""
    battery_at: datetime | None
    recover_by: datetime | None


@dataclass(frozen=True, slots=True)
class PlanStandView(View):
    """A plan that is on its way, on board, or in work ashore."""

    id: str
    robot: str
    kind: str
    standing: str
    """Its state, in words."""
    by: str


@dataclass(frozen=True, slots=True)
class OpenItemView(View):
    """An item of a checklist that is open."""

    key: str
    text: str
    """What is the matter, with what the robot told."""
    is_blocking: bool
    is_manual: bool
    """Whether a person ticks it; the robot answers the others."""


@dataclass(frozen=True, slots=True)
class OpenChecklistView(View):
    """A checklist that was begun and of which something is open."""

    id: str
    robot: str
    title: str
    standing: str
    """How it stands, in words."""
    items: list[OpenItemView]
    """Blocking ones first."""


@dataclass(frozen=True, slots=True)
class OverdueView(View):
    """Something that was to be by now and is not."""

    robot: str
    kind: Annotated[str, one_of("contact", "recovery", "daily")]
    """Of a robot that was to be heard, to be recovered, or to be looked at."""
    text: str


@dataclass(frozen=True, slots=True)
class StandView(View):
    """Everything that the next watch has to know of robots and plans."""

    alarms: list[OpenAlarmView]
    robots: list[RobotStandView]
    plans: list[PlanStandView]
    """On their way or on board."""
    drafts: list[PlanStandView]
    """In work, or waiting at the station."""
    checklists: list[OpenChecklistView] | None
    """Begun, and with something open; ``null`` on a page that was signed before pages told of
    them."""
    overdue: list[OverdueView]


async def standing(foundation: Foundation) -> StandView:
    """Return how everything stands now."""
    fleet, services = foundation.services.get(Fleet), foundation.services
    robots = [one.record.id for one in fleet.statuses if one.record.kind != "recorded"]
    alarms = [
        OpenAlarmView(
            one.id,
            one.robot,
            one.level,
            one.text,
            one.raised_at,
            one.acknowledged_by,
            one.assigned_to,
            one.cleared_at is not None,
        )
        for one in foundation.alarms.open
    ]
    late = {
        one.robot: one.text
        for one in foundation.alarms.open
        if one.cause in OVERDUE and one.cleared_at is None and one.robot is not None
    }
    views, batteries = services.get(FleetViews), services.get(BatteryUse)
    stands = [
        await _robot(foundation, views, batteries, robot, is_overdue=robot in late)
        for robot in robots
    ]

    def read(session: Session) -> tuple[list[PlanRecord], list[PlanRecord], list[ScheduledSend]]:
        return (
            list_plans(session, states=_ON_BOARD),
            list_plans(session, states=_IN_WORK),
            open_scheduled_sends(session),
        )

    plans, drafts, waiting = await foundation.store.query(read)
    lists = [
        (robot, one) for robot in robots for one in await services.get(Checklists).standing(robot)
    ]
    in_water = [(one, views.robot_view(one.robot).deployment) for one in stands]
    began_at = {one.robot: found.started_at for one, found in in_water if found is not None}
    names = {one.robot: one.name for one in stands}
    later = {one.plan: f"waits for {text_of(condition_of(one.condition))}" for one in waiting}
    return StandView(
        alarms,
        stands,
        [_plan(one) for one in plans],
        [_plan(one, later.get(one.id, "")) for one in drafts],
        [_checklist(robot, one.run.id, one) for robot, one in lists if one.run and one.open_items],
        [
            *overdue_robots(stands, late, foundation.clock.now()),
            *not_looked_at(began_at, names, lists, foundation.clock.now()),
        ],
    )


def _checklist(robot: str, run: str, one: ListStanding) -> OpenChecklistView:
    items = sorted(one.open_items, key=lambda item: not item.item.blocking)
    return OpenChecklistView(
        id=run,
        robot=robot,
        title=one.template.title,
        standing=one.words,
        items=[
            OpenItemView(
                item.item.key, item.words_if_open, item.item.blocking, item.item.kind == "manual"
            )
            for item in items
        ],
    )


def overdue_robots(
    stands: Sequence[RobotStandView], late: Mapping[str, str], now: datetime
) -> Iterator[OverdueView]:
    """Return robots that were to be heard, or to be recovered, by now."""
    for one in stands:
        if one.is_overdue:
            yield OverdueView(one.robot, "contact", late[one.robot])
        if one.deployment and one.recover_by is not None and one.recover_by < now:
            text = f"{one.name} was to be recovered by {one.recover_by:%Y-%m-%d %H:%MZ}."
            yield OverdueView(one.robot, "recovery", text)


def not_looked_at(
    began_at: Mapping[str, datetime],
    names: Mapping[str, str],
    lists: Sequence[tuple[str, ListStanding]],
    now: datetime,
) -> Iterator[OverdueView]:
    """Return daily lists of robots in the water that nobody began within their time.

    A robot that is in the water for less than that time is not overdue yet.

    Args:
        began_at: Begin of the deployment of each robot that is in one.
        names: Their names.
        lists: Every list of each robot.
        now: This moment.
    """
    for robot, one in lists:
        if one.run is not None or one.template.act != "daily" or robot not in began_at:
            continue
        valid_h = one.template.valid_h
        if valid_h and now - began_at[robot] < timedelta(hours=valid_h):
            continue
        hours = f" within the last {valid_h:g} h" if valid_h else ""
        text = f"{one.template.title} of {names[robot]}: nobody began it{hours}."
        yield OverdueView(robot, "daily", text)


async def _robot(
    foundation: Foundation,
    views: FleetViews,
    batteries: BatteryUse,
    robot: str,
    *,
    is_overdue: bool,
) -> RobotStandView:
    view, battery = views.robot_view(robot), await batteries.of(robot)
    told = None if battery is None else battery_view(robot, battery, foundation.clock.now())
    return RobotStandView(
        robot=robot,
        name=view.name,
        deployment=None if view.deployment is None else view.deployment.name,
        activity=view.activity,
        in_charge=foundation.services.get(Leases).of(robot).holder or "",
        is_overdue=is_overdue,
        next_contact="" if view.next_contact is None else view.next_contact.text,
        battery=None if told is None else told.left,
        battery_at=None if told is None else told.measured_at,
        recover_by=None if told is None or told.recover_by is None else told.recover_by.at,
    )


def _plan(plan: PlanRecord, more: str = "") -> PlanStandView:
    words = plan.state.replace("_", " ")
    standing = f"{words}, {more}" if more else words
    return PlanStandView(plan.id, plan.robot, plan.kind, standing, plan.created_by)
