from datetime import UTC, datetime, timedelta

import pytest

from robot_link.clock import SystemClock
from server.base import clock_file
from server.base.clock_file import read_clock, start_clock, stop_clock


@pytest.fixture
def wall(monkeypatch):
    """A wall clock that the test moves."""

    class Wall:
        now_ = datetime(2026, 11, 21, 4, 0, tzinfo=UTC)

        @classmethod
        def now(cls, zone):
            return cls.now_.astimezone(zone)

        @classmethod
        def wait(cls, seconds):
            cls.now_ += timedelta(seconds=seconds)

    monkeypatch.setattr(clock_file, "datetime", Wall)
    return Wall


def shown(anchors, wall):
    return anchors.time_anchor + (wall.now(UTC) - anchors.wall_anchor) * anchors.speed


def test_without_a_file_time_is_the_machines_own():
    assert isinstance(read_clock(None), SystemClock)


def test_a_fresh_demo_begins_now(tmp_path, wall):
    anchors = start_clock(tmp_path / "clock.json", 20.0)
    assert anchors.time_anchor == anchors.wall_anchor == wall.now(UTC)
    clock = read_clock(tmp_path / "clock.json")
    assert clock.speed == 20.0


def test_time_goes_on_after_a_stop_as_the_wall_saw_the_pause(tmp_path, wall):
    path = tmp_path / "clock.json"
    first = start_clock(path, 20.0)
    wall.wait(100)
    stop_clock(path)
    stopped_at = shown(first, wall)
    wall.wait(3600)
    second = start_clock(path, 1.0)
    assert second.time_anchor == stopped_at + timedelta(hours=1)


def test_time_never_goes_back_after_a_kill(tmp_path, wall):
    path = tmp_path / "clock.json"
    first = start_clock(path, 20.0)
    wall.wait(100)
    last_seen = shown(first, wall)
    second = start_clock(path, 1.0)
    assert second.time_anchor >= last_seen


def test_a_clock_file_that_is_none_is_refused(tmp_path):
    path = tmp_path / "clock.json"
    path.write_text('{"speed": 0}')
    with pytest.raises(ValueError, match="wall_anchor"):
        read_clock(path)
