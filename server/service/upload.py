"""Bringing plans on board: nothing is shown before the robot proved it, and nothing is lost.

A transfer is a row before the first byte leaves. It survives a restart of the station: what the
robot says of the plan on board decides how it goes on, so a plan that arrived while nobody listened
is not sent again, and one that did not is.
"""

import asyncio
import logging
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from db.fault import StoreError
from db.query import transfers as query
from db.query.plans import ENDED_STATES, PlanRecord, change_plan, get_plan
from db.query.transfers import TransferRecord
from robot_link.messages import (
    CommandKind,
    CommandLevel,
    LinkState,
    OnboardPlanState,
    PlanHash,
    PlanReport,
    RobotId,
    UploadReport,
)
from robot_link.mission import Mission
from robot_link.station import UploadUnderWayError
from server.foundation import Foundation
from server.problem import FieldError, conflict
from server.service.command import Check, Commands
from server.service.fleet import Fleet
from server.service.link import Radio
from server.service.plan_document import mission_of
from server.service.plan_ledger import PlanLedger
from server.service.view.plan import TransferView

log = logging.getLogger(__name__)

HOLDS = (OnboardPlanState.ON_BOARD, OnboardPlanState.RUNNING, OnboardPlanState.DONE)
"""States in which a robot has the plan that it names, whole."""
SENDABLE = ("draft", "on_board")
"""States of a plan that can be sent; one that is on board already is only started."""
_ATTEMPTS = 3
_PAUSE_S = 2.0
_POLL_S = 0.2
_NOTICE_S = 2.0
_START_PATIENCE_S = 20.0
"""Wall time for a robot to say that it flies the plan after it was told to start."""
_LIFE = timedelta(hours=24)
"""A transfer that found no contact for this long, by the robots' clock, is given up."""


class TransferError(Exception):
    """The transfer cannot go on; the message says why to a person."""


class WithdrawnError(Exception):
    """Someone ended the transfer; it must not do anything more."""


