"""``grace db``: care of the database."""

import sqlite3
from argparse import ArgumentParser, Namespace
from contextlib import closing
from pathlib import Path

from sqlalchemy import make_url

from db.migrate import schema_version
from server.base.settings import Settings
from server.cli.data import add_data_option, open_store, settings_of
from server.cli.failure import CommandError


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    upgrade = actions.add_parser(
        "upgrade", help="bring the schema up to date, as serve does, and show it"
    )
    backup = actions.add_parser("backup", help="copy the database while the station runs")
    backup.add_argument("file", type=Path, help="where to; must not exist")
    for action in (upgrade, backup):
        add_data_option(action)


def run(arguments: Namespace) -> int:
    """Do the action on the folder's database."""
    settings = settings_of(arguments)
    match arguments.action:
        case "backup":
            _backup(settings, arguments.file)
        case _:
            with open_store(settings) as store, store.read() as session:
                print(schema_version(session.connection()))
    return 0


def _backup(settings: Settings, target: Path) -> None:
    url = make_url(settings.resolved_database_url)
    if url.get_backend_name() != "sqlite" or url.database is None:
        raise CommandError("This copies SQLite only; use pg_dump for PostgreSQL.")
    if target.exists():
        raise CommandError(f"{target} exists already; nothing was copied.")
    if not Path(url.database).exists():
        raise CommandError(f"There is no database at {url.database}.")
    with closing(sqlite3.connect(url.database)) as source, closing(sqlite3.connect(target)) as copy:
        source.backup(copy)
    print(f"Copied to {target}.")
