"""``grace deployment netcdf``: a deployment as a file of OG1.0, with what the checks say."""

import shutil
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from server.base.job import JobError
from server.base.problem import Problem
from server.cli.data import checked, clock_of, open_remote, open_store, result_of, settings_of
from server.cli.deployment_verb.taken import add_arguments, download, folder_of, free
from server.cli.deployment_verb.word import BY, refusal
from server.cli.failure import CommandError
from server.delivery import file_task
from server.delivery.files import FOLDER, Wish, order_of, write_kept

ACTION = "netcdf"


def add_action(actions: Any) -> ArgumentParser:  # noqa: ANN401 - argparse's own, which has no name
    """Declare the action."""
    parser = actions.add_parser(ACTION, help="write it as NetCDF of OG1.0 and CF, and check that")
    add_arguments(parser)
    return parser


def run(arguments: Namespace) -> int:
    """Write the file; the status is 1 unless every check passed."""
    folder = folder_of(arguments)
    path, checks = _there(arguments, folder) if arguments.url else _here(arguments, folder)
    print(f"{arguments.deployment} is in {path}.")
    for one in checks:
        print(f"{one['suite']}: {_WORDS[one['state']]} {one['message']}".rstrip())
        for finding in one["findings"]:
            print(f"  {finding['variable'] or finding['check']}: {finding['message']}")
            print(f"    {finding['fix']}")
    return 0 if all(one["state"] == "passed" for one in checks) else 1


_WORDS = {"passed": "passed", "findings": "findings", "unchecked": "could not be checked."}


def _there(arguments: Namespace, folder: Path) -> tuple[Path, Sequence[Mapping[str, Any]]]:
    path = f"/api/deployments/{arguments.deployment}/files"
    with open_remote(arguments) as client:
        body = {"no_better_data": arguments.no_better_data}
        made = result_of(client, client.post(path, json=body))["file"]
        (file,) = [one for one in checked(client.get(path)).json()["files"] if one["id"] == made]
        target = free(folder / file["name"])
        download(client, f"{path}/{made}", target)
    return target, file["checks"]


def _here(arguments: Namespace, folder: Path) -> tuple[Path, Sequence[Mapping[str, Any]]]:
    settings = settings_of(arguments)
    at = clock_of(settings).now()
    wish = Wish.of(arguments.deployment, settings, at, no_better_data=arguments.no_better_data)
    with open_store(settings) as store:
        try:
            with store.read() as session:
                order = order_of(session, wish)
            target = free(folder / f"{order.identity}.nc")
            kept = file_task.run(order, lambda _: None, lambda: False)
            store.change(lambda session: write_kept(session, order, kept, at, BY)).result()
        except Problem as problem:
            raise CommandError(refusal(problem)) from problem
        except (JobError, ValueError) as error:
            raise CommandError(str(error)) from error
    shutil.copyfile(file_task.kept_path(settings.data_dir / FOLDER, kept.sha256), target)
    return target, [asdict(one) for one in kept.checks]
