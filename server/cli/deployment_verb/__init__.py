"""``grace deployment``: the life of deployments, and what leaves the station of them."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from db.query.fleet import deployment_change as change
from db.query.fleet.deployments import DeploymentRecord
from server.cli.data import checked, clock_of, open_remote, open_store, settings_of
from server.cli.deployment_verb import metadata, netcdf, pack, quality
from server.cli.deployment_verb.word import BY, utc_moment
from server.cli.failure import CommandError
from server.cli.option import add_data_option, add_remote_options
from server.deployment.deployments import write_step
from server.deployment.view import DeploymentView, deployment_view, list_views

_VERBS: Mapping[str, tuple[str, str]] = {
    "begin": ("began", "say that a planned deployment has begun"),
    "end": ("ended", "say that a deployment is over"),
    "review": ("reviewed", "sign that its data were looked at"),
    "deliver": ("delivered", "note to whom its data were handed over"),
    "reopen": ("reopened", "let a reviewed or delivered one be reviewed anew"),
}
"""Steps of a life: the last word of their event, and their help."""


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listed = actions.add_parser("list", help="list deployments with their states")
    listed.add_argument("--robot", help="only those of this robot")
    parsers = [listed]
    for step, (_, help_text) in _VERBS.items():
        one = actions.add_parser(step, help=help_text)
        one.add_argument("deployment", help="its id, such as deployment-3")
        parsers.append(one)
        if step in ("begin", "end"):
            one.add_argument("--at", type=utc_moment, help="moment in UTC; by default now")
        elif step == "review":
            one.add_argument("--note", default="", help="what is to be known of the data")
        elif step == "deliver":
            one.add_argument("--to", required=True, help="who has the data now")
        else:
            one.add_argument("--reason", required=True, help="what was found")
    parsers += quality.add_actions(actions)
    parsers += [metadata.add_action(actions), netcdf.add_action(actions), pack.add_action(actions)]
    for one in parsers:
        add_data_option(one)
        add_remote_options(one)


def run(arguments: Namespace) -> int:
    """Do the action on a data folder, or through the station at ``--url``."""
    if arguments.action == "list":
        for line in _listed(arguments):
            print(line)
        return 0
    if arguments.action in quality.ACTIONS:
        return quality.run(arguments)
    for part in (metadata, netcdf, pack):
        if arguments.action == part.ACTION:
            return part.run(arguments)
    told = _step_there(arguments) if arguments.url else _step_here(arguments)
    print(f"{told['id']} of {told['robot']} is {told['state'].replace('_', ' ')}.")
    return 0


def _listed(arguments: Namespace) -> list[str]:
    if arguments.url:
        query = {"limit": 1000} | ({"robot": arguments.robot} if arguments.robot else {})
        with open_remote(arguments) as client:
            found = checked(client.get("/api/deployments", params=query)).json()["deployments"]
        return [
            _line(one["id"], one["robot"], one["state"], one["samples"], one["name"])
            for one in found
        ]
    with open_store(settings_of(arguments)) as store, store.read() as session:
        return [
            _line(one.id, one.robot, one.state, one.samples, one.name)
            for one in list_views(session, arguments.robot)
        ]


def _line(deployment: str, robot: str, state: str, samples: int, name: str) -> str:
    return f"{deployment}  {robot}  {state:9}  {samples:9} samples  {name}"


def _body(arguments: Namespace) -> dict[str, Any]:
    """Return what a step is told, as REST takes it."""
    match arguments.action:
        case "begin" | "end":
            return {"at": None if arguments.at is None else arguments.at.isoformat()}
        case "review":
            return {"note": arguments.note}
        case "deliver":
            return {"to": arguments.to}
        case _:
            return {"reason": arguments.reason}


def _step_there(arguments: Namespace) -> Mapping[str, Any]:
    path = f"/api/deployments/{arguments.deployment}/{arguments.action}"
    with open_remote(arguments) as client:
        return checked(client.post(path, json=_body(arguments))).json()


def _step_here(arguments: Namespace) -> Mapping[str, Any]:
    settings = settings_of(arguments)
    at = clock_of(settings).now()
    decide, why = _decision(arguments, at)

    def write(session: Session) -> DeploymentView:
        event = _VERBS[arguments.action][0]
        record = write_step(session, at, decide, event, BY, why)
        return deployment_view(session, record)

    with open_store(settings) as store:
        view = store.change(write).result()
    return {"id": view.id, "robot": view.robot, "state": view.state}


def _decision(
    arguments: Namespace, now: datetime
) -> tuple[Callable[[Session], DeploymentRecord], str]:
    """Return the change of a step, and what is said with it."""
    deployment, action = arguments.deployment, arguments.action
    if action in ("begin", "end"):
        at = arguments.at or now
        if at > now:
            raise CommandError(f"{at:%Y-%m-%d %H:%M:%S}Z has not come yet.", status=2)
        step = change.begin_deployment if action == "begin" else change.end_deployment
        return lambda session: step(session, deployment, at), ""
    if action == "review":
        note = arguments.note
        return lambda s: change.review_deployment(s, deployment, note, now, BY), note
    if action == "deliver":
        to = arguments.to
        return lambda s: change.deliver_deployment(s, deployment, to, now, BY), to
    return lambda s: change.reopen_deployment(s, deployment), arguments.reason
