"""The way out: rows become messages, and messages are handed to gateways.

A message is a row in state "sending" before the gateway is called. Whoever is killed in between
leaves that row behind, and it is handed over again: the same bytes under the same number, which
the gateway may charge again but the robot takes once.
"""

import asyncio
import logging
from collections.abc import Callable
from datetime import timedelta
from typing import Final, Protocol

from sqlalchemy.orm import Session

from db.fault import StoreError, StoreUnavailableError
from db.query.satellite.outbox import OutboxRecord, get_outbox, open_outbox
from db.query.satellite.satellite_messages import SENDING, SatelliteMessage, messages_in
from db.store import Store
from robot_link.clock import Clock
from robot_link.station.gateway.gateway import (
    GatewayRefusal,
    GatewayUnreachableError,
    Taken,
    retry_after_s,
)
from server.base.retry_queue import until_stored
from server.base.wakeups import Wakeups
from server.satellite import message_row
from server.satellite.budget import utc_day
from server.satellite.message_row import Call
from server.satellite.preparing import Looked, expire, needs_work, prepare
from server.satellite.row_kind import FIRST_PRIORITY, Means, RowKinds

log = logging.getLogger(__name__)

_MENDED_S: Final = 60.0
"""Wall time after which what waits is looked at again: a key's file may have been mended."""


class Sender(Protocol):
    """Hands messages to the gateway of a carrier; ``server.satellite.gateways.Gateways``."""

    async def send(
        self,
        carrier: str,
        imei: str,
        data: bytes,
        *,
        client_id: int,
        flush: bool = False,
        priority: int = 5,
    ) -> Taken:
        """Hand one message over; raises as the ``SatelliteGateway`` of ``robot_link``."""
        ...


