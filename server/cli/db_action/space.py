"""``grace db vacuum`` and ``grace db unarchive``: room that rows left, and rows that left."""

from argparse import ArgumentParser, Namespace
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol

from db.care import sqlite_file
from db.space import vacuum
from server.base.settings import Settings
from server.cli.data import clock_of, open_store
from server.cli.data_folder import hold_data_folder
from server.cli.failure import CommandError
from server.storage.archive import ArchiveError
from server.storage.restoring import restore_file


class Actions(Protocol):
    """Where actions of a verb are declared."""

    def add_parser(self, name: str, *, help: str) -> ArgumentParser:
        """Declare one."""
        ...


def add_space_arguments(actions: Actions) -> list[ArgumentParser]:
    """Declare the two actions."""
    shrink = actions.add_parser(
        "vacuum",
        help="give the room of deleted rows back to the disk; SQLite: station stopped",
    )
    back = actions.add_parser(
        "unarchive", help="read files of moved rows back; the station may run"
    )
    back.add_argument("files", nargs="+", type=Path, metavar="FILE", help="below DATA/archive")
    return [shrink, back]


def run_vacuum(settings: Settings) -> None:
    """Give room back, and say how much.

    Raises:
        DataFolderTakenError: If a station runs on a SQLite database.
        StoreUnavailableError: If it cannot be done; nothing was.
    """
    url = settings.resolved_database_url
    with ExitStack() as held:
        if sqlite_file(url) is not None:
            held.enter_context(hold_data_folder(settings.data_dir))
        done = vacuum(url)
    print(f"It took {_mb(done.before_bytes)} and takes {_mb(done.after_bytes)} now.")


def run_unarchive(settings: Settings, arguments: Namespace) -> None:
    """Read files back, one after another, and say what each brought.

    Raises:
        CommandError: If one is damaged, or of a robot that the station does not know.
    """
    now = clock_of(settings).now()
    with open_store(settings) as store:
        for file in arguments.files:
            try:
                back = restore_file(store, settings.data_dir, file, now)
            except ArchiveError as error:
                raise CommandError(str(error)) from error
            print(f"{file}: {back} rows are back.")


def _mb(size: int) -> str:
    return f"{size / 1e6:.1f} MB"
