"""``grace deployment pack``: all that is to be handed over of a deployment, as one ZIP."""

import shutil
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

from server.base.job import JobError
from server.base.problem import Problem
from server.cli.data import checked, clock_of, open_remote, open_store, result_of, settings_of
from server.cli.deployment_verb.taken import add_arguments, download, folder_of, free
from server.cli.deployment_verb.word import BY, refusal
from server.cli.failure import CommandError
from server.delivery.files import FOLDER, Wish
from server.delivery.package import task
from server.delivery.package.packages import package_order_of, write_package

ACTION = "pack"


def add_action(actions: Any) -> ArgumentParser:  # noqa: ANN401 - argparse's own, which has no name
    """Declare the action."""
    parser = actions.add_parser(ACTION, help="pack all that is to be handed over as one ZIP")
    add_arguments(parser)
    parser.add_argument(
        "--journal",
        action="store_true",
        help="add every packet of the robot, without those that carry keys",
    )
    return parser


def run(arguments: Namespace) -> int:
    """Pack the delivery and write it to the folder."""
    folder = folder_of(arguments)
    path, sha256 = _there(arguments, folder) if arguments.url else _here(arguments, folder)
    print(f"{arguments.deployment} is in {path}, SHA-256 {sha256}.")
    return 0


def _there(arguments: Namespace, folder: Path) -> tuple[Path, str]:
    path = f"/api/deployments/{arguments.deployment}/delivery"
    body = {"no_better_data": arguments.no_better_data, "has_journal": arguments.journal}
    with open_remote(arguments) as client:
        made = result_of(client, client.post(path, json=body))["package"]
        packages = checked(client.get(path)).json()["packages"]
        (package,) = [one for one in packages if one["id"] == made]
        target = free(folder / package["name"])
        download(client, f"{path}/{made}", target)
    return target, package["sha256"]


def _here(arguments: Namespace, folder: Path) -> tuple[Path, str]:
    settings = settings_of(arguments)
    at = clock_of(settings).now()
    wish = Wish.of(arguments.deployment, settings, at, no_better_data=arguments.no_better_data)
    with open_store(settings) as store:
        try:
            with store.read() as session:
                order = package_order_of(session, wish, has_journal=arguments.journal)
            kept = task.run(order, lambda _: None, lambda: False)
            target = free(folder / kept.name)
            store.change(lambda session: write_package(session, order, kept, at, BY)).result()
        except Problem as problem:
            raise CommandError(refusal(problem)) from problem
        except (JobError, ValueError) as error:
            raise CommandError(str(error)) from error
    shutil.copyfile(task.package_path(settings.data_dir / FOLDER, kept.sha256), target)
    return target, kept.sha256
