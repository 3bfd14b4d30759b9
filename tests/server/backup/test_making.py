"""What is made is whole or not there: killed makers, other engines, older schemas."""

import os
import stat
import subprocess
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from random import Random

import pytest
from alembic import command
from sqlalchemy import select, text

from db import care
from db.bridge import Bridge
from db.care import complaints
from db.dump import dump_complaint
from db.engine import write_engine
from db.fault import StoreUnavailableError
from db.migrate import configuration, schema_version
from db.query.fleet.robots import add_robot, list_robots
from db.store import Store
from db.tables import RawFrameRow
from robot_link.messages import RawFrame
from server.backup import task
from server.backup.failure import BackupError
from server.backup.key import PrivateKey
from server.backup.making import BY_HAND, BackupOrder, MadeBackup, beside, make_backup
from server.backup.restoring import restore_backup
from server.backup.shelf import Shelf
from tests.db.conftest import robot_record
from tests.db.old_schema import RowMaker, reflected
from tests.db.test_store_fault import wait_until
from tests.postgresql_server import PostgresqlServer, postgresql_server
from tests.server.backup.conftest import fatten

ROOT = Path(__file__).parents[3]
KILLS = 5
SEED = 20261129


@pytest.fixture
def data(tmp_path):
    """A data folder with a robot and its secret."""
    folder = tmp_path / "data"
    (folder / "secret").mkdir(parents=True)
    (folder / "secret" / "robot-mini-1").write_text("a0" * 32)
    fill(f"sqlite:///{folder / 'station.sqlite3'}")
    return folder


@pytest.fixture(scope="module")
def server() -> Iterator[PostgresqlServer]:
    with postgresql_server() as running:
        if running is None:
            pytest.skip("this machine has no PostgreSQL server (apt-get install postgresql)")
        yield running


@pytest.fixture
def postgresql_url(server: PostgresqlServer) -> Iterator[str]:
    name = server.database()
    yield server.url(name)
    server.drop(name)


def fill(url: str) -> None:
    store = Store.open(url)
    store.change(lambda session: add_robot(session, robot_record())).result(60)
    store.close()


def robots_in(url: str) -> list[str]:
    store = Store.open(url)
    try:
        with store.read() as session:
            return [robot.id for robot in list_robots(session)]
    finally:
        store.close()


def killed_at(share: float, data: Path, target: Path, staging: str) -> None:
    """Make a backup in a process and kill that once so much of it is done."""
    with subprocess.Popen(
        [sys.executable, "-m", "tests.server.backup.doomed", data, target, staging],
        cwd=ROOT, stdout=subprocess.PIPE, text=True,
    ) as maker:  # fmt: skip
        assert maker.stdout is not None
        for line in maker.stdout:
            if float(line) >= share:
                break
        maker.kill()


@pytest.mark.process
def test_a_maker_that_is_killed_leaves_nothing_that_counts_as_a_backup(data, tmp_path):
    fatten(data / "station.sqlite3", 30)
    disk = tmp_path / "disk"
    disk.mkdir()
    shelf = Shelf(disk, "a1b2c3")
    target = shelf.place(datetime(2026, 3, 1, tzinfo=UTC), is_encrypted=False)
    draw = Random(SEED)
    for share in (0.0, *(draw.random() * 0.99 for _ in range(KILLS))):
        killed_at(share, data, target, shelf.staging)
        assert shelf.backups() == []
    assert list(disk.iterdir()), "no maker was killed in the middle of its work"
    order = BackupOrder(data, f"sqlite:///{data}/station.sqlite3", target, staging=shelf.staging)
    made = task.run(order, lambda _: None, lambda: False)
    assert isinstance(made, MadeBackup)
    assert [path.name for path in disk.iterdir()] == [made.name]
    other = f"sqlite:///{tmp_path / 'other' / 'station.sqlite3'}"
    (tmp_path / "other").mkdir()
    restore_backup(target, tmp_path / "other", other)
    assert robots_in(other) == ["mini-1"]


