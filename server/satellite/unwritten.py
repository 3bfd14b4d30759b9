"""Orders to surface that could not be written down: they leave all the same."""

import asyncio
import logging
from collections.abc import Callable
from typing import Final

from robot_link.clock import Clock
from robot_link.messages import CommandLevel, CommandNumber, CommandReport
from robot_link.station.gateway.gateway import (
    GatewayRefusal,
    GatewayUnreachableError,
    retry_after_s,
)
from server.satellite.modem import Modem
from server.satellite.order_row import SURFACE_PRIORITY
from server.satellite.outbox import Sender

log = logging.getLogger(__name__)

_ATTEMPTS: Final = 12
_CLIENT_IDS: Final = 0xFFFF
OnLevel = Callable[[CommandReport], None]


class UnwrittenOrders:
    """Hands orders to gateways from memory. Belongs to one event loop."""

    def __init__(self, sender: Sender) -> None:
        self._sender = sender
        self._waiting: asyncio.Queue[tuple[Modem, CommandNumber, bytes, OnLevel, Clock]] = (
            asyncio.Queue()
        )

    def add(
        self, modem: Modem, number: CommandNumber, data: bytes, on_level: OnLevel, clock: Clock
    ) -> None:
        """Hand an order over as soon as its gateway takes it."""
        self._waiting.put_nowait((modem, number, data, on_level, clock))

    async def run(self) -> None:
        """Serve until cancelled."""
        async with asyncio.TaskGroup() as group:
            while True:
                order = await self._waiting.get()
                group.create_task(self._send(*order), name=f"unwritten order {order[1]}")

    async def _send(
        self, modem: Modem, number: CommandNumber, data: bytes, on_level: OnLevel, clock: Clock
    ) -> None:
        for attempt in range(1, _ATTEMPTS + 1):
            try:
                await self._sender.send(
                    modem.carrier,
                    modem.imei,
                    data,
                    client_id=number % _CLIENT_IDS + 1,
                    priority=SURFACE_PRIORITY,
                )
            except (GatewayRefusal, GatewayUnreachableError) as error:
                log.critical("surface order for %s by satellite: %s", modem.robot, error)
                await asyncio.sleep(retry_after_s(attempt))
            except ValueError as error:
                log.critical("surface order for %s cannot go at all: %s", modem.robot, error)
                return
            else:
                level = CommandLevel.QUEUED
                on_level(CommandReport(modem.robot, number, level, clock.now(), modem.carrier))
                return
