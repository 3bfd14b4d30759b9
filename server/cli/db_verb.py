"""``grace db``: care of the database.

A backup is one file with what a station must not lose, a gzipped tar of plain files:
``station.sqlite3``, ``clock.json`` of a demo, ``secret/*`` and ``log/*``. What else is in a data
folder the programs make anew.
"""

import filecmp
import gzip
import shutil
import tarfile
import tempfile
import zlib
from argparse import ArgumentParser, Namespace
from collections.abc import Generator, Iterable
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from typing import Final

from db import care
from db.engine import shown_url
from db.fault import StoreError, StoreUnavailableError
from db.migrate import schema_version
from robot_link.whole_file import keep_names
from server.base.settings import Settings
from server.cli.data import open_store, settings_of
from server.cli.data_folder import CLOCK_FILE, DataFolderError, hold_data_folder
from server.cli.db_action.space import add_space_arguments, run_unarchive, run_vacuum
from server.cli.failure import CommandError
from server.cli.option import add_data_option
from server.current.told import FOLDER as CURRENT_FOLDER
from server.logbook.picture import FOLDER as PICTURE_FOLDER
from server.water.waters import CHART_FOLDER

DATABASE: Final = "station.sqlite3"
FOLDERS: Final = ("secret", "log", CHART_FOLDER, CURRENT_FOLDER, PICTURE_FOLDER)
_SQLITE_BEGINS: Final = b"SQLite format 3\0"
_BLOCK_BYTES: Final = 1 << 20


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
    for action in (upgrade, check, backup, restore, *add_space_arguments(actions)):
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


class BackupError(Exception):
    """A backup cannot be made or unpacked; the sentence says why and what to do."""


def pack(folder: Path, database: Path, target: Path) -> None:
    """Pack a data folder while a station may run on it; ``target`` appears whole or not at all.

    Raises:
        BackupError: If there is nothing to pack, or ``target`` exists or cannot be written.
        StoreUnavailableError: If the database cannot be read.
    """
    if target.exists():
        raise BackupError(f"{target} exists already; nothing was copied.")
    if not database.exists():
        raise BackupError(f"There is no database at {database}.")
    with _said(target), _beside(target) as staging:
        care.copy_sqlite(database, staging / DATABASE)
        fresh = staging / "backup"
        with tarfile.open(fresh, "x:gz", compresslevel=6) as archive:
            archive.add(staging / DATABASE, DATABASE)
            if (folder / CLOCK_FILE).is_file():
                archive.add(folder / CLOCK_FILE, CLOCK_FILE)
            for name in FOLDERS:
                for file in sorted((folder / name).glob("*")):
                    # A name that begins with a dot is of a file that is half written.
                    is_whole = file.is_file() and not file.is_symlink() and file.name[0] != "."
                    if is_whole:
                        archive.add(file, f"{name}/{file.name}")
        fresh.chmod(0o600)
        fresh.replace(target)
        keep_names(target.parent.absolute())


def unpack(source: Path, folder: Path, database: Path) -> None:
    """Unpack a backup, all of it or nothing; a copy of the database alone is one, too.

    Raises:
        BackupError: If ``source`` is no backup or a damaged one, or the folder has something that
            would be lost.
    """
    with _said(folder), _beside(folder / DATABASE) as staging:
        _unpack_into(staging, source)
        if not (staging / DATABASE).is_file():
            raise BackupError(f"{source} holds no {DATABASE}; it is no backup of a station.")
        wrong = _complaint(staging / DATABASE)
        if wrong:
            raise BackupError(f"The database in {source} is damaged: {wrong}")
        moves = [(staging / CLOCK_FILE, folder / CLOCK_FILE)]
        for name in FOLDERS:
            moves += [(file, folder / name / file.name) for file in (staging / name).glob("*")]
        # What an attempt that was cut off has left is there already, and is not lost.
        moves = [(fresh, place) for fresh, place in moves if _is_missing(fresh, place)]
        _refuse_to_replace(place for _, place in moves)
        _refuse_to_replace(
            database.with_name(f"{database.name}{end}") for end in ("", "-wal", "-shm")
        )
        with _said(database):
            database.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            with _beside(database) as near:
                # It may be on another disk than the folder, and appears whole or not at all.
                fresh = Path(shutil.move(staging / DATABASE, near / DATABASE))
                # The database last: as long as there is none, the same can be done again.
                _move_all([*moves, (fresh, database)])


def _is_missing(fresh: Path, place: Path) -> bool:
    """Tell whether there is a file to be put in a place that does not have the same already."""
    if not fresh.exists():
        return False
    return not (place.is_file() and filecmp.cmp(fresh, place, shallow=False))


def _move_all(moves: list[tuple[Path, Path]]) -> None:
    """Move files to their places, all of them or none."""
    moved: list[tuple[Path, Path]] = []
    try:
        for fresh, place in moves:
            place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            fresh.replace(place)
            moved.append((fresh, place))
            keep_names(place.parent)
    except BaseException:
        for fresh, place in reversed(moved):
            with suppress(OSError):
                place.replace(fresh)
        raise


def _complaint(database: Path) -> str:
    """Return what is first wrong with a database, or ""."""
    try:
        return next(iter(care.complaints(f"sqlite:///{database}")), "")
    except StoreUnavailableError as error:
        return str(error)


def _refuse_to_replace(places: Iterable[Path]) -> None:
    for place in places:
        if place.exists():
            raise BackupError(
                f"{place} is there already and would be lost; move it away, or restore into "
                "another folder with --data. Nothing was restored."
            )


def _unpack_into(staging: Path, source: Path) -> None:
    try:
        with source.open("rb") as file:
            is_database = file.read(len(_SQLITE_BEGINS)) == _SQLITE_BEGINS
        if is_database:
            care.copy_sqlite(source, staging / DATABASE)
            return
        with gzip.open(source) as stream:
            with tarfile.open(fileobj=stream, mode="r:") as archive:
                for member in archive:
                    _unpack_one(archive, member, staging, source)
            # The checksum stands at the end, behind what tar reads.
            while stream.read(_BLOCK_BYTES):
                pass
    except (tarfile.TarError, EOFError, zlib.error) as error:
        raise BackupError(f"{source} is no backup, or a damaged one ({error}).") from error
    except OSError as error:
        raise BackupError(f"{source} cannot be read: {error.strerror or error}.") from error


def _unpack_one(
    archive: tarfile.TarFile, member: tarfile.TarInfo, staging: Path, source: Path
) -> None:
    parts = PurePosixPath(member.name).parts
    is_ours = parts in ((DATABASE,), (CLOCK_FILE,)) or (len(parts) == 2 and parts[0] in FOLDERS)
    content = archive.extractfile(member) if member.isfile() else None
    if not is_ours or ".." in parts or content is None:
        raise BackupError(f"{source} holds {member.name!r}; it is no backup of a station.")
    place = staging.joinpath(*parts)
    place.parent.mkdir(mode=0o700, exist_ok=True)
    with content, place.open("xb") as file:
        place.chmod(0o600)
        shutil.copyfileobj(content, file)


@contextmanager
def _beside(target: Path) -> Generator[Path]:
    """Give a folder on the same disk that nobody else can look into, for as long as it is used."""
    with tempfile.TemporaryDirectory(prefix=".grace-", dir=target.parent) as staging:
        yield Path(staging)


@contextmanager
def _said(place: Path) -> Generator[None]:
    try:
        yield
    except OSError as error:
        raise BackupError(f"{place} cannot be written: {error.strerror or error}.") from error
