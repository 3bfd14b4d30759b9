"""Where verbs work: a data folder with its database and clock, or a running station by REST."""

import os
import sys
import time
from argparse import Namespace
from collections.abc import Generator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import httpx
from pydantic import ValidationError

from db.care import sqlite_file
from db.engine import shown_url
from db.fault import StoreError
from db.migrate import NewerSchemaError
from db.store import Store
from robot_link.clock import Clock
from server.base.clock_file import read_clock
from server.base.problem import Problem
from server.base.settings import Settings
from server.cli.data_folder import (
    CLOCK_FILE,
    DataFolderError,
    DataFolderTakenError,
    hold_data_folder,
    make_data_folder,
)
from server.cli.failure import CommandError
from server.cli.option import TOKEN_VARIABLE

POLL_PERIOD_S = 0.2


def settings_of(arguments: Namespace, **more: Any) -> Settings:  # noqa: ANN401 - fields of the settings
    """Return the settings of an invocation: what was said here, else the environment.

    Raises:
        CommandError: If they do not fit; the sentence names the setting.
    """
    said = {"data_dir": arguments.data, **more}
    try:
        return Settings(**{name: value for name, value in said.items() if value is not None})
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"])
        message = first["msg"].removeprefix("Value error, ")
        raise CommandError(f"{name}: {message}" if name else message, status=2) from error


def clock_of(settings: Settings) -> Clock:
    """Return the clock of a data folder: a demo's scaled one where it has one."""
    clock_file = settings.clock_file or settings.data_dir / CLOCK_FILE
    return read_clock(clock_file if clock_file.exists() else None)


@contextmanager
def open_store(settings: Settings, *, is_held: bool = False) -> Generator[Store]:
    """Open the database of a data folder; refusals on the way become a ``CommandError``.

    A station may be running on it: both then write in turns. It may be of another version, so its
    schema is changed only while no station has the folder.

    Args:
        settings: Where it is.
        is_held: Whether this process holds the folder already.
    """
    folder = settings.data_dir
    fresh: Path | None = None
    try:
        make_data_folder(folder)
        fresh = _missing_file(settings)
        alone = nullcontext() if is_held else hold_data_folder(folder)
        if fresh is None:
            store = Store.open(settings.resolved_database_url, alone=alone)
        else:
            with alone:  # nothing is made beside a station whose database is another one
                store = Store.open(settings.resolved_database_url)
    except DataFolderTakenError as error:
        if fresh is not None:
            raise CommandError(
                f"{error} It has no database at {fresh}: give GRACE_DATABASE_URL as it was given."
            ) from error
        raise CommandError(
            f"{error} Its database has another schema than this version needs: let this version "
            "take over with `grace upgrade`, or use the version that runs."
        ) from error
    except DataFolderError as error:
        raise CommandError(str(error)) from error
    except (StoreError, NewerSchemaError) as error:
        raise CommandError(f"{shown_url(settings.resolved_database_url)}: {error}") from error
    if fresh is not None:
        print(f"There was no database: a new one is at {fresh}.", file=sys.stderr)
    try:
        yield store
    except (StoreError, Problem) as error:
        raise CommandError(str(error)) from error
    finally:
        store.close()


def _missing_file(settings: Settings) -> Path | None:
    """Return the file of a SQLite database that is not there yet, or holds nothing."""
    file = sqlite_file(settings.resolved_database_url)
    return None if file is None or (file.exists() and file.stat().st_size) else file


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


def result_of(client: httpx.Client, answer: httpx.Response) -> Mapping[str, Any]:
    """Wait for the job that an answer tells of, and return its result.

    Raises:
        CommandError: If it has none; the sentence is the job's own.
    """
    job = checked(answer).json()
    while True:
        told = checked(client.get(f"/api/jobs/{job['id']}")).json()
        if told["state"] not in {"queued", "running"}:
            break
        time.sleep(POLL_PERIOD_S)
    if told["state"] != "done":
        raise CommandError(told["message"])
    return told["result"]
