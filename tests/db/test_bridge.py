"""Rows wait on the disk while the database is gone, and are in it once when it is back."""

import errno
import os
import random
import signal
import stat
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import select

from autonomy.arrays import IntArray
from db.bridge import FILE_NAME, TORN_NAME, Bridge
from db.fault import StoreUnavailableError
from db.frame_file import FrameFile
from db.query.fleet.robots import add_robot
from db.query.measured.samples import sample_columns
from db.query.station.events import add_event
from db.store import Store
from db.tables import RawFrameRow
from db.telemetry_text import TelemetryTextError, rows_of, text_of
from db.writer import Kept
from robot_link.messages import RawFrame, Sample
from tests.db.conftest import ON_POSTGRESQL, ON_SQLITE, START, report, robot_record, sample
from tests.db.target import target_report
from tests.db.test_store_fault import locked, wait_until


def raw(number: int) -> RawFrame:
    """A packet; nothing but the bridge keeps it from being kept twice."""
    return RawFrame(None, "xbee", outgoing=False, data=b"%d" % number, at=START)


def packets(store: Store) -> list[int]:
    with store.read() as session:
        rows = session.scalars(select(RawFrameRow.data).order_by(RawFrameRow.key))
        return [int(data) for data in rows]


def numbers(store: Store) -> IntArray:
    with store.read() as session:
        return sample_columns(session, "mini-1", "blue_light").sequence


@pytest.fixture
def bridged(store, url, tmp_path):
    """A store that has a bridge journal, on the database of ``store``."""
    store.close()
    opened = Store.open(url, bridge_dir=tmp_path)
    yield opened
    opened.close()


@ON_SQLITE
def test_rows_are_kept_on_the_disk_while_the_database_is_locked(bridged, url, tmp_path):
    told = []
    bridged.add_bridged_listener(told.extend)
    with locked(url):
        assert bridged.append([sample(0), raw(0)]).result(60) is Kept.BRIDGE
        assert bridged.append([sample(1), raw(1)]).result(60) is Kept.BRIDGE
        assert bridged.bridged_rows == bridged.waiting_rows == 4
        assert (tmp_path / FILE_NAME).exists()
        with pytest.raises(StoreUnavailableError):
            bridged.change(lambda s: add_event(s, START, "test", "gone")).result(60)
    wait_until(lambda: bridged.waiting_rows == 0)
    assert packets(bridged) == [0, 1]
    wait_until(lambda: len(told) == 4)
    assert sorted(one.sequence for one in told if isinstance(one, Sample)) == [0, 1]
    assert not (tmp_path / FILE_NAME).exists()
    assert bridged.append([raw(2)]).result(60) is Kept.DATABASE
    assert packets(bridged) == [0, 1, 2]


@ON_SQLITE
def test_rows_that_wait_when_the_station_ends_are_written_at_its_next_start(bridged, url, tmp_path):
    with locked(url):
        assert bridged.append([raw(0)]).result(60) is Kept.BRIDGE
        late = bridged.append([raw(1)])
        bridged.close()
        assert late.result(60) is Kept.BRIDGE
    again = Store.open(url, bridge_dir=tmp_path)
    wait_until(lambda: again.waiting_rows == 0)
    assert packets(again) == [0, 1]
    again.close()


@ON_SQLITE
def test_without_room_on_the_disk_rows_wait_in_memory_and_it_is_said(bridged, url, monkeypatch):
    monkeypatch.setattr(FrameFile, "append", _no_room)
    with locked(url):
        waiting = bridged.append([raw(0)])
        wait_until(lambda: bridged.bridge_fault is not None)
        assert bridged.bridge_fault == "No space left on device"
        assert not waiting.done()
        monkeypatch.undo()
        assert waiting.result(60) is Kept.BRIDGE
        assert bridged.bridge_fault is None
    wait_until(lambda: bridged.waiting_rows == 0)
    assert packets(bridged) == [0]


def _no_room(self, payload):
    raise OSError(28, "No space left on device")


