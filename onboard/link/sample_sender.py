"""Samples from the robot's memory to the station, until it says that they are stored."""

import asyncio
from collections.abc import Iterable, Sequence

from onboard.link.sample_queue import SampleQueue
from robot_link.clock import monotonic_s
from robot_link.mavlink.codec import Codec, packets
from robot_link.mavlink.telemetry import SAMPLE_FRAME_BYTES, sample_message
from robot_link.messages import LogId
from robot_link.sample_log import Measurement, SampleKey, SampleLog
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

    def record(self, measurement: Measurement) -> int:
        """Keep a measurement and return its number.

        Raises:
            ValueError: If a number is not finite.
            KeyError: If no such variable is declared.
        """
        sample_message(LogId(0), 0, measurement)
        key = self._log.append(measurement)
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
                await self._send(station, keys)
            else:
                await self._wait()

    async def _send(self, station: Address, keys: list[SampleKey]) -> None:
        frames = [
            self._codec.pack(sample_message(key.log, key.sequence, measurement))
            for key in keys
            if (measurement := self._log.get(key)) is not None
        ]
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
