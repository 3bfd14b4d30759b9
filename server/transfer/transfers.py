"""Bringing plans on board: nothing is shown before the robot proved it, and nothing is lost.

A transfer is a row before the first byte leaves. It survives a restart of the station: what the
robot says of the plan on board decides how it goes on, so a plan that arrived while nobody listened
is not sent again, and one that did not is.
"""

import asyncio
import logging
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import Final

from sqlalchemy.orm import Session

from db.fault import StoreError
from db.query.mission import transfers as query
from db.query.mission.plans import ENDED_STATES, PlanRecord, get_plan
from db.query.mission.transfers import TransferRecord
from db.query.station.events import add_event
from robot_link.mavlink.mission_item import item_count
from robot_link.messages import RobotId, UploadReport
from server.base.problem import FieldError, conflict
from server.checklist.gate import Overrule, Pass, StartGate
from server.command.commands import Check
from server.command.state import CommandChanged
from server.fleet.link_view import SatelliteQuoteView
from server.fleet.routing import RequestedLink
from server.plan.document import mission_of
from server.plan.drafting import SENDABLE, broken_off, outdated_by
from server.plan.state import note as note_plan
from server.plan.view import TransferView
from server.satellite.satellite import OutboxChanged
from server.transfer.machine import TransferMachine, TransferServices
from server.transfer.plan_row import PlanRows
from server.transfer.quote import quote_of
from server.transfer.state import (
    TransferChanged,
    TransferEvidence,
    TransferFailed,
    close_all,
)
from server.transfer.view import transfer_of_plan, transfer_view
from server.transfer.withdrawal_row import WithdrawalRows, begin_withdrawal

_SENDABLE = (*SENDABLE, "waiting")
"""One that waits on board is only started."""
_NAMED_MAX = 3
"""Limits that a refusal names; the others are in its list."""
_NOTICE_S = 2.0
log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class LinkRequest:
    """What the operator says about the link of one transfer."""

    link: RequestedLink = "auto"
    is_forced: bool = False
    """Whether it is sent by satellite although the robot was not heard for long."""


ANY_LINK: Final = LinkRequest()


