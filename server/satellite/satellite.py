"""A station's satellite side, put together: what others of the station ask of it."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from db.query import outbox as outbox_query
from db.query.commands import CommandRecord
from db.query.outbox import OutboxRecord
from db.query.plans import PlanRecord
from db.query.transfers import TransferRecord, open_transfers
from robot_link.messages import (
    CommandKind,
    CommandNumber,
    CommandReport,
    PlanReport,
)
from robot_link.satellite.blob import Blob
from robot_link.satellite.order import pack_order
from robot_link.station.gateway.gateway import HeldBackError, MobileOriginated
from robot_link.station.ground import next_counter
from server.access.foundation import Foundation
from server.base.problem import conflict
from server.base.retry_queue import RetryQueue, until_stored
from server.base.secret import SecretUnreadableError
from server.fleet.disabled_links import DisabledLinks
from server.fleet.fleet import Fleet
from server.fleet.link_view import SatelliteQuoteView, SatelliteView
from server.fleet.routing import LinkChoice, MessageKind, RequestedLink, choose_links
from server.fleet.words import sentence
from server.plan.document import mission_of
from server.satellite import order_row, plan_row
from server.satellite.budget import budget_of
from server.satellite.contact import is_out_of_contact, out_of_contact_text
from server.satellite.content import Telling
from server.satellite.hearing import Hearing
from server.satellite.inbox import Inbox
from server.satellite.modem import Modem, modems_of
from server.satellite.outbox import LOOK_S, Outbox, Sender
from server.satellite.panel import satellite_view
from server.satellite.preparing import Means
from server.satellite.preview import Circumstances, has_mission, quote_view
from server.satellite.standing import DEFAULT_SETTINGS, Settings, accounts
from server.satellite.unwritten import UnwrittenOrders

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class SatelliteListeners:
    """Who is told what; all are called on the event loop."""

    tell: Callable[[Sequence[Telling]], Awaitable[None]]
    """Takes what messages tell, as radio's; returns once it is stored."""
    level: Callable[[CommandReport], None]
    """Takes levels of commands that are not written down with what proved them."""


