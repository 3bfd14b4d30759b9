"""``grace robot``: a robot's onboard program alone, and the robots that the station knows.

The program on board imports nothing of the station; ``fleet`` does, and is imported when needed.
"""

import json
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic import ValidationError

from server.cli.failure import CommandError
from server.cli.option import add_data_option, add_remote_options
from server.watch.console import log_to_console

FLY = "fly"
ACTIONS = (FLY, "add", "list", "retire", "restore")


def completed(words: Sequence[str]) -> list[str]:
    """Return the words of the command line with the action that may be left out.

    ``grace robot grace-1 --nodes ...`` is ``grace robot fly grace-1 --nodes ...``.
    """
    at = words.index("robot") + 1
    is_said = not words[at:] or words[at] in (*ACTIONS, "-h", "--help")
    return list(words) if is_said else [*words[:at], FLY, *words[at:]]


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    fly = actions.add_parser(
        FLY, help="run one robot's onboard program alone, against its nodes; may be left out"
    )
    _add_flight(fly)
    add = actions.add_parser("add", help="let the station know a robot")
    _add_robot(add)
    show = actions.add_parser("list", help="list the robots, the retired ones last")
    retire = actions.add_parser("retire", help="take a robot out of the fleet; its past stays")
    restore = actions.add_parser("restore", help="bring a retired robot back into the workshop")
    for action in (retire, restore):
        action.add_argument("robot", help="its id, such as grace-1")
    for action in (add, show, retire, restore):
        add_data_option(action)
        add_remote_options(action)


def _add_flight(parser: ArgumentParser) -> None:
    parser.add_argument("robot", help="its name, such as grace-1")
    parser.add_argument(
        "--nodes",
        type=Path,
        required=True,
        metavar="FILE",
        help='JSON file with the addresses of its nodes: {"body": "tcp://127.0.0.1:4567", ...}',
    )
    parser.add_argument(
        "--radio", required=True, metavar="URI", help="its radio, such as xbee:///dev/ttyUSB0"
    )
    parser.add_argument(
        "--memory",
        type=Path,
        required=True,
        metavar="DIR",
        help="folder of what it remembers while it is switched off, with its key in robot.key and"
        " the one that signs its radio in signing.key",
    )
    parser.add_argument(
        "--unsigned",
        action="store_true",
        help="begin without signing.key: whoever has such a radio can then give it orders",
    )
    parser.add_argument(
        "--speed", type=float, default=1.0, help="how many times faster than life its nodes are"
    )


def _add_robot(parser: ArgumentParser) -> None:
    parser.add_argument("robot", help="short name: lower-case letters, digits and dashes")
    parser.add_argument("--name", help="what operators call it (default: the short name)")
    parser.add_argument("--protocol", choices=("grace", "mavlink"), default="grace")
    parser.add_argument("--model", default="", metavar="KEY", help="vehicle, such as miniglider")
    parser.add_argument("--system", type=int, metavar="N", help="its MAVLink system id, 1 to 249")
    parser.add_argument(
        "--link",
        action="append",
        default=[],
        metavar="URI",
        help="such as xbee:///dev/ttyUSB0; once for each, the best first",
    )
    parser.add_argument("--water", required=True, metavar="ID", help="see grace water list")
    parser.add_argument(
        "--recorded", action="store_true", help="a name for recordings: no radio, no system id"
    )
    parser.add_argument(
        "--unsigned",
        action="store_true",
        help="its radio cannot sign: whoever has such a radio can then pose as it",
    )
    parser.add_argument("--signed", action="store_true", help="sign a MAVLink vehicle's radio too")
    parser.add_argument(
        "--workshop", action="store_true", help="no deployment begins; it stays in the workshop"
    )
    parser.add_argument("--deployment", metavar="NAME", help="of the one that begins now")
    parser.add_argument("--purpose", default="", help="of the deployment")
    parser.add_argument(
        "--person", action="append", default=[], metavar="NAME", help="who deploys it; once each"
    )


def run(arguments: Namespace) -> int:
    """Do the action: fly until told to stop, or change or list what the station knows."""
    if arguments.action == FLY:
        return _fly(arguments)
    from server.cli.robot_verb import fleet

    return fleet.run(arguments)


def _fly(arguments: Namespace) -> int:
    # The onboard program is heavy to import; few other verbs run it.
    from onboard.computer import SIGNING_KEY_FILE
    from onboard.memory import KeyUnreadableError
    from simulator.robot_process import RobotSettings
    from simulator.robot_process import run as run_robot

    try:
        settings = RobotSettings(
            robot=arguments.robot,
            nodes=_addresses(arguments.nodes),
            radio=arguments.radio,
            memory=arguments.memory,
            speed=arguments.speed,
        )
    except ValidationError as error:
        first = error.errors()[0]
        message = first["msg"].removeprefix("Value error, ")
        raise CommandError(f"{first['loc'][0]}: {message}", status=2) from error
    if not (arguments.unsigned or (settings.memory / SIGNING_KEY_FILE).exists()):
        raise CommandError(
            f"{settings.memory / SIGNING_KEY_FILE} is not there: write the key into it that the"
            " station showed when the robot was added, or say --unsigned."
        )
    log_to_console()
    try:
        run_robot(settings)
    except KeyUnreadableError as error:
        raise CommandError(str(error)) from error
    return 0


def _addresses(file: Path) -> Mapping[str, str]:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise CommandError(f"--nodes: {file}: {error}", status=2) from error
    if not isinstance(content, dict):
        raise CommandError(f"--nodes: {file} holds no JSON object.", status=2)
    return {str(name): str(address) for name, address in content.items()}
