"""A station's satellite side, put together: what others of the station ask of it."""

import asyncio
import logging
from collections import defaultdict
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from db.query.satellite.outbox import OutboxRecord
from robot_link.messages import PlanQueue, PlanReport
from robot_link.report import SatelliteReport
from robot_link.station.gateway.gateway import HeldBackError, MobileOriginated
from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.base.retry_queue import RetryQueue, until_stored
from server.base.secret import SecretUnreadableError
from server.base.wakeups import Wakeups
from server.fleet.disabled_links import DisabledLinks
from server.fleet.fleet import Fleet
from server.fleet.link_view import SatelliteView
from server.fleet.routing import LinkChoice, MessageKind, RequestedLink, choose_links
from server.fleet.words import sentence
from server.satellite.account import DEFAULT_SETTINGS, Account, Settings, account_of
from server.satellite.contact import is_out_of_contact, out_of_contact_text
from server.satellite.emergency import EmergencyMessages
from server.satellite.ending import RowsChanged
from server.satellite.hearing import Hearing
from server.satellite.inbox import Inbox
from server.satellite.modem import Modem, modems_of
from server.satellite.outbox import Outbox, Sender
from server.satellite.panel import satellite_view
from server.satellite.row_kind import Means, RowKinds

log = logging.getLogger(__name__)

_REST_S = 0.25
"""Wall time between two looks at the links of robots that report all the time."""
_KINDS = ("satellite", "link")
"""Settings that are kept in memory."""
Tell = Callable[[Sequence[SatelliteReport]], Awaitable[None]]
"""Takes what messages tell, as radio's; returns once it is stored."""


@dataclass(frozen=True, slots=True)
class OutboxChanged:
    """More is known of something that is sent by satellite; published after the commit."""

    row: OutboxRecord


@dataclass(frozen=True, slots=True)
class MessageArrived:
    """A gateway delivered a robot's message, or delivered it again; it is kept."""

    robot: str


@dataclass(frozen=True, slots=True)
class AccountRead:
    """A robot's satellite settings and budget were read anew, or it went out of contact or back."""

    robot: str


