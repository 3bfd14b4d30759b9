"""``grace link``: the links to robots, looked at from the command line."""

import asyncio
import logging
from argparse import ArgumentParser, Namespace

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from db.query.fleet.robots import list_robots
from robot_link.station.gateway.address import (
    check_link,
)
from robot_link.transport.opening import is_radio
from server.base.secret import (
    SecretStore,
    SecretUnreadableError,
)
from server.base.settings import Settings
from server.cli.data import checked, open_remote, open_store, settings_of
from server.cli.failure import CommandError
from server.cli.option import add_data_option, add_remote_options
from server.link.examination import examine_link

_LONGEST_LISTENING_S = 3600.0


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
        found = asyncio.run(examine_link(uri, settings, listen_s, _say))
    except ValueError as error:
        raise CommandError(f"{error}.", 2) from error
    _say(found.shown)
    return 0 if found.is_well else 1


def _say(line: str) -> None:
    print(line, flush=True)


def _remark(uri: str) -> str:
    """Return what is wrong with a link, or ""."""
    try:
        check_link(uri)
    except ValueError as error:
        return str(error)
    return ""
