"""``grace import``: a recorded deployment from files of any maker."""

import re
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import httpx
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

from db.query.fleet.recordings import DeploymentExistsError
from server.base.channels import catalogue_in
from server.base.job import JobError
from server.cli.data import POLL_PERIOD_S, checked, clock_of, open_remote, open_store, settings_of
from server.cli.data_folder import DataFolderError, DataFolderTakenError, hold_data_folder
from server.cli.failure import CommandError
from server.cli.import_verb.foreign import run_foreign
from server.cli.option import add_data_option, add_remote_options
from server.recording import intake
from server.recording.keep import ROBOT_ID
from server.recording.map_fit import run as fit_maps
from server.recording.table import FLIGHT_COLUMNS, Policy


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    parser.add_argument(
        "files",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="CSV of time,latitude,longitude,depth and then variables; with "
        f"{', '.join(FLIGHT_COLUMNS)} it can be identified (an empty cell of these says that the "
        "row does not tell; a position_std_m makes its position a fix). With --propose or "
        "--mapping also tables with any columns, Seaglider and OG1 NetCDF, Slocum files with "
        "their cache files, the card of a robot of ours, and ZIP archives of them",
    )
    parser.add_argument(
        "--propose",
        action="store_true",
        help="print what the columns would become, as JSON to edit for --mapping; import nothing",
    )
    parser.add_argument(
        "--mapping",
        metavar="JSON",
        help="a file of what the columns become, or - to take what --propose prints as it is",
    )
    parser.add_argument("--robot", required=True, metavar="NAME", help="created if not known")
    parser.add_argument(
        "--policy",
        type=Policy,
        choices=list(Policy),
        default=Policy.REFUSE,
        help="with broken rows: skip them, or refuse the file (default)",
    )
    parser.add_argument(
        "--clock-offset",
        type=float,
        metavar="SECONDS",
        help="with --mapping: how far the recorder's clock was ahead; every time becomes so much "
        "earlier",
    )
    add_data_option(parser)
    add_remote_options(parser)


def run(arguments: Namespace) -> int:
    """Import into a data folder that no station uses, or through the station at ``--url``."""
    if not re.fullmatch(ROBOT_ID, arguments.robot):
        raise CommandError("--robot: lower-case letters, digits and dashes, please.", status=2)
    if arguments.propose or arguments.mapping:
        return run_foreign(arguments)
    if len(arguments.files) > 1:
        raise CommandError("Several files need --mapping; --propose prints one.", status=2)
    (arguments.file,) = arguments.files
    console = Console(stderr=True)
    try:
        with Progress(
            TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), console=console
        ) as progress:
            bar = _Bar(progress)
            result = (_by_station if arguments.url else _by_folder)(arguments, bar)
    except JobError as error:
        _print_faults((error.result or {}).get("errors", []))
        raise CommandError(str(error)) from error
    except OSError as error:
        raise CommandError(f"{arguments.file}: {error.strerror}") from error
    _print_result(result)
    return 0


class _Bar:
    """The progress bar of one import."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._task = progress.add_task("Reading the file", total=1.0)

    def report(self, share: float, message: str) -> None:
        self._progress.update(self._task, completed=share, description=message)


def _by_folder(arguments: Namespace, bar: _Bar) -> Mapping[str, Any]:
    settings = settings_of(arguments)
    clock = clock_of(settings)
    try:
        with (
            hold_data_folder(settings.data_dir),
            arguments.file.open("rb") as file,
            open_store(settings, is_held=True) as store,
        ):
            with store.read() as session:
                channels = catalogue_in(session)
            order = intake.ImportOrder(
                file=file,
                size=arguments.file.stat().st_size,
                title=arguments.file.name,
                robot=arguments.robot,
                policy=arguments.policy,
                by="command line",
                channels=channels,
            )
            recording, read = intake.read_order(
                order, lambda share: bar.report(share * intake.READ_SHARE, "Reading the file")
            )
            bar.report(intake.READ_SHARE, "Keeping the rows")
            at = clock.now()
            kept = store.change(
                lambda session: intake.keep_order(session, order, recording, read, at)
            ).result()
            with store.read() as session:
                problem = intake.fit_problem(session, order.robot, recording)
            outcomes = fit_maps(
                problem,
                lambda news: bar.report(intake.fit_share(news[0]), news[1]),
                lambda: False,
            )
            store.change(
                lambda session: intake.keep_maps(
                    session, order.robot, kept.deployment.id, outcomes, clock.now()
                )
            ).result()
    except DataFolderTakenError as error:
        raise CommandError(f"{error} Import through it: give --url and GRACE_TOKEN.") from error
    except (DataFolderError, DeploymentExistsError) as error:
        raise CommandError(str(error)) from error
    bar.report(1.0, "Imported")
    return intake.import_result(kept, recording, outcomes)


def _by_station(arguments: Namespace, bar: _Bar) -> Mapping[str, Any]:
    with open_remote(arguments) as client, arguments.file.open("rb") as file:
        answer = client.post(
            "/api/imports",
            data={"robot": arguments.robot, "policy": arguments.policy.value},
            files={"file": (arguments.file.name, file, "text/csv")},
        )
        job = _followed(client, checked(answer).json()["id"], bar)
    if job["state"] != "done":
        raise JobError(job["message"], job["result"])
    return job["result"]


def _followed(client: httpx.Client, job_id: str, bar: _Bar) -> Mapping[str, Any]:
    while True:
        job = checked(client.get(f"/api/jobs/{job_id}")).json()
        bar.report(job["progress"], job["message"])
        if job["state"] not in {"queued", "running"}:
            return job
        time.sleep(POLL_PERIOD_S)


def _print_result(result: Mapping[str, Any]) -> None:
    _print_faults(result["skipped"])
    print(
        f"{result['deployment']} of {result['robot']}: {result['rows']} rows imported, "
        f"{result['skipped_rows']} left out."
    )
    for score in result["scores"]:
        print(
            f"{score['title']} ({score['held_out']} of {score['held_out'] + score['samples']}): "
            f"RMSE {score['rmse']:.4g} {score['unit']}, NLPD {score['nlpd']:.3f}, "
            f"WMSE {score['wmse']:.3f}, inside the 90 % interval {score['coverage_90']:.1%}"
        )
    for missing in result["without_map"]:
        print(f"No map of {missing['variable']}: {missing['reason']}")


def _print_faults(faults: list[Mapping[str, Any]]) -> None:
    for fault in faults:
        print(f"line {fault['line']}: {fault['reason']}")