class Satellite:
    """What is sent and heard by satellite. Belongs to one event loop.

    Args:
        foundation: The shared parts of the station.
        fleet: The robots as they are now.
        sender: The gateways.
        disabled_links: What the operator has disabled.
        tell: Takes what robots say.
    """

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        sender: Sender,
        disabled_links: DisabledLinks,
        tell: Tell,
    ) -> None:
        self._store = foundation.store
        self._clock = foundation.clock
        self._secrets = foundation.secrets
        self._fleet = fleet
        self._disabled_links = disabled_links
        self._bus = foundation.bus
        self._settings: dict[str, Settings] = {}
        self._accounts: dict[str, Account] = {}
        """What was read of each robot, until something changes it."""
        self._is_held_up: dict[str, bool] = {}
        """Whether each robot was out of contact when it was looked at last."""
        self._looks = Wakeups(foundation.clock, _REST_S)
        self._hearing = Hearing(foundation.store, foundation.clock, fleet, disabled_links)
        self._changes: defaultdict[str, int] = defaultdict(int)
        """How often each robot's account was changed; one that is being read may be old."""
        self._plan_said: dict[str, tuple[datetime, datetime]] = {}
        """When each robot's last word on its plan arrived by satellite, and when it was said."""
        self._queue = RetryQueue("satellite messages")
        self.kinds = RowKinds()
        """Where others register what they send."""
        self.inbox = Inbox(self._store, self._clock, self.kinds, tell)
        self.outbox = Outbox(
            self._store, self._clock, sender, self.kinds, self._means, self._row_changed
        )
        self.emergency = EmergencyMessages(sender)

    async def load(self) -> None:
        """Remember who was heard when, and finish what the station had not done when it stopped."""
        await self.refresh()
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
            group.create_task(self.emergency.run(), name="satellite emergencies")
            group.create_task(self._look(), name="satellite links")

    async def refresh(self) -> None:
        """Read settings, budgets and last sessions anew, and show them."""
        self._accounts.clear()
        for status in list(self._fleet.statuses):
            await self._look_at(status.record.id)

    def robot_changed(self, robot: str) -> None:
        """Take that a robot said something, or that a link to it changed."""
        if modems_of(self._fleet.status(robot).record):
            self._looks.wake(robot)

    def settings_changed(self, event: SettingsChanged) -> None:
        """Take that other settings hold for a robot, or for all."""
        if event.kind in _KINDS:
            everyone = [status.record.id for status in self._fleet.statuses]
            for robot in everyone if event.robot is None else [event.robot]:
                self._read_again(robot)
            self.stir()

    def rows_changed(self, event: RowsChanged) -> None:
        """Take that something on its way to a robot began or ended, by whichever hand or link."""
        self._read_again(event.robot)
        self.stir()

    def follow_switch(self) -> None:
        """Have a link that was enabled or disabled count at once."""
        for status in self._fleet.statuses:
            self._hearing.show_links(status, self.settings(status.record.id))
        self.stir()

    @property
    def waits(self) -> Mapping[str, str]:
        """Why rows of the outbox are not sent on, by their ids."""
        return self.outbox.waits

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
        if modem is not None:
            self._bus.publish(MessageArrived(modem.robot))
        if arrival.is_new and modem is not None:
            is_proved = arrival.reading.content is not None
            settings = self.settings(modem.robot)
            self._hearing.note(modem, message, settings, is_proved=is_proved)
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
        return next(iter(self.enabled_modems(robot)), None)

    def obstacle(self, robot: str) -> str:
        """Return why nothing may be sent to a robot unless its operator insists, or ""."""
        status, settings = self._fleet.status(robot), self.settings(robot).satellite
        if is_out_of_contact(status, settings, self._clock.now()):
            return out_of_contact_text(status, settings)
        return ""

    async def view(self, robot: str, limit: int) -> SatelliteView:
        """Return a robot's budget and its newest messages.

        Raises:
            Problem: 404 if there is no such robot.
        """
        status, now = self._fleet.status(robot), self._clock.now()
        return await self._store.query(lambda s: satellite_view(s, self.kinds, status, now, limit))

    def stir(self) -> None:
        """Look at once for what is to be sent."""
        self.outbox.stir()

    def enabled_modems(self, robot: str) -> tuple[Modem, ...]:
        """Return the satellite links of a robot that may be used, the preferred one first."""
        modems = modems_of(self._fleet.status(robot).record)
        return tuple(one for one in modems if self._disabled_links.is_enabled(one.uri))

    def robot_key(self, robot: str) -> bytes:
        """Return the key that messages to a robot are signed with.

        Raises:
            SecretUnreadableError: If its file is damaged.
        """
        return self._secrets.robot_key(robot)

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
        if obstacle and not self.kinds.of(row).is_urgent(row) and not row.document.get("is_forced"):
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
        self._bus.publish(OutboxChanged(row))
        if self._fleet.knows(row.robot):
            self._read_again(row.robot)
            self._fleet.touch(row.robot)

    def _read_again(self, robot: str) -> None:
        self._accounts.pop(robot, None)
        self._changes[robot] += 1
        self._looks.wake(robot)

    def _pass_on(self, message: MobileOriginated, values: Sequence[SatelliteReport]) -> None:
        """Pass on what a message tells, but not a word on the plan that came after a newer one."""
        words = PlanReport | PlanQueue
        kept: list[SatelliteReport] = [one for one in values if not isinstance(one, words)]
        for report in values:
            if isinstance(report, PlanReport) and self._is_newest(report, message.session_at):
                self._plan_said[report.robot] = (report.received_at, message.session_at)
                kept.append(report)
                kept += (one for one in values if isinstance(one, PlanQueue))
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
        """Bring the links of robots up to date when something changed, or is due by the clock."""
        while True:
            for robot in await self._looks.next():
                await until_stored("satellite links", lambda robot=robot: self._look_at(robot))

    async def _look_at(self, robot: str) -> None:
        if not self._fleet.knows(robot):
            return
        status = self._fleet.status(robot)
        modems = modems_of(status.record)
        if not modems:
            return
        account = await self._account(robot)
        for modem in modems:
            await self._hearing.remember(modem)
        waits = self.outbox.waits_for_budget(robot)
        self._hearing.show(status, account, waits_for_budget=waits)
        is_held_up = bool(self.obstacle(robot))
        if self._is_held_up.get(robot) != is_held_up:
            self._is_held_up[robot] = is_held_up
            self._bus.publish(AccountRead(robot))
            self.stir()
        moments = [account.until, *self._hearing.due_at(status, account.settings)]
        now = self._clock.now()
        self._looks.set_due(robot, min([one for one in moments if one > now], default=None))

    async def _account(self, robot: str) -> Account:
        """Return what holds for a robot, read anew if something may have changed it."""
        account, at = self._accounts.get(robot), self._clock.now()
        if account is None or account.until <= at:
            changes = self._changes[robot]
            account = await self._store.query(
                lambda session: account_of(session, self.kinds, robot, at)
            )
            if changes == self._changes[robot]:  # else it is read once more by the look it woke
                self._accounts[robot] = account
            self._bus.publish(AccountRead(robot))
            if self._settings.get(robot) != account.settings:
                self._settings[robot] = account.settings
                self._fleet.touch(robot)
        return account
