"""``grace deployment metadata``: who answers for the data of a robot, shown or changed."""

import asyncio
import json
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from server.base.channels import Channels
from server.base.configuration import ConfigurationBook
from server.base.event_bus import EventBus
from server.base.problem import Problem
from server.cli.data import checked, clock_of, open_remote, open_store, settings_of
from server.cli.deployment_verb.word import BY, refusal
from server.cli.failure import CommandError

ACTION = "metadata"
_KIND = "delivery"


def add_action(actions: Any) -> ArgumentParser:  # noqa: ANN401 - argparse's own, which has no name
    """Declare the action."""
    parser = actions.add_parser(ACTION, help="show or change what files say of who and by whom")
    parser.add_argument("--robot", help="of this robot alone; by default of all")
    parser.add_argument(
        "--file", type=Path, help="JSON object with the fields that change; null returns to none"
    )
    return parser


def run(arguments: Namespace) -> int:
    """Print the metadata that hold, after a change where one was given."""
    patch = {} if arguments.file is None else _read(arguments.file)
    value = _there(arguments, patch) if arguments.url else _here(arguments, patch)
    print(json.dumps(value, indent=2, ensure_ascii=False))
    return 0


def _read(file: Path) -> dict[str, Any]:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise CommandError(f"--file: {file}: {error}", status=2) from error
    if not isinstance(content, dict):
        raise CommandError(f"--file: {file} holds no JSON object.", status=2)
    return content


def _there(arguments: Namespace, patch: Mapping[str, Any]) -> Mapping[str, Any]:
    query = {} if arguments.robot is None else {"robot": arguments.robot}
    path = f"/api/config/{_KIND}"
    with open_remote(arguments) as client:
        answer = (
            client.patch(path, params=query, json=patch)
            if patch
            else client.get(path, params=query)
        )
        return checked(answer).json()["value"]


def _here(arguments: Namespace, patch: Mapping[str, Any]) -> Mapping[str, Any]:
    settings = settings_of(arguments)
    clock = clock_of(settings)
    with open_store(settings) as store:
        bus = EventBus()
        book = ConfigurationBook(store, clock, bus, Channels(store, clock, bus))
        try:
            now = asyncio.run(
                book.patch(_KIND, arguments.robot, patch, by=BY)
                if patch
                else book.current(_KIND, arguments.robot)
            )
        except Problem as problem:
            raise CommandError(refusal(problem)) from problem
    return now.value.model_dump(mode="json")