class Outbox:
    """Sends what is due, to each modem one message after another. Belongs to one event loop.

    Args:
        store: Where the rows are.
        clock: The robots' clock.
        sender: The gateways.
        kinds: What the rows mean.
        means: Returns what sending a row takes, or a sentence that says why nothing may be sent.
        on_change: Called with each row that changed, after the commit.
    """

    def __init__(
        self,
        store: Store,
        clock: Clock,
        sender: Sender,
        kinds: RowKinds,
        means: Callable[[OutboxRecord], Means | str],
        on_change: Callable[[OutboxRecord], None],
    ) -> None:
        self._store = store
        self._clock = clock
        self._sender = sender
        self._kinds = kinds
        self._means = means
        self._on_change = on_change
        self._looks = Wakeups(clock)
        self._calls: dict[str, asyncio.Task[None]] = {}
        self._called: dict[str, SatelliteMessage] = {}
        self.waits: dict[str, str] = {}
        """Why an open row is not sent on, by its id."""
        self._over_budget: dict[str, str] = {}
        """Robots by the rows that wait for a budget."""

    def stir(self) -> None:
        """Look at once: something new is to be sent, or an obstacle is gone."""
        self._looks.wake()

    def waits_for_budget(self, robot: str) -> bool:
        """Tell whether something for a robot is not sent because today's budget is spent."""
        return robot in self._over_budget.values()

    async def run(self) -> None:
        """Send until cancelled."""
        try:
            while True:
                await until_stored("the satellite outbox", self.step)
                await self._looks.next()
        finally:
            await self._let_go()

    async def step(self) -> None:
        """Do what is due now; calls of gateways go on by themselves."""
        now = self._clock.now()
        rows = await self._store.query(open_outbox)
        waits: dict[str, str] = {}
        over_budget: dict[str, str] = {}
        for row in rows:
            looked = await self._look_at(row)
            if looked.waits:
                waits[row.id] = looked.waits
            if looked.is_over_budget:
                over_budget[row.id] = row.robot
        before, self.waits, self._over_budget = self.waits, waits, over_budget
        for row in [one for one in {**before, **waits} if waits.get(one) != before.get(one)]:
            self._changed(
                await self._store.query(lambda session, row=row: get_outbox(session, row))
            )
        free = await self._store.query(_messages)
        for message, row in free:
            if message.retry_at is None or message.retry_at <= now:
                self._call(message, row)
        moments = [row.expires_at for row in rows]
        moments += [one.retry_at for one, _ in free if one.retry_at is not None]
        if over_budget:
            moments.append(utc_day(now)[1])
        if waits:
            moments.append(now + timedelta(seconds=_MENDED_S * max(1.0, self._clock.speed)))
        self._looks.set_due("", min([one for one in moments if one > now], default=None))

    async def settle(self) -> None:
        """Wait until no gateway is being called."""
        while self._calls:
            await asyncio.wait(list(self._calls.values()))

    async def _look_at(self, row: OutboxRecord) -> Looked:
        now = self._clock.now()
        if not await self._store.query(lambda session: needs_work(session, self._kinds, row, now)):
            return Looked()
        if now >= row.expires_at:
            kinds = self._kinds
            self._changed(
                await self._store.write(lambda session: expire(session, kinds, row.id, now))
            )
            return Looked()
        means = self._means(row)
        if isinstance(means, str):
            return Looked(means)
        try:
            return await self._store.write(
                lambda session: prepare(session, self._kinds, row.id, means, now)
            )
        except (ValueError, KeyError) as error:
            log.exception("%s cannot be sent", row.id)
            return Looked(f"It cannot be sent: {error}")

    def _call(self, message: SatelliteMessage, row: OutboxRecord) -> None:
        """Call the gateway; what is urgent does not wait for what is being said before it."""
        busy = any(other.imei == message.imei for other in self._called.values())
        if message.id in self._calls or (busy and not self._kinds.of(row).is_urgent(row)):
            return
        if row.state != "open" or isinstance(self._means(row), str):
            return
        name = f"{message.id} to {message.robot} by {message.carrier}"
        task = asyncio.create_task(self._hand_over(message), name=name)
        self._calls[message.id], self._called[message.id] = task, message
        task.add_done_callback(lambda _: self._called_back(message.id))

    def _called_back(self, message: str) -> None:
        task = self._calls.pop(message)
        del self._called[message]
        if not task.cancelled() and task.exception() is not None:
            log.error("%s was not handed over", task.get_name(), exc_info=task.exception())
        self.stir()

    async def _hand_over(self, message: SatelliteMessage) -> None:
        call = await self._begin_call(message)
        if call is None:
            return
        try:
            answer = await self._sender.send(
                message.carrier,
                message.imei,
                message.data,
                client_id=message.client_id,
                flush=call.flush,
                priority=message.priority,
            )
        except GatewayUnreachableError as error:
            await self._postpone(message, error.sentence)
        except GatewayRefusal as error:
            if error.retry == "later":
                await self._postpone(message, error.sentence)
            else:
                await self._refuse(message, error.sentence)
        except ValueError as error:
            await self._refuse(message, f"{error}.")
        else:
            await self._take(call, answer)

    async def _begin_call(self, message: SatelliteMessage) -> Call | None:
        """Write the call down before it is made; what is urgent does not wait for a disk."""
        try:
            return await self._store.write(lambda s: message_row.begin_call(s, message.id))
        except StoreUnavailableError as error:
            log.warning("%s is not written down as called: %s", message.id, error)
            return Call(message, flush=False) if message.priority == FIRST_PRIORITY else None

    async def _take(self, call: Call, answer: Taken) -> None:
        at, message = self._clock.now(), call.message
        await self._note(message, lambda s: message_row.taken(s, self._kinds, call, answer, at))

    async def _postpone(self, message: SatelliteMessage, sentence: str) -> None:
        at = self._clock.now()
        wait_s = retry_after_s(message.attempts + 1) * max(1.0, self._clock.speed)
        retry_at = at + timedelta(seconds=wait_s)
        await self._note(
            message,
            lambda s: message_row.postponed(s, self._kinds, message.id, sentence, at, retry_at),
        )

    async def _refuse(self, message: SatelliteMessage, sentence: str) -> None:
        at = self._clock.now()
        await self._note(
            message, lambda s: message_row.refused(s, self._kinds, message.id, sentence, at)
        )

    async def _note(
        self, message: SatelliteMessage, write: Callable[[Session], OutboxRecord]
    ) -> None:
        async def work() -> None:
            self._changed(await self._store.write(write))

        try:
            await until_stored(message.id, work)
        except StoreError as error:
            # The row still says "sending": it is handed over again at the next start.
            log.warning("%s: what the gateway said was not kept: %s", message.id, error)

    def _changed(self, row: OutboxRecord) -> None:
        self._on_change(row)

    async def _let_go(self) -> None:
        calls = list(self._calls.values())
        for call in calls:
            call.cancel()
        await asyncio.gather(*calls, return_exceptions=True)


def _messages(session: Session) -> list[tuple[SatelliteMessage, OutboxRecord]]:
    """Return the messages that a gateway is to have, the urgent ones first, with their rows."""
    found = [(one, get_outbox(session, one.outbox)) for one in messages_in(session, SENDING)]
    return sorted(found, key=lambda pair: pair[0].priority > FIRST_PRIORITY)
