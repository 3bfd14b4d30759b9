"""The satellite node: short records out, short records in, whatever device carries them.

A *session* sends at most one record and brings at most one. Programs know this node alone: an
Iridium modem (``satellite_9602``) or any other device serves the same questions, so that swapping
one for another changes no program.

| question | values | answer |
|---|---|---|
| session | record: hex or null, for_ring: bool | the fields of ``SessionOutcome`` |
| signal | | bars 0..5 |
| identity | | kind, name |

Topic ``ring``: something waits ashore, ``{"count": n}``.
"""

import asyncio
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Protocol

from onboard.node.client import NodeClient, Subscription
from onboard.node.server import NodeServer
from onboard.node.wire import Content

RING = "ring"
SESSION_LIMIT_S = 120.0
"""Wall time after which a session that never ends counts as failed."""


@dataclass(frozen=True, slots=True)
class SessionOutcome:
    """What one session brought about."""

    is_sent: bool
    """Whether the record was taken ashore (without a record: whether the session came about)."""
    received: bytes | None
    """The record that came."""
    queued: int
    """Records that still wait ashore."""
    text: str
    """One sentence where it failed, else empty."""
    sent_number: int | None = None
    """Number of the sent record by the carrier's count (MOMSN)."""
    received_number: int | None = None
    """Number of the received record by the carrier's count (MTMSN)."""


class SatelliteDevice(Protocol):
    """A device that exchanges records with the shore; one user at a time."""

    kind: str
    """What it is, such as ``iridium-9602``."""
    record_max: int
    """Bytes that a record has at most."""

    async def run(self, on_ring: Callable[[], None]) -> None:
        """Open the device, serve and open it again until cancelled; tell of rings."""
        ...

    async def session(self, record: bytes | None, *, for_ring: bool) -> SessionOutcome:
        """Exchange records; a device that is not there gives an outcome that says so."""
        ...

    async def signal(self) -> int:
        """Return the signal's strength in bars, 0..5."""
        ...

    @property
    def name(self) -> str:
        """How the shore knows the device, such as its IMEI; empty until known."""
        ...


class SatelliteNode:
    """Serves a device to any number of programs, one session after the other."""

    def __init__(self, device: SatelliteDevice) -> None:
        self._device = device
        self._one = asyncio.Lock()
        self._rings = 0
        self.server = NodeServer(
            "satellite",
            {"session": self._session, "signal": self._signal, "identity": self._identity},
            (RING,),
        )

    async def run(self) -> None:
        """Run the device until cancelled."""
        await self._device.run(self._ring)

    def _ring(self) -> None:
        self._rings += 1
        self.server.publish(RING, {"count": self._rings})

    async def _session(self, values: dict[str, Any]) -> Content:
        text = values.get("record")
        record = None if text is None else bytes.fromhex(text)
        if record is not None and not 1 <= len(record) <= self._device.record_max:
            raise ValueError(f"a record has 1 to {self._device.record_max} bytes")
        async with self._one:
            outcome = await self._device.session(record, for_ring=bool(values.get("for_ring")))
        received = None if outcome.received is None else outcome.received.hex()
        return {**asdict(outcome), "received": received}

    async def _signal(self, _values: dict[str, Any]) -> Content:
        async with self._one:
            return {"bars": await self._device.signal()}

    async def _identity(self, _values: dict[str, Any]) -> Content:
        device = self._device
        return {"kind": device.kind, "name": device.name, "record_max": device.record_max}


class SatelliteClient:
    """The satellite node as the onboard program sees it."""

    def __init__(self, node: NodeClient) -> None:
        self._node = node

    def rings(self) -> Subscription:
        """Hear of what waits ashore; several rings count as one."""
        return self._node.subscribe(RING)

    async def session(self, record: bytes | None, *, for_ring: bool = False) -> SessionOutcome:
        """Exchange records.

        Raises:
            NodeError: If the node refuses.
            NodeGoneError: If the node is not there.
            NodeSilentError: If the session does not end.
        """
        answer = await self._node.ask(
            "session",
            timeout_s=SESSION_LIMIT_S,
            record=None if record is None else record.hex(),
            for_ring=for_ring,
        )
        received = answer.pop("received")
        return SessionOutcome(
            received=None if received is None else bytes.fromhex(received), **answer
        )

    async def signal(self) -> int:
        """Return the signal's strength in bars; raises as ``session``."""
        return (await self._node.ask("signal"))["bars"]
