"""``grace link``: the links to robots, looked at from the command line."""

import asyncio
import logging
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from contextlib import suppress
from urllib.parse import urlsplit

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from db.query.robots import list_robots
from robot_link.acoustic.micromodem import open_modem
from robot_link.clock import SystemClock
from robot_link.messages import RobotId
from robot_link.station.gateway.address import (
    check_link,
    is_acoustic,
    is_satellite,
    satellite_address,
)
from robot_link.transport.datagram import PortChanged
from robot_link.transport.doctor import Doctor
from robot_link.transport.opening import is_radio
from server.base.secret import (
    GATEWAY_KINDS,
    GatewayKind,
    SecretStore,
    SecretUnreadableError,
    secret_fault,
)
from server.base.settings import Settings
from server.cli.data import add_data_option, open_store, settings_of
from server.cli.failure import CommandError
from server.cli.remote import add_remote_options, checked, open_remote

_LONGEST_LISTENING_S = 3600.0
_TLS_PORT = 443
Say = Callable[[str], None]


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    doctor = actions.add_parser(
        "doctor", help="open a link, say what it hears, and what to try where it is silent"
    )
    doctor.add_argument(
        "uri", help="the link, such as xbee:///dev/ttyUSB0, udp://127.0.0.1:14550, or of a gateway"
    )
    doctor.add_argument(
        "--seconds", type=float, default=10.0, help="how long to listen (default: 10)"
    )
    add_data_option(doctor)
    show = actions.add_parser("list", help="list the links of the station's robots")
    add_data_option(show)
    add_remote_options(show)


def run(arguments: Namespace) -> int:
    """Do the action; the doctor's exit status says whether a robot was heard."""
    if arguments.action == "doctor":
        return _examine(arguments.uri, arguments.seconds, settings_of(arguments))
    table = _live_links(arguments) if arguments.url else _registered_links(arguments)
    Console().print(table if table.row_count else "There is no robot yet.")
    return 0


def _registered_links(arguments: Namespace) -> Table:
    """Return the links as the data folder has them."""
    settings = settings_of(arguments)
    secrets = SecretStore(settings.secret_dir)
    with open_store(settings) as store, store.read() as session:
        robots = list_robots(session)
    table = Table("robot", "system", "link", "signed", "remark")
    for robot in robots:
        for number, uri in enumerate(robot.links):
            system = robot.system_id if number == 0 else None
            name = "" if number else robot.id
            signed = _signed(secrets, robot.id) if is_radio(uri) else ""
            table.add_row(name, str(system or ""), escape(uri), signed, escape(_remark(uri)))
        if not robot.links:
            remark = "a recording" if robot.kind == "recorded" else "no link: give it one"
            table.add_row(robot.id, str(robot.system_id or ""), "", "", remark)
    return table


def _signed(secrets: SecretStore, robot: str) -> str:
    """Return whether a robot's radio is signed: yes, no, or that its key is damaged."""
    try:
        return "no" if secrets.signing_key(robot) is None else "yes"
    except (SecretUnreadableError, OSError):
        return "key damaged"


def _live_links(arguments: Namespace) -> Table:
    """Return the links as a running station knows them now."""
    table = Table("robot", "link", "state", "frames", "bad", "dBm", "signed", "remark")
    with open_remote(arguments) as client:
        for robot in checked(client.get("/api/robots")).json():
            links = checked(client.get(f"/api/robots/{robot['id']}/links")).json()
            for number, link in enumerate(links):
                strength = link["rssi_dbm"]
                table.add_row(
                    "" if number else robot["id"],
                    escape(link["uri"]),
                    link["state"].replace("_", " "),
                    str(link["frames_received"]),
                    str(link["frames_bad"]),
                    "" if strength is None else f"{strength:g}",
                    {True: "yes", False: "no"}.get(link["is_signed"], ""),
                    escape(link["text"]),
                )
    return table


def _examine(uri: str, listen_s: float, settings: Settings) -> int:
    if not 0 < listen_s <= _LONGEST_LISTENING_S:
        raise CommandError(f"--seconds must be above 0 and up to {_LONGEST_LISTENING_S:g}.", 2)
    logging.getLogger("robot_link").addHandler(logging.NullHandler())
    try:
        if is_satellite(uri) or is_acoustic(uri):
            examined = examine_other(uri, settings, listen_s, _say)
        else:
            examined = Doctor(uri, _say).examine(listen_s)
        return 0 if asyncio.run(examined) else 1
    except ValueError as error:
        raise CommandError(f"{error}.", 2) from error


def _say(line: str) -> None:
    print(line, flush=True)


def _remark(uri: str) -> str:
    """Return what is wrong with a link, or ""."""
    try:
        check_link(uri)
    except ValueError as error:
        return str(error)
    return ""


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
