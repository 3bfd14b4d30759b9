"""One transfer under way: the choice of a link, the sending, the robot's word, and the start.

It asks nobody again and again: what robots report, how links fare, rows of the satellite's outbox
and levels of commands wake it (``take_*``, ``wake``), and so does the moment at which its patience
ends. Each step is handed to ``server.transfer.state``.
"""

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from db.fault import StoreError
from db.query.mission.plans import PlanRecord
from db.query.mission.transfers import TransferRecord
from db.query.satellite.outbox import OutboxRecord, outbox_of_transfer
from robot_link.clock import set_or_after
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
from robot_link.satellite.blob import Blob
from robot_link.station.gateway.address import SATELLITE_CARRIERS
from robot_link.station.link import UploadUnderWayError
from server.base.foundation import Foundation
from server.base.retry_queue import until_stored
from server.command.commands import Commands
from server.command.state import SETTLED
from server.command.view import CommandView
from server.fleet.fleet import Fleet
from server.fleet.routing import LinkKind, RequestedLink
from server.link.link import Radio
from server.plan.document import mission_of
from server.plan.ledger import PlanLedger
from server.satellite.satellite import Satellite
from server.transfer import plan_row
from server.transfer.state import (
    RADIO_LIFE,
    TransferEvidence,
    WithdrawnError,
    apply,
    check_open,
    close,
    finish,
    note,
)

log = logging.getLogger(__name__)

BEGUN = (OnboardPlanState.RUNNING, OnboardPlanState.DONE, OnboardPlanState.FAILED)
"""What a robot says of a plan once it has begun to fly it."""
_ATTEMPTS = 3
_PAUSE_S = 2.0
"""Wall time for a robot that did not answer to say by itself that it has the plan."""
_START_PATIENCE_S = 20.0
"""Wall time for a robot to say that it flies the plan after it was told to start."""
_RADIO_PATIENCE_S = 20.0
"""Wall time that a transfer which was not begun by satellite gives radio to come back."""


class TransferError(Exception):
    """The transfer cannot go on; the message says why to a person."""


@dataclass(frozen=True, slots=True)
class TransferServices:
    """What transfers need of the station."""

    foundation: Foundation
    fleet: Fleet
    ledger: PlanLedger
    commands: Commands
    radio: Radio
    satellite: Satellite


