"""A database that is damaged, gone or in the wrong place: one sentence, and the way out."""

import errno
import importlib
import os
import sqlite3
import stat
import tarfile
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from server.cli.data_folder import hold_data_folder
from tests.server.cli.test_cli import grace

PAGE = 4096


@pytest.fixture
def folder(tmp_path, capsys):
    """A data folder with a token, a secret and a log."""
    folder = tmp_path / "data"
    assert grace("token", "create", "--role", "viewer", "--name", "kept", "--data", folder) == 0
    for name, text in {"secret/robot-mini-1": "a0" * 32, "log/station.log": "began"}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    (folder / "station.sqlite3-wal").unlink(missing_ok=True)
    capsys.readouterr()
    return folder


def damage(file):
    """Overwrite all pages but the first, as a disk that lost them would."""
    size = file.stat().st_size
    with file.open("r+b") as raw:
        raw.seek(PAGE)
        raw.write(b"\x5a" * (size - PAGE))


def said(capsys):
    """What was said to the person: one line, nothing of the program's insides."""
    text = capsys.readouterr().err
    assert len(text.splitlines()) == 1, text
    assert "Traceback" not in text
    return text


@contextmanager
def as_another_user():
    """Have no right to write what is root's or the owner's."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


def test_a_whole_database_is_called_whole(folder, capsys):
    assert grace("db", "check", "--data", folder) == 0
    assert capsys.readouterr().out.endswith("is whole.\n")


def test_a_damaged_database_is_found_and_the_way_out_is_said(folder, capsys):
    damage(folder / "station.sqlite3")
    assert grace("db", "check", "--data", folder) == 1
    told = capsys.readouterr()
    assert "Traceback" not in told.out + told.err
    assert "grace db restore" in told.err or "cannot be read" in told.err


def test_a_row_that_belongs_to_nothing_is_found(folder, capsys):
    with closing(sqlite3.connect(folder / "station.sqlite3")) as base, base:
        columns = "kind, robot_key, value, changed_at, changed_by"
        base.execute(f"INSERT INTO configuration ({columns}) VALUES ('x', 99, '{{}}', 0, 'x')")
    assert grace("db", "check", "--data", folder) == 1
    assert "A row of configuration belongs to a row of robot" in capsys.readouterr().out


def test_a_missing_table_is_found(folder, capsys):
    with closing(sqlite3.connect(folder / "station.sqlite3")) as base, base:
        base.execute("DROP TABLE raw_frame")
    assert grace("db", "check", "--data", folder) == 1
    assert "The table raw_frame is missing." in capsys.readouterr().out


def test_a_check_of_nothing_makes_no_database(tmp_path, capsys):
    nothing = tmp_path / "nothing"
    nothing.mkdir()
    assert grace("db", "check", "--data", nothing) == 1
    assert "There is no database" in said(capsys)
    assert not list(nothing.iterdir())


@pytest.mark.parametrize("verb", [("serve", "--port", "0"), ("token", "list")])
@pytest.mark.parametrize("harm", [damage, lambda file: file.write_bytes(b"no database" * 1000)])
def test_no_verb_opens_a_damaged_database_with_more_than_a_sentence(folder, capsys, verb, harm):
    harm(folder / "station.sqlite3")
    assert grace(*verb, "--data", folder) == 1
    assert "grace db restore" in said(capsys)


@pytest.mark.parametrize("verb", [("serve", "--port", "0"), ("token", "list"), ("db", "check")])
@pytest.mark.parametrize(
    ("url", "sentence"),
    [
        ("nonsense", "not the URL of a database"),
        ("mysql://ann:secret-word@host/db", "must be SQLite or PostgreSQL"),
        ("postgresql+nodriver://ann:secret-word@host/db", "no known driver"),
        ("sqlite:////nowhere/station.sqlite3", "database"),
    ],
)
def test_a_wrong_url_is_named_without_its_password(
    tmp_path, capsys, monkeypatch, verb, url, sentence
):
    monkeypatch.setenv("GRACE_DATABASE_URL", url)
    assert grace(*verb, "--data", tmp_path) == 1
    told = said(capsys)
    assert sentence in told
    assert "secret-word" not in told


@pytest.mark.parametrize(
    "verb",
    [("serve", "--port", "0"), ("demo", "--port", "0"), ("token", "list"), ("db", "upgrade")],
)
def test_a_folder_that_may_not_be_written_is_named_with_the_way_out(tmp_path, capsys, verb):
    importlib.import_module(f"server.cli.{verb[0]}_verb")  # another user may not read it
    tmp_path.chmod(0o555)
    with as_another_user():
        assert grace(*verb, "--data", tmp_path) == 1
    tmp_path.chmod(0o755)
    told = said(capsys)
    assert str(tmp_path) in told
    assert "choose another with --data" in told


def test_a_file_in_the_place_of_the_folder_is_named(tmp_path, capsys):
    (tmp_path / "data").touch()
    assert grace("serve", "--port", "0", "--data", tmp_path / "data") == 1
    assert "cannot be written" in said(capsys)


def test_a_backup_brings_back_database_secrets_and_logs(folder, tmp_path, capsys):
    backup, other = tmp_path / "lake.tar.gz", tmp_path / "other"
    assert grace("db", "backup", backup, "--data", folder) == 0
    assert stat.S_IMODE(backup.stat().st_mode) == 0o600
    assert grace("db", "restore", backup, "--data", other) == 0
    capsys.readouterr()
    assert grace("token", "list", "--data", other) == 0
    assert "kept" in capsys.readouterr().out
    for name in ("secret/robot-mini-1", "log/station.log"):
        assert (other / name).read_text() == (folder / name).read_text()
    assert stat.S_IMODE((other / "secret" / "robot-mini-1").stat().st_mode) == 0o600
    assert not [left for left in (*tmp_path.iterdir(), *other.iterdir()) if ".grace" in left.name]


def test_what_is_half_written_is_not_in_a_backup(folder, tmp_path):
    backup = tmp_path / "lake.tar.gz"
    for name in ("secret/.signing-mini-1.new", "log/.stamps-mini-1.new"):
        (folder / name).write_text("half")
    assert grace("db", "backup", backup, "--data", folder) == 0
    with tarfile.open(backup) as archive:
        names = archive.getnames()
    assert "secret/robot-mini-1" in names
    assert not [name for name in names if "/." in name]


@pytest.mark.parametrize("undoes", [True, False], ids=["refused by the disk", "cut off"])
def test_a_restore_that_did_not_come_to_its_end_can_be_done_again(
    folder, tmp_path, capsys, monkeypatch, undoes
):
    backup, other = tmp_path / "lake.tar.gz", tmp_path / "other"
    elsewhere = tmp_path / "disk" / "lake.sqlite3"
    grace("db", "backup", backup, "--data", folder)
    monkeypatch.setenv("GRACE_DATABASE_URL", f"sqlite:///{elsewhere}")
    replace, is_over = Path.replace, []

    def fail(fresh, place):
        if is_over and not undoes:
            raise OSError(errno.EIO, "Input/output error")
        if place == elsewhere:
            is_over.append(True)
            raise OSError(errno.EIO, "Input/output error")
        return replace(fresh, place)

    capsys.readouterr()
    with monkeypatch.context() as harm:
        harm.setattr(Path, "replace", fail)
        assert grace("db", "restore", backup, "--data", other) == 1
    assert str(elsewhere) in said(capsys)
    left = {file.name for file in other.rglob("*") if file.is_file()}
    assert left == ({"station.lock"} if undoes else {"station.lock", "robot-mini-1", "station.log"})
    assert grace("db", "restore", backup, "--data", other) == 0
    assert (other / "secret/robot-mini-1").read_text() == "a0" * 32
    assert [file.name for file in elsewhere.parent.iterdir()] == ["lake.sqlite3"]


def test_a_database_on_another_disk_than_its_folder_is_restored(
    folder, tmp_path, capsys, monkeypatch
):
    backup, elsewhere = tmp_path / "lake.tar.gz", tmp_path / "disk" / "lake.sqlite3"
    grace("db", "backup", backup, "--data", folder)
    monkeypatch.setenv("GRACE_DATABASE_URL", f"sqlite:///{elsewhere}")

    def on_two_disks(move):
        def moved(source, target, **rest):
            disks = {Path(one).is_relative_to(elsewhere.parent) for one in (source, target)}
            if len(disks) > 1:
                raise OSError(errno.EXDEV, "Invalid cross-device link")
            return move(source, target, **rest)

        return moved

    with monkeypatch.context() as disks:
        disks.setattr(Path, "replace", on_two_disks(Path.replace))
        disks.setattr(os, "rename", on_two_disks(os.rename))
        assert grace("db", "restore", backup, "--data", tmp_path / "other") == 0
    capsys.readouterr()
    assert grace("token", "list", "--data", tmp_path / "other") == 0
    assert "kept" in capsys.readouterr().out


def test_a_copy_of_the_database_alone_is_restored_too(folder, tmp_path, capsys):
    other = tmp_path / "other"
    assert grace("db", "restore", folder / "station.sqlite3", "--data", other) == 0
    assert grace("token", "list", "--data", other) == 0
    assert "kept" in capsys.readouterr().out


@pytest.mark.parametrize("there", ["station.sqlite3", "station.sqlite3-wal", "secret/robot-mini-1"])
def test_nothing_is_restored_over_what_is_there(folder, tmp_path, capsys, there):
    backup, other = tmp_path / "lake.tar.gz", tmp_path / "other"
    grace("db", "backup", backup, "--data", folder)
    (other / there).parent.mkdir(parents=True)
    (other / there).write_text("precious")
    capsys.readouterr()
    assert grace("db", "restore", backup, "--data", other) == 1
    assert "would be lost" in said(capsys)
    files = {file.name for file in other.rglob("*") if file.is_file()}
    assert files == {"station.lock", (other / there).name}
    assert (other / there).read_text() == "precious"


def test_nothing_is_restored_under_a_running_station(folder, tmp_path, capsys):
    backup = tmp_path / "lake.tar.gz"
    grace("db", "backup", backup, "--data", folder)
    capsys.readouterr()
    with hold_data_folder(folder):
        assert grace("db", "restore", backup, "--data", folder) == 1
    assert "runs on" in said(capsys)


def _cut(backup):
    backup.write_bytes(backup.read_bytes()[:-100])


def _flipped(backup):
    content = bytearray(backup.read_bytes())
    content[len(content) // 2] ^= 0xFF
    backup.write_bytes(content)


def _foreign(backup):
    with tarfile.open(backup, "w:gz") as archive:
        archive.add(__file__, "../outside.py")


def _of_something_else(backup):
    backup.write_bytes(b"PK")


@pytest.mark.parametrize("harm", [_cut, _flipped, _foreign, _of_something_else])
def test_a_damaged_backup_leaves_the_folder_empty(folder, tmp_path, capsys, harm):
    backup, other = tmp_path / "lake.tar.gz", tmp_path / "other"
    grace("db", "backup", backup, "--data", folder)
    harm(backup)
    capsys.readouterr()
    assert grace("db", "restore", backup, "--data", other) == 1
    assert str(backup) in said(capsys)
    assert {left.name for left in other.iterdir()} == {"station.lock"}
    assert not (tmp_path / "outside.py").exists()


def test_a_damaged_database_in_a_backup_is_not_restored(folder, tmp_path, capsys):
    damage(folder / "station.sqlite3")
    other = tmp_path / "other"
    assert grace("db", "restore", folder / "station.sqlite3", "--data", other) == 1
    said(capsys)
    assert {left.name for left in other.iterdir()} == {"station.lock"}