def test_what_killed_work_left_goes_with_the_next_and_what_others_use_stays(data, tmp_path):
    disk, other = tmp_path / "disk", tmp_path / "other"
    for left in (disk / f"{BY_HAND}killed", other / ".grace-restore-killed"):
        left.mkdir(parents=True)
        (left / "station.sqlite3").write_text("all secrets")
    target = disk / "lake.tar.gz"
    with beside(disk / "another.tar.gz", BY_HAND) as used:
        make_backup(BackupOrder(data, f"sqlite:///{data / 'station.sqlite3'}", target))
        assert set(disk.iterdir()) == {target, used}
    restore_backup(target, other, f"sqlite:///{other / 'station.sqlite3'}")
    assert not list(other.glob(".grace-*"))


@pytest.mark.parametrize("is_emptied", [False, True])
def test_a_row_of_the_bridge_journal_is_restored_once(data, tmp_path, monkeypatch, is_emptied):
    """Also where it reaches the database while the backup is made."""
    bridge = Bridge(data)
    at = datetime(2026, 3, 1, tzinfo=UTC)
    bridge.put(bridge.batch([RawFrame(None, "xbee", outgoing=False, data=b"kept", at=at)]))
    bridge.close()
    url, other = f"sqlite:///{data / 'station.sqlite3'}", tmp_path / "other"
    copy = care.copy_sqlite

    def copy_later(*words):
        if is_emptied:
            assert packets_in(url, data) == [b"kept"]
        copy(*words)

    monkeypatch.setattr(care, "copy_sqlite", copy_later)
    make_backup(BackupOrder(data, url, tmp_path / "lake.tar.gz"))
    other.mkdir()
    restored = f"sqlite:///{other / 'station.sqlite3'}"
    restore_backup(tmp_path / "lake.tar.gz", other, restored)
    assert packets_in(restored, other) == [b"kept"]


def packets_in(url: str, folder: Path) -> list[bytes]:
    """Return the packets in a database, once the bridge journal has reached it."""
    store = Store.open(url, bridge_dir=folder)
    try:
        wait_until(lambda: store.waiting_rows == 0)
        with store.read() as session:
            return list(session.scalars(select(RawFrameRow.data)))
    finally:
        store.close()


