"""Options that several verbs have; light to import, for the verb that runs on board."""

from argparse import ArgumentParser
from pathlib import Path

TOKEN_VARIABLE = "GRACE_TOKEN"


def add_data_option(parser: ArgumentParser) -> None:
    """Add ``--data``."""
    parser.add_argument(
        "--data",
        type=Path,
        metavar="DIR",
        help="data folder of the station (default: GRACE_DATA_DIR, or the user's data folder)",
    )


def add_remote_options(parser: ArgumentParser) -> None:
    """Add ``--url``; the token that goes with it is no option, which everybody here could read."""
    parser.add_argument(
        "--url",
        help="address of a running station, instead of a data folder; "
        f"{TOKEN_VARIABLE} of the environment holds a bearer token",
    )
