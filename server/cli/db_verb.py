"""``grace db``: care of the database, and backups.

A backup is one file with what a station must not lose (``server/backup/content.py``), a gzipped tar
of plain files: ``station.sqlite3`` or ``station.dump``, ``secret/*``, ``log/*`` and others. It may
be encrypted (``server/backup/sealing.py``).
"""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from db import care
from db.engine import shown_url
from db.fault import StoreError
from db.migrate import schema_version
from server.backup.failure import BackupError
from server.backup.key import Passphrase, PrivateKey, PublicKey
from server.backup.making import BackupOrder, make_backup
from server.backup.restoring import restore_backup
from server.base.settings import Settings
from server.cli.data import open_store, settings_of
from server.cli.data_folder import DataFolderError, hold_data_folder
from server.cli.db_action.space import add_space_arguments, run_unarchive, run_vacuum
from server.cli.failure import CommandError
from server.cli.option import add_data_option


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
    sealing = backup.add_mutually_exclusive_group()
    sealing.add_argument("--public-key", help="encrypt for a key of `grace db backup-key`")
    restore = actions.add_parser(
        "restore", help="unpack a backup into a data folder that has no database"
    )
    restore.add_argument("file", type=Path, help="a backup, or a copy of the database alone")
    opening = restore.add_mutually_exclusive_group()
    opening.add_argument("--key", type=Path, help="file of `grace db backup-key`")
    for group in (sealing, opening):
        group.add_argument(
            "--passphrase-file", type=Path, help="file that holds a passphrase in its first line"
        )
    key = actions.add_parser(
        "backup-key", help="make the key of encrypted backups; its public half is for the station"
    )
    key.add_argument("file", type=Path, help="where the key is kept, away from the station")
    for action in (upgrade, check, backup, restore, *add_space_arguments(actions)):
        add_data_option(action)


def run(arguments: Namespace) -> int:
    """Do the action on the folder's database; a check's exit status says whether it is whole."""
    try:
        if arguments.action == "backup-key":
            return _make_key(arguments.file)
        settings = settings_of(arguments)
        match arguments.action:
            case "backup":
                _backup(settings, arguments)
            case "restore":
                _restore(settings, arguments)
            case "check":
                return _check(settings)
            case "vacuum":
                run_vacuum(settings)
            case "unarchive":
                run_unarchive(settings, arguments)
            case _:
                with open_store(settings) as store, store.read() as session:
                    print(schema_version(session.connection()))
    except (StoreError, BackupError, DataFolderError) as error:
        raise CommandError(str(error)) from error
    return 0


def _make_key(file: Path) -> int:
    key = PrivateKey.make(file)
    print(key.public.text)
    print(
        "The line above is for the station: Settings, Sizes and retention, Backups. "
        f"{file} opens the backups (keep it away from the station, in two places; nobody can "
        "make it again)."
    )
    return 0


def _backup(settings: Settings, arguments: Namespace) -> None:
    lock: PublicKey | Passphrase | None = None
    if arguments.public_key is not None:
        try:
            lock = PublicKey.parse(arguments.public_key)
        except ValueError as error:
            raise CommandError(f"--public-key: {error}.", status=2) from error
    elif arguments.passphrase_file is not None:
        lock = Passphrase.load(arguments.passphrase_file)
    made = make_backup(
        BackupOrder(settings.data_dir, settings.resolved_database_url, arguments.file, lock)
    )
    keep = (
        "It holds keys: keep it as safe as the station."
        if lock is None
        else "It is encrypted: keep what opens it elsewhere."
    )
    print(f"Packed into {arguments.file}, {made.bytes / 1e6:.1f} MB, and read again. {keep}")


def _restore(settings: Settings, arguments: Namespace) -> None:
    opener: PrivateKey | Passphrase | None = None
    if arguments.key is not None:
        opener = PrivateKey.load(arguments.key)
    elif arguments.passphrase_file is not None:
        opener = Passphrase.load(arguments.passphrase_file)
    with hold_data_folder(settings.data_dir):
        restore_backup(arguments.file, settings.data_dir, settings.resolved_database_url, opener)
    print(f"Restored into {settings.data_dir}.")


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
