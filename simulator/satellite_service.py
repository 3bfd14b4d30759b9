"""The emulated satellite service of the simulator's process: its network and its gateway."""

import logging
import random
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager

from cryptography.hazmat.primitives.asymmetric.rsa import RSAPrivateKey
from cryptography.hazmat.primitives.serialization import load_pem_private_key

from simulator.iridium.network import IridiumNetwork
from simulator.iridium.rockblock_gateway import RockBlockGateway
from simulator.iridium.subscriber import Account
from simulator.settings import GatewaySettings, SimulatorSettings

_log = logging.getLogger(__name__)


def satellites(settings: SimulatorSettings, in_view: Callable[[str], bool]) -> IridiumNetwork:
    """Return the satellite network, which knows the modem of every robot.

    Args:
        settings: Those of the process.
        in_view: Tells whether the modem of an IMEI sees the sky now.
    """
    network = IridiumNetwork(
        random.Random(f"{settings.seed} satellites"),
        settings.satellite(),
        settings.clock(),
        in_view,
        settings.satellite_memory,
    )
    gateway = settings.gateway
    account = Account("", "") if gateway is None else Account(gateway.username, gateway.password)
    for name in settings.robots:
        imei = settings.definition(name).imei
        if imei:
            network.add_subscriber(imei, account)
    return network


@asynccontextmanager
async def gateway(
    settings: GatewaySettings | None, network: IridiumNetwork
) -> AsyncGenerator[None]:
    """Open the network's gateway as long as the context lasts; without settings there is none.

    Raises:
        ValueError: If its key is no RSA key.
        OSError: If its port is taken.
    """
    if settings is None:
        yield
        return
    key = load_pem_private_key(settings.private_key_pem.encode(), password=None)
    if not isinstance(key, RSAPrivateKey):
        raise ValueError("the gateway signs with an RSA key")  # noqa: TRY004 - the text is wrong
    rockblock = RockBlockGateway(network, key, settings.push_url)
    async with rockblock.serve("127.0.0.1", settings.port) as url:
        _log.info("satellite gateway at %s", url)
        yield