@ON_SQLITE
def test_a_journal_that_the_disk_does_not_remove_holds_up_nobody_and_is_written_once(
    bridged, url, tmp_path, monkeypatch
):
    told = []
    bridged.add_bridged_listener(told.extend)
    unlink = Path.unlink

    def refuse(path, missing_ok=False):
        if path.name == FILE_NAME:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        unlink(path, missing_ok)

    monkeypatch.setattr(Path, "unlink", refuse)
    with locked(url):
        assert bridged.append([raw(0)]).result(60) is Kept.BRIDGE
    wait_until(lambda: told == [raw(0)])
    assert bridged.waiting_rows == 0
    assert bridged.append([raw(1)]).result(60) is Kept.DATABASE
    bridged.close()
    monkeypatch.undo()
    again = Store.open(url, bridge_dir=tmp_path)
    wait_until(lambda: again.waiting_rows == 0)
    assert packets(again) == [0, 1]
    again.close()


@ON_POSTGRESQL
def test_a_server_that_is_killed_again_and_again_gets_each_row_once_in_order(bridged, postgresql):
    """The server is killed at random moments, also in the middle of a commit or of emptying."""
    drawn = random.Random()
    futures = []
    for _ in range(4):
        for _ in range(drawn.randrange(5, 60)):
            futures.append(bridged.append([raw(len(futures)), sample(len(futures))]))
            time.sleep(0.005)
        postgresql.kill()
        for _ in range(drawn.randrange(5, 60)):
            futures.append(bridged.append([raw(len(futures)), sample(len(futures))]))
            time.sleep(0.005)
        postgresql.start()
        time.sleep(drawn.random())
    kept = [future.result(60) for future in futures]
    wait_until(lambda: bridged.waiting_rows == 0)
    assert Kept.BRIDGE in kept
    assert packets(bridged) == list(range(len(futures)))
    assert sorted(numbers(bridged)) == list(range(len(futures)))


@ON_POSTGRESQL
def test_what_is_read_after_the_server_came_back_is_read_at_the_first_attempt(bridged, postgresql):
    bridged.append([raw(0)]).result(60)
    assert packets(bridged) == [0]
    postgresql.stop()
    postgresql.start()
    assert packets(bridged) == [0]


@ON_POSTGRESQL
def test_a_commit_that_was_made_before_the_connection_died_is_not_made_again(bridged, monkeypatch):
    """The server kept the batch, but its answer never came."""
    engine = bridged._write_engine
    real, cut = engine.dialect.do_commit, []

    def commit(connection):
        real(connection)
        if not cut:
            cut.append(True)
            connection.dbapi_connection.close()
            connection.dbapi_connection.execute("SELECT 1")

    monkeypatch.setattr(engine.dialect, "do_commit", commit)
    assert bridged.append([raw(0)]).result(60) is Kept.BRIDGE
    wait_until(lambda: bridged.waiting_rows == 0)
    assert packets(bridged) == [0]


CHILD = """
import sys
from pathlib import Path
from db.store import Store
from tests.db.conftest import sample
from tests.db.test_bridge import raw

store = Store.open(sys.argv[1], bridge_dir=Path(sys.argv[2]))
print("open", flush=True)
for line in sys.stdin:
    number = int(line)
    where = store.append([raw(number), sample(number)]).result()
    print(number, where.value, flush=True)
"""


