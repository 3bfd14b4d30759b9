"""``grace audit``: event log and log book held against their hashes, and written to a file."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from db.query.log_book.check import complaints, size
from db.query.log_book.entries import every_attachment
from db.query.station.event_chain import look_through
from db.store import Store
from server.cli.data import open_store, settings_of
from server.cli.failure import CommandError
from server.cli.option import add_data_option
from server.logbook.picture import complaints as picture_complaints
from server.system.event_export import blocks


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    verify = actions.add_parser(
        "verify",
        help="say whether an event, or the log book, was changed, and where; changes nothing",
    )
    verify.add_argument("--head", help="hash that an earlier look printed; it must be in the chain")
    export = actions.add_parser("export", help="write the log as lines of JSON, with its hashes")
    export.add_argument("file", type=Path, help="where to; must not exist yet")
    for action in (verify, export):
        add_data_option(action)


def run(arguments: Namespace) -> int:
    """Do one of the two; a running station is not disturbed."""
    with open_store(settings_of(arguments)) as store:
        if arguments.action == "export":
            return _export(store, arguments.file)
        return _verify(store, arguments.head, settings_of(arguments).data_dir)


def _verify(store: Store, noted: str | None, data_dir: Path) -> int:
    """Return 0 if the chain is whole, and the log book is what its events tell."""
    with store.read() as session:
        found = look_through(session, noted)
        wrong = [*complaints(session), *picture_complaints(data_dir, every_attachment(session))]
        versions, pages = size(session)
    if found.fault:
        print(f"The first {found.rows} events fit. Then {found.fault}.")
    if wrong:
        print("The log book was changed:", *wrong, sep="\n")
    if found.fault or wrong:
        return 1
    print(f"All {found.rows} events fit. Note the head elsewhere: {found.head}")
    if versions:
        print(f"The log book fits: {versions} versions of entries, {pages} signed pages.")
    return 0


def _export(store: Store, file: Path) -> int:
    try:
        with file.open("xb") as target:
            target.writelines(blocks(store))
    except FileExistsError as error:
        raise CommandError(f"{file} exists; nothing was written.") from error
    except OSError as error:
        file.unlink(missing_ok=True)
        raise CommandError(f"{file}: {error.strerror}; nothing was written.") from error
    print(f"{file.stat().st_size} bytes are in {file}.")
    return 0
