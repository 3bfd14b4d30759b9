"""Where files that leave the station are put, and how they come from one that runs."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

import httpx

from server.cli.failure import CommandError


def add_arguments(parser: ArgumentParser) -> None:
    """Declare what leaves the station, and where to."""
    parser.add_argument("deployment", help="its id, such as deployment-3")
    parser.add_argument("folder", type=Path, help="where to; the file's name is its id")
    parser.add_argument(
        "--no-better-data",
        action="store_true",
        help="confirm, of a reviewed deployment, that nothing better exists than telemetry",
    )


def folder_of(arguments: Namespace) -> Path:
    """Return the folder that was named; raises ``CommandError`` if it is none."""
    folder: Path = arguments.folder
    if not folder.is_dir():
        raise CommandError(f"{folder} is no folder.", status=2)
    return folder


def free(target: Path) -> Path:
    """Return a path at which nothing is; raises ``CommandError`` if something is."""
    if target.exists():
        raise CommandError(f"{target} is there already; nothing was written.")
    return target


def download(client: httpx.Client, path: str, target: Path) -> None:
    """Write what a station answers to a new file; nothing is left of one that broke off."""
    part = target.with_name(f".{target.name}.part")
    try:
        with client.stream("GET", path) as answer, part.open("wb") as content:
            answer.raise_for_status()
            for block in answer.iter_bytes():
                content.write(block)
        part.replace(target)
    except httpx.HTTPError as error:
        raise CommandError(f"The station broke off: {error}") from error
    finally:
        part.unlink(missing_ok=True)
