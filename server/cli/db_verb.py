"""``grace db``: care of the database."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from db import care
from db.engine import shown_url
from db.fault import StoreError
from db.migrate import schema_version
from server.base.settings import Settings
from server.cli.backup import BackupError, pack, unpack
from server.cli.data import add_data_option, open_store, settings_of
from server.cli.data_folder import DataFolderError, hold_data_folder
from server.cli.failure import CommandError


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    upgrade = actions.add_parser(
        "upgrade", help="bring the schema up to date, as serve does, and show it"
    )
    check = actions.add_parser(
        "check", help="read the whole database and say what is wrong with it; changes nothing"
    )
    backup = actions.add_parser(
        "backup", help="pack database, secrets and logs into one file while the station runs"
    )
    backup.add_argument("file", type=Path, help="where to, such as lake.tar.gz; must not exist")
    restore = actions.add_parser(
        "restore", help="unpack a backup into a data folder that has no database"
    )
    restore.add_argument("file", type=Path, help="a backup, or a copy of the database alone")
    for action in (upgrade, check, backup, restore):
        add_data_option(action)


def run(arguments: Namespace) -> int:
    """Do the action on the folder's database; a check's exit status says whether it is whole."""
    settings = settings_of(arguments)
    try:
        match arguments.action:
            case "backup":
                pack(settings.data_dir, _sqlite(settings, "pg_dump"), arguments.file)
                print(
                    f"Packed into {arguments.file}. It holds keys: keep it as safe as the station."
                )
            case "restore":
                with hold_data_folder(settings.data_dir):
                    unpack(arguments.file, settings.data_dir, _sqlite(settings, "pg_restore"))
                print(f"Restored into {settings.data_dir}.")
            case "check":
                return _check(settings)
            case _:
                with open_store(settings) as store, store.read() as session:
                    print(schema_version(session.connection()))
    except (StoreError, BackupError, DataFolderError) as error:
        raise CommandError(str(error)) from error
    return 0


def _check(settings: Settings) -> int:
    url = settings.resolved_database_url
    wrong = care.complaints(url)
    if not wrong:
        print(f"{shown_url(url)} is whole.")
        return 0
    print(*wrong, sep="\n")
    raise CommandError(
        f"{shown_url(url)} is damaged. Stop the station and keep the file; then go back to a "
        "backup with `grace db restore`, or to what `sqlite3 FILE .recover` can still read."
    )


def _sqlite(settings: Settings, instead: str) -> Path:
    file = care.sqlite_file(settings.resolved_database_url)
    if file is None:
        raise CommandError(
            f"This is for SQLite only; use {instead} for PostgreSQL, and copy "
            f"{settings.secret_dir} beside it."
        )
    return file
