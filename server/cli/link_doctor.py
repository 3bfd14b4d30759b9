"""What ``grace link doctor`` says of links that carry no MAVLink: satellite gateways and modems."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from urllib.parse import urlsplit

from robot_link.acoustic.micromodem import open_modem
from robot_link.clock import SystemClock
from robot_link.messages import RobotId
from robot_link.station.gateway.address import is_acoustic, satellite_address
from robot_link.transport.datagram import PortChanged
from server.base.secret import GATEWAY_KINDS, GatewayKind, SecretStore, SecretUnreadableError
from server.base.settings import Settings

Say = Callable[[str], None]
_TLS_PORT = 443


async def examine(uri: str, settings: Settings, listen_s: float, say: Say) -> bool:
    """Examine a link that is no radio; return whether it is as it should be.

    Nothing is sent that costs anything: of a satellite gateway the account is looked at and its
    address is called, and of an acoustic modem only the one at the station's port is asked.

    Raises:
        ValueError: If the link names none.
    """
    if is_acoustic(uri):
        return await _examine_modem(uri, listen_s, say)
    return await _examine_gateway(uri, settings, listen_s, say)


async def _examine_modem(uri: str, listen_s: float, say: Say) -> bool:
    modem = open_modem({RobotId("robot"): uri}, SystemClock())
    running = asyncio.create_task(modem.run(), name="doctor's modem")
    reason = "it says nothing"
    try:
        with suppress(TimeoutError):
            async with asyncio.timeout(listen_s):
                async for event in modem.events():
                    if isinstance(event, PortChanged) and event.is_open:
                        say("The Micro-Modem at the station's port answers and has its address.")
                        say("  Try: measure a range; the robot's own modem answers it.")
                        return True
                    if isinstance(event, PortChanged):
                        reason = event.reason
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
    say(f"No Micro-Modem answers at the station's port: {reason}.")
    say("  Try: Is it switched on, is the path or the port of the link right, and its baud?")
    return False


async def _examine_gateway(uri: str, settings: Settings, listen_s: float, say: Say) -> bool:
    carrier, imei = satellite_address(uri)
    kind: GatewayKind = next(kind for kind in GATEWAY_KINDS if kind == carrier)
    say(f"Modem {imei} is reached through {kind}; no message is sent, for each one is paid.")
    if kind == "directip" and settings.directip_port is None:
        say("Messages of the robot cannot come in: no port is set to take them.")
        say("  Try: set GRACE_DIRECTIP_PORT, and for its networks GRACE_DIRECTIP_ALLOWED.")
    try:
        account = SecretStore(settings.secret_dir).gateway(kind)
    except (SecretUnreadableError, OSError) as error:
        say(f"The account cannot be read: {error}")
        return False
    if account is None:
        say(f"The data folder {settings.data_dir} has no account with {kind}.")
        say("  Try: name the station's folder with --data, or enter the account on the page Links.")
        return False
    if kind == "rockblock" and not account.public_key:
        say("What RockBLOCK pushes is refused: its public key is not entered.")
    if kind != "directip" and not account.password:
        say("The account has no password or token; nothing can be sent.")
        return False
    parts = urlsplit(account.url)
    host, port = parts.hostname or "", parts.port or _TLS_PORT
    try:
        async with asyncio.timeout(listen_s):
            _, writer = await asyncio.open_connection(host, port)
    except (OSError, TimeoutError) as error:
        say(f"The gateway at {host} port {port} cannot be reached ({type(error).__name__}).")
        say("  Try: Is this machine on the Internet, and does its firewall let that port out?")
        return False
    writer.transport.abort()
    with suppress(OSError):
        await writer.wait_closed()
    say(f"The gateway at {host} port {port} can be reached.")
    is_taking = kind != "directip" or settings.directip_port is not None
    return is_taking and (kind != "rockblock" or bool(account.public_key))
