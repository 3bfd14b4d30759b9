"""Samples from the robot's memory to the station, until it says that they are stored."""

import asyncio
from collections.abc import Iterable, Sequence

from onboard.link.sample_queue import SampleQueue
from robot_link.clock import monotonic_s
from robot_link.mavlink.codec import Codec, packets
from robot_link.mavlink.detection import entry_message
from robot_link.mavlink.several import at_once, samples_message
from robot_link.mavlink.telemetry import SAMPLE_FRAME_BYTES
from robot_link.messages import LogId
from robot_link.sample_log import LogEntry, Measurement, SampleKey, SampleLog
from robot_link.service.pace import Pace
from robot_link.timing import LinkTiming
from robot_link.transport.datagram import (
    Address,
    DatagramTransport,
    Delivery,
    Fate,
    PortClosedError,
)

_FAILURES_BEFORE_SILENCE = 3
"""Datagrams in a row without a confirmation after which the station must be heard first."""


class SampleSender:
    """Sends while the station is in contact, as many samples in a datagram as fit.

    Belongs to one event loop; measurements may be recorded before it runs.
    """

    def __init__(
        self,
        log: SampleLog,
        codec: Codec,
        transport: DatagramTransport,
        timing: LinkTiming,
        pace: Pace,
    ) -> None:
        self._log = log
        self._codec = codec
        self._transport = transport
        self._pace = pace
        self._stale_s = timing.stale_s
        self._frame_bytes = SAMPLE_FRAME_BYTES + codec.trailer_bytes
        self._queue = SampleQueue(log.kept(), timing.resend_s, timing.resend_limit_s)
        self._station: Address | None = None
        self._heard_s = 0.0
        self._failures = 0
        self._in_contact = asyncio.Event()
        self._stirred = asyncio.Event()

    def __len__(self) -> int:
        return len(self._queue)

    def record(self, entry: LogEntry) -> int:
        """Keep a measurement or a heard tag and return its number.

        Raises:
            ValueError: If it says what cannot be, such as a number that is not finite.
            KeyError: If no such variable is declared.
        """
        entry_message(LogId(0), 0, entry)
        key = self._log.append(entry)
        self._queue.add(key)
        self._stirred.set()
        return key.sequence

    def stored(self, log: LogId, sequences: Sequence[int]) -> None:
        """Take the station's word that samples are stored; unknown ones do not matter."""
        keys = [SampleKey(log, sequence) for sequence in sequences]
        self._log.forget(keys)
        for key in keys:
            self._queue.discard(key)

    def contact(self, station: Address) -> None:
        """Note that the station was just heard."""
        self._station = station
        self._heard_s = monotonic_s()
        self._failures = 0
        self._in_contact.set()

    async def run(self) -> None:
        """Send until cancelled."""
        while True:
            await self._in_contact.wait()
            station = self._station
            if station is None or monotonic_s() - self._heard_s > self._stale_s:
                self._in_contact.clear()
                continue
            self._stirred.clear()
            count = max(1, self._transport.max_payload // self._frame_bytes)
            keys = self._queue.take(count, monotonic_s())
            if keys:
                await self._send(station, self._groups(keys))
            else:
                await self._wait()

    def _groups(self, keys: Sequence[SampleKey]) -> list[list[SampleKey]]:
        """Return samples with those that follow them and were taken at the same place and time."""
        most = at_once(self._transport.max_payload - self._codec.trailer_bytes)
        groups: list[list[SampleKey]] = []
        grouped: set[SampleKey] = set()
        for key in keys:
            if key in grouped:
                continue
            group, entry = [key], self._log.get(key)
            following = SampleKey(key.log, key.sequence + 1)
            while (
                len(group) < most
                and self._queue.holds(following)
                and following not in grouped
                and _is_beside(entry, self._log.get(following))
            ):
                group.append(following)
                following = SampleKey(key.log, following.sequence + 1)
            groups.append(group)
            grouped.update(group)
        self._queue.send(grouped.difference(keys), monotonic_s())
        return groups

    def _frame(self, group: Sequence[SampleKey]) -> bytes | None:
        """Return the frame of a group; None where it may be forgotten meanwhile."""
        entries = [entry for key in group if (entry := self._log.get(key)) is not None]
        measured = [entry for entry in entries if isinstance(entry, Measurement)]
        first = group[0]
        if len(group) > 1 and len(measured) == len(group):
            return self._codec.pack(samples_message(first.log, first.sequence, measured))
        return self._codec.pack(entry_message(*first, entries[0])) if entries else None

    async def _send(self, station: Address, groups: list[list[SampleKey]]) -> None:
        keys = [key for group in groups for key in group]
        frames = [frame for group in groups if (frame := self._frame(group)) is not None]
        for packet in packets(frames, self._transport.max_payload):
            await self._pace.spend(len(packet))
            try:
                fate = await self._transport.send(station, packet)
            except PortClosedError:
                self._fail(keys)
                return
            fate.add_done_callback(lambda done: self._settle(keys, done.result()))

    def _settle(self, keys: Iterable[SampleKey], delivery: Delivery) -> None:
        if delivery.fate in (Fate.DELIVERED, Fate.UNCONFIRMED):
            self._failures = 0
        else:
            self._fail(keys)

    def _fail(self, keys: Iterable[SampleKey]) -> None:
        self._queue.hurry(keys)
        self._stirred.set()
        self._failures += 1
        if self._failures >= _FAILURES_BEFORE_SILENCE:
            self._in_contact.clear()

    async def _wait(self) -> None:
        """Wait until a sample is due."""
        due_s = self._queue.next_due_s()
        try:
            async with asyncio.timeout(None if due_s is None else due_s - monotonic_s()):
                await self._stirred.wait()
        except TimeoutError:
            pass


def _is_beside(entry: LogEntry | None, other: LogEntry | None) -> bool:
    """Tell whether two measurements were taken at one place and time."""
    return (
        isinstance(entry, Measurement)
        and isinstance(other, Measurement)
        and entry.measured_at == other.measured_at
        and entry.position_ned == other.position_ned
        and entry.position_std_m == other.position_std_m
    )
