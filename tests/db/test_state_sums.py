"""Charts and tracks of very many reports, read by sums, against all reports read one by one."""

import math
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest
from sqlalchemy import delete, select

from db.column import microseconds
from db.query.measured import decimation
from db.query.measured.imported import complete_states
from db.query.measured.telemetry import history, track
from db.state_sums import STRETCH_US, StateRollup, StateSummed, sum_up_next, summed_until_us
from robot_link.messages import STATE
from tests.db.conftest import START, report

SECONDS, EVERY_S = 6000, 5
LATER = START + timedelta(days=1)
CHANNELS = (*STATE.keys, *STATE.norms)


def flown(seed=3):
    """Return reports of a robot whose every channel wanders, some of them without a place."""
    rng = np.random.default_rng(seed)
    reports = []
    for second in range(0, SECONDS, EVERY_S):
        east_m, depth_m, speed_m_s = rng.normal(size=3).tolist()
        is_lost = rng.random() < 0.1
        reports.append(
            report(
                second,
                depth_m=depth_m,
                position_ned=(math.nan if is_lost else 1.0, east_m, depth_m),
                velocity_ned=(speed_m_s, 0.1 * east_m, 0.0),
                position_std_m=math.inf if is_lost else abs(east_m),
                battery_v=float(rng.uniform(9.0, 12.0)),
            )
        )
    return reports


def sum_up(store, before=LATER):
    while store.change(lambda session: sum_up_next(session, 7, before)).result():
        pass


@pytest.fixture
def read_by_sums(monkeypatch):
    """Have sums used for what is otherwise short enough to be read as it is."""
    monkeypatch.setattr(decimation, "READ_ROWS_MAX", 0)


def extremes(store, channel):
    with store.read() as session:
        found = history(session, "mini-1", channel, max_points=20)
    return min(found.value, default=None), max(found.value, default=None), found.decimated


def told(reports, channel):
    values = [STATE.shown(one)[channel] for one in reports]
    return [one for one in values if math.isfinite(one)]


@pytest.mark.usefixtures("read_by_sums")
def test_a_chart_by_sums_keeps_the_extremes_of_every_channel(store):
    reports = flown()
    store.append(reports).result()
    sum_up(store)
    for channel in CHANNELS:
        values = told(reports, channel)
        assert extremes(store, channel) == (
            pytest.approx(min(values)),
            pytest.approx(max(values)),
            True,
        ), channel


@pytest.mark.usefixtures("read_by_sums")
def test_a_track_by_sums_keeps_the_deepest_place_and_leaves_out_what_has_none(store):
    reports = flown()
    store.append(reports).result()
    sum_up(store)
    with store.read() as session:
        found = track(session, "mini-1", max_points=20)
    placed = [one.position_ned for one in reports if not math.isnan(one.position_ned[0])]
    assert found.decimated
    assert float(found.position_ned[:, 2].max()) == max(place[2] for place in placed)
    assert {tuple(place) for place in found.position_ned.tolist()} <= set(placed)


@pytest.mark.usefixtures("read_by_sums")
def test_reports_that_are_not_summed_up_yet_are_in_the_chart(store):
    reports = flown()
    store.append(reports).result()
    sum_up(store, START + timedelta(seconds=SECONDS / 2))
    values = told(reports, "battery_v")
    assert extremes(store, "battery_v") == (min(values), max(values), True)


@pytest.mark.usefixtures("read_by_sums")
def test_a_late_report_changes_the_sums_of_its_time(store):
    store.append(flown()).result()
    sum_up(store)
    store.append([report(601.5, battery_v=99.0)]).result()
    assert extremes(store, "battery_v")[1] == 99.0


@pytest.mark.usefixtures("read_by_sums")
def test_what_a_second_file_tells_of_a_report_is_summed_up(store):
    reports = [replace(one, net_buoyancy_kg=math.nan) for one in flown()]
    store.append(reports).result()
    sum_up(store)
    assert extremes(store, "net_buoyancy_kg") == (None, None, False)
    rows = [
        (microseconds(one.measured_at), {"net_buoyancy_kg": n / 1e3})
        for n, one in enumerate(reports)
    ]
    store.change(lambda session: complete_states(session, 1, rows)).result()
    assert extremes(store, "net_buoyancy_kg")[:2] == (0.0, (len(reports) - 1) / 1e3)


def test_summing_up_in_pieces_is_summing_up_at_once(store):
    store.append(flown()).result()
    sum_up(store)

    def sums(session):
        rows = session.scalars(select(StateRollup)).all()
        return {(one.channel, one.stretch): (one.size, one.least, one.greatest) for one in rows}

    with store.read() as session:
        in_pieces = sums(session)

    def anew(session):
        session.execute(delete(StateRollup))
        session.execute(delete(StateSummed))
        sum_up_next(session, 1000, LATER)

    store.change(anew).result()
    with store.read() as session:
        assert sums(session) == in_pieces
        assert len({stretch for _, stretch in in_pieces}) == SECONDS * 1_000_000 / STRETCH_US


def test_nothing_is_summed_up_that_may_go_on(store):
    store.append(flown()).result()
    until = START + timedelta(seconds=1000)
    sum_up(store, until)
    with store.read() as session:
        assert summed_until_us(session, 1) == microseconds(until) // STRETCH_US * STRETCH_US
