"""A robot's own radio, without a port."""

import asyncio
from collections.abc import AsyncIterator
from typing import Final

from robot_link.transport.datagram import (
    Address,
    Delivery,
    PortChanged,
    PortClosedError,
    Received,
    TransportEvent,
)
from robot_link.transport.keeper import DISABLED
from robot_link.transport.xbee import BYTES_PER_S
from simulator.xbee_air import MAX_PAYLOAD, Air

_WINDOW: Final = 8
_SLOW_BIT_RATE: Final = 10_000


class RobotRadio:
    """A ``DatagramTransport`` that is open whenever it is plugged in."""

    carrier = "xbee"
    is_mute = False

    def __init__(self, address: Address, air: Air) -> None:
        self.is_enabled = True
        self._address = address
        self._air = air
        self._window = asyncio.Semaphore(_WINDOW)
        self._events: asyncio.Queue[TransportEvent] = asyncio.Queue()
        self._events.put_nowait(PortChanged(is_open=True, reason=""))

    @property
    def max_payload(self) -> int:
        """Bytes that fit one packet; 0 while it is unplugged."""
        return MAX_PAYLOAD if self.is_enabled else 0

    @property
    def bytes_per_s(self) -> float:
        """Telemetry that the air may carry, as of a real radio of this rate."""
        rate = self._air.conditions.bit_rate
        return BYTES_PER_S[10 if 0 < rate <= _SLOW_BIT_RATE else 200]

    def set_enabled(self, is_enabled: bool) -> None:
        """Cut the radio off, or bring it back."""
        if is_enabled != self.is_enabled:
            self.is_enabled = is_enabled
            self._events.put_nowait(PortChanged(is_enabled, "" if is_enabled else DISABLED))

    async def let_go(self) -> None:
        """Cut the radio off for good."""
        self.set_enabled(False)

    async def run(self) -> None:
        """Serve until cancelled."""
        await asyncio.get_running_loop().create_future()

    async def send(self, address: Address, data: bytes) -> asyncio.Future[Delivery]:
        """Hand a datagram to the radio; see ``DatagramTransport.send``."""
        await self._window.acquire()
        if not self.is_enabled:
            self._window.release()
            raise PortClosedError(DISABLED)
        fate = self._air.transmit(self._address, address, data)
        fate.add_done_callback(lambda _: self._window.release())
        return fate

    async def events(self) -> AsyncIterator[TransportEvent]:
        """Yield what the radio hears, until cancelled."""
        while True:
            yield await self._events.get()

    def hear(self, source: Address, data: bytes) -> None:
        """Take a packet from the air."""
        if self.is_enabled:
            self._events.put_nowait(Received(source, data, self._air.conditions.rssi_dbm))
