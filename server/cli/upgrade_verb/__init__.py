"""``grace upgrade``: this version takes over from the station that runs, which may be another."""

import json
import socket
import sys
from argparse import ArgumentParser, Namespace

from server.cli.data import settings_of
from server.cli.failure import CommandError
from server.cli.option import add_data_option
from server.cli.service.desk import control_address


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    add_data_option(parser)


def run(arguments: Namespace) -> int:
    """Ask the station of the folder to hand over, and say how it goes."""
    folder = settings_of(arguments).data_dir
    told: dict[str, object] = {}
    try:
        with socket.socket(socket.AF_UNIX) as desk, control_address(folder) as address:
            desk.connect(address)
            desk.sendall(json.dumps({"python": sys.executable}).encode() + b"\n")
            for line in desk.makefile():
                told = json.loads(line)
                if "done" not in told:
                    print(told["said"], flush=True)
    except OSError as error:
        raise CommandError(
            f"No station that can be replaced runs on {folder} ({error.strerror}); "
            "start it with this version instead."
        ) from error
    if not told.get("done"):
        raise CommandError(str(told.get("said", "The station did not say what became of it.")))
    print(told["said"])
    return 0