def test_a_disk_that_lost_what_was_written_is_found_before_the_file_has_its_name(
    data, tmp_path, monkeypatch
):
    def lose(descriptor, offset, length, advice):
        del offset, length, advice
        place = Path(f"/proc/self/fd/{descriptor}").resolve()
        with place.open("r+b") as file:
            file.seek(place.stat().st_size // 2)
            file.write(b"\0" * 64)

    monkeypatch.setattr(os, "posix_fadvise", lose)
    for lock in (None, PrivateKey(bytes(range(32))).public):
        target = tmp_path / "lake.tar.gz"
        with pytest.raises(BackupError, match="The disk does not hold what was written"):
            make_backup(BackupOrder(data, f"sqlite:///{data / 'station.sqlite3'}", target, lock))
        assert [path.name for path in tmp_path.iterdir()] == ["data"]


def test_a_backup_of_an_older_schema_is_restored_and_brought_up_to_date(tmp_path):
    data, other = tmp_path / "data", tmp_path / "other"
    data.mkdir()
    other.mkdir()
    url, new = (f"sqlite:///{folder / 'station.sqlite3'}" for folder in (data, other))
    engine = write_engine(url)
    with engine.begin() as connection:
        command.upgrade(configuration(connection), "0025")
        RowMaker().add_row(connection, reflected(connection)["robot"])
        old = schema_version(connection)
    engine.dispose()
    made = make_backup(BackupOrder(data, url, tmp_path / "old.tar.gz"))
    restore_backup(tmp_path / made.name, other, new)
    assert len(robots_in(new)) == 1
    assert complaints(new) == []
    engine = write_engine(new)
    with engine.connect() as connection:
        assert schema_version(connection) != old == "0025"
    engine.dispose()


def test_a_station_on_postgresql_is_backed_up_and_restored_likewise(
    data,
    tmp_path,
    server,
    postgresql_url,
):
    fill(postgresql_url)
    key = PrivateKey(bytes(range(32)))
    target = tmp_path / "lake.tar.gz.sealed"
    make_backup(BackupOrder(data, postgresql_url, target, key.public))
    other = tmp_path / "other"
    other.mkdir()
    name = server.database()
    restore_backup(target, other, server.url(name), key)
    assert robots_in(server.url(name)) == ["mini-1"]
    assert complaints(server.url(name)) == []
    assert (other / "secret/robot-mini-1").read_text() == "a0" * 32

    (tmp_path / "third").mkdir()
    with pytest.raises(BackupError, match="has tables already"):
        restore_backup(target, tmp_path / "third", server.url(name), key)
    with pytest.raises(BackupError, match=r"of PostgreSQL, .* set to SQLite"):
        restore_backup(target, tmp_path / "third", f"sqlite:///{tmp_path}/third/a.sqlite3", key)
    assert list((tmp_path / "third").iterdir()) == []
    server.drop(name)


def test_a_backup_of_sqlite_is_not_put_into_postgresql(
    data,
    tmp_path,
    postgresql_url,
):
    target = tmp_path / "lake.tar.gz"
    make_backup(BackupOrder(data, f"sqlite:///{data / 'station.sqlite3'}", target))
    (tmp_path / "other").mkdir()
    with pytest.raises(BackupError, match=r"of SQLite, .* set to PostgreSQL"):
        restore_backup(target, tmp_path / "other", postgresql_url)
    assert list((tmp_path / "other").iterdir()) == []


def test_a_dump_that_is_damaged_is_told(tmp_path, postgresql_url):
    fill(postgresql_url)
    made = tmp_path / "lake.tar.gz"
    (tmp_path / "data").mkdir()
    make_backup(BackupOrder(tmp_path / "data", postgresql_url, made))
    subprocess.run(["tar", "xzf", made, "station.dump"], cwd=tmp_path, check=True)
    dump = tmp_path / "station.dump"
    assert dump_complaint(dump) == ""
    os.truncate(dump, dump.stat().st_size // 2)
    assert "pg_restore failed" in dump_complaint(dump)


def test_a_password_is_never_on_a_command_line(data, tmp_path, monkeypatch):
    """A program in the place of pg_dump tells what everybody could see of it."""
    tools = tmp_path / "tools"
    tools.mkdir()
    spy = tools / "pg_dump"
    spy.write_text(f'#!/bin/sh\necho "$@ / $PGPASSWORD" > {tmp_path}/seen\nexit 1\n')
    spy.chmod(0o755)
    monkeypatch.setenv("PATH", str(tools))
    url = "postgresql+psycopg://ann:p%40ss@db.example:5433/lake?sslmode=require"
    with pytest.raises(StoreUnavailableError, match="pg_dump failed"):
        make_backup(BackupOrder(data, url, tmp_path / "lake.tar.gz"))
    arguments, _, password = (tmp_path / "seen").read_text().strip().partition(" / ")
    assert password == "p@ss"
    assert "p@ss" not in arguments
    assert "p%40ss" not in arguments
    assert "postgresql://ann@db.example:5433/lake?sslmode=require" in arguments


def test_without_pg_dump_it_is_said_what_to_install(data, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr("db.dump._PACKAGED", tmp_path)
    with pytest.raises(StoreUnavailableError, match="apt-get install postgresql-client"):
        make_backup(BackupOrder(data, "postgresql://ann@localhost/lake", tmp_path / "a.tar.gz"))


def test_what_was_restored_is_its_owner_s_alone(data, tmp_path):
    nested = data / "camera_pictures" / "deployment-1"
    nested.mkdir(parents=True)
    (nested / "1.jpg").write_bytes(b"picture")
    make_backup(
        BackupOrder(data, f"sqlite:///{data / 'station.sqlite3'}", tmp_path / "lake.tar.gz")
    )
    other = tmp_path / "other"
    other.mkdir()
    url = f"sqlite:///{other / 'station.sqlite3'}"
    restore_backup(tmp_path / "lake.tar.gz", other, url)
    files = [path for path in other.rglob("*") if path.is_file()]
    assert other / "camera_pictures/deployment-1/1.jpg" in files
    assert {stat.S_IMODE(path.stat().st_mode) & 0o077 for path in files} <= {0o000, 0o044}
    with write_engine(url).connect() as connection:
        assert connection.execute(text("SELECT count(*) FROM robot")).scalar() == 1