class Transfers:
    """Transfers under way. Belongs to one event loop."""

    def __init__(self, services: TransferServices, gate: StartGate) -> None:
        self._services = services
        self._foundation = services.foundation
        self._store = services.foundation.store
        self._clock = services.foundation.clock
        self._bus = services.foundation.bus
        self._fleet = services.fleet
        self._ledger = services.ledger
        self._satellite = services.satellite
        self._gate = gate
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._machines: dict[str, TransferMachine] = {}
        """What is under way to each robot."""
        self._asking: dict[str, asyncio.Lock] = defaultdict(asyncio.Lock)
        self._changed: dict[str, None] = {}
        """Transfers that are to be shown, in order."""
        self._has_changed = asyncio.Event()
        services.satellite.kinds.register(PlanRows(begin_withdrawal))
        services.satellite.kinds.register(WithdrawalRows())
        self._bus.subscribe(OutboxChanged, self._row_changed)
        self._bus.subscribe(CommandChanged, self._command_changed)

    async def resume(self) -> None:
        """Go on with the transfers that were under way when the station stopped."""
        for transfer in await self._store.query(query.open_transfers):
            if self._fleet.knows(transfer.robot):
                self._begin(transfer, is_new=False)

    async def run(self) -> None:
        """Show transfers as they change, until cancelled."""
        while True:
            await self._has_changed.wait()
            self._has_changed.clear()
            changed, self._changed = self._changed, {}
            for transfer in changed:
                await self._show(transfer)

    async def _show(self, transfer: str) -> None:
        try:
            view = await self.view(transfer)
            self._ledger.set_transfer(await self._ledger.get(view.plan_id), view)
        except StoreError as error:
            log.warning("%s is not shown: %s", transfer, error)
        else:
            self._bus.publish(TransferChanged(view))

    def _note_change(self, transfer: str) -> None:
        self._changed[transfer] = None
        self._has_changed.set()

    def robot_changed(self, robot: str) -> None:
        """Take that a robot said something, or that a link to it changed."""
        machine = self._machines.get(robot)
        if machine is not None:
            machine.wake()

    def take_upload(self, report: UploadReport) -> None:
        """Take how far the link is with an upload."""
        machine = self._machines.get(report.robot)
        if machine is not None:
            machine.take_upload(report)

    def _row_changed(self, event: OutboxChanged) -> None:
        transfer = event.row.transfer
        if transfer is None:
            return
        machine = self._machines.get(event.row.robot)
        if machine is not None and machine.transfer.id == transfer:
            machine.take_row(event.row)
        self._note_change(transfer)

    def _command_changed(self, event: CommandChanged) -> None:
        machine = self._machines.get(event.command.robot)
        if machine is not None:
            machine.take_command(event.command)

    async def stop(self) -> None:
        """Let go of every transfer; they go on when the station starts again."""
        tasks = list(self._tasks.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def is_under_way(self, robot: str) -> bool:
        """Tell whether a plan is on its way to a robot."""
        return robot in self._machines

    async def send(
        self,
        plan: str,
        *,
        start: bool,
        check: Check | None = None,
        confirmed: bool = False,
        request: LinkRequest = ANY_LINK,
        may_wait: bool = False,
        overrule: Overrule | None = None,
        goes_on: bool = False,
    ) -> str:
        """Begin to bring a plan on board and return the transfer's id.

        It takes the place of one that is on its way to the same robot by satellite, which would
        else hold everything up for days.

        Args:
            plan: Id of the plan.
            start: Whether the robot is told to fly it as soon as it is on board.
            check: Asked in the transaction; what it raises keeps the transfer from beginning.
            confirmed: Whether a person wants it flown although it no longer fits the robot, or its
                dry run broke off.
            request: The link that it is to take, and whether a person insists on it.
            may_wait: Whether it may wait on board behind a plan that the robot flies; else it is
                refused while one is flown.
            overrule: A person's word that it shall start although a checklist is not complete.
            goes_on: Whether it goes on with a mission that was started, which no checklist stops.

        Raises:
            UnknownIdError: If there is no such plan.
            Problem: 409 if the plan is not one that can be sent now; the sentence says why.
            StoreUnavailableError: Nothing was begun.
        """
        record = await self._ledger.get(plan)
        async with self._asking[record.robot]:
            under_way = await self._under_way(record, start=start, request=request)
            if under_way is not None:
                return under_way
            running = await self._ledger.of_robot(record.robot, ("running",))
            _check_sendable(record, [] if may_wait else running)
            passes = None
            if start and not goes_on:
                passes = await self._gate.look(record.robot, overrule)
            return await self._new_transfer(
                record, start, check, passes, confirmed=confirmed, request=request
            )

    async def view(self, transfer: str) -> TransferView:
        """Return a transfer and how far it is proved.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        waits = self._satellite.waits
        view = await self._store.query(lambda session: transfer_view(session, transfer, waits))
        return self._with_progress(view)

    async def view_of_plan(self, plan: str) -> TransferView | None:
        """Return the newest transfer of a plan, ``None`` if it was never sent."""
        waits = self._satellite.waits
        view = await self._store.query(lambda session: transfer_of_plan(session, plan, waits))
        return None if view is None else self._with_progress(view)

    def _with_progress(self, view: TransferView) -> TransferView:
        """Add the items that the robot proved to have and that are in memory only."""
        machine = self._machines.get(view.robot)
        if machine is None or machine.transfer.id != view.id:
            return view
        return replace(view, items_sent=max(view.items_sent, machine.items_sent))

    async def quote(self, plan: str) -> SatelliteQuoteView:
        """Return what sending a plan by satellite takes; sends nothing.

        Raises:
            UnknownIdError: If there is no such plan.
            Problem: 409 if there is nothing to send yet, or it is too long for satellite.
        """
        record = await self._ledger.get(plan)
        status = self._fleet.status(record.robot)
        return await quote_of(record, status, self._satellite, self._foundation)

    async def withdraw(self, robot: str, reason: str) -> None:
        """End the transfer to a robot that is under way; a plan that had not arrived is a draft."""
        await self._close(robot, TransferEvidence.WITHDRAWN, reason, calls_back=True)

    async def withdraw_transfer(self, transfer: str, *, by: str) -> TransferView:
        """Withdraw a transfer that has not arrived; its plan is a draft again.

        Raises:
            UnknownIdError: If there is none of this id.
            Problem: 409 if there is nothing left to withdraw.
        """
        view = await self.view(transfer)
        if not view.can_withdraw:
            raise conflict(f"{transfer} is {view.state.replace('_', ' ')}; it cannot be withdrawn.")
        reason = f"{by} withdrew {view.plan_id}."
        await self._close(view.robot, TransferEvidence.WITHDRAWN, reason, calls_back=True)
        await self._note_withdrawal(view, reason)
        self._bus.publish(TransferFailed(view.plan_id, reason))
        return await self.view(transfer)

    async def _note_withdrawal(self, view: TransferView, reason: str) -> None:
        at = self._clock.now()
        data = {"plan": view.plan_id, "transfer": view.id}
        await self._store.write(
            lambda session: add_event(
                session, at, "plan.withdrawn", reason, robot=view.robot, data=data
            )
        )

    async def _close(
        self, robot: str, evidence: TransferEvidence, reason: str, *, calls_back: bool
    ) -> None:
        at = self._clock.now()
        await self._store.write(
            lambda session: close_all(session, robot, evidence, reason, at, calls_back=calls_back)
        )
        ending = self.stop_for(robot)
        if ending is not None:
            await asyncio.wait([ending])

    async def _new_transfer(
        self,
        record: PlanRecord,
        start: bool,
        check: Check | None,
        passes: Pass | None,
        *,
        confirmed: bool,
        request: LinkRequest,
    ) -> str:
        if not confirmed:
            self._check_fits(record)
        self._check_link(record, request)
        mission = mission_of(record)
        at = self._clock.now()

        def write(session: Session) -> TransferRecord:
            if check is not None:
                check(session)
            if get_plan(session, record.id).state not in _SENDABLE:
                raise conflict(f"{record.id} was changed meanwhile; look at it again.")
            if passes is not None and (said := passes(session)):
                note_plan(session, record.id, {"checklist": said}, at)
            transfer = query.add_transfer(
                session,
                record.id,
                record.robot,
                items=item_count(mission),
                size=len(mission.canonical_bytes()),
                start=start,
                at=at,
                route=request.link,
                is_forced=request.is_forced,
            )
            return query.get_transfer(session, transfer)

        transfer = await self._store.write(write)
        self._begin(transfer, is_new=True)
        return transfer.id

    async def _under_way(
        self, plan: PlanRecord, *, start: bool, request: LinkRequest
    ) -> str | None:
        """Return the transfer of this plan that is under way, if it is the one that is asked for.

        One by satellite gives way to another plan.

        Raises:
            Problem: 409 if another transfer to the robot is under way.
        """
        machine = self._machines.get(plan.robot)
        if machine is None:
            return None
        transfer, row = machine.transfer, machine.row
        if (await self._ledger.get(transfer.plan)).state in ENDED_STATES:
            # The plan was flown already; its transfer only has to notice.
            await asyncio.wait([self._tasks[transfer.id]], timeout=_NOTICE_S)
            if transfer.id not in self._tasks:
                return None
        is_other = transfer.plan != plan.id or transfer.start != start
        is_other = is_other or request.link not in ("auto", transfer.route)
        if is_other and row is not None and row.state not in ("applied", "held"):
            _check_sendable(await self._ledger.get(plan.id), [], is_resent=transfer.plan == plan.id)
            self._check_link(plan, request)
            # A newer plan by satellite does both by itself: it empties the queue and is newer.
            links = self._satellite.choice(plan.robot, "plan", request.link).links
            await self._close(
                plan.robot,
                TransferEvidence.SUPERSEDED,
                f"{plan.id} takes its place.",
                calls_back="satellite" not in links,
            )
            return None
        if is_other:
            raise conflict(
                f"{transfer.plan} is on its way to {plan.robot}; wait until {transfer.id} "
                "has ended."
            )
        return transfer.id

    def _check_fits(self, plan: PlanRecord) -> None:
        """Refuse a plan of another place or time, or that a dry run did not fly as it must."""
        outdated = outdated_by(self._fleet.status(plan.robot), plan, self._clock.now())
        found = (*outdated, *broken_off(plan))
        if found:
            reasons = " ".join(one.message for one in found)
            fault = "is outdated" if outdated else "may not be flown as it must"
            raise conflict(
                f"{plan.id} {fault}: {reasons} Plan again, or confirm that it shall be flown "
                "all the same.",
                [FieldError(loc=[one.field], msg=one.message) for one in found],
            )

    def _check_link(self, plan: PlanRecord, request: LinkRequest) -> None:
        """Refuse a link that cannot be taken, or that only a person who insists may take."""
        choice = self._satellite.choice(plan.robot, "plan", request.link)
        if not choice.links and request.link != "auto":
            raise conflict(choice.reason)
        if "satellite" in choice.links and not request.is_forced:
            obstacle = self._satellite.obstacle(plan.robot)
            if obstacle:
                raise conflict(
                    f"{obstacle} Nothing is sent to it by satellite unless you insist.",
                    [FieldError(loc=["body", "force"], msg=obstacle)],
                )

    def _begin(self, transfer: TransferRecord, *, is_new: bool) -> None:
        machine = TransferMachine(
            transfer, self._services, is_new=is_new, on_change=self._note_change
        )
        task = self._foundation.background.start(
            f"{transfer.id} to {transfer.robot}", self._run(machine)
        )
        self._tasks[transfer.id] = task
        self._machines[transfer.robot] = machine
        task.add_done_callback(lambda _: self._ended(machine))
        self._note_change(transfer.id)

    async def _run(self, machine: TransferMachine) -> None:
        reason = await machine.run()
        if reason:
            self._bus.publish(TransferFailed(machine.transfer.plan, reason))

    def _ended(self, machine: TransferMachine) -> None:
        transfer = machine.transfer
        self._tasks.pop(transfer.id, None)
        if self._machines.get(transfer.robot) is machine:
            del self._machines[transfer.robot]
        self._note_change(transfer.id)

    def stop_for(self, robot: str) -> asyncio.Task[None] | None:
        """Let go of the transfer to a robot that has ended otherwise; return what is ending."""
        machine = self._machines.pop(robot, None)
        task = None if machine is None else self._tasks.get(machine.transfer.id)
        if task is not None:
            task.cancel()
            self._services.radio.cancel_upload(RobotId(robot), "it was withdrawn")
        return task


def _check_sendable(
    plan: PlanRecord, running: list[PlanRecord], *, is_resent: bool = False
) -> None:
    """Refuse a plan that is in no state to be sent, or breaks a limit.

    Args:
        plan: The plan.
        running: What its robot flies.
        is_resent: Whether it is on its way already, by a link that it shall leave.
    """
    if plan.state not in _SENDABLE and not (is_resent and plan.state == "sent"):
        raise conflict(
            f"{plan.id} is {plan.state.replace('_', ' ')}; only a draft can be sent. Plan again."
        )
    violations = plan.document.get("violations", ())
    if violations:
        named = " ".join(one["message"] for one in violations[:_NAMED_MAX])
        count = "a limit" if len(violations) == 1 else f"{len(violations)} limits"
        raise conflict(
            f"{plan.id} breaks {count}: {named} Change it and plan again.",
            [FieldError(loc=[one["field"]], msg=one["message"]) for one in violations],
        )
    if running:
        raise conflict(
            f"{plan.robot} flies {running[0].id}; wait until it has ended, or surface {plan.robot}."
        )
