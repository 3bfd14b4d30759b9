"""Samples that were not ashore when the robot was switched off are not lost."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.link.sample_file import FileSampleLog
from robot_link.messages import LogId, Sample
from robot_link.sample_log import Measurement, SampleKey
from tests.robot_link.rig import MINI, rig, until

NOW = datetime(2026, 5, 1, 12, 0, 0, 250_000, tzinfo=UTC)


def measurement(number: int) -> Measurement:
    place = (1.5 * number, -0.1, 3.0)
    return Measurement("chlorophyll", number / 3, place, 0.25, NOW + timedelta(seconds=number))


def test_samples_outlive_the_program_and_what_is_ashore_does_not(tmp_path: Path):
    path = tmp_path / "samples"
    killed = FileSampleLog(path, LogId(7))
    keys = [killed.append(measurement(number)) for number in range(5)]
    killed.forget([*keys[1:3], SampleKey(LogId(6), 0)])
    again = FileSampleLog(path, LogId(8))
    assert again.kept() == [keys[0], keys[3], keys[4]]
    assert [again.get(key) for key in again.kept()] == [measurement(n) for n in (0, 3, 4)]
    assert again.append(measurement(9)) == (8, 0), "a new log counts from 0"
    again.forget(keys)
    third = FileSampleLog(path, LogId(9))
    assert third.kept() == [(8, 0)]
    assert third.get(SampleKey(LogId(8), 0)) == measurement(9)


def test_log_that_is_taken_up_again_gives_no_number_twice(tmp_path: Path):
    FileSampleLog(tmp_path / "samples", LogId(7)).append(measurement(0))
    assert FileSampleLog(tmp_path / "samples", LogId(7)).append(measurement(1)) == (7, 1)


@given(cut=st.integers(0, 2000), flipped=st.integers(0, 2000), bit=st.integers(0, 7))
def test_file_that_a_power_cut_spoilt_gives_what_is_whole_and_nothing_else(
    tmp_path_factory: pytest.TempPathFactory, cut: int, flipped: int, bit: int
):
    path = tmp_path_factory.mktemp("cut") / "samples"
    log = FileSampleLog(path, LogId(7))
    keys = [log.append(measurement(number)) for number in range(8)]
    data = bytearray(path.read_bytes())
    data[flipped % len(data)] ^= 1 << bit
    path.write_bytes(data[: max(1, len(data) - cut)])
    after = FileSampleLog(path, LogId(8))
    whole = len(data[: max(1, len(data) - cut)].splitlines())
    assert set(after.kept()) <= set(keys)
    assert len(after.kept()) >= min(whole - 3, len(keys) - 2)
    assert all(after.get(key) == measurement(key.sequence) for key in after.kept())
    after.append(measurement(20))
    assert SampleKey(LogId(8), 0) in FileSampleLog(path, LogId(9)).kept()


def test_line_that_says_what_cannot_be_is_passed_over(tmp_path: Path):
    path = tmp_path / "samples"
    path.write_bytes(b"\xff\n00000000 {}\n\nzz\n" + b"2d0b9d1c []\n")
    assert FileSampleLog(path, LogId(1)).kept() == []


def test_file_stays_as_small_as_what_is_kept(tmp_path: Path):
    path = tmp_path / "samples"
    log = FileSampleLog(path, LogId(7))
    for number in range(3000):
        log.forget([log.append(measurement(number))])
    assert len(path.read_bytes().splitlines()) <= 1026


def test_robot_whose_disk_refuses_keeps_its_samples_in_memory(tmp_path: Path, caplog):
    path = tmp_path / "samples"
    path.mkdir()
    log = FileSampleLog(path, LogId(7))
    key = log.append(measurement(1))
    assert log.get(key) == measurement(1)
    log.forget([key])
    assert log.kept() == []
    assert "cannot keep samples" in caplog.text


def test_disk_that_takes_again_what_it_refused_is_given_all_of_it(tmp_path: Path):
    path = tmp_path / "samples"
    log = FileSampleLog(path, LogId(7))
    keys = [log.append(measurement(0))]
    path.unlink()
    path.mkdir()
    keys += [log.append(measurement(number)) for number in range(1, 100)]
    log.forget(keys[5:10])
    assert [one.name for one in tmp_path.iterdir()] == ["samples"], "no half file takes room"
    path.rmdir()
    keys += [log.append(measurement(number)) for number in range(100, 200)]
    assert FileSampleLog(path, LogId(8)).kept() == keys[:5] + keys[10:]


def test_file_that_cannot_be_read_is_added_to_and_not_replaced(tmp_path: Path, monkeypatch):
    path = tmp_path / "samples"
    keys = [FileSampleLog(path, LogId(7)).append(measurement(0))]
    with monkeypatch.context() as broken:
        broken.setattr(Path, "read_bytes", _refuse)
        log = FileSampleLog(path, LogId(8))
        for number in range(1200):
            keys.append(log.append(measurement(number)))
            log.forget(keys[1:-1])
            del keys[1:-1]
    assert FileSampleLog(path, LogId(9)).kept() == keys


def _refuse(path: Path) -> bytes:
    raise OSError(5, "Input/output error", str(path))


async def test_samples_of_an_older_log_go_ashore_under_their_own_names(tmp_path: Path):
    killed = FileSampleLog(tmp_path / "samples", LogId(7))
    for number in range(20):
        killed.append(measurement(number))
    after = FileSampleLog(tmp_path / "samples", LogId(8))
    async with rig(tmp_path, log=after) as it, it.station() as (_, heard):
        robot = it.robots[MINI].link
        assert robot.unacknowledged_samples == 20
        robot.record_sample("chlorophyll", 1.0, (0.0, 0.0, 0.0), 0.1, NOW)
        await until(lambda: not robot.unacknowledged_samples)
        names = {(sample.log, sample.sequence) for sample in heard.of(Sample)}
    assert names == {*((7, number) for number in range(20)), (8, 0)}
    assert FileSampleLog(tmp_path / "samples", LogId(9)).kept() == []
