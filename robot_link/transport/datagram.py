"""What every radio offers to the sessions above it: datagrams to an address, and their fate."""

import asyncio
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final, NewType, Protocol

Address = NewType("Address", int)
"""64-bit address of a radio."""
FAR_END: Final = Address(0)
"""Whoever is at the other end of a link that has no addresses."""
BROADCAST: Final = Address(0xFFFF)
"""Everyone in reach; never confirmed by a receiver."""


class Fate(StrEnum):
    """What became of a datagram, as far as the radio can know."""

    DELIVERED = "delivered"
    """The far radio confirmed it (of a broadcast: it was sent)."""
    UNCONFIRMED = "unconfirmed"
    """It left, and this kind of link never says more."""
    NOT_ACKNOWLEDGED = "not_acknowledged"
    """No confirmation; the far side may have it nevertheless."""
    TOO_LARGE = "too_large"
    REFUSED = "refused"
    """The radio itself could not send it."""
    UNKNOWN = "unknown"
    """The port closed, or the radio never said."""


@dataclass(frozen=True, slots=True)
class Delivery:
    """The radio's word on one datagram."""

    fate: Fate
    retries: int = 0
    detail: str = ""
    """What the radio said where it refused, for a person."""


class PortClosedError(Exception):
    """There is no open port to the radio at the moment; it is being opened again."""


def _always(_may_move: bool) -> bool:
    return True


@dataclass(frozen=True, slots=True)
class Received:
    """One datagram from the air."""

    address: Address
    """The sender."""
    data: bytes
    rssi_dbm: float | None
    """Strength last measured for this sender, None until known."""
    where: str = ""
    """Where it was sent from, for a person, where anybody may speak to the port."""
    accept: Callable[[bool], bool] = field(default=_always, compare=False, repr=False)
    """Call it when the datagram is believed: answers go to its sender from then on. Its argument
    says whether the sender may be another host than the one before; it returns False where the
    datagram is to be dropped all the same, for it is not from the far end."""


@dataclass(frozen=True, slots=True)
class PortChanged:
    """The link to the radio opened or closed."""

    is_open: bool
    reason: str
    """Why it closed or could not be opened, for a person; empty when open."""


@dataclass(frozen=True, slots=True)
class Garbled:
    """Bytes that the port brought and that were no valid frame."""

    frames: int
    data: bytes = b""
    """The first of these bytes."""


@dataclass(frozen=True, slots=True)
class Stranger:
    """Somebody else than the far end speaks on a link that has one far end."""

    where: str
    """Where the other one speaks from, for a person."""
    data: bytes
    took_over: bool
    """Whether it now counts as the far end, which had been silent for long."""


TransportEvent = Received | PortChanged | Garbled | Stranger


class DatagramTransport(Protocol):
    """One radio, owned by one event loop.

    It decodes nothing above its own frames and sends nothing twice: acknowledgement is the
    session's work.
    """

    @property
    def carrier(self) -> str:
        """Kind of link for reports, such as ``xbee``."""
        ...

    @property
    def max_payload(self) -> int:
        """Bytes that fit one datagram, as the radio itself says; 0 while it is closed."""
        ...

    @property
    def is_mute(self) -> bool:
        """Whether the port could be opened, but the radio does not answer."""
        ...

    @property
    def bytes_per_s(self) -> float:
        """Bytes of telemetry that all robots behind this radio may send it together, per second."""
        ...

    @property
    def is_enabled(self) -> bool:
        """Whether the operator lets the port be open."""
        ...

    def set_enabled(self, is_enabled: bool) -> None:
        """Enable the port, or disable it, which closes it and keeps it closed."""
        ...

    async def let_go(self) -> None:
        """Give the port up for good, and return once what it brought was taken."""
        ...

    async def run(self) -> None:
        """Open, serve and open again until cancelled."""
        ...

    async def send(self, address: Address, data: bytes) -> asyncio.Future[Delivery]:
        """Hand a datagram to the radio, waiting while too many are under way.

        Returns:
            A future of what becomes of it; it never fails and need not be awaited.

        Raises:
            PortClosedError: If no port is open.
        """
        ...

    def events(self) -> AsyncIterator[TransportEvent]:
        """Yield what the radio brings, in order, until cancelled; for one reader."""
        ...
