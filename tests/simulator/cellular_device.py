"""Another device of the satellite node: records over a cellular modem's TCP connection.

Each session opens a connection to a host ashore, sends ``u16 length | record`` (length 0: nothing)
after a line with its name, and is answered ``u8 taken | u16 queued | u16 length | record``. While
no session runs, a second connection (first byte ``R``, sessions ``S``) brings one byte a ring.
All integers are big endian.
"""

import asyncio
import logging
import struct
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager, suppress

from onboard.node.satellite import SessionOutcome
from tests.tcp_peer import Streams, connected

_RECORD_MAX = 340
_ANSWER = struct.Struct(">BHH")
_REOPEN_S = 1.0

_log = logging.getLogger(__name__)


class CellularDevice:
    """Exchanges records with one host ashore.

    Args:
        name: How the host knows the device.
        port: The host's port on this machine.
        session_limit_s: Wall time that a session may take.
    """

    kind = "cellular"
    record_max = _RECORD_MAX

    def __init__(self, name: str, port: int, session_limit_s: float = 60.0) -> None:
        self.name = name
        self._port = port
        self._limit_s = session_limit_s
        self._has_host = False

    async def run(self, on_ring: Callable[[], None]) -> None:
        """Listen for rings until cancelled; a host that is away is tried again."""
        while True:
            with suppress(OSError, TimeoutError):
                async with self._connected(b"R") as (reader, _):
                    self._has_host = True
                    try:
                        while await reader.read(1):
                            on_ring()
                    finally:
                        self._has_host = False
            await asyncio.sleep(_REOPEN_S)

    async def session(self, record: bytes | None, *, for_ring: bool) -> SessionOutcome:
        """Exchange records; a host that is away gives an outcome that says so."""
        try:
            async with asyncio.timeout(self._limit_s):
                return await self._session(record)
        except (OSError, TimeoutError, asyncio.IncompleteReadError) as error:
            return SessionOutcome(False, None, 0, f"no cellular session: {error or 'no answer'}")

    async def signal(self) -> int:
        """Return five bars while the host is there, else none."""
        return 5 if self._has_host else 0

    async def _session(self, record: bytes | None) -> SessionOutcome:
        async with self._connected(b"S") as (reader, writer):
            data = record or b""
            writer.write(struct.pack(">H", len(data)) + data)
            taken, queued, length = _ANSWER.unpack(await reader.readexactly(_ANSWER.size))
            received = await reader.readexactly(length) if length else None
        return SessionOutcome(
            bool(taken), received, queued, "" if taken else "the host did not take the record"
        )

    @asynccontextmanager
    async def _connected(self, purpose: bytes) -> AsyncGenerator[Streams, None]:
        async with connected(self._port) as (reader, writer):
            writer.write(purpose + self.name.encode() + b"\n")
            yield reader, writer
