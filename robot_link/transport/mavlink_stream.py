"""MAVLink 2 on a byte stream that carries nothing else: a serial line or a TCP connection.

The wire is one MAVLink frame after another in both directions, see ``robot_link.mavlink.frame``;
there is one far end, which has no address. Whatever is between frames is skipped and counted.
Nothing confirms that a frame arrived.
"""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Final

from robot_link.mavlink.frame import MavlinkFrameReader
from robot_link.transport.datagram import (
    FAR_END,
    Address,
    Delivery,
    Fate,
    Garbled,
    PortClosedError,
    Received,
)
from robot_link.transport.keeper import KeptTransport, first_to_end
from robot_link.transport.port import Port

HUNG_UP: Final = "the far side hung up"


@dataclass(frozen=True, slots=True)
class StreamTiming:
    """Wall seconds of one stream."""

    write_timeout_s: float = 10.0
    """Longest wait for the far side to take bytes; then the stream counts as dead."""
    quiet_s: float = 1.0
    """Silence after which half a frame is given up."""
    reopen_s: float = 0.5
    """Time between two attempts to open the port."""


class MavlinkStream(KeptTransport):
    """Carries MAVLink frames over a byte stream to one far end. Belongs to one event loop."""

    def __init__(
        self,
        carrier: str,
        open_port: Callable[[], Awaitable[Port]],
        *,
        bytes_per_s: float,
        frame_bytes: int,
        timing: StreamTiming | None = None,
    ) -> None:
        """Describe a stream; ``run`` opens it.

        Args:
            carrier: Kind of link for reports.
            open_port: Opens the stream, raising ``OSError`` where it cannot.
            bytes_per_s: Telemetry that it carries, bytes per second.
            frame_bytes: How many bytes are handed over at once, at most.
            timing: Its time-outs.
        """
        self.carrier = carrier
        self.bytes_per_s = bytes_per_s
        self.max_payload = 0
        """0 while the port is closed."""
        self._open_port = open_port
        self._frame_bytes = frame_bytes
        self._timing = timing or StreamTiming()
        super().__init__(carrier, self._serve, self._timing.reopen_s)
        self._port: Port | None = None
        self._writing = asyncio.Lock()
        self._stuck = asyncio.Event()

    async def send(self, address: Address, data: bytes) -> asyncio.Future[Delivery]:
        """Write frames; whoever is at the far end gets them, whatever the address."""
        del address
        fate: asyncio.Future[Delivery] = asyncio.get_running_loop().create_future()
        async with self._writing:
            if self._port is None or not self.max_payload:
                raise PortClosedError
            try:
                async with asyncio.timeout(self._timing.write_timeout_s):
                    await self._port.write(data)
            except TimeoutError as error:
                self._stuck.set()
                raise PortClosedError("the far side takes no bytes") from error
            except OSError as error:
                raise PortClosedError(str(error)) from error
        fate.set_result(Delivery(Fate.UNCONFIRMED))
        return fate

    async def _serve(self) -> str:
        """Serve one opening of the port; return why it ended."""
        try:
            self._port = await self.place.open(self._open_port)
        except OSError as error:
            return str(error) or type(error).__name__
        self._stuck.clear()
        self.max_payload = self._frame_bytes
        self._keeper.opened()
        try:
            return await first_to_end(
                (f"{self.carrier} read", self._read(self._port)),
                (f"{self.carrier} watch", self._watch()),
            )
        finally:
            self.max_payload = 0
            self.place.close(self._port)
            self._port = None

    async def _watch(self) -> str:
        await self._stuck.wait()
        return "the far side takes no bytes"

    async def _read(self, port: Port) -> str:
        def hear(frames: bytes) -> None:
            self._keeper.bring(Received(FAR_END, frames, None))

        try:
            return await read_frames(port, self._timing.quiet_s, hear, self._keeper.bring)
        except OSError as error:
            return str(error)


async def give_back(port: Port, unfinished: bytes, reading: asyncio.Future[bytes]) -> None:
    """End a read, and give back to the port what nobody has made whole frames of."""
    reading.cancel()
    (last,) = await asyncio.gather(reading, return_exceptions=True)
    port.unread(unfinished + (last if isinstance(last, bytes) else b""))


async def read_frames(
    port: Port, quiet_s: float, hear: Callable[[bytes], object], bring: Callable[[Garbled], None]
) -> str:
    """Read whole frames until the far side hangs up; return that it did.

    Args:
        port: Where from.
        quiet_s: Silence after which half a frame is given up, s.
        hear: Takes frames that came together.
        bring: Takes what was between frames.

    Raises:
        OSError: If the port failed.
    """
    frames = MavlinkFrameReader()
    bad = 0
    next_bytes = asyncio.ensure_future(port.read())
    try:
        while True:
            done, _ = await asyncio.wait((next_bytes,), timeout=quiet_s)
            data = next_bytes.result() if done else b""
            if done and not data:
                return HUNG_UP
            whole = frames.feed(data) if done else frames.flush()
            if whole:
                hear(b"".join(whole))
            if frames.bad > bad:
                bring(Garbled(frames.bad - bad, frames.take_dropped()))
                bad = frames.bad
            if done:
                next_bytes = asyncio.ensure_future(port.read())
    finally:
        await give_back(port, frames.unfinished, next_bytes)
