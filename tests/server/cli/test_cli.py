"""The command line on a data folder."""

import io
import logging
import os
import socket

import pytest
from alembic import command
from alembic.script import ScriptDirectory

from db.engine import write_engine
from db.migrate import configuration, schema_version
from server.access.secret import new_secret
from server.cli.data_folder import hold_data_folder
from server.cli.main import VERBS, main
from server.watch.console import WithoutSecrets
from tests.server.recording.test_import import dive_csv


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "data"


def grace(*words):
    return main([str(word) for word in words])


def test_help_names_every_verb(capsys):
    with pytest.raises(SystemExit) as ended:
        grace("--help")
    assert ended.value.code == 0
    text = capsys.readouterr().out
    assert all(verb in text for verb in VERBS)


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself(verb, capsys):
    with pytest.raises(SystemExit) as ended:
        grace(verb, "--help")
    assert ended.value.code == 0
    assert verb in capsys.readouterr().out


def test_a_token_is_printed_once_listed_without_its_secret_and_revoked(folder, capsys):
    assert grace("token", "create", "--role", "pilot", "--name", "survey", "--data", folder) == 0
    secret = capsys.readouterr().out.strip()
    assert secret.startswith("grace_")
    assert grace("token", "list", "--data", folder) == 0
    listed = capsys.readouterr().out
    assert "token-1  pilot   until" in listed
    assert secret not in listed
    assert grace("token", "revoke", "token-1", "--data", folder) == 0
    grace("token", "list", "--data", folder)
    assert "revoked" in capsys.readouterr().out
    assert grace("token", "revoke", "token-9", "--data", folder) == 1
    assert "There is no token 'token-9'" in capsys.readouterr().err


def test_people_are_added_with_a_password_from_a_pipe(folder, capsys, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO("correct horse battery\n"))
    assert grace("user", "add", "ann", "--role", "admin", "--data", folder) == 0
    monkeypatch.setattr("sys.stdin", io.StringIO("short\n"))
    assert grace("user", "add", "bob", "--role", "pilot", "--data", folder) == 1
    assert "at least 10 characters" in capsys.readouterr().err
    assert grace("user", "change", "ann", "--role", "viewer", "--data", folder) == 1
    assert "last administrator" in capsys.readouterr().err
    assert grace("user", "link", "ann", "--data", folder) == 0
    assert capsys.readouterr().out.startswith("/sign-in?token=grace_")
    grace("user", "list", "--data", folder)
    assert capsys.readouterr().out == "ann  admin\n"


def test_import_names_broken_lines_and_export_writes_what_came_in(folder, tmp_path, capsys):
    file = tmp_path / "dive.csv"
    file.write_text(dive_csv(rows=12, broken=(4,)))
    assert grace("import", file, "--robot", "eva", "--data", folder) == 1
    told = capsys.readouterr()
    assert told.out.splitlines()[0] == "line 6: time is not a number: 'oops'"
    assert "Nothing was imported" in told.err
    assert grace("import", file, "--robot", "eva", "--data", folder, "--policy", "skip") == 0
    told = capsys.readouterr().out.splitlines()
    assert told[:2] == [
        "line 6: time is not a number: 'oops'",
        "deployment-1 of eva: 11 rows imported, 1 left out.",
    ]
    assert told[2].startswith("No map of chlorophyll: a map needs at least 20 samples")
    assert grace("import", file, "--robot", "eva", "--data", folder, "--policy", "skip") == 1
    assert "already, as deployment-1" in capsys.readouterr().err
    target = tmp_path / "out.csv"
    assert grace("export", "deployment-1", target, "--data", folder) == 0
    assert len(target.read_text().splitlines()) == 13
    assert grace("export", "deployment-1", target, "--data", folder) == 1
    assert "nothing was written" in capsys.readouterr().err
    assert grace("export", "deployment-1", tmp_path / "out.nc", "--data", folder) == 2
    grace("export", "--data", folder)
    assert "deployment-1  eva  recorded  dive.csv" in capsys.readouterr().out


def test_import_prints_hold_out_scores(folder, tmp_path, capsys):
    file = tmp_path / "dive.csv"
    file.write_text(dive_csv())
    assert grace("import", file, "--robot", "eva", "--data", folder) == 0
    assert "Chlorophyll, held out (15 of 60): RMSE 0." in capsys.readouterr().out


