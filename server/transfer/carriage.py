"""One plan on its way: the choice of a road, the transfer, the robot's word, and its start."""

import asyncio
import logging

from sqlalchemy.orm import Session

from db.fault import StoreError
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
from robot_link.station.gateway.address import SATELLITE_CARRIERS
from robot_link.station.link import UploadUnderWayError
from server.access.foundation import Foundation
from server.base.retry_queue import until_stored
from server.command.command import Commands
from server.fleet.fleet import Fleet
from server.fleet.routing import RequestedLink
from server.link.link import Radio, SatelliteLink
from server.plan.document import mission_of
from server.plan.ledger import PlanLedger
from server.plan.state import PlanEvidence
from server.satellite.plan_row import ground_of
from server.transfer.progress import RADIO_LIFE
from server.transfer.row import (
    WithdrawnError,
    check_open,
    close,
    end_by_satellite,
    proceed,
    proceed_with_plan,
)

log = logging.getLogger(__name__)

HOLDS = (OnboardPlanState.ON_BOARD, OnboardPlanState.RUNNING, OnboardPlanState.DONE)
"""States in which a robot has the plan that it names, whole."""
_SETTLED = ("applied", "refused", "expired")
_ATTEMPTS = 3
_PAUSE_S = 2.0
_POLL_S = 0.2
_START_PATIENCE_S = 20.0
"""Wall time for a robot to say that it flies the plan after it was told to start."""
_RADIO_PATIENCE_S = 20.0
"""Wall time that a transfer which was not begun by satellite gives radio to come back."""


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
        satellite: SatelliteLink,
        *,
        is_new: bool,
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
        self._satellite = satellite
        self._may_leave_radio = is_new
        """Whether satellite may be taken at once: whoever sent it was told which road that is."""
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
        await self._finish()

    async def _bring_on_board(self, plan: PlanRecord) -> None:
        mission, reason, attempts = mission_of(plan), "", 0
        while attempts < _ATTEMPTS:
            road = await self._road(plan)
            if self._holds(plan) or (road == "satellite" and await self._by_satellite(plan)):
                break
            if road == "satellite":
                await asyncio.sleep(_POLL_S)
                continue
            if attempts:
                await asyncio.sleep(_PAUSE_S)
            attempts += 1
            reason = await self._send(plan, mission)
            self._may_leave_radio = False
            if not reason:
                break
        else:
            raise TransferError(reason)
        await self._change_with_plan(
            PlanEvidence.CONFIRMED,
            f"{plan.robot} has {plan.id} on board.",
            state="on_board",
            level=CommandLevel.APPLIED.value,
            items_sent=self.transfer.items,
        )

    async def _road(self, plan: PlanRecord) -> str:
        """Wait for a road to the robot, or for its word that it has the plan; return which."""
        status, transfer = self._fleet.status(plan.robot), self.transfer
        loop = asyncio.get_running_loop()
        since, deadline = loop.time(), transfer.started_at + RADIO_LIFE
        while not self._holds(plan):
            roads = self._satellite.choice(plan.robot, "plan", _wish(transfer)).links
            if "satellite" in roads:
                waited = loop.time() - since > _RADIO_PATIENCE_S
                asked_for = transfer.route == "satellite"
                if waited or asked_for or self._may_leave_radio or self._is_by_satellite():
                    return "satellite"
            elif status.radio_state is LinkState.LIVE:
                return "radio"
            if self._clock.now() > deadline:
                raise TransferError(f"{plan.robot} was not heard for {RADIO_LIFE.days} day.")
            await asyncio.sleep(_POLL_S)
        return "radio"

    def _is_by_satellite(self) -> bool:
        return self._satellite.row_of(self.transfer.id) is not None

    async def _by_satellite(self, plan: PlanRecord) -> bool:
        """Follow the plan by satellite; tell whether it is on board, or radio is to be tried."""
        row = await self._satellite.begin(self.transfer, plan)
        if row is None:
            return False
        status, level, noted = self._fleet.status(plan.robot), "", False
        carrier = row.carrier
        while not (row.state == "applied" or self._holds(plan)):
            if not noted and any(part.sends for part in ground_of(row).parts):
                await until_stored(self.transfer.id, lambda: self._note_sending(plan, carrier))
                noted = True
            if row.level != level:
                level = row.level
                await self._change(level=level)
            if row.ended_at is not None:
                raise TransferError(row.reason)
            if status.radio_state is LinkState.LIVE and self._may_change_to_radio(plan):
                await self._satellite.hold(self.transfer.id)
                return False
            await asyncio.sleep(_POLL_S)
            row = self._satellite.row_of(self.transfer.id) or row
        return True

    def _may_change_to_radio(self, plan: PlanRecord) -> bool:
        roads = self._satellite.choice(plan.robot, "plan", _wish(self.transfer)).links
        return "radio" in roads

    async def _send(self, plan: PlanRecord, mission: Mission) -> str:
        """Upload once; return why it did not get on board, or ""."""
        self._on_the_air.clear()
        radio = self._fleet.status(plan.robot).radio
        carrier = "" if radio is None else radio.carrier
        upload = asyncio.ensure_future(self._radio.upload(RobotId(plan.robot), mission))
        on_the_air = asyncio.ensure_future(self._on_the_air.wait())
        try:
            await asyncio.wait({upload, on_the_air}, return_when=asyncio.FIRST_COMPLETED)
            if self._on_the_air.is_set():
                await until_stored(self.transfer.id, lambda: self._note_sending(plan, carrier))
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

    async def _note_sending(self, plan: PlanRecord, carrier: str) -> None:
        """Write down that a radio or a gateway has taken the first bytes."""
        changes: dict[str, object] = {"state": "sending", "carrier": carrier}
        if carrier not in SATELLITE_CARRIERS:
            changes["level"] = CommandLevel.QUEUED.value
        text = f"{plan.id} is on its way to {plan.robot}."
        await self._change_with_plan(PlanEvidence.SENT, text, **changes)

    async def _start(self, plan: PlanRecord) -> None:
        if plan.sha256 is None:
            raise TransferError(f"{plan.id} has no hash.")
        await self._starts_by_itself(plan)
        for _ in range(_ATTEMPTS):
            if self._has_begun(plan):
                break
            road = await self._road_of_orders(plan)
            if self._has_begun(plan):
                break
            command = await self._commands.send(
                plan.robot,
                CommandKind.START,
                by="the station",
                plan=PlanHash(plan.sha256),
                check=lambda session: check_open(session, self.transfer.id),
            )
            if await self._begins(plan, None if road == "radio" else command):
                break
        else:
            raise TransferError(f"{plan.robot} has {plan.id} on board but does not start it.")
        await self._change(state="running")

    async def _starts_by_itself(self, plan: PlanRecord) -> None:
        """Wait for a robot that was told to start with the plan itself, as satellite does.

        It says so when it calls next; in reach of radio it is asked after a while.
        """
        row = self._satellite.row_of(self.transfer.id)
        if row is None or row.state != "applied":
            return
        status, loop = self._fleet.status(plan.robot), asyncio.get_running_loop()
        live_since: float | None = None
        while not self._has_begun(plan) and self._clock.now() < row.expires_at:
            if status.radio_state is not LinkState.LIVE:
                live_since = None
            elif live_since is None:
                live_since = loop.time()
            elif loop.time() - live_since > _START_PATIENCE_S:
                return
            await asyncio.sleep(_POLL_S)

    async def _road_of_orders(self, plan: PlanRecord) -> str:
        """Wait until the robot can be told to start, or says that it has; return by which road."""
        status = self._fleet.status(plan.robot)
        deadline = self._clock.now() + RADIO_LIFE
        while not self._has_begun(plan):
            if status.radio_state is LinkState.LIVE:
                return "radio"
            if self._is_by_satellite() and "satellite" in (
                self._satellite.choice(plan.robot, "command").links
            ):
                return "satellite"
            if self._clock.now() > deadline:
                raise TransferError(f"{plan.robot} was not heard for {RADIO_LIFE.days} day.")
            await asyncio.sleep(_POLL_S)
        return "radio"

    async def _begins(self, plan: PlanRecord, command: str | None) -> bool:
        """Wait for the robot to say that it flies the plan.

        Args:
            plan: The plan.
            command: An order by satellite, whose answer takes until it expires; else ``None``.
        """
        with_patience = asyncio.get_running_loop().time() + _START_PATIENCE_S
        while not self._has_begun(plan):
            if asyncio.get_running_loop().time() > with_patience:
                if command is None or (await self._commands.view(command)).level in _SETTLED:
                    return False
                with_patience += _START_PATIENCE_S
            await asyncio.sleep(_POLL_S)
        return True

    def _report_of(self, plan: PlanRecord) -> PlanReport | None:
        report = self._fleet.status(plan.robot).plan_report
        return report if report is not None and report.sha256 == plan.sha256 else None

    def _holds(self, plan: PlanRecord) -> bool:
        report = self._report_of(plan)
        return report is not None and report.state in HOLDS

    def _has_begun(self, plan: PlanRecord) -> bool:
        report = self._report_of(plan)
        begun = (OnboardPlanState.RUNNING, OnboardPlanState.DONE, OnboardPlanState.FAILED)
        return report is not None and report.state in begun

    async def _change(self, **changes: object) -> None:
        await self._store.write(lambda session: proceed(session, self.transfer.id, **changes))

    async def _change_with_plan(self, evidence: PlanEvidence, text: str, **changes: object) -> None:
        at = self._clock.now()
        plan = await self._store.write(
            lambda session: proceed_with_plan(session, self.transfer, evidence, text, at, **changes)
        )
        if plan is not None:
            self._ledger.publish(plan)

    async def _finish(self) -> None:
        """End the transfer; what is still to be sent of it by satellite is not sent any more."""
        at, reason = self._clock.now(), "it is on board already"

        def write(session: Session) -> None:
            proceed(session, self.transfer.id, ended_at=at)
            end_by_satellite(session, self.transfer.id, "superseded", reason, at, calls_back=True)

        await self._store.write(write)

    async def _give_up(self, reason: str) -> None:
        at = self._clock.now()
        record = await self._store.write(
            lambda session: close(session, self.transfer, "failed", reason, at, calls_back=True)
        )
        if record is not None:
            self._ledger.publish(record)


def _wish(transfer: TransferRecord) -> RequestedLink:
    match transfer.route:
        case "radio" | "satellite" as asked:
            return asked
        case _:
            return "auto"
