"""A running station as the command line reaches it: by REST, with a bearer token."""

import os
from argparse import ArgumentParser, Namespace
from collections.abc import Generator
from contextlib import contextmanager

import httpx

from server.cli.failure import CommandError

TOKEN_VARIABLE = "GRACE_TOKEN"


def add_remote_options(parser: ArgumentParser) -> None:
    """Add ``--url``; the token that goes with it is no option, which everybody here could read."""
    parser.add_argument(
        "--url",
        help="address of a running station, instead of a data folder; "
        f"{TOKEN_VARIABLE} of the environment holds a bearer token",
    )


@contextmanager
def open_remote(arguments: Namespace) -> Generator[httpx.Client]:
    """Open a client of the station at ``--url``; what it refuses becomes a ``CommandError``."""
    token = os.environ.get(TOKEN_VARIABLE)
    if not token:
        raise CommandError(
            f"--url needs a token in {TOKEN_VARIABLE}; grace token create makes one.", status=2
        )
    headers = {"Authorization": f"Bearer {token}"}
    try:
        with httpx.Client(base_url=arguments.url, headers=headers, timeout=60.0) as client:
            yield client
    except httpx.HTTPError as error:
        raise CommandError(f"{arguments.url} does not answer: {error}") from error


def checked(answer: httpx.Response) -> httpx.Response:
    """Return the answer unless it is a refusal.

    Raises:
        CommandError: With the station's own sentence.
    """
    if answer.is_success:
        return answer
    try:
        problem = answer.json()
        fields = [f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in problem.get("errors", [])]
        sentence = "; ".join([problem["detail"], *fields])
    except (ValueError, KeyError):
        sentence = f"The station answered {answer.status_code}."
    raise CommandError(sentence)