def test_import_into_a_folder_that_a_station_uses_points_to_the_station(folder, tmp_path, capsys):
    file = tmp_path / "dive.csv"
    file.write_text(dive_csv(rows=3))
    with hold_data_folder(folder):
        assert grace("import", file, "--robot", "eva", "--data", folder) == 1
        assert grace("serve", "--data", folder, "--port", "0") == 1
    told = capsys.readouterr().err
    assert "Import through it: give --url and GRACE_TOKEN." in told
    assert "A station runs on" in told


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("import", "nowhere.csv", "--robot", "eva"), "No such file"),
        (("import", "nowhere.csv", "--robot", "Eva!"), "lower-case letters"),
        (("import", "x.csv", "--robot", "eva", "--url", "http://127.0.0.1:1"), "GRACE_TOKEN"),
        (("serve", "--host", "0.0.0.0"), "can be reached from other machines"),
        (("serve", "--port", "99999"), "port: Input should be less than"),
        (("demo", "--speed", "90"), "between 0.1 and 50"),
        (("export", "deployment-1"), "Say where to write it"),
        (("export", "deployment-1", "x.csv"), "There is no deployment 'deployment-1'"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_sentence(words, sentence, folder, capsys, monkeypatch):
    monkeypatch.setenv("GRACE_DATA_DIR", str(folder))
    assert grace(*words) in {1, 2}
    told = capsys.readouterr().err
    assert sentence in told
    assert "Traceback" not in told


@pytest.mark.parametrize("verb", ["serve", "demo"])
def test_a_port_that_is_taken_is_named(verb, folder, capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert grace(verb, "--data", folder, "--port", port) == 1
    assert f"Port {port}" in capsys.readouterr().err


def test_a_station_that_starts_removes_what_killed_backups_and_restores_left(
    folder, tmp_path, capsys
):
    no_key = tmp_path / "key.pem"
    no_key.write_text("no key")
    left = [folder / ".grace-restore-killed", folder / "before-upgrade" / ".grace-by-hand-killed"]
    for staging in left:
        staging.mkdir(parents=True)
        (staging / "station.sqlite3").write_text("all secrets")
    tls = ("--tls-certificate", no_key, "--tls-key", no_key)
    assert grace("serve", "--data", folder, "--port", "0", *tls) == 1
    assert "key.pem" in capsys.readouterr().err
    assert not any(staging.exists() for staging in left)


def test_the_database_is_copied_while_it_is_used(folder, tmp_path, capsys):
    grace("token", "create", "--role", "viewer", "--data", folder)
    assert grace("db", "backup", tmp_path / "copy.sqlite3", "--data", folder) == 0
    assert grace("db", "backup", tmp_path / "copy.sqlite3", "--data", folder) == 1
    assert grace("db", "upgrade", "--data", folder) == 0
    newest = ScriptDirectory.from_config(configuration()).get_current_head()
    assert capsys.readouterr().out.splitlines()[-1] == newest
    assert (tmp_path / "copy.sqlite3").stat().st_size > 0


def test_a_verb_changes_no_schema_under_a_running_station(folder, capsys):
    """The station that runs may be of an older version, which could not read it any more."""
    folder.mkdir()
    engine = write_engine(f"sqlite:///{folder / 'station.sqlite3'}")
    with engine.begin() as connection:
        command.upgrade(configuration(connection), "0040")
    with hold_data_folder(folder):
        assert grace("user", "list", "--data", folder) == 1
    told = capsys.readouterr().err
    assert "A station runs on" in told
    assert "`grace upgrade`" in told
    with engine.connect() as connection:
        assert schema_version(connection) == "0040"
    assert grace("user", "list", "--data", folder) == 0
    newest = ScriptDirectory.from_config(configuration()).get_current_head()
    with engine.connect() as connection:
        assert schema_version(connection) == newest
    engine.dispose()
    with hold_data_folder(folder):
        assert grace("user", "list", "--data", folder) == 0


def others_may(path):
    return path.stat().st_mode & 0o077


def test_a_verb_says_that_it_made_the_database(folder, capsys):
    file = folder / "station.sqlite3"
    for said in (f"There was no database: a new one is at {file}.\n", ""):
        assert grace("user", "list", "--data", folder) == 0
        assert capsys.readouterr().err == said


def test_beside_a_station_that_has_another_database_a_verb_makes_none(folder, capsys):
    with hold_data_folder(folder):
        assert grace("token", "create", "--role", "viewer", "--data", folder) == 1
    told = capsys.readouterr()
    assert "give GRACE_DATABASE_URL" in told.err
    assert told.out == ""
    assert not (folder / "station.sqlite3").exists()


@pytest.mark.skipif(os.geteuid() != 0, reason="this is not root")
def test_root_makes_nothing_in_the_folder_of_another_user(folder, capsys):
    folder.mkdir()
    os.chown(folder, 65534, 65534)
    assert grace("user", "list", "--data", folder) == 1
    assert f"The data folder {folder} belongs to the user" in capsys.readouterr().err
    assert list(folder.iterdir()) == []


def test_what_a_verb_keeps_is_for_its_user_alone(folder, tmp_path, capsys):
    mask = os.umask(0o022)
    try:
        grace("token", "create", "--role", "pilot", "--data", folder)
        grace("db", "backup", tmp_path / "copy.sqlite3", "--data", folder)
    finally:
        assert os.umask(mask) == 0o022
    assert not others_may(folder)
    assert not others_may(tmp_path / "copy.sqlite3")
    assert not any(others_may(path) for path in folder.rglob("*"))


def test_a_folder_that_others_could_read_is_closed_to_them(folder):
    (folder / "log").mkdir(parents=True)
    log = folder / "log" / "station.log"
    log.touch(0o644)
    folder.chmod(0o755)
    with hold_data_folder(folder):
        assert not others_may(folder)
        assert not others_may(log)
        assert not any(others_may(path) for path in folder.iterdir() if path.is_file())


@pytest.mark.parametrize(
    ("said", "secret"),
    [
        ('127.0.0.1:9 - "WebSocket /api/live?robots=a&ticket=%s" [accepted]', "grace_abc"),
        ("GET /sign-in?token=%s failed", "short"),
        ("POST /api/gateways/rockblock/push/%s failed", "fEw_-x"),
        ("Authorization: Bearer %s", "abc.def"),
        pytest.param("somebody said %s here", new_secret(), id="new secret"),
    ],
)
def test_no_secret_reaches_the_log(said, secret):
    record = logging.LogRecord("x", logging.INFO, "", 0, said, (secret,), None)
    line = WithoutSecrets().format(record)
    assert secret not in line
    assert "(secret)" in line


def test_a_token_is_no_option_that_a_list_of_processes_shows(capsys):
    with pytest.raises(SystemExit):
        grace("import", "dive.csv", "--robot", "eva", "--url", "http://x", "--token", "grace_x")
    assert "--token" in capsys.readouterr().err