@pytest.mark.process
def test_what_was_kept_on_the_disk_survives_sigkill_of_the_station(url, tmp_path, request):
    """Killed while the database is away, and again while the journal is being emptied."""
    server = request.getfixturevalue("postgresql") if url.startswith("postgresql") else None
    store = Store.open(url)
    store.change(lambda session: add_robot(session, robot_record())).result(60)
    store.close()
    drawn, number, kept = random.Random(), 0, {}
    for _ in range(3):
        child = subprocess.Popen(
            [sys.executable, "-c", CHILD, url, str(tmp_path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert child.stdout.readline() == "open\n"
        with _gone(server, url):
            for _ in range(drawn.randrange(2, 12)):
                child.stdin.write(f"{number}\n")
                child.stdin.flush()
                done, where = child.stdout.readline().split()
                kept[int(done)] = where
                number += 1
            if drawn.random() < 0.5:
                child.send_signal(signal.SIGKILL)
                child.wait()
        time.sleep(0.5 * drawn.random())
        child.kill()
        child.communicate()
    store = Store.open(url, bridge_dir=tmp_path)
    wait_until(lambda: store.waiting_rows == 0)
    assert packets(store) == sorted(kept)
    assert sorted(numbers(store)) == sorted(kept)
    assert "bridge" in kept.values()
    store.close()


def _gone(server, url):
    return locked(url) if server is None else server.down()


@ON_SQLITE
def test_a_row_of_an_unknown_robot_is_put_beside_the_journal_and_holds_up_nobody(
    bridged, url, tmp_path
):
    with locked(url):
        stranger = replace(sample(0), robot="mini-9")
        assert bridged.append([raw(0), stranger, sample(1)]).result(60) is Kept.BRIDGE
    wait_until(lambda: bridged.waiting_rows == 0)
    assert packets(bridged) == [0]
    assert numbers(bridged).tolist() == [1]
    assert rows_of((tmp_path / "bridge.refused").read_bytes()) == [stranger]


def test_a_batch_that_is_written_is_known_by_its_number(store, tmp_path):
    bridge = Bridge(tmp_path)
    batch = bridge.batch([raw(0)])
    assert store.change(lambda session: bridge.keep_once(session, batch)).result(60)
    assert not store.change(lambda session: bridge.keep_once(session, batch)).result(60)
    assert store.change(lambda s: bridge.keep_once(s, bridge.batch([raw(1)]))).result(60)
    elsewhere = tmp_path / "other"
    elsewhere.mkdir()
    other = Bridge(elsewhere)
    assert store.change(lambda session: other.keep_once(session, other.batch([]))).result(60)


def test_a_journal_that_could_not_be_removed_gives_no_number_again(store, tmp_path):
    bridge = Bridge(tmp_path)
    bridge.put(bridge.batch([raw(0)]))
    newer = bridge.batch([raw(1)])
    assert store.change(lambda session: bridge.keep_once(session, newer)).result(60)
    bridge.close()
    again = Bridge(tmp_path)
    with store.read() as session:
        again.catch_up(session)
    assert again.batch([]).number > newer.number
    again.close()


def test_a_torn_end_is_cut_off_wherever_it_was_torn(tmp_path):
    """Every whole frame is read again, whatever length of the file survived."""
    path = tmp_path / "some.journal"
    whole = FrameFile(path)
    ends = [whole.append(bytes([number]) * number) for number in range(1, 6)]
    whole.close()
    data = path.read_bytes()
    for length in range(len(data)):
        path.write_bytes(data[:length])
        torn = FrameFile(path)
        expected = sum(end <= length for end in ends)
        assert [frame.payload[0] for frame in torn.frames()] == list(range(1, expected + 1))
        torn.append(b"next")
        torn.close()
        again = FrameFile(path)
        assert [frame.payload for frame in again.frames()][-1] == b"next"
        again.clear()
        assert not path.exists()


def test_a_frame_with_a_wrong_bit_is_not_believed(tmp_path):
    path = tmp_path / "some.journal"
    file = FrameFile(path)
    first = file.append(b"one")
    file.append(b"two")
    file.close()
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    again = FrameFile(path)
    assert [frame.payload for frame in again.frames()] == [b"one"]
    assert again.end == first
    assert path.with_suffix(".torn").read_bytes() == bytes(data[first:])
    again.close()


def test_a_frame_that_the_disk_has_damaged_takes_no_later_one_with_it(tmp_path):
    path = tmp_path / "some.journal"
    file = FrameFile(path)
    first, second, _ = (file.append(word) for word in (b"one", b"two", b"three"))
    file.close()
    flip(path, second - 1)
    damaged = path.read_bytes()[first:second]
    again = FrameFile(path)
    for _ in range(2):
        assert [frame.payload for frame in again.frames()] == [b"one", b"three"]
    assert path.with_suffix(".torn").read_bytes() == damaged
    again.append(b"four")
    assert [frame.payload for frame in again.frames()] == [b"one", b"three", b"four"]
    again.close()


def flip(path, offset):
    """Have the disk lose a bit."""
    with path.open("r+b") as file:
        file.seek(offset)
        [byte] = file.read(1)
        file.seek(offset)
        file.write(bytes([byte ^ 1]))


def test_zeros_that_a_power_cut_left_at_the_end_are_no_frames(tmp_path):
    path = tmp_path / "some.journal"
    file = FrameFile(path)
    end = file.append(b"one")
    file.close()
    with path.open("ab") as longer:
        longer.write(bytes(4096))
    again = FrameFile(path)
    assert [frame.payload for frame in again.frames()] == [b"one"]
    assert again.end == end
    again.close()


def test_batches_around_one_that_the_disk_has_damaged_are_written(store, url, tmp_path):
    bridge = Bridge(tmp_path)
    ends = []
    for number in range(3):
        bridge.put(bridge.batch([raw(number)]))
        ends.append((tmp_path / FILE_NAME).stat().st_size)
    bridge.close()
    flip(tmp_path / FILE_NAME, ends[1] - 1)
    opened = Store.open(url, bridge_dir=tmp_path)
    wait_until(lambda: opened.waiting_rows == 0)
    assert packets(opened) == [0, 2]
    assert (tmp_path / TORN_NAME).exists()
    opened.close()


def test_a_batch_that_the_disk_damages_while_it_waits_holds_up_nobody(tmp_path):
    bridge = Bridge(tmp_path)
    for number in range(2):
        bridge.put(bridge.batch([raw(number)]))
    flip(tmp_path / FILE_NAME, (tmp_path / FILE_NAME).stat().st_size - 1)
    [batch] = bridge.oldest(100)
    assert batch.rows == [raw(0)]
    bridge.written()
    assert bridge.waiting_rows == 0
    assert not (tmp_path / FILE_NAME).exists()
    assert (tmp_path / TORN_NAME).exists()
    bridge.close()


def test_a_frame_is_on_the_disk_after_the_folder_of_the_last_one_could_not_be_synced(
    tmp_path, monkeypatch
):
    path = tmp_path / "some.journal"
    file = FrameFile(path)
    file.append(b"one")
    sync = os.fsync

    def refuse_folders(descriptor):
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", refuse_folders)
    with pytest.raises(OSError, match=os.strerror(errno.EIO)):
        file.clear()
    assert file.is_empty
    monkeypatch.undo()
    file.append(b"two")
    file.close()
    again = FrameFile(path)
    assert [frame.payload for frame in again.frames()] == [b"two"]
    again.close()


def test_a_frame_leaves_room_on_the_disk_for_others(tmp_path):
    file = FrameFile(tmp_path / "some.journal", reserve_bytes=2**60)
    with pytest.raises(OSError, match="too little room"):
        file.append(b"one")
    assert file.is_empty


def test_every_kind_of_telemetry_is_read_as_it_was_written():
    rows = [report(1), report(2, battery_v=-1.5), sample(3), target_report(4), raw(5)]
    rows.append(RawFrame(None, "iridium", outgoing=True, data=bytes(range(256)), at=START))
    assert sorted(map(repr, rows_of(text_of(rows)))) != []
    assert rows_of(text_of(rows)) == rows
    [gap] = rows_of(text_of([report(1, heading_rad=float("nan"))]))
    assert np.isnan(gap.heading_rad)


def test_text_that_this_version_does_not_know_is_refused_by_name():
    with pytest.raises(TelemetryTextError, match="Tide"):
        rows_of(b'Tide [{"height_m": 1.0}]')
    with pytest.raises(TelemetryTextError, match="sequence"):
        rows_of(text_of([sample(0)]).replace(b'"sequence":0', b'"sequence":"many"'))
