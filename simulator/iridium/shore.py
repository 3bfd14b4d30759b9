"""Everything ashore of one emulated satellite service, opened and closed together."""

from collections.abc import AsyncGenerator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from simulator.iridium.cloudloop_gateway import CloudloopGateway
from simulator.iridium.directip_gateway import DirectIpGateway
from simulator.iridium.key import make_key, public_pem, write_public_key
from simulator.iridium.network import IridiumNetwork
from simulator.iridium.rockblock_gateway import RockBlockGateway

_Gateway = RockBlockGateway | DirectIpGateway | CloudloopGateway


@dataclass(frozen=True, slots=True)
class GatewayDoor:
    """Where one gateway is found, and where it finds its customer."""

    push_url: str | None
    """None keeps the messages of modems until there is one."""
    port: int = 0
    """0 asks the system to choose one."""


@dataclass(frozen=True, slots=True)
class ShoreSettings:
    """Which gateways there are; by default RockBLOCK's alone."""

    rockblock: GatewayDoor | None = GatewayDoor(None)
    rockblock_format: Literal["form", "json"] = "form"
    directip: GatewayDoor | None = None
    directip_confirms: bool = False
    cloudloop: GatewayDoor | None = None
    public_key_file: Path | None = None
    """Where the key that verifies RockBLOCK's pushes is written."""
    host: str = "127.0.0.1"


@dataclass(frozen=True, slots=True)
class Shore:
    """The gateways that are open."""

    public_key: str
    """PEM of the key that verifies RockBLOCK's pushes."""
    rockblock_url: str | None
    directip_url: str | None
    cloudloop_url: str | None
    rockblock: RockBlockGateway | None
    directip: DirectIpGateway | None
    cloudloop: CloudloopGateway | None


@asynccontextmanager
async def open_shore(network: IridiumNetwork, settings: ShoreSettings) -> AsyncGenerator[Shore]:
    """Open the gateways of a network until the context is left.

    Raises:
        ValueError: If a host or push URL is not of this machine.
        OSError: If a port is taken.
    """
    key = make_key()
    if settings.public_key_file is not None:
        write_public_key(key, settings.public_key_file)
    rockblock = settings.rockblock and RockBlockGateway(
        network, key, settings.rockblock.push_url, push_format=settings.rockblock_format
    )
    directip = settings.directip and DirectIpGateway(
        network, settings.directip.push_url, confirms=settings.directip_confirms
    )
    cloudloop = settings.cloudloop and CloudloopGateway(network, settings.cloudloop.push_url)
    async with AsyncExitStack() as stack:

        async def url(gateway: _Gateway | None, door: GatewayDoor | None) -> str | None:
            if gateway is None or door is None:
                return None
            return await stack.enter_async_context(gateway.serve(settings.host, door.port))

        yield Shore(
            public_key=public_pem(key),
            rockblock_url=await url(rockblock, settings.rockblock),
            directip_url=await url(directip, settings.directip),
            cloudloop_url=await url(cloudloop, settings.cloudloop),
            rockblock=rockblock,
            directip=directip,
            cloudloop=cloudloop,
        )
