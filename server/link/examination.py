"""One link examined: opened by itself for a while, what it brings, and what the station would show.

``grace link doctor`` says it line by line; the form that adds a robot shows it while one types.
"""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from urllib.parse import urlsplit

from robot_link.acoustic.micromodem import open_modem
from robot_link.clock import SystemClock, monotonic_s
from robot_link.mavlink.codec import STATION_SYSTEM
from robot_link.mavlink.flight_mode import autopilot_title
from robot_link.messages import LinkState, RobotId
from robot_link.station.gateway.address import (
    camera_tags,
    is_acoustic,
    is_cameras,
    is_satellite,
    satellite_address,
)
from robot_link.transport.datagram import PortChanged
from robot_link.transport.doctor import Doctor, Hearing
from server.base.secret import (
    GATEWAY_KINDS,
    GatewayKind,
    SecretStore,
    SecretUnreadableError,
    secret_fault,
)
from server.base.settings import Settings

_TLS_PORT = 443
Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class HeardSystem:
    """A system that spoke on a link."""

    system_id: int
    title: str
    """What it says that it is, such as ArduSub; "a robot of ours" where it speaks our dialect."""
    protocol: str
    """``grace`` or ``mavlink``."""
    age_s: float
    """How long ago it was heard last."""
    frames: int
    is_signed: bool


@dataclass(frozen=True, slots=True)
class Examination:
    """What became of the examination of one link."""

    state: LinkState
    """What the station would say of the link."""
    is_well: bool
    """Whether a robot was heard, or the way to it is open, and nothing needs to be put right."""
    shown: str
    """What the station would show, in one sentence."""
    heard: tuple[HeardSystem, ...] = ()


async def examine_link(
    uri: str, settings: Settings, listen_s: float, say: Say, *, is_brief: bool = False
) -> Examination:
    """Open a link of any kind for a while and tell what it brings; what is sent costs nothing.

    Args:
        uri: The link.
        settings: Of the station: where its accounts with gateways are.
        listen_s: How long to listen, s.
        say: Takes each finding, a sentence, as it is made.
        is_brief: End soon after a robot is known, and ask a radio who else is in its network only
            where nothing is heard.

    Raises:
        ValueError: If the link names none.
    """
    if is_cameras(uri):
        shown = (
            f"The station will show the cameras as never having seen tags of {camera_tags(uri)}."
        )
        say("This link opens nothing: what each camera sees is said under Settings, Cameras.")
        return Examination(LinkState.NEVER_HEARD, is_well=True, shown=shown)
    if is_satellite(uri) or is_acoustic(uri):
        is_well = await examine_other(uri, settings, listen_s, say)
        kind = "acoustic modem" if is_acoustic(uri) else "gateway"
        state = LinkState.NEVER_HEARD if is_well else LinkState.MUTE
        shown = (
            f"The station will show the {kind} as never heard, until the robot speaks through it."
            if is_well
            else f"The station will show that the {kind} does not answer."
        )
        return Examination(state, is_well, shown)
    doctor = Doctor(uri, say, is_brief=is_brief)
    is_well = await doctor.examine(listen_s)
    return _told(doctor.heard, is_well=is_well)


def _told(heard: Hearing, *, is_well: bool) -> Examination:
    systems = tuple(
        _system(heard, system) for system in sorted(heard.heard_s) if system != STATION_SYSTEM
    )
    if systems:
        names = " and ".join(f"system {one.system_id} ({one.title})" for one in systems)
        shown = f"The station will show {names} as live."
        return Examination(LinkState.LIVE, is_well, shown, systems)
    if heard.was_open:
        shown = "The station will show the robot as never heard."
        return Examination(LinkState.NEVER_HEARD, is_well, shown)
    if "no XBee" in heard.closed_reason:
        shown = "The station will show that its radio does not answer."
        return Examination(LinkState.MUTE, is_well, shown)
    shown = "The station will show the port as closed."
    return Examination(LinkState.PORT_CLOSED, is_well, shown)


def _system(heard: Hearing, system: int) -> HeardSystem:
    is_ours = system in heard.ours
    kind = heard.kinds.get(system)
    if is_ours or kind is None:
        title = "a robot of ours" if is_ours else "kind not told yet"
    else:
        title = autopilot_title(*kind)
    frames = sum(count for (one, _), count in heard.frames.items() if one == system)
    return HeardSystem(
        system_id=system,
        title=title,
        protocol="grace" if is_ours else "mavlink",
        age_s=max(0.0, monotonic_s() - heard.heard_s[system]),
        frames=frames,
        is_signed=heard.signed[system, True] > 0,
    )


async def examine_other(uri: str, settings: Settings, listen_s: float, say: Say) -> bool:
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
        say(f"The account cannot be read: {secret_fault(error)}")
        return False
    if account is None:
        say(f"The data folder {settings.data_dir} has no account with {kind}.")
        say("  Try: name the station's folder with --data, or enter it in Settings, Gateways.")
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
