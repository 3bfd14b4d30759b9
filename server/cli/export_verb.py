"""``grace export``: a deployment as a file that other programs read."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from db.query.fleet.deployments import get_deployment, list_deployments
from db.query.fleet.robots import get_robot
from db.store import Store
from server.cli.data import open_store, settings_of
from server.cli.failure import CommandError
from server.cli.option import add_data_option
from server.recording.export import csv_blocks, geojson, kml


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    parser.add_argument("deployment", nargs="?", help="its id; without one, list them all")
    parser.add_argument(
        "file", nargs="?", type=Path, help="where to; ends in .csv, .geojson or .kml"
    )
    add_data_option(parser)


def run(arguments: Namespace) -> int:
    """Write the file; a running station is not disturbed."""
    with open_store(settings_of(arguments)) as store:
        if arguments.deployment is None:
            _list(store)
        elif arguments.file is None:
            raise CommandError("Say where to write it: grace export DEPLOYMENT FILE.", status=2)
        else:
            _write(store, arguments.deployment, arguments.file)
    return 0


def _list(store: Store) -> None:
    with store.read() as session:
        for deployment in list_deployments(session, limit=1000):
            print(f"{deployment.id}  {deployment.robot}  {deployment.kind:8}  {deployment.title}")


def _write(store: Store, deployment: str, file: Path) -> None:
    with store.read() as session:
        record = get_deployment(session, deployment)
        robot = get_robot(session, record.robot)
        match file.suffix:
            case ".csv":
                blocks = csv_blocks(session, record, robot)
            case ".geojson":
                blocks = iter([geojson(session, record, robot)])
            case ".kml":
                blocks = iter([kml(session, record, robot)])
            case _:
                raise CommandError("The file must end in .csv, .geojson or .kml.", status=2)
        try:
            with file.open("x", encoding="utf-8") as target:
                target.writelines(blocks)
        except OSError as error:
            raise CommandError(f"{file}: {error.strerror}; nothing was written.") from error
    print(f"{record.id} of {record.robot} is in {file}.")