class Uploads:
    """Transfers under way. Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        ledger: PlanLedger,
        commands: Commands,
        radio: Radio,
    ) -> None:
        self._foundation = foundation
        self._store = foundation.store
        self._clock = foundation.clock
        self._fleet = fleet
        self._ledger = ledger
        self._commands = commands
        self._radio = radio
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._robots: dict[str, str] = {}
        """Transfer under way by robot."""
        self._items_sent: dict[str, int] = {}
        self._asking: dict[str, asyncio.Lock] = defaultdict(asyncio.Lock)
        commands.purges.append(withdraw_in)
        commands.on_surface.append(self._stop_for)
        self.on_failure: list[Callable[[str, str], None]] = []
        """Called with plan and reason when a plan did not get on board or did not start."""

    async def resume(self) -> None:
        """Go on with the transfers that were under way when the station stopped."""
        for transfer in await self._store.query(query.open_transfers):
            if self._fleet.knows(transfer.robot):
                self._begin(transfer)

    async def stop(self) -> None:
        """Let go of every transfer; they go on when the station starts again."""
        tasks = list(self._tasks.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def upload(self, plan: str, *, start: bool, check: Check | None = None) -> str:
        """Begin to bring a plan on board and return the transfer's id.

        Args:
            plan: Id of the plan.
            start: Whether the robot is told to fly it as soon as it is on board.
            check: Asked in the transaction; what it raises keeps the transfer from beginning.

        Raises:
            UnknownIdError: If there is no such plan.
            Problem: 409 if the plan is not one that can be sent now; the sentence says why.
            StoreUnavailableError: Nothing was begun.
        """
        record = await self._ledger.get(plan)
        async with self._asking[record.robot]:
            under_way = await self._under_way(record, start=start)
            return under_way or await self._new_transfer(record, start, check)

    async def view(self, transfer: str) -> TransferView:
        """Return a transfer and how far it is proved.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        record = await self._store.query(lambda session: query.get_transfer(session, transfer))
        sent = max(record.items_sent, self._items_sent.get(transfer, 0))
        return transfer_view(replace(record, items_sent=sent))

    def take(self, report: UploadReport) -> None:
        """Take how far the link is with an upload."""
        transfer = self._robots.get(report.robot)
        if transfer is not None:
            self._items_sent[transfer] = report.items_sent

    async def _new_transfer(self, record: PlanRecord, start: bool, check: Check | None) -> str:
        _check_sendable(record, await self._ledger.of_robot(record.robot, ("running",)))
        mission = mission_of(record)
        at = self._clock.now()

        def write(session: Session) -> TransferRecord:
            if check is not None:
                check(session)
            if get_plan(session, record.id).state not in SENDABLE:
                raise conflict(f"{record.id} was changed meanwhile; look at it again.")
            transfer = query.add_transfer(
                session,
                record.id,
                record.robot,
                items=len(mission.legs),
                size=len(mission.canonical_bytes()),
                start=start,
                at=at,
            )
            return query.get_transfer(session, transfer)

        transfer = await self._store.write(write)
        self._begin(transfer)
        return transfer.id

    async def _under_way(self, plan: PlanRecord, *, start: bool) -> str | None:
        """Return the transfer of this plan that is under way, if it is the one that is asked for.

        Raises:
            Problem: 409 if another transfer to the robot is under way.
        """
        transfer = self._robots.get(plan.robot)
        if transfer is None:
            return None
        record = await self._store.query(lambda session: query.get_transfer(session, transfer))
        if (await self._ledger.get(record.plan)).state in ENDED_STATES:
            # The plan was flown already; its transfer only has to notice.
            await asyncio.wait([self._tasks[transfer]], timeout=_NOTICE_S)
            if transfer not in self._tasks:
                return None
        if record.plan != plan.id or record.start != start:
            raise conflict(
                f"{record.plan} is on its way to {plan.robot}; wait until {transfer} has ended."
            )
        return transfer

    def _begin(self, transfer: TransferRecord) -> None:
        task = self._foundation.background.start(
            f"{transfer.id} to {transfer.robot}", self._carry(transfer)
        )
        self._tasks[transfer.id] = task
        self._robots[transfer.robot] = transfer.id
        task.add_done_callback(lambda _: self._ended(transfer))

    def _ended(self, transfer: TransferRecord) -> None:
        self._tasks.pop(transfer.id, None)
        self._items_sent.pop(transfer.id, None)
        if self._robots.get(transfer.robot) == transfer.id:
            del self._robots[transfer.robot]

    async def withdraw(self, robot: str, reason: str) -> None:
        """End the transfer to a robot that is under way; a plan that had not arrived is a draft."""
        at = self._clock.now()
        await self._store.write(lambda session: withdraw_in(session, robot, at, reason))
        await self._stop_for(robot)

    async def _stop_for(self, robot: str) -> None:
        transfer = self._robots.get(robot)
        task = None if transfer is None else self._tasks.get(transfer)
        if task is not None:
            task.cancel()
            self._radio.cancel_upload(RobotId(robot), "it was withdrawn")
            await asyncio.wait([task])
        await self._ledger.refresh(robot)

    async def _carry(self, transfer: TransferRecord) -> None:
        try:
            plan = await self._ledger.get(transfer.plan)
            await self._bring_on_board(transfer, plan)
            if transfer.start:
                await self._start(transfer, plan)
            await self._change(transfer, ended_at=self._clock.now())
        except TransferError as error:
            await self._give_up(transfer, str(error))
        except WithdrawnError:
            log.info("%s was withdrawn", transfer.id)
        except StoreError as error:
            # The row stays open: the transfer goes on when the station starts again.
            log.warning("%s was interrupted: %s", transfer.id, error)

    async def _bring_on_board(self, transfer: TransferRecord, plan: PlanRecord) -> None:
        mission, reason = mission_of(plan), ""
        for attempt in range(_ATTEMPTS):
            if attempt:
                await asyncio.sleep(_PAUSE_S)
            await self._contact(transfer, plan)
            if self._holds(plan):
                break
            reason = await self._send(transfer, plan, mission)
            if not reason:
                break
        else:
            raise TransferError(reason)
        await self._change(
            transfer, state="on_board", level=CommandLevel.APPLIED.value, items_sent=transfer.items
        )
        await self._ledger.advance(
            plan.id,
            "on_board",
            f"{plan.robot} has {plan.id} on board.",
            only_from=("draft", "sent"),
        )

    async def _send(self, transfer: TransferRecord, plan: PlanRecord, mission: Mission) -> str:
        """Upload once; return why it did not get on board, or ""."""
        await self._change(transfer, state="sending", level=CommandLevel.QUEUED.value)
        await self._ledger.advance(
            plan.id, "sent", f"{plan.id} is on its way to {plan.robot}.", only_from=("draft",)
        )
        try:
            report = await self._radio.upload(RobotId(plan.robot), mission)
        except UploadUnderWayError:
            return "another upload had not ended"
        if report.state is OnboardPlanState.REFUSED:
            raise TransferError(f"{plan.robot} refused {plan.id}: {report.reason}")
        return "" if report.state in HOLDS else report.reason or "the robot did not answer"

    async def _contact(self, transfer: TransferRecord, plan: PlanRecord) -> None:
        """Wait until the robot can be reached, or says that it has the plan."""
        picture = self._fleet.picture(plan.robot)
        deadline = transfer.started_at + _LIFE
        while not (picture.link_state is LinkState.LIVE or self._holds(plan)):
            if self._clock.now() > deadline:
                raise TransferError(f"{plan.robot} was not heard for {_LIFE.days} day.")
            await asyncio.sleep(_POLL_S)

    async def _start(self, transfer: TransferRecord, plan: PlanRecord) -> None:
        if plan.sha256 is None:
            raise TransferError(f"{plan.id} has no hash.")
        for _ in range(_ATTEMPTS):
            if self._has_begun(plan):
                break
            await self._contact(transfer, plan)
            await self._commands.send(
                plan.robot,
                CommandKind.START,
                by="the station",
                plan=PlanHash(plan.sha256),
                check=lambda session: _check_open(session, transfer.id),
            )
            if await self._begins(plan):
                break
        else:
            raise TransferError(f"{plan.robot} has {plan.id} on board but does not start it.")
        await self._change(transfer, state="running")

    async def _begins(self, plan: PlanRecord) -> bool:
        """Wait for the robot to say that it flies the plan."""
        with_patience = asyncio.get_running_loop().time() + _START_PATIENCE_S
        while not self._has_begun(plan):
            if asyncio.get_running_loop().time() > with_patience:
                return False
            await asyncio.sleep(_POLL_S)
        return True

    def _report_of(self, plan: PlanRecord) -> PlanReport | None:
        report = self._fleet.picture(plan.robot).plan_report
        return report if report is not None and report.sha256 == plan.sha256 else None

    def _holds(self, plan: PlanRecord) -> bool:
        report = self._report_of(plan)
        return report is not None and report.state in HOLDS

    def _has_begun(self, plan: PlanRecord) -> bool:
        report = self._report_of(plan)
        begun = (OnboardPlanState.RUNNING, OnboardPlanState.DONE, OnboardPlanState.FAILED)
        return report is not None and report.state in begun

    async def _change(self, transfer: TransferRecord, **changes: object) -> None:
        await self._store.write(
            lambda session: query.change_transfer(session, transfer.id, **changes)
        )

    async def _give_up(self, transfer: TransferRecord, reason: str) -> None:
        at = self._clock.now()
        record = await self._store.write(
            lambda session: _close(session, transfer, "failed", reason, at)
        )
        if record is not None:
            self._ledger.publish(record)
        for listener in self.on_failure:
            listener(transfer.plan, reason)


