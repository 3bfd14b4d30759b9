"""A network of XBee radios that do not exist: one at the station's port, one in each robot.

The station's radio speaks API frames on a pseudo-terminal or a TCP port, as an XBee-PRO 900HP
does; the robots' radios are ``DatagramTransport`` objects in the simulator's own process.
"""

import asyncio
import random
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager, suppress
from functools import partial
from pathlib import Path

from robot_link.transport.datagram import Address, Delivery
from robot_link.transport.xbee_frame import ApiMode
from simulator.pseudo_terminal import pseudo_terminal
from simulator.xbee_air import MAX_PAYLOAD, Air, AirConditions, Listener
from simulator.xbee_module import STATION_NODE_ID, StationModule
from simulator.xbee_radio import RobotRadio

__all__ = ["MAX_PAYLOAD", "AirConditions", "RobotRadio", "XBeeNetwork"]

_OVERRUN_BYTES = 2**18
"""More than so many bytes that a TCP client does not take are lost."""


class XBeeNetwork:
    """The radios of one network and the air between them; belongs to one event loop.

    ``in_reach(a, b)`` says whether radio waves pass between two radios now. ``discovery_s`` is how
    long the station's radio waits for the others when it asks who is there.
    """

    def __init__(
        self,
        rng: random.Random,
        conditions: AirConditions,
        in_reach: Callable[[Address, Address], bool] = lambda _a, _b: True,
        *,
        discovery_s: float = 3.2,
    ) -> None:
        self.air = Air(rng, conditions, in_reach)
        """What is between the radios."""
        self._discovery_s = discovery_s

    @property
    def conditions(self) -> AirConditions:
        """How bad the air is; may be replaced at any time."""
        return self.air.conditions

    @conditions.setter
    def conditions(self, conditions: AirConditions) -> None:
        self.air.conditions = conditions

    def robot_radio(self, address: Address, node_id: str = "") -> RobotRadio:
        """Return the radio of a robot, in process.

        Args:
            address: Its address.
            node_id: Its name, up to 20 characters; without one it is named after its address.

        Raises:
            ValueError: If the address is taken.
        """
        radio = RobotRadio(address, self.air)
        name = node_id or f"ROBOT {address & 0xFFFF:04X}"
        self.air.listen(address, Listener(name, radio.hear))
        return radio

    def transmit(
        self, source: Address, destination: Address, data: bytes
    ) -> asyncio.Future[Delivery]:
        """Send a packet into the air; the future tells what its sender's radio will say."""
        return self.air.transmit(source, destination, data)

    @asynccontextmanager
    async def pty(
        self, address: Address, link: Path, mode: ApiMode = 1
    ) -> AsyncGenerator[None, None]:
        """Put the station's radio on a pseudo-terminal, reached through the symbolic link.

        Leaving the context pulls the plug: whoever has the port open sees it vanish.
        """

        def feed(data: bytes) -> None:
            module.feed(data)

        async with pseudo_terminal(link, feed) as write:
            module = self._module(address, mode, write)
            self.air.listen(address, Listener(STATION_NODE_ID, module.hear))
            try:
                yield
            finally:
                self.air.leave(address)

    @asynccontextmanager
    async def tcp(
        self, address: Address, host: str, port: int = 0, mode: ApiMode = 1
    ) -> AsyncGenerator[int, None]:
        """Put the station's radio on a TCP port, for one client at a time.

        Yields:
            The port's number; 0 asks the system to choose it.
        """
        clients: set[asyncio.StreamWriter] = set()

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            if clients:
                writer.close()
                return
            clients.add(writer)
            module = self._module(address, mode, partial(_write_unless_full, writer))
            self.air.listen(address, Listener(STATION_NODE_ID, module.hear))
            try:
                while data := await reader.read(65536):
                    module.feed(data)
            except ConnectionError:
                pass
            finally:
                self.air.leave(address)
                clients.discard(writer)
                writer.close()

        server = await asyncio.start_server(serve, host, port)
        try:
            yield server.sockets[0].getsockname()[1]
        finally:
            server.close()
            for writer in list(clients):
                writer.transport.abort()
                with suppress(ConnectionError):
                    await writer.wait_closed()
            await server.wait_closed()

    def _module(
        self, address: Address, mode: ApiMode, write: Callable[[bytes], None]
    ) -> StationModule:
        return StationModule(address, mode, self.air, write, self._discovery_s)


def _write_unless_full(writer: asyncio.StreamWriter, frame: bytes) -> None:
    if writer.transport.get_write_buffer_size() < _OVERRUN_BYTES:
        writer.write(frame)
