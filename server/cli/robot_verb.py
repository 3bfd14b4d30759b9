"""``grace robot``: a robot's onboard program alone, against its nodes."""

import json
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from pathlib import Path

from pydantic import ValidationError

from server.cli.console_log import log_to_console
from server.cli.failure import CommandError


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
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


def run(arguments: Namespace) -> int:
    """Fly the robot until told to stop."""
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
