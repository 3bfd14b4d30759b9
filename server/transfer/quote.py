"""What sending a plan by satellite takes, said before anything is sent."""

from dataclasses import dataclass
from datetime import datetime
from typing import Final

from db.query.mission.plans import PlanRecord
from robot_link.satellite.blob import Blob
from robot_link.satellite.chunk import sizes
from robot_link.satellite.config import Tariff
from robot_link.satellite.cost import credits, quote
from server.base.foundation import Foundation
from server.base.problem import conflict
from server.fleet.link_view import (
    AutoRouteView,
    SatelliteMessageCostView,
    SatelliteQuoteView,
)
from server.fleet.routing import LinkChoice
from server.fleet.status import RobotStatus
from server.fleet.words import carrier_title, clock_time
from server.plan.document import mission_of
from server.satellite.budget import Budget, budget_of
from server.satellite.satellite import Satellite

_PLANNED: Final = ("draft", "sent", "on_board", "running")


@dataclass(frozen=True, slots=True)
class Circumstances:
    """What a quote depends on beside the plan."""

    status: RobotStatus
    tariff: Tariff
    budget: Budget
    choice: LinkChoice
    """The link that "auto" would take."""
    carrier: str | None
    """The gateway; ``None`` without a satellite link that is plugged in."""
    link_fault: str
    """Why no satellite link can be used; empty if one can."""
    obstacle: str
    """Why only a person who insists may send."""
    now: datetime


async def quote_of(
    plan: PlanRecord, status: RobotStatus, satellite: Satellite, foundation: Foundation
) -> SatelliteQuoteView:
    """Return what a plan would cost, and what speaks against sending it by satellite.

    Raises:
        Problem: 409 if there is nothing to send yet, or it is too long for satellite.
    """
    if plan.state not in _PLANNED or "settings" not in plan.document:
        raise conflict(f"{plan.id} is {plan.state}; there is nothing to send.")
    robot, now = plan.robot, foundation.clock.now()
    tariff, modem = satellite.settings(robot).satellite.tariff, satellite.modem(robot)
    given = Circumstances(
        status=status,
        tariff=tariff,
        budget=await foundation.store.query(lambda s: budget_of(s, robot, tariff, now)),
        choice=satellite.choice(robot, "plan"),
        carrier=None if modem is None else modem.carrier,
        link_fault=satellite.choice(robot, "plan", "satellite").reason,
        obstacle=satellite.obstacle(robot),
        now=now,
    )
    try:
        return quote_view(plan, given)
    except ValueError as error:
        raise conflict(f"{plan.id} cannot go by satellite: {error}.") from error


def quote_view(plan: PlanRecord, given: Circumstances) -> SatelliteQuoteView:
    """Return what a plan costs by satellite, and what speaks against sending it.

    Raises:
        ValueError: If the plan has no mission yet, or one that is too long for satellite.
    """
    blob = Blob.of(mission_of(plan))
    messages = sizes(blob)
    cost = quote(messages, given.tariff)
    refusal = _refusal(plan, messages, given)
    return SatelliteQuoteView(
        sha256=plan.sha256 or blob.plan,
        bytes=len(blob.packed),
        messages=[
            SatelliteMessageCostView(index, size, credits(size, given.tariff))
            for index, size in enumerate(messages)
        ],
        credits=cost.credits,
        price=round(cost.price, 4),
        currency=given.tariff.currency,
        credits_left_today=given.budget.left,
        credits_per_day=given.budget.per_day,
        earliest_delivery_at=_earliest(given),
        text=_text(plan, cost.messages, cost.credits, given),
        refusal=refusal or given.obstacle or None,
        may_force=not refusal and bool(given.obstacle),
        auto=AutoRouteView(
            "satellite" if "satellite" in given.choice.links else "radio", given.choice.reason
        ),
    )


def _refusal(plan: PlanRecord, messages: tuple[int, ...], given: Circumstances) -> str:
    if given.carrier is None:
        return given.link_fault
    if plan.state not in ("draft", "on_board"):
        return f"{plan.id} is {plan.state.replace('_', ' ')}; only a draft can be sent."
    largest = max(credits(size, given.tariff) for size in messages)
    if largest > given.budget.per_day:
        return (
            f"One message needs {largest} credits; the budget of {plan.robot} is "
            f"{given.budget.per_day} a day."
        )
    return ""


def _earliest(given: Circumstances) -> datetime | None:
    """Return when the robot calls next; a call that is overdue says nothing of the next."""
    known = given.status.satellite
    due = None if known is None else known.next_session_at
    return due if due is not None and due > given.now else None


def _text(plan: PlanRecord, messages: int, cost: int, given: Circumstances) -> str:
    what = f"{messages} message{'s' * (messages != 1)}, {cost} credits"
    by = "satellite" if given.carrier is None else carrier_title(given.carrier)
    due = _earliest(given)
    when = (
        f"; {plan.robot} calls next about {clock_time(due)}"
        if due is not None
        else f"; nobody knows when {plan.robot} calls next"
    )
    left = given.budget.left
    short = f" Only {left} credits are left today; the rest goes at 00:00Z." if cost > left else ""
    return f"{what} by {by}{when}.{short} A part that is lost is sent and charged again."
