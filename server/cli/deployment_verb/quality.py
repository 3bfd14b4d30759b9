"""``grace deployment check`` and ``flag``: what is known of the quality of data."""

from argparse import ArgumentParser, Namespace
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from typing import Any

from server.base.problem import Problem
from server.cli.data import checked, clock_of, open_remote, open_store, result_of, settings_of
from server.cli.deployment_verb.word import BY, refusal, utc_moment
from server.cli.failure import CommandError
from server.delivery import quality_task
from server.delivery.quality import FLAG_WORDS, run_of, write_flag, write_run

ACTIONS = ("check", "flag")
_FLAGS = {words.replace(" ", "-"): flag for flag, words in FLAG_WORDS.items()}


def add_actions(actions: Any) -> list[ArgumentParser]:  # noqa: ANN401 - argparse's own, which has no name
    """Declare the actions."""
    check = actions.add_parser("check", help="judge its data by the rules of quality control")
    flag = actions.add_parser("flag", help="flag a stretch of time of a series by hand")
    for one in (check, flag):
        one.add_argument("deployment", help="its id, such as deployment-3")
    flag.add_argument("--series", required=True, help="a channel, position or depth")
    flag.add_argument("--from", dest="first", type=utc_moment, required=True, help="in UTC")
    flag.add_argument("--to", dest="last", type=utc_moment, required=True, help="in UTC")
    flag.add_argument("--flag", choices=tuple(_FLAGS), required=True)
    flag.add_argument("--reason", required=True)
    return [check, flag]


def run(arguments: Namespace) -> int:
    """Do the action on a data folder, or through the station at ``--url``."""
    if arguments.action == "flag":
        kept = _flag(arguments)
        print(f"{kept} is set: {arguments.series} is {arguments.flag.replace('-', ' ')}.")
        return 0
    for series, tests in _counts(arguments).items():
        for test, found in tests.items():
            numbers = ", ".join(f"{found[one]} {one.replace('_', ' ')}" for one in found)
            print(f"{series:24} {test:10} {numbers}")
    return 0


def _counts(arguments: Namespace) -> Mapping[str, Any]:
    if arguments.url:
        path = f"/api/deployments/{arguments.deployment}/quality"
        with open_remote(arguments) as client:
            result_of(client, client.post(path))
            return checked(client.get(path)).json()["run"]["counts"]
    settings = settings_of(arguments)
    url = settings.resolved_database_url
    with open_store(settings) as store:
        with store.read() as session:
            wanted = run_of(session, arguments.deployment, url)
        try:
            found = quality_task.run(wanted, lambda _: None, lambda: False)
        except ValueError as error:
            raise CommandError(str(error)) from error
        at = clock_of(settings).now()
        store.change(lambda session: write_run(session, wanted, found, at, BY)).result()
    return found.counts


def _flag(arguments: Namespace) -> str:
    flag = _FLAGS[arguments.flag]
    if arguments.url:
        body = {
            "series": arguments.series,
            "first_at": arguments.first.isoformat(),
            "last_at": arguments.last.isoformat(),
            "flag": flag,
            "reason": arguments.reason,
        }
        with open_remote(arguments) as client:
            path = f"/api/deployments/{arguments.deployment}/flags"
            return checked(client.post(path, json=body)).json()["id"]
    settings = settings_of(arguments)
    at = clock_of(settings).now()
    with open_store(settings) as store, _refusing():
        return (
            store.change(
                lambda session: write_flag(
                    session,
                    arguments.deployment,
                    series=arguments.series,
                    first_at=arguments.first,
                    last_at=arguments.last,
                    flag=flag,
                    reason=arguments.reason,
                    at=at,
                    by=BY,
                )
            )
            .result()
            .id
        )


@contextmanager
def _refusing() -> Generator[None]:
    try:
        yield
    except Problem as problem:
        raise CommandError(refusal(problem)) from problem
