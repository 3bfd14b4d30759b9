"""One plan on its way: contact, the radio's transfer, the robot's word, and its start."""

import asyncio
import logging
from datetime import timedelta

from db.fault import StoreError
from db.query import transfers as query
from db.query.plans import PlanRecord
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
from server.service.command import Commands
from server.service.fleet import Fleet
from server.service.link import Radio
from server.service.plan_document import mission_of
from server.service.plan_ledger import PlanLedger
from server.service.transfer_row import WithdrawnError, check_open, close
from server.service.turn import until_stored

log = logging.getLogger(__name__)

HOLDS = (OnboardPlanState.ON_BOARD, OnboardPlanState.RUNNING, OnboardPlanState.DONE)
"""States in which a robot has the plan that it names, whole."""
_ATTEMPTS = 3
_PAUSE_S = 2.0
_POLL_S = 0.2
_START_PATIENCE_S = 20.0
"""Wall time for a robot to say that it flies the plan after it was told to start."""
_LIFE = timedelta(hours=24)
"""A transfer that found no contact for this long, by the robots' clock, is given up."""


class TransferError(Exception):
    """The transfer cannot go on; the message says why to a person."""


class Carriage:
    """Brings one plan on board and starts it; belongs to one event loop.

    What the robot says of the plan on board decides how it goes on. So it may begin anew at any
    time: after a restart of the station, or when storage works again that failed under it.
    """

    def __init__(
        self,
        transfer: TransferRecord,
        foundation: Foundation,
        fleet: Fleet,
        ledger: PlanLedger,
        commands: Commands,
        radio: Radio,
    ) -> None:
        self.transfer = transfer
        self.items_sent = 0
        """Items that the robot proved to have."""
        self._store = foundation.store
        self._clock = foundation.clock
        self._fleet = fleet
        self._ledger = ledger
        self._commands = commands
        self._radio = radio
        self._on_the_air = asyncio.Event()

    def take(self, report: UploadReport) -> None:
        """Take how far the link is with the upload."""
        self.items_sent = report.items_sent
        if report.state is not OnboardPlanState.FAILED:
            self._on_the_air.set()

    async def run(self) -> str:
        """Carry the plan to where the transfer shall bring it; return why that failed, or ""."""
        transfer = self.transfer
        try:
            await until_stored(transfer.id, self._carry)
        except TransferError as error:
            reason = str(error)
            await until_stored(transfer.id, lambda: self._give_up(reason))
            return reason
        except WithdrawnError:
            log.info("%s was withdrawn", transfer.id)
        except StoreError as error:
            # The row stays open: the transfer goes on when the station starts again.
            log.warning("%s was interrupted: %s", transfer.id, error)
        return ""

    async def _carry(self) -> None:
        transfer = self.transfer
        await self._store.query(lambda session: check_open(session, transfer.id))
        plan = await self._ledger.get(transfer.plan)
        await self._bring_on_board(plan)
        if transfer.start:
            await self._start(plan)
        await self._change(ended_at=self._clock.now())

    async def _bring_on_board(self, plan: PlanRecord) -> None:
        mission, reason = mission_of(plan), ""
        for attempt in range(_ATTEMPTS):
            if attempt:
                await asyncio.sleep(_PAUSE_S)
            await self._contact(plan)
            if self._holds(plan):
                break
            reason = await self._send(plan, mission)
            if not reason:
                break
        else:
            raise TransferError(reason)
        await self._change(
            state="on_board", level=CommandLevel.APPLIED.value, items_sent=self.transfer.items
        )
        await self._ledger.advance(
            plan.id,
            "on_board",
            f"{plan.robot} has {plan.id} on board.",
            only_from=("draft", "sent"),
        )

    async def _send(self, plan: PlanRecord, mission: Mission) -> str:
        """Upload once; return why it did not get on board, or ""."""
        self._on_the_air.clear()
        upload = asyncio.ensure_future(self._radio.upload(RobotId(plan.robot), mission))
        on_the_air = asyncio.ensure_future(self._on_the_air.wait())
        try:
            await asyncio.wait({upload, on_the_air}, return_when=asyncio.FIRST_COMPLETED)
            if self._on_the_air.is_set():
                await until_stored(self.transfer.id, lambda: self._note_sending(plan))
            report = await upload
        except UploadUnderWayError:
            return "another upload had not ended"
        finally:
            for task in (upload, on_the_air):
                task.cancel()
            await asyncio.gather(upload, on_the_air, return_exceptions=True)
        if report.state is OnboardPlanState.REFUSED:
            raise TransferError(f"{plan.robot} refused {plan.id}: {report.reason}")
        return "" if report.state in HOLDS else report.reason or "the robot did not answer"

    async def _note_sending(self, plan: PlanRecord) -> None:
        """Write down that the radio has taken the first bytes."""
        await self._change(state="sending", level=CommandLevel.QUEUED.value)
        await self._ledger.advance(
            plan.id, "sent", f"{plan.id} is on its way to {plan.robot}.", only_from=("draft",)
        )

    async def _contact(self, plan: PlanRecord) -> None:
        """Wait until the robot can be reached, or says that it has the plan."""
        picture = self._fleet.picture(plan.robot)
        deadline = self.transfer.started_at + _LIFE
        while not (picture.link_state is LinkState.LIVE or self._holds(plan)):
            if self._clock.now() > deadline:
                raise TransferError(f"{plan.robot} was not heard for {_LIFE.days} day.")
            await asyncio.sleep(_POLL_S)

    async def _start(self, plan: PlanRecord) -> None:
        if plan.sha256 is None:
            raise TransferError(f"{plan.id} has no hash.")
        for _ in range(_ATTEMPTS):
            if self._has_begun(plan):
                break
            await self._contact(plan)
            await self._commands.send(
                plan.robot,
                CommandKind.START,
                by="the station",
                plan=PlanHash(plan.sha256),
                check=lambda session: check_open(session, self.transfer.id),
            )
            if await self._begins(plan):
                break
        else:
            raise TransferError(f"{plan.robot} has {plan.id} on board but does not start it.")
        await self._change(state="running")

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

    async def _change(self, **changes: object) -> None:
        await self._store.write(
            lambda session: query.change_transfer(session, self.transfer.id, **changes)
        )

    async def _give_up(self, reason: str) -> None:
        at = self._clock.now()
        record = await self._store.write(
            lambda session: close(session, self.transfer, "failed", reason, at)
        )
        if record is not None:
            self._ledger.publish(record)
