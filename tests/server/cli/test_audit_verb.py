"""``grace audit``: a log that was changed says so, and its lines can be held against it outside."""

import json
import sqlite3
from contextlib import closing
from getpass import getuser
from hashlib import sha256

import pytest

from tests.server.cli.test_cli import grace


@pytest.fixture
def folder(tmp_path, capsys):
    """A data folder in whose log somebody at the command line did three things."""
    folder = tmp_path / "data"
    for name in ("one", "two", "three"):
        assert grace("token", "create", "--role", "viewer", "--name", name, "--data", folder) == 0
    capsys.readouterr()
    return folder


def test_a_whole_log_fits_and_its_head_can_be_held_against_later_ones(folder, capsys):
    assert grace("audit", "verify", "--data", folder) == 0
    told = capsys.readouterr().out
    head = told.split()[-1]
    assert told.startswith("All 3 events fit.")
    assert grace("token", "create", "--role", "viewer", "--name", "four", "--data", folder) == 0
    assert grace("audit", "verify", "--head", head, "--data", folder) == 0
    assert grace("audit", "verify", "--head", "0" * 64, "--data", folder) == 1
    assert "written anew" in capsys.readouterr().out


def test_a_changed_event_is_named(folder, capsys):
    with closing(sqlite3.connect(folder / "station.sqlite3")) as database, database:
        database.execute("UPDATE event SET text = 'Nothing.' WHERE cursor = 2")
    assert grace("audit", "verify", "--data", folder) == 1
    told = capsys.readouterr().out
    assert told.startswith("The first 1 events fit. Then event 2 (")
    assert "token.created" in told


def test_whoever_has_the_file_can_work_out_the_chain(folder, tmp_path, capsys):
    file = tmp_path / "log.ndjson"
    assert grace("audit", "export", file, "--data", folder) == 0
    assert grace("audit", "export", file, "--data", folder) == 1
    assert "exists" in capsys.readouterr().err
    previous = bytes(32)
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    for line in lines:
        previous = sha256(previous + line["hashed"].encode()).digest()
        assert line["hash"] == previous.hex()
        assert line["by"] == getuser()
    assert len(lines) == 3
