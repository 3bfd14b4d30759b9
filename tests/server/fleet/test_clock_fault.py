"""A clock that is off by minutes: what arrives is shown as what it is, and the clock is told."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from db.query.measured.samples import newest_samples
from robot_link.messages import StateReport
from server.fleet.clock_fault import ClockJudge
from tests.server.conftest import MINI, until
from tests.server.fake_link import state_report

NOW = datetime(2026, 5, 1, 12, 0, tzinfo=UTC)
MINUTES = timedelta(minutes=1)


def told(later_s: float, late_by: timedelta) -> StateReport:
    arrived = NOW + timedelta(seconds=later_s)
    return replace(state_report(MINI, at=arrived), measured_at=arrived - late_by)


def heard(judge: ClockJudge, *reports: StateReport, is_prompt: bool = True) -> ClockJudge:
    for report in reports:
        judge.hear(report, is_prompt=is_prompt)
    return judge


async def test_gauges_go_on_when_a_clock_is_minutes_behind_and_the_clock_is_told(
    client, station, world
):
    now = datetime.now(UTC)
    for later_s in range(8):
        at = now + timedelta(seconds=later_s)
        said_at = at - 20 * MINUTES
        world.tell(state_report(MINI, (1.0, 0.5, 0.1 * later_s), at=at, measured_at=said_at))
    found = (await client.get(f"/api/robots/{MINI}/state")).json()
    assert "20 min behind" in found["clock_fault"]
    assert found["channels"]["depth_m"]["value"] == pytest.approx(0.7)
    assert station.fleet.status(MINI).state.measured_at == now + timedelta(seconds=7)
    world.tell(state_report(MINI, (1.0, 0.5, 0.4), at=now + timedelta(seconds=8)))
    found = (await client.get(f"/api/robots/{MINI}/state")).json()
    assert (found["clock_fault"], found["channels"]["depth_m"]["value"]) == (None, 0.4)


async def test_gauges_go_on_at_once_when_a_clock_is_minutes_ahead_and_the_clock_is_told(
    client, station, world
):
    now = datetime.now(UTC)
    for later_s, depth_m in enumerate((0.2, 0.3)):
        at = now + timedelta(seconds=later_s)
        said_at = at + 12 * MINUTES
        world.tell(state_report(MINI, (1.0, 0.5, depth_m), at=at, measured_at=said_at))
    found = (await client.get(f"/api/robots/{MINI}/state")).json()
    assert "12 min ahead" in found["clock_fault"]
    assert found["channels"]["depth_m"]["value"] == 0.3
    assert station.fleet.status(MINI).state.measured_at == at, "the true age is that of its arrival"
    assert station.fleet.status(MINI).refused == 0


async def test_sample_dated_ahead_that_comes_before_any_state_is_kept_as_of_its_arrival(
    foundation, world
):
    ahead = datetime.now(UTC) + timedelta(hours=2)
    world.robots[MINI].sample((1.0, 0.5, 0.2), measured_at=ahead)
    await until(lambda: world.acknowledged)
    (kept,) = await foundation.store.query(lambda session: newest_samples(session, MINI))
    assert abs(kept.measured_at - datetime.now(UTC)) < MINUTES


def test_states_that_waited_on_the_way_accuse_no_clock():
    burst = [told(0.001 * number, timedelta(seconds=300 - number)) for number in range(60)]
    slow = [told(10 + number, timedelta(seconds=240 - 6 * number)) for number in range(20)]
    assert heard(ClockJudge(1.0), *burst, *slow).fault is None


def test_one_late_state_accuses_no_clock_and_one_in_time_acquits_it():
    judge = heard(ClockJudge(1.0), told(0, 5 * MINUTES), told(100, 0 * MINUTES))
    assert heard(judge, told(101, 5 * MINUTES)).fault is None
    behind = [told(200 + number, 5 * MINUTES) for number in range(6)]
    assert heard(judge, *behind).fault is not None
    assert heard(judge, told(300, 0 * MINUTES)).fault is None


def test_limits_grow_with_the_speed_of_the_clock():
    behind = [told(number, 5 * MINUTES) for number in range(20)]
    assert heard(ClockJudge(1.0), *behind).fault is not None
    assert heard(ClockJudge(20.0), *behind).fault is None
    assert heard(ClockJudge(20.0), told(0, -10 * MINUTES)).fault is None
    assert heard(ClockJudge(20.0), told(0, -21 * MINUTES)).fault is not None


def test_state_that_a_gateway_delivers_late_accuses_no_clock_and_acquits_none():
    late = [told(60 * number, 300 * MINUTES) for number in range(20)]
    assert heard(ClockJudge(1.0), *late, is_prompt=False).fault is None
    behind = [told(number, 5 * MINUTES) for number in range(6)]
    judge = heard(ClockJudge(1.0), *behind)
    assert heard(judge, *late, is_prompt=False).fault is not None
    assert judge.dated(late[0]).measured_at == late[0].measured_at + 5 * MINUTES
    assert heard(judge, told(0, -2 * MINUTES), is_prompt=False).fault.ahead == 2 * MINUTES


def test_what_was_kept_under_water_is_put_as_long_before_as_its_clock_says():
    judge = heard(ClockJudge(1.0), told(0, -10 * MINUTES))
    kept = told(0, -7 * MINUTES)
    assert judge.dated(kept).measured_at == NOW - 3 * MINUTES
    assert judge.dated(told(0, -11 * MINUTES)).measured_at == NOW, "never after its arrival"


def test_sentence_stays_while_a_clock_is_off_by_the_same_and_says_against_what():
    judge = heard(ClockJudge(1.0), told(0, -90 * MINUTES))
    said = judge.fault.text
    assert "90 min ahead of the station's" in said
    for later_s in range(1, 200):
        jitter = timedelta(seconds=40 * (-1) ** later_s)
        fault = heard(judge, told(later_s, jitter - 90 * MINUTES)).fault
        assert (fault.text, fault.ahead) == (said, 90 * MINUTES - jitter)
    assert "99 min ahead" in heard(judge, told(300, -99 * MINUTES)).fault.text


def test_state_by_satellite_acquits_no_clock_that_is_days_behind_at_high_speed():
    days = timedelta(days=5)
    judge = heard(ClockJudge(10.0), *(told(10 * number, days) for number in range(8)))
    assert heard(judge, told(100, days), is_prompt=False).fault is not None
