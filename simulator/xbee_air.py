"""The air between XBee radios that do not exist: what is lost, doubled, delayed or must wait."""

import asyncio
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from robot_link.transport.datagram import BROADCAST, Address, Delivery, Fate

MAX_PAYLOAD = 256
"""NP of an XBee-PRO 900HP."""

_HEADER_BYTES: Final = 24
"""What a packet adds in the air: preamble, addresses, checksum; estimated."""
_CONFIRMATION_BYTES: Final = 20
"""A confirmation in the air; estimated."""


@dataclass(frozen=True, slots=True)
class AirConditions:
    """How bad the air is; every number holds for one transmission attempt."""

    loss: float = 0.0
    """Probability that a packet, or its confirmation, is not heard."""
    duplication: float = 0.0
    """Probability that a heard packet arrives twice."""
    delay_s: float = 0.005
    """Shortest time from radio to radio."""
    jitter_s: float = 0.005
    """Greatest extra time, uniformly distributed; packets may overtake one another."""
    mac_retries: int = 3
    """Further attempts of the radio itself before it reports 0x21."""
    rssi_dbm: float = -52.0
    """Strength of every packet."""
    bit_rate: float = 0.0
    """Bits per second that all radios share, one packet after another; 0 is no limit."""

    def air_s(self, size: int, *, is_confirmed: bool) -> float:
        """Return how long a packet of so many bytes, and its confirmation, fill the air."""
        if not self.bit_rate:
            return 0.0
        size += _HEADER_BYTES + (_CONFIRMATION_BYTES if is_confirmed else 0)
        return 8.0 * size / self.bit_rate


@dataclass(frozen=True, slots=True)
class Listener:
    """A radio that hears."""

    node_id: str
    """Its name, the NI parameter."""
    hear: Callable[[Address, bytes], None]
    """Called with sender and data."""


@dataclass(slots=True)
class _Flight:
    """A packet on its way."""

    source: Address
    destination: Address
    data: bytes
    fate: asyncio.Future[Delivery]
    attempt: int = 0
    is_heard: bool = False


class Air:
    """Belongs to one event loop.

    ``in_reach(a, b)`` says whether radio waves pass between two radios now; a submerged robot is
    out of everyone's reach, and packets under way to it are lost.
    """

    def __init__(
        self,
        rng: random.Random,
        conditions: AirConditions,
        in_reach: Callable[[Address, Address], bool],
    ) -> None:
        self.conditions = conditions
        """May be replaced at any time."""
        self._rng = rng
        self._in_reach = in_reach
        self._listeners: dict[Address, Listener] = {}
        self._is_free_s = 0.0
        """When everything that was sent so far is through."""

    def transmit(
        self, source: Address, destination: Address, data: bytes
    ) -> asyncio.Future[Delivery]:
        """Send a packet; the future tells what its sender's radio will say."""
        fate: asyncio.Future[Delivery] = asyncio.get_running_loop().create_future()
        if len(data) > MAX_PAYLOAD:
            fate.set_result(Delivery(Fate.TOO_LARGE))
            return fate
        self._fly(_Flight(source, destination, data, fate))
        return fate

    def listen(self, address: Address, listener: Listener) -> None:
        """Let a radio hear.

        Raises:
            ValueError: If the address is taken.
        """
        if address in self._listeners:
            raise ValueError(f"two radios cannot have the address {address:016X}")
        self._listeners[address] = listener

    def leave(self, address: Address) -> None:
        """Let a radio hear no more."""
        del self._listeners[address]

    def neighbours(self, asker: Address) -> list[tuple[float, Address, str]]:
        """Return who hears a question who is there and is heard answering.

        Returns:
            For each a share of the time that the asker waits, its address and its name.
        """
        return [
            (self._rng.random(), address, listener.node_id)
            for address, listener in self._listeners.items()
            if address != asker and self._passes(asker, address) and self._passes(address, asker)
        ]

    def _fly(self, flight: _Flight) -> None:
        air = self.conditions
        loop = asyncio.get_running_loop()
        air_s = air.air_s(len(flight.data), is_confirmed=flight.destination != BROADCAST)
        self._is_free_s = max(self._is_free_s, loop.time()) + air_s
        waiting_s = self._is_free_s - loop.time() if air_s else 0.0
        delay_s = waiting_s + air.delay_s + air.jitter_s * self._rng.random()
        loop.call_later(delay_s, self._land, flight)

    def _land(self, flight: _Flight) -> None:
        """End one attempt: heard or not, confirmed or not, repeated or given up."""
        if flight.destination == BROADCAST:
            for address in [a for a in self._listeners if a != flight.source]:
                if self._passes(flight.source, address):
                    self._hear(flight, address)
            self._settle(flight, Fate.DELIVERED)
            return
        passes = self._passes(flight.source, flight.destination)
        if passes and not flight.is_heard:
            flight.is_heard = True
            self._hear(flight, flight.destination)
        if passes and self._rng.random() >= self.conditions.loss:
            self._settle(flight, Fate.DELIVERED)
        elif flight.attempt < self.conditions.mac_retries:
            flight.attempt += 1
            self._fly(flight)
        else:
            self._settle(flight, Fate.NOT_ACKNOWLEDGED)

    def _passes(self, source: Address, destination: Address) -> bool:
        return (
            destination in self._listeners
            and self._in_reach(source, destination)
            and self._rng.random() >= self.conditions.loss
        )

    def _hear(self, flight: _Flight, address: Address) -> None:
        self._arrive(flight, address)
        if self._rng.random() < self.conditions.duplication:
            air = self.conditions
            delay_s = air.delay_s + air.jitter_s * self._rng.random()
            asyncio.get_running_loop().call_later(delay_s, self._arrive, flight, address)

    def _arrive(self, flight: _Flight, address: Address) -> None:
        listener = self._listeners.get(address)
        if listener is not None and self._in_reach(flight.source, address):
            listener.hear(flight.source, flight.data)

    @staticmethod
    def _settle(flight: _Flight, fate: Fate) -> None:
        if not flight.fate.done():
            flight.fate.set_result(Delivery(fate, flight.attempt))
