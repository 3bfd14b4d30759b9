"""``grace openapi``: the REST interface as a document, without a running station."""

import json
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from server.app import create_app
from server.base.settings import Settings


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    parser.add_argument("--out", type=Path, help="file to write (default: standard output)")


def run(arguments: Namespace) -> int:
    """Write the OpenAPI document."""
    text = json.dumps(create_app(Settings()).openapi(), indent=1) + "\n"
    if arguments.out is None:
        sys.stdout.write(text)
    else:
        arguments.out.write_text(text)
    return 0
