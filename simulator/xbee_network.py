"""A network of XBee radios that do not exist: one at the station's port, one in each robot."""

import asyncio
import random
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass
from pathlib import Path

from robot_link.transport.datagram import Address, Delivery, TransportEvent


@dataclass(frozen=True, slots=True)
class AirConditions:
    """How bad the air is; every number holds for one transmission attempt."""

    loss: float = 0.0
    """Probability that an attempt is not heard."""
    duplication: float = 0.0
    """Probability that a heard packet arrives twice."""
    delay_s: float = 0.005
    """Shortest time from radio to radio."""
    jitter_s: float = 0.005
    """Greatest extra time, uniformly distributed; packets may overtake one another."""
    mac_retries: int = 3
    """Further attempts of the radio itself before it reports 0x21."""


class RobotRadio:
    """A robot's own radio: a ``DatagramTransport`` without a port."""

    carrier = "xbee"
    max_payload = 256

    async def run(self) -> None:
        """Serve until cancelled."""
        raise NotImplementedError

    async def send(self, address: Address, data: bytes) -> asyncio.Future[Delivery]:
        """Hand a datagram to the radio; see ``DatagramTransport.send``."""
        raise NotImplementedError

    def events(self) -> AsyncIterator[TransportEvent]:
        """Yield what the radio hears."""
        raise NotImplementedError


class XBeeNetwork:
    """The air between the radios.

    ``in_reach(a, b)`` says whether radio waves pass between two radios now; a submerged robot is
    out of everyone's reach, and packets under way to it are lost.
    """

    def __init__(
        self,
        rng: random.Random,
        conditions: AirConditions,
        in_reach: Callable[[Address, Address], bool] = lambda _a, _b: True,
    ) -> None:
        raise NotImplementedError

    def robot_radio(self, address: Address) -> RobotRadio:
        """Return the radio of a robot, in process."""
        raise NotImplementedError

    def pty(self, address: Address, link: Path) -> AbstractAsyncContextManager[None]:
        """Put the station's radio on a pseudo-terminal, reached through the symbolic link.

        Leaving the context pulls the plug: whoever has the port open sees it vanish.
        """
        raise NotImplementedError

    def tcp(self, address: Address, host: str, port: int) -> AbstractAsyncContextManager[int]:
        """Put the station's radio on a TCP port; yields the port's number (0 chooses one)."""
        raise NotImplementedError