class TransferMachine:
    """Brings one plan on board and starts it; belongs to one event loop.

    What the robot says of the plan on board decides how it goes on. So it may begin anew at any
    time: after a restart of the station, or when storage works again that failed under it.

    Args:
        transfer: As it was written down.
        services: What it needs of the station.
        is_new: Whether it was asked for just now, not before a restart.
        on_change: Called with its id when more of it is known.
    """

    def __init__(
        self,
        transfer: TransferRecord,
        services: TransferServices,
        *,
        is_new: bool,
        on_change: Callable[[str], None],
    ) -> None:
        self.transfer = transfer
        self.items_sent = 0
        """Items that the robot proved to have."""
        self.row: OutboxRecord | None = None
        """How far it is by satellite; ``None`` if it was never to go there."""
        self._store = services.foundation.store
        self._clock = services.foundation.clock
        self._fleet = services.fleet
        self._ledger = services.ledger
        self._commands = services.commands
        self._radio = services.radio
        self._satellite = services.satellite
        self._on_change = on_change
        self._may_leave_radio = is_new
        """Whether satellite may be taken at once: whoever sent it was told which link that is."""
        self._is_kept = False
        """Whether the robot answered the upload that the plan waits behind the one it flies."""
        self._on_the_air = asyncio.Event()
        self._news = asyncio.Event()
        self._levels: dict[str, str] = {}
        """Newest level of the commands to start."""

    def wake(self) -> None:
        """Look again: the robot, one of its links or a setting changed."""
        self._news.set()

    def take_upload(self, report: UploadReport) -> None:
        """Take how far the link is with the upload."""
        self.items_sent = report.items_sent
        if report.state is not OnboardPlanState.FAILED:
            self._on_the_air.set()
        self._on_change(self.transfer.id)

    def take_row(self, row: OutboxRecord) -> None:
        """Take how far it is by satellite."""
        self.row = row
        self._news.set()

    def take_command(self, command: CommandView) -> None:
        """Take how far a command is proved that may be its own."""
        if command.id in self._levels:
            self._levels[command.id] = command.level
            self._news.set()

    async def run(self) -> str:
        """Bring the plan to where the transfer shall; return why that failed, or ""."""
        transfer = self.transfer
        try:
            await until_stored(transfer.id, self._bring)
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

    async def _bring(self) -> None:
        transfer = self.transfer

        def read(session: Session) -> OutboxRecord | None:
            check_open(session, transfer.id)
            return outbox_of_transfer(session, transfer.id)

        self.row = await self._store.query(read)
        plan = await self._ledger.get(transfer.plan)
        await self._bring_on_board(plan)
        if transfer.start:
            await self._start(plan)
        at = self._clock.now()
        await self._store.write(lambda session: finish(session, transfer.id, at))
        self._on_change(transfer.id)

    async def _bring_on_board(self, plan: PlanRecord) -> None:
        mission, reason, attempts = mission_of(plan), "", 0
        while attempts < _ATTEMPTS:
            link = await self._link(plan)
            if self._has_come(plan) or (link == "satellite" and await self._by_satellite(plan)):
                break
            if link == "satellite":
                continue
            if attempts and await self._until(lambda: self._has_come(plan), _PAUSE_S):
                break
            attempts += 1
            reason = await self._send(plan, mission)
            self._may_leave_radio = False
            if not reason:
                break
        else:
            raise TransferError(reason)
        proved, text = TransferEvidence.ROBOT_HAS_IT, f"{plan.robot} has {plan.id} on board."
        if not self._holds(plan) and (self._is_kept or self._keeps(plan)):
            proved = TransferEvidence.ROBOT_KEEPS_IT
            text = f"{plan.id} waits on board of {plan.robot} for the next surfacing."
        level, items = CommandLevel.APPLIED.value, self.transfer.items
        await self._move(proved, text, level=level, items_sent=items)

    async def _link(self, plan: PlanRecord) -> LinkKind:
        """Wait for a link to the robot, or for its word that it has the plan; return which."""
        transfer, loop = self.transfer, asyncio.get_running_loop()
        patient_until, deadline = loop.time() + _RADIO_PATIENCE_S, transfer.started_at + RADIO_LIFE
        while not self._has_come(plan):
            links = self._satellite.choice(plan.robot, "plan", _requested(transfer)).links
            patience_s = patient_until - loop.time()
            if "satellite" in links:
                is_by_satellite = transfer.route == "satellite" or self.row is not None
                if patience_s <= 0.0 or is_by_satellite or self._may_leave_radio:
                    return "satellite"
            elif self._is_live(plan):
                return "radio"
            self._check_life(plan, deadline)
            longest_s = self._wall_s(deadline)
            await self._wait(longest_s if patience_s <= 0.0 else min(longest_s, patience_s))
        return "radio"

    async def _by_satellite(self, plan: PlanRecord) -> bool:
        """Follow the plan by satellite; tell whether it is on board, or radio is to be tried."""
        row = await self._begin_by_satellite(plan)
        if row is None:
            await self._wait(_PAUSE_S)
            return False
        level, noted, carrier = "", False, row.carrier
        while not (row.state == "applied" or self._has_come(plan)):
            if not noted and any(part.sends for part in plan_row.ground_of(row).parts):
                await until_stored(self.transfer.id, lambda: self._note_sending(plan, carrier))
                noted = True
            if row.level != level:
                level = row.level
                await self._note(level=level)
            if row.ended_at is not None:
                raise TransferError(row.reason)
            if self._is_live(plan) and self._may_change_to_radio(plan):
                self.row = await self._store.write(
                    lambda session: plan_row.hold(session, self.transfer.id)
                )
                return False
            await self._wait(None)
            row = self.row or row
        return True

    async def _begin_by_satellite(self, plan: PlanRecord) -> OutboxRecord | None:
        """Begin or go on to send by satellite; ``None`` if the robot has no link for it."""
        modem = self._satellite.modem(plan.robot)
        if modem is None:
            return None
        at, blob = self._clock.now(), Blob.of(mission_of(plan))
        life = timedelta(hours=self._satellite.settings(plan.robot).satellite.expiry_h)
        row = await self._store.write(
            lambda session: plan_row.begin_plan(
                session, self.transfer, plan, blob, modem, at=at, expires_at=at + life
            )
        )
        self.row = row
        self._on_change(self.transfer.id)
        return row

    def _may_change_to_radio(self, plan: PlanRecord) -> bool:
        links = self._satellite.choice(plan.robot, "plan", _requested(self.transfer)).links
        return "radio" in links

    async def _send(self, plan: PlanRecord, mission: Mission) -> str:
        """Upload once; return why it did not get on board, or ""."""
        self._on_the_air.clear()
        radio = self._fleet.status(plan.robot).radio
        carrier = "" if radio is None else radio.carrier
        upload = asyncio.ensure_future(
            self._radio.upload(RobotId(plan.robot), mission, may_wait=True)
        )
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
        self._is_kept = report.state is OnboardPlanState.WAITING
        has_come = self._is_kept or report.state in plan_row.HOLDS
        return "" if has_come else report.reason or "the robot did not answer"

    async def _note_sending(self, plan: PlanRecord, carrier: str) -> None:
        """Write down that a radio or a gateway has taken the first bytes."""
        changes: dict[str, object] = {"carrier": carrier}
        if carrier not in SATELLITE_CARRIERS:
            changes["level"] = CommandLevel.QUEUED.value
        text = f"{plan.id} is on its way to {plan.robot}."
        await self._move(TransferEvidence.FIRST_BYTES, text, **changes)

    async def _start(self, plan: PlanRecord) -> None:
        if plan.sha256 is None:
            raise TransferError(f"{plan.id} has no hash.")
        await self._starts_by_itself(plan)
        for _ in range(_ATTEMPTS):
            if self._has_begun(plan):
                break
            link = await self._link_of_commands(plan)
            if self._has_begun(plan):
                break
            command = await self._commands.send(
                plan.robot,
                CommandKind.START,
                by="the station",
                plan=PlanHash(plan.sha256),
                check=lambda session: check_open(session, self.transfer.id),
            )
            if await self._begins(plan, None if link == "radio" else command):
                break
        else:
            raise TransferError(f"{plan.robot} has {plan.id} on board but does not start it.")
        if not self._starts_later(plan):
            await self._move(TransferEvidence.ROBOT_FLIES_IT, "")

    async def _starts_by_itself(self, plan: PlanRecord) -> None:
        """Wait for a robot that was told to start with the plan itself, as satellite does.

        It says so when it calls next; in reach of radio it is asked after a while.
        """
        row = self.row
        if row is None or row.state != "applied":
            return
        loop = asyncio.get_running_loop()
        patient_until: float | None = None
        while not self._has_begun(plan) and self._clock.now() < row.expires_at:
            longest_s = self._wall_s(row.expires_at)
            if not self._is_live(plan):
                patient_until = None
            elif patient_until is None:
                patient_until = loop.time() + _START_PATIENCE_S
            elif loop.time() >= patient_until:
                return
            if patient_until is not None:
                longest_s = min(longest_s, patient_until - loop.time())
            await self._wait(longest_s)

    async def _link_of_commands(self, plan: PlanRecord) -> LinkKind:
        """Wait until the robot can be told to start, or says that it has; return by which link."""
        deadline = self._clock.now() + RADIO_LIFE
        while not self._has_begun(plan):
            if self._is_live(plan):
                return "radio"
            links = self._satellite.choice(plan.robot, "command").links
            if self.row is not None and "satellite" in links:
                return "satellite"
            self._check_life(plan, deadline)
            await self._wait(self._wall_s(deadline))
        return "radio"

    async def _begins(self, plan: PlanRecord, command: str | None) -> bool:
        """Wait for the robot to say that it flies the plan.

        Args:
            plan: The plan.
            command: One by satellite, whose answer takes until it expires; else ``None``.
        """
        if await self._until(lambda: self._has_begun(plan), _START_PATIENCE_S) or command is None:
            return self._has_begun(plan)
        self._levels[command] = ""
        self._levels[command] = (await self._commands.view(command)).level
        await self._until(lambda: self._has_begun(plan) or self._levels[command] in SETTLED)
        return self._has_begun(plan)

    async def _until(self, is_so: Callable[[], bool], longest_s: float | None = None) -> bool:
        """Wait for news until something is so, at most so long by the wall; tell whether it is."""
        loop = asyncio.get_running_loop()
        deadline = None if longest_s is None else loop.time() + longest_s
        while not is_so():
            if deadline is not None and loop.time() >= deadline:
                return False
            await self._wait(None if deadline is None else deadline - loop.time())
        return True

    async def _wait(self, longest_s: float | None) -> None:
        """Wait for news, at most so long by the wall."""
        await set_or_after(self._news, longest_s)
        self._news.clear()

    def _wall_s(self, moment: datetime) -> float:
        """Return the time by the wall until a moment of the robots' clock."""
        return max(0.0, (moment - self._clock.now()).total_seconds() / self._clock.speed)

    def _check_life(self, plan: PlanRecord, deadline: datetime) -> None:
        if self._clock.now() > deadline:
            raise TransferError(f"{plan.robot} was not heard for {RADIO_LIFE.days} day.")

    def _is_live(self, plan: PlanRecord) -> bool:
        return self._fleet.status(plan.robot).radio_state is LinkState.LIVE

    def _report_of(self, plan: PlanRecord) -> PlanReport | None:
        report = self._fleet.status(plan.robot).plan_report
        return report if report is not None and report.sha256 == plan.sha256 else None

    def _holds(self, plan: PlanRecord) -> bool:
        report = self._report_of(plan)
        return report is not None and report.state in plan_row.HOLDS

    def _keeps(self, plan: PlanRecord) -> bool:
        """Tell whether the robot says that the plan waits behind the one on board."""
        queue = self._fleet.status(plan.robot).plan_queue
        return queue is not None and plan.sha256 is not None and queue.next_sha256 == plan.sha256

    def _has_come(self, plan: PlanRecord) -> bool:
        return self._holds(plan) or self._keeps(plan)

    def _starts_later(self, plan: PlanRecord) -> bool:
        """Tell whether the robot says that it begins the plan at the next surfacing."""
        queue = self._fleet.status(plan.robot).plan_queue
        return self._keeps(plan) and queue is not None and queue.next_starts

    def _has_begun(self, plan: PlanRecord) -> bool:
        """Tell whether the robot flies the plan by its own word, or will at the next surfacing."""
        report = self._report_of(plan)
        return self._starts_later(plan) or (report is not None and report.state in BEGUN)

    async def _note(self, **changes: object) -> None:
        await self._store.write(lambda session: note(session, self.transfer.id, **changes))
        self._on_change(self.transfer.id)

    async def _move(self, evidence: TransferEvidence, text: str, **changes: object) -> None:
        at = self._clock.now()
        await self._store.write(
            lambda session: apply(session, self.transfer.id, evidence, at, text, **changes)
        )
        self._on_change(self.transfer.id)

    async def _give_up(self, reason: str) -> None:
        at, failed = self._clock.now(), TransferEvidence.FAILED
        await self._store.write(
            lambda session: close(session, self.transfer.id, failed, reason, at, calls_back=True)
        )
        self._on_change(self.transfer.id)


def _requested(transfer: TransferRecord) -> RequestedLink:
    match transfer.route:
        case "radio" | "satellite" as asked:
            return asked
        case _:
            return "auto"
