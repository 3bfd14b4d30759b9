"""A gateway that is a web service: a door for messages to modems, and posts of those from them."""

from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass

from simulator.background import alongside
from simulator.iridium.http_server import Respond, http_server
from simulator.iridium.network import IridiumNetwork
from simulator.iridium.push import Pusher
from simulator.iridium.session import MobileOriginatedMessage
from simulator.iridium.subscriber import Carrier
from simulator.iridium.webhook import Webhook


@dataclass(frozen=True, slots=True)
class WebService:
    """What one gateway does with what it is asked, and with what its modems send."""

    carrier: Carrier
    path: str
    """Where messages to modems are taken."""
    respond: Respond
    take: Callable[[MobileOriginatedMessage], None]
    """Called with each session of the carrier's modems."""
    pusher: Pusher
    webhook: Webhook

    @asynccontextmanager
    async def opened(self, network: IridiumNetwork, host: str, port: int) -> AsyncGenerator[str]:
        """Serve until the context is left.

        Yields:
            The URL that takes messages to modems.

        Raises:
            ValueError: If the host is not this machine itself.
            OSError: If the port is taken.
        """
        stop_listening = network.on_message(self.carrier, self.take)
        try:
            async with (
                self.webhook.opened(),
                http_server(self.respond, host, port) as url,
                alongside(self.pusher.run(), f"{self.carrier} pushes"),
            ):
                yield url + self.path
        finally:
            stop_listening()
