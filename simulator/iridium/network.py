"""The Iridium network between modems on robots and gateways ashore.

Everything that takes time takes it by the robots' clock. One network belongs to one event loop.
"""

import asyncio
import random
from collections.abc import Callable, Mapping
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path

from robot_link.clock import Clock
from simulator.iridium.acceptance import Accepted, Reason, RefusedError
from simulator.iridium.conditions import SatelliteConditions
from simulator.iridium.line import OUTGOING_CAPACITY, SEQUENCE, Line
from simulator.iridium.memory import MemoryFile, NetworkMemory
from simulator.iridium.message_queue import LOWEST_PRIORITY, QueuedMessage
from simulator.iridium.session import (
    MobileOriginatedMessage,
    MobileOriginatedStatus,
    MobileTerminatedStatus,
    Place,
    SessionResult,
)
from simulator.iridium.subscriber import Account, Carrier, Subscriber, credit_count

MAX_MOBILE_ORIGINATED = 340
"""Bytes of one message of a 9602 modem."""

_SECOND_RING_S = 20.0
_QUIET_S = 10.0
"""A message that follows another one sooner causes no ring of its own."""
_KM_PER_DEGREE = 111.2


class IridiumNetwork:
    """Queues, sessions, rings and bills of a satellite service.

    ``in_view(imei)`` says whether a modem has power and sees the sky now. The customers' end is
    a gateway: it calls ``accept`` for each message to a modem, and is called for each message
    from one. With a ``memory_file`` another network of a later process goes on where this one
    ended; sessions and rings under way are lost.
    """

    def __init__(
        self,
        rng: random.Random,
        conditions: SatelliteConditions,
        clock: Clock,
        in_view: Callable[[str], bool] = lambda _imei: True,
        memory_file: Path | None = None,
    ) -> None:
        self.conditions = conditions
        """May be replaced at any time."""
        self.clock = clock
        self._rng = rng
        self._in_view = in_view
        self._lines: dict[str, Line] = {}
        self._gateways: dict[Carrier, list[Callable[[MobileOriginatedMessage], None]]] = {}
        self._memory_file = None if memory_file is None else MemoryFile(memory_file)
        memory = NetworkMemory() if self._memory_file is None else self._memory_file.load()
        self._memories = memory.lines
        self._next_id = memory.next_id
        self._unclaimed: list[MobileOriginatedMessage] = []
        """Messages from modems for which there is no gateway yet."""

    # ---- customers -----------------------------------------------------------------------------

    def add_subscriber(
        self,
        imei: str,
        account: Account,
        *,
        carrier: Carrier = "rockblock",
        serial: int = 0,
        thing: str = "",
    ) -> Subscriber:
        """Make a modem known; return its entry, whose switches may be changed at any time.

        Raises:
            ValueError: If this is no IMEI, or is known already.
        """
        if imei in self._lines:
            raise ValueError(f"the modem {imei} is known already")
        subscriber = Subscriber(imei, account, carrier, serial or int(imei[-5:]), thing)
        line = self._lines[imei] = Line(subscriber)
        if imei in self._memories:
            line.remember(self._memories[imei])
            self._unclaimed += line.outgoing.values()
        return subscriber

    def subscriber(self, imei: str) -> Subscriber | None:
        """Return a modem's entry."""
        line = self._lines.get(imei)
        return None if line is None else line.subscriber

    @property
    def subscribers(self) -> Mapping[str, Subscriber]:
        """Every modem by its IMEI."""
        return {imei: line.subscriber for imei, line in self._lines.items()}

    @property
    def credits_charged(self) -> Mapping[str, int]:
        """What messages to each modem have cost."""
        return {imei: line.credits_charged for imei, line in self._lines.items()}

    @property
    def mobile_originated_credits(self) -> Mapping[str, int]:
        """What messages from each modem have cost."""
        return {imei: line.mobile_originated_credits for imei, line in self._lines.items()}

    def waiting(self, imei: str) -> tuple[QueuedMessage, ...]:
        """Return what waits for a modem or is on its way into the queue, the next one first.

        Raises:
            RefusedError: If the modem is not known.
        """
        return tuple(self._swept(imei).queue)

    # ---- a gateway's side ----------------------------------------------------------------------

    def on_message(
        self, carrier: Carrier, callback: Callable[[MobileOriginatedMessage], None]
    ) -> Callable[[], None]:
        """Tell a gateway of each session of its modems; return what ends that.

        The gateway calls ``settle`` for a message that need not be remembered any longer.
        """
        callbacks = self._gateways.setdefault(carrier, [])
        callbacks.append(callback)
        unclaimed, self._unclaimed = self._unclaimed, []
        for message in unclaimed:
            self._later(0.0, self._hand_over, self._lines[message.imei], message)
        return partial(callbacks.remove, callback)

    def settle(self, message: MobileOriginatedMessage) -> None:
        """Forget a message that its customer has taken, or never will."""
        self._lines[message.imei].outgoing.pop(message.record_id, None)
        self._remember()

    def accept(
        self,
        imei: str,
        data: bytes,
        *,
        priority: int = LOWEST_PRIORITY,
        flush: bool = False,
        mtmsn: int | None = None,
    ) -> Accepted:
        """Queue a message for a modem and charge its account.

        Args:
            imei: The modem.
            data: 1 to 270 bytes.
            priority: 1 (first) to 5.
            flush: Whether to delete first what waits.
            mtmsn: The message's number, 1 to 65535, instead of the network's own.

        Raises:
            RefusedError: If the message is not taken; nothing is charged or deleted then.
        """
        line = self._swept(imei)
        credits_needed = line.price_of(data, mtmsn)
        if flush:
            line.queue.flush()
        if not line.queue.has_room(priority):
            raise RefusedError(Reason.QUEUE_FULL)
        if mtmsn is None:
            mtmsn = line.mtmsn = line.mtmsn % (SEQUENCE - 1) + 1
        now = self.clock.now()
        delay_s = self._transit_s()
        ready_at = now + timedelta(seconds=delay_s)
        message = QueuedMessage(self._number(), mtmsn, data, priority, now, ready_at)
        position = line.queue.put(message)
        line.charge(credits_needed)
        self._remember()
        self._later(delay_s, self._announce, line, ready_at)
        return Accepted(message.message_id, mtmsn, position)

    def flush(self, imei: str) -> int:
        """Delete what waits for a modem; return how many messages that were.

        Raises:
            RefusedError: If the modem is not known.
        """
        count = self._swept(imei).queue.flush()
        self._remember()
        return count

    def ring(self, imei: str) -> None:
        """Ring a modem that has no message.

        Raises:
            RefusedError: If the modem is not known or is not to be rung.
        """
        line = self._swept(imei)
        if not line.subscriber.is_ring_enabled:
            raise RefusedError(Reason.RING_DISABLED)
        self._ring(line)

    def draw(self, probability: float) -> bool:
        """Return whether a chance event happens."""
        return self._rng.random() < probability

    # ---- a modem's side ------------------------------------------------------------------------

    def has_signal(self, imei: str) -> bool:
        """Return whether a modem finds the network now."""
        return imei in self._lines and not self.conditions.outage and self._in_view(imei)

    def signal(self, imei: str) -> int:
        """Return how strong a modem hears the network, 0 to 5."""
        return self._rng.randint(2, 5) if self.has_signal(imei) else 0

    def on_ring(self, imei: str, callback: Callable[[], None]) -> Callable[[], None]:
        """Tell a modem of rings; return what ends that.

        Raises:
            KeyError: If the modem is not known.
        """
        callbacks = self._lines[imei].ring_callbacks
        callbacks.append(callback)
        return partial(callbacks.remove, callback)

    async def session(
        self, imei: str, data: bytes | None, place: Place | None = None
    ) -> SessionResult:
        """Send at most one message from a modem and fetch at most one for it.

        Args:
            imei: The modem.
            data: The message; None only looks into the mailbox.
            place: Where the modem is, if it matters.
        """
        line = self._lines.get(imei)
        if line is None or not line.subscriber.is_attached:
            return _failed(MobileOriginatedStatus.ACCESS_DENIED, 0)
        if line.is_in_session:
            return _failed(MobileOriginatedStatus.BUSY, line.momsn)
        if data is not None and len(data) > MAX_MOBILE_ORIGINATED:
            return _failed(MobileOriginatedStatus.TOO_MANY_SEGMENTS, line.momsn)
        line.is_in_session = True
        try:
            return await self._session(line, data or b"", place)
        finally:
            line.is_in_session = False
            self._remember()

    # ---- within --------------------------------------------------------------------------------

    async def _session(self, line: Line, data: bytes, place: Place | None) -> SessionResult:
        imei = line.subscriber.imei
        if not self.has_signal(imei):
            await self._wait(self.conditions.session_s)
            return _failed(MobileOriginatedStatus.NO_NETWORK, line.momsn)
        await self._wait(self.conditions.session_s)
        lost = _failed(MobileOriginatedStatus.LINK_LOST, line.momsn)
        if not self.has_signal(imei):
            return lost
        trouble = self._trouble()
        if trouble == "before":
            self._report(line, b"", place, mtmsn=0, status=13)
            return lost
        if trouble == "after":
            self._report(line, data, place, mtmsn=0)
            return lost
        result = self._fetch(line)
        if trouble != "ashore":
            self._report(line, data, place, mtmsn=result.mtmsn)
        line.momsn = (line.momsn + 1) % SEQUENCE
        return result

    def _trouble(self) -> str:
        if not self.draw(self.conditions.mobile_originated_loss):
            return ""
        return self._rng.choice(("before", "after", "ashore"))

    def _fetch(self, line: Line) -> SessionResult:
        """Let a modem fetch what is next in its queue."""
        ok = MobileOriginatedStatus.OK
        ready = self._swept(line.subscriber.imei).queue.ready(self.clock.now())
        if not ready:
            return SessionResult(ok, line.momsn)
        is_overtaken = len(ready) > 1 and self.draw(self.conditions.reordering)
        message = self._rng.choice(ready[1:]) if is_overtaken else ready[0]
        if not self.draw(self.conditions.duplication):
            line.queue.remove(message)
            ready.remove(message)
        if self.draw(self.conditions.loss):
            error = MobileTerminatedStatus.ERROR
            return SessionResult(ok, line.momsn, error, message.mtmsn, None, len(ready))
        received = MobileTerminatedStatus.RECEIVED
        return SessionResult(ok, line.momsn, received, message.mtmsn, message.data, len(ready))

    def _report(
        self, line: Line, data: bytes, place: Place | None, *, mtmsn: int, status: int = 0
    ) -> None:
        """Bring a session to the gateway's knowledge, after a while, perhaps twice."""
        if status == 0:
            line.mobile_originated_credits += credit_count(len(data))
        cep_km = self._rng.randint(1, 8)
        place = self._blur(place, cep_km)
        message = MobileOriginatedMessage(
            record_id=self._number(),
            imei=line.subscriber.imei,
            session_at=self.clock.now().replace(microsecond=0),
            session_status=status,
            momsn=line.momsn,
            mtmsn=mtmsn,
            data=data,
            latitude_deg=place.latitude_deg,
            longitude_deg=place.longitude_deg,
            cep_km=cep_km,
        )
        line.post(message)
        delay_s = self._transit_s()
        if self.draw(self.conditions.reordering):
            delay_s += 2.0 * (self.conditions.session_s + self._transit_s())
        self._later(delay_s, self._hand_over, line, message)
        if self.draw(self.conditions.duplication):
            self._later(delay_s + self._transit_s(), self._hand_over, line, message)

    def _blur(self, place: Place | None, cep_km: int) -> Place:
        """Return what the network takes for a modem's place; it measures with a Doppler shift."""
        if place is None:
            return Place(0.0, 0.0)
        std_deg = cep_km / 1.8 / _KM_PER_DEGREE
        latitude_deg = place.latitude_deg + self._rng.gauss(0.0, std_deg)
        longitude_deg = place.longitude_deg + self._rng.gauss(0.0, std_deg)
        return Place(max(-90.0, min(90.0, latitude_deg)), (longitude_deg + 180.0) % 360.0 - 180.0)

    def _hand_over(self, line: Line, message: MobileOriginatedMessage) -> None:
        callbacks = tuple(self._gateways.get(line.subscriber.carrier, ()))
        if not callbacks:
            self._unclaimed = [*self._unclaimed, message][-OUTGOING_CAPACITY:]
        for callback in callbacks:
            callback(message)

    def _announce(self, line: Line, ready_at: datetime) -> None:
        """Ring for a message that came into the queue then, however late the loop is."""
        last_at, line.last_ready_at = line.last_ready_at, ready_at
        if last_at is None or (ready_at - last_at).total_seconds() >= _QUIET_S:
            self._ring(line)
            self._later(_SECOND_RING_S, self._ring_again, line)

    def _ring_again(self, line: Line) -> None:
        if line.queue.ready(self.clock.now()):
            self._ring(line)

    def _ring(self, line: Line) -> None:
        subscriber = line.subscriber
        is_sent = self.conditions.ring and subscriber.is_ring_enabled and subscriber.is_attached
        if is_sent and self.has_signal(subscriber.imei) and not self.draw(self.conditions.loss):
            for callback in tuple(line.ring_callbacks):
                callback()

    def _swept(self, imei: str) -> Line:
        line = self._lines.get(imei)
        if line is None:
            raise RefusedError(Reason.UNKNOWN_IMEI)
        if line.queue.sweep(self.clock.now()):
            self._remember()
        return line

    def _remember(self) -> None:
        if self._memory_file is not None:
            lines = {imei: line.memory() for imei, line in self._lines.items()}
            self._memory_file.save(NetworkMemory(self._next_id, self._memories | lines))

    def _transit_s(self) -> float:
        return self.conditions.latency_s + self.conditions.jitter_s * self._rng.random()

    def _number(self) -> int:
        number, self._next_id = self._next_id, self._next_id + 1
        return number

    async def _wait(self, duration_s: float) -> None:
        await asyncio.sleep(duration_s / self.clock.speed)

    def _later(self, delay_s: float, call: Callable[..., None], *args: object) -> None:
        asyncio.get_running_loop().call_later(delay_s / self.clock.speed, call, *args)


def _failed(status: MobileOriginatedStatus, momsn: int) -> SessionResult:
    return SessionResult(status, momsn, MobileTerminatedStatus.ERROR)