def withdraw_in(session: Session, robot: str, at: datetime, reason: str) -> None:
    """Withdraw the transfers to a robot, in the transaction of a surface order."""
    for transfer in query.open_transfers(session):
        if transfer.robot == robot:
            _close(session, transfer, "withdrawn", reason, at)


def transfer_view(record: TransferRecord) -> TransferView:
    """Return a transfer as REST says it."""
    return TransferView(
        id=record.id,
        robot=record.robot,
        plan_id=record.plan,
        state=record.state,
        items_sent=record.items_sent,
        items=record.items,
        bytes=record.bytes,
        level=record.level,
        started_at=record.started_at,
        ended_at=record.ended_at,
        reason=record.reason,
    )


def _check_open(session: Session, transfer: str) -> None:
    if query.get_transfer(session, transfer).ended_at is not None:
        raise WithdrawnError


def _close(
    session: Session, transfer: TransferRecord, state: str, reason: str, at: datetime
) -> PlanRecord | None:
    """End a transfer that is open; a plan that had not arrived is a draft again."""
    if query.get_transfer(session, transfer.id).ended_at is not None:
        return None
    query.change_transfer(session, transfer.id, state=state, reason=reason, ended_at=at)
    plan = get_plan(session, transfer.plan)
    if plan.state != "sent":
        return change_plan(session, plan.id, at=at, document={"message": reason})
    message = f"Not confirmed on board: {reason}"
    return change_plan(session, plan.id, at=at, state="draft", document={"message": message})


def _check_sendable(plan: PlanRecord, running: list[PlanRecord]) -> None:
    if plan.state not in SENDABLE:
        raise conflict(
            f"{plan.id} is {plan.state.replace('_', ' ')}; only a draft can be sent. Plan again."
        )
    violations = plan.document.get("violations", ())
    if violations:
        raise conflict(
            f"{plan.id} breaks {len(violations)} limits; change it and plan again.",
            [FieldError(loc=[one["field"]], msg=one["message"]) for one in violations],
        )
    if running:
        raise conflict(
            f"{plan.robot} flies {running[0].id}; wait until it has ended, or surface {plan.robot}."
        )
