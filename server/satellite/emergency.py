"""Messages that leave though nothing could be written down, such as a command to surface."""

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from robot_link.station.gateway.gateway import (
    GatewayRefusal,
    GatewayUnreachableError,
    retry_after_s,
)
from server.satellite.modem import Modem
from server.satellite.outbox import Sender
from server.satellite.row_kind import FIRST_PRIORITY

log = logging.getLogger(__name__)

_ATTEMPTS: Final = 12
_CLIENT_IDS: Final = 0xFFFF


@dataclass(frozen=True, slots=True)
class EmergencyMessage:
    """What a robot must be told though storage fails."""

    modem: Modem
    number: int
    """Names the message at its gateway."""
    data: bytes
    title: str
    """What it is, for the log."""
    on_taken: Callable[[], None]
    """Called when its gateway has it."""


class EmergencyMessages:
    """Hands messages to gateways from memory. Belongs to one event loop."""

    def __init__(self, sender: Sender) -> None:
        self._sender = sender
        self._waiting: asyncio.Queue[EmergencyMessage] = asyncio.Queue()

    def add(self, message: EmergencyMessage) -> None:
        """Hand a message over as soon as its gateway takes it."""
        self._waiting.put_nowait(message)

    async def run(self) -> None:
        """Serve until cancelled."""
        async with asyncio.TaskGroup() as group:
            while True:
                message = await self._waiting.get()
                group.create_task(self._send(message), name=f"emergency {message.number}")

    async def _send(self, message: EmergencyMessage) -> None:
        modem = message.modem
        for attempt in range(1, _ATTEMPTS + 1):
            try:
                await self._sender.send(
                    modem.carrier,
                    modem.imei,
                    message.data,
                    client_id=message.number % _CLIENT_IDS + 1,
                    priority=FIRST_PRIORITY,
                )
            except (GatewayRefusal, GatewayUnreachableError) as error:
                log.critical("%s for %s by satellite: %s", message.title, modem.robot, error)
                await asyncio.sleep(retry_after_s(attempt))
            except ValueError as error:
                log.critical("%s for %s cannot go at all: %s", message.title, modem.robot, error)
                return
            else:
                message.on_taken()
                return
