"""Transfers: what one would cost, sending a plan, and how far it is on its way."""

from dataclasses import replace
from typing import Annotated, Literal

from fastapi import APIRouter, Depends
from pydantic import Field

from db.query.mission.plans import ENDED_STATES
from server.access.dependency import PilotInCharge, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.view import Body
from server.base.work.changes import WaitingDep
from server.base.work.started import Started, StartedView
from server.checklist.gate import Overrule
from server.fleet.link_view import SatelliteQuoteView
from server.plan.ledger import PlanLedger
from server.plan.view import PlanView, TransferView
from server.transfer.transfers import LinkRequest, Transfers

router = APIRouter(prefix="/api", tags=["transfers"], route_class=IdempotentRoute)

PlanLedgerDep = Annotated[PlanLedger, Depends(service(PlanLedger))]
TransfersDep = Annotated[Transfers, Depends(service(Transfers))]


class UploadRequest(Body):
    """How a plan is to be brought on board."""

    start: bool = False
    """Whether the robot is told to fly it as soon as it is on board."""
    confirmed: bool = False
    """Whether to send a plan although it was made for another place or time; see `check`."""
    route: Literal["auto", "radio", "satellite"] = "auto"
    """The link that it is to take; ``auto`` is what the robot's settings say."""
    force: bool = False
    """Whether to send it by satellite although the robot was not heard for long."""
    overrule: Annotated[str, Field(max_length=500)] = ""
    """Why it is to start although a checklist that the robot's settings require is not complete;
    logged, and shown at the plan. Without it 409 lists what is open."""


@router.get("/plans/{plan}", tags=["plans"])
async def get_plan(
    caller: Viewer,
    plan: str,
    ledger: PlanLedgerDep,
    transfers: TransfersDep,
    waiting: WaitingDep,
) -> PlanView:
    """Return a plan: its legs, its account, what it breaks, and where it is on its way."""
    del caller

    async def look() -> PlanView:
        view = ledger.view(await ledger.get(plan))
        return replace(view, transfer=await transfers.view_of_plan(plan))

    return await waiting.told(plan, look, has_ended=lambda one: one.state in ENDED_STATES)


@router.get("/plans/{plan}/satellite", tags=["plans"])
async def quote_plan(caller: Viewer, plan: str, transfers: TransfersDep) -> SatelliteQuoteView:
    """Return what the plan would cost by satellite: bytes, messages, credits, price; sends nothing.

    The bytes of each message are those that are sent.
    """
    del caller
    return await transfers.quote(plan)


@router.post("/plans/{plan}/upload", status_code=202, tags=["plans"])
async def upload_plan(
    caller: PilotInCharge,
    plan: str,
    transfers: TransfersDep,
    started: Started,
    body: UploadRequest | None = None,
) -> StartedView:
    """Bring a draft on board; 409 lists each limit that it breaks, or why it is outdated.

    The robot's old plan stays until the new one is whole and proved by its hash. While one is
    flown, the new one waits on board behind it; with `start` it begins at the next surfacing.
    """
    wanted = body or UploadRequest()
    reason = wanted.overrule.strip()
    transfer = await transfers.send(
        plan,
        start=wanted.start,
        confirmed=wanted.confirmed,
        request=LinkRequest(wanted.route, wanted.force),
        may_wait=True,
        overrule=Overrule(reason, caller.name) if reason else None,
    )
    return started(transfer)


@router.get("/transfers/{transfer}")
async def get_transfer(
    caller: Viewer, transfer: str, transfers: TransfersDep, waiting: WaitingDep
) -> TransferView:
    """Return a transfer: its parts, the level that is proved, and what it has cost."""
    del caller
    return await waiting.told(
        transfer,
        lambda: transfers.view(transfer),
        has_ended=lambda one: one.ended_at is not None,
    )


@router.post("/transfers/{transfer}/withdraw")
async def withdraw_transfer(
    caller: PilotInCharge, transfer: str, transfers: TransfersDep
) -> TransferView:
    """Withdraw a transfer that has not arrived; what a gateway took may still reach the robot."""
    return await transfers.withdraw_transfer(transfer, by=caller.name)