class Satellite:
    """Plans, orders and messages by satellite. Belongs to one event loop.

    Args:
        foundation: The shared parts of the station.
        fleet: The robots as they are now.
        sender: The gateways.
        disabled_links: What the operator has disabled.
        listeners: Who is told what.
    """

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        sender: Sender,
        disabled_links: DisabledLinks,
        listeners: SatelliteListeners,
    ) -> None:
        self._store = foundation.store
        self._clock = foundation.clock
        self._secrets = foundation.secrets
        self._fleet = fleet
        self._disabled_links = disabled_links
        self._listeners = listeners
        self._settings: dict[str, Settings] = {}
        self._hearing = Hearing(foundation.store, foundation.clock, fleet, disabled_links)
        self._rows: dict[str, OutboxRecord] = {}
        """Newest row of each transfer that is or was under way by satellite since the start."""
        self._plan_said: dict[str, tuple[datetime, datetime]] = {}
        """When each robot's last word on its plan arrived by satellite, and when it was said."""
        self._queue = RetryQueue("satellite messages")
        self.inbox = Inbox(self._store, self._clock, listeners.tell)
        self.outbox = Outbox(self._store, self._clock, sender, self._means, self._row_changed)
        self._unwritten = UnwrittenOrders(sender)

    async def load(self) -> None:
        """Remember who was heard when, and finish what the station had not done when it stopped."""
        await self.refresh()
        for row in await self._store.query(_rows_under_way):
            self._row_changed(row)
        for record in await self.inbox.unsettled():
            modem = self._modem(record.message.imei)
            if modem is not None:
                try:
                    key = self._secrets.robot_key(modem.robot)
                except SecretUnreadableError as error:
                    log.error("what %s said is not passed on: %s", modem.robot, error)  # noqa: TRY400 - the text says all
                    continue
                values = await self.inbox.values_again(record, modem, key)
                self._pass_on(record.message, values)

    async def run(self) -> None:
        """Serve until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.outbox.run(), name="satellite outbox")
            group.create_task(self._queue.run(), name="satellite messages")
            group.create_task(self._unwritten.run(), name="unwritten satellite orders")
            group.create_task(self._look(), name="satellite links")

    async def refresh(self) -> None:
        """Read settings, budgets and last sessions anew, and show them."""
        at = self._clock.now()
        statuses = {p.record.id: p for p in self._fleet.statuses if modems_of(p.record)}
        found = await self._store.query(lambda session: accounts(session, statuses, at))
        for robot, status in statuses.items():
            self._settings[robot] = found[robot].settings
            for modem in modems_of(status.record):
                await self._hearing.remember(modem)
            waits = self.outbox.waits_for_budget(robot)
            self._hearing.show(status, found[robot], waits_for_budget=waits)

    @property
    def waits(self) -> Mapping[str, str]:
        """Why rows of the outbox are not sent on, by their ids."""
        return self.outbox.waits

    def is_enabled(self, imei: str) -> bool:
        """Tell whether messages of a modem are taken; a stranger's are."""
        modem = self._modem(imei)
        return modem is None or self._disabled_links.is_enabled(modem.uri)

    async def take(self, message: MobileOriginated) -> bool:
        """Take what a gateway delivers; tell whether it is new. It is kept when this returns.

        Raises:
            HeldBackError: The operator has unplugged the link, or the robot's key cannot be read;
                the gateway must keep the message.
            StoreUnavailableError: It could not be kept; the gateway must deliver it again.
        """
        modem = self._modem(message.imei)
        if modem is not None and not self._disabled_links.is_enabled(modem.uri):
            raise HeldBackError(f"The satellite link of {modem.robot} is unplugged.")
        try:
            key = b"" if modem is None else self._secrets.robot_key(modem.robot)
        except SecretUnreadableError as error:
            raise HeldBackError(sentence(error)) from error
        arrival = await self.inbox.take(message, modem, key)
        if arrival.is_new and modem is not None:
            settings, is_bad = self.settings(modem.robot), bool(arrival.reading.fault)
            self._hearing.note(modem, message, settings, is_bad=is_bad)
            for row in arrival.changed:
                self._row_changed(row)
            if not arrival.reading.fault:
                self._pass_on(message, arrival.values)
            self.outbox.stir()
        return arrival.is_new

    def settings(self, robot: str) -> Settings:
        """Return the settings that hold for a robot, as they were read last."""
        return self._settings.get(robot, DEFAULT_SETTINGS)

    def choice(
        self, robot: str, kind: MessageKind, requested: RequestedLink = "auto"
    ) -> LinkChoice:
        """Choose the links of a message to a robot."""
        status, routing = self._fleet.status(robot), self.settings(robot).routing
        setting: RequestedLink = routing.plan if kind == "plan" else routing.command
        return choose_links(kind, status.known_links, setting, requested)

    def modem(self, robot: str) -> Modem | None:
        """Return the satellite link that a robot is told things by."""
        modems = modems_of(self._fleet.status(robot).record)
        return next((one for one in modems if self._disabled_links.is_enabled(one.uri)), None)

    def obstacle(self, robot: str) -> str:
        """Return why nothing may be sent to a robot unless its operator insists, or ""."""
        status, settings = self._fleet.status(robot), self.settings(robot).satellite
        if is_out_of_contact(status, settings, self._clock.now()):
            return out_of_contact_text(status, settings)
        return ""

    async def quote(self, plan: PlanRecord) -> SatelliteQuoteView:
        """Return what a plan would cost, and what speaks against sending it by satellite.

        Raises:
            Problem: 409 if there is nothing to send yet, or it is too long for satellite.
        """
        if not has_mission(plan):
            raise conflict(f"{plan.id} is {plan.state}; there is nothing to send.")
        robot, now = plan.robot, self._clock.now()
        tariff, modem = self.settings(robot).satellite.tariff, self.modem(robot)
        given = Circumstances(
            status=self._fleet.status(robot),
            tariff=tariff,
            budget=await self._store.query(lambda s: budget_of(s, robot, tariff, now)),
            choice=self.choice(robot, "plan"),
            carrier=None if modem is None else modem.carrier,
            road_fault=self.choice(robot, "plan", "satellite").reason,
            obstacle=self.obstacle(robot),
            now=now,
        )
        try:
            return quote_view(plan, given)
        except ValueError as error:
            raise conflict(f"{plan.id} cannot go by satellite: {error}.") from error

    async def view(self, robot: str, limit: int) -> SatelliteView:
        """Return a robot's budget and its newest messages.

        Raises:
            Problem: 404 if there is no such robot.
        """
        status, now = self._fleet.status(robot), self._clock.now()
        return await self._store.query(lambda s: satellite_view(s, status, now, limit))

    async def begin(self, transfer: TransferRecord, plan: PlanRecord) -> OutboxRecord | None:
        """Begin or go on to send a plan by satellite; ``None`` if the robot has no link for it."""
        modem = self.modem(transfer.robot)
        if modem is None:
            return None
        at, blob = self._clock.now(), Blob.of(mission_of(plan))
        life = timedelta(hours=self.settings(transfer.robot).satellite.expiry_h)

        def write(session: Session) -> OutboxRecord:
            return plan_row.begin_plan(
                session, transfer, plan, blob, modem, at=at, expires_at=at + life
            )

        row = await self._store.write(write)
        self._row_changed(row)
        self.outbox.stir()
        return row

    def row_of(self, transfer: str) -> OutboxRecord | None:
        """Return how far a transfer is by satellite; ``None`` if it was never to go there."""
        return self._rows.get(transfer)

    def stir(self) -> None:
        """Look at once for what is to be sent."""
        self.outbox.stir()

    async def hold(self, transfer: str) -> None:
        """Send nothing more of a transfer while radio is tried."""
        await self._store.write(lambda session: plan_row.hold(session, transfer))

    def order_in(self, session: Session, command: CommandRecord, *, is_only: bool) -> None:
        """Add the rows of an order with the order itself: to surface, to every link.

        Args:
            session: The transaction of the order.
            command: The order.
            is_only: Whether no other link carries it.
        """
        modems = modems_of(self._fleet.status(command.robot).record)
        enabled = [one for one in modems if self._disabled_links.is_enabled(one.uri)]
        for modem in enabled if command.kind is CommandKind.SURFACE else enabled[:1]:
            order_row.begin_order(session, command, modem, command.created_at, is_only=is_only)

    def surface_unwritten(self, robot: str, number: CommandNumber, expires: datetime) -> None:
        """Send an order to surface that could not be written down: storage must not stop it."""
        status, at = self._fleet.status(robot), self._clock.now()
        try:
            key = self._secrets.robot_key(robot)
        except SecretUnreadableError as error:
            log.critical("%s is not told by satellite to surface: %s", robot, error)
            return
        for modem in modems_of(status.record):
            if self._disabled_links.is_enabled(modem.uri):
                counter = next_counter(0, at)
                data = pack_order(
                    CommandKind.SURFACE, number, expires, None, key, modem.system, counter
                )
                self._unwritten.add(modem, number, data, self._listeners.level, self._clock)

    def _means(self, row: OutboxRecord) -> Means | str:
        if not self._fleet.knows(row.robot):
            return f"There is no robot {row.robot} any more."
        status = self._fleet.status(row.robot)
        modem = next((one for one in modems_of(status.record) if one.imei == row.imei), None)
        if modem is None:
            return f"{row.robot} has no modem {row.imei} any more."
        if not self._disabled_links.is_enabled(modem.uri):
            return "The satellite link is unplugged."
        obstacle = self.obstacle(row.robot)
        if obstacle and not order_row.is_surface(row) and not row.document.get("is_forced"):
            return f"{obstacle} It is sent when the robot is heard again."
        try:
            key = self._secrets.robot_key(row.robot)
        except SecretUnreadableError as error:
            return sentence(error)
        return Means(modem, key, self.settings(row.robot).satellite.tariff)

    def _modem(self, imei: str) -> Modem | None:
        for status in self._fleet.statuses:
            for modem in modems_of(status.record):
                if modem.imei == imei:
                    return modem
        return None

    def _row_changed(self, row: OutboxRecord) -> None:
        if row.transfer is not None:
            self._rows[row.transfer] = row
        if self._fleet.knows(row.robot):
            self._fleet.touch(row.robot)

    def _pass_on(self, message: MobileOriginated, values: Sequence[Telling]) -> None:
        """Pass on what a message tells, but not a word on the plan that came after a newer one."""
        kept: list[Telling] = [one for one in values if not isinstance(one, PlanReport)]
        for report in values:
            if isinstance(report, PlanReport) and self._is_newest(report, message.session_at):
                self._plan_said[report.robot] = (report.received_at, message.session_at)
                kept.append(report)
        self._queue.add(lambda: self.inbox.settle(message, kept))

    def _is_newest(self, report: PlanReport, session_at: datetime) -> bool:
        known = self._fleet.status(report.robot).plan_report
        arrived_at, said_at = self._plan_said.get(report.robot, (None, None))
        if said_at is not None and session_at < said_at:
            return False
        if known is None or known.received_at == arrived_at:
            return True
        return session_at >= known.received_at

    async def _look(self) -> None:
        while True:
            await until_stored("satellite links", self.refresh)
            await asyncio.sleep(LOOK_S)


def _rows_under_way(session: Session) -> list[OutboxRecord]:
    """Return the rows that have not ended, and those whose transfers have not noticed their end."""
    transfers = [
        outbox_query.outbox_of_transfer(session, one.id) for one in open_transfers(session)
    ]
    return [*outbox_query.open_outbox(session), *(row for row in transfers if row is not None)]
