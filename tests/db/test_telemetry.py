import math
from cProfile import Profile
from dataclasses import replace
from datetime import timedelta
from uuid import uuid4

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sqlalchemy import event as sqlalchemy_event
from sqlalchemy import select

from db.fault import UnknownIdError
from db.query.fleet.deployments import joint_spans
from db.query.fleet.robots import add_robot
from db.query.measured import decimation, samples
from db.query.measured.samples import (
    iterate_samples,
    kept_counts,
    newest_readings,
    sample_columns,
    sampled_variables,
)
from db.query.measured.telemetry import (
    STATE_CHANNELS,
    history,
    newest_plan_report,
    newest_state,
    track,
)
from db.sample_tables import SampleRun
from db.tables import StateRow
from robot_link.messages import (
    OnboardPlanState,
    PlanHash,
    PlanReport,
    RawFrame,
    RobotId,
    RobotMode,
)
from robot_link.report import Reading
from tests.db.conftest import ON_SQLITE, START, report, robot_record, sample


def test_very_many_samples_of_a_map_become_an_even_part_of_them(store, monkeypatch):
    monkeypatch.setattr(samples, "MANY", 100)
    monkeypatch.setattr(samples, "THINNED", 20)
    store.append([sample(number, value=float(number)) for number in range(1000)]).result()
    with store.read() as session:
        spans = joint_spans(session, ["mini-1"])
        every = samples.sample_columns(session, "mini-1", "blue_light", within=spans)
        some = samples.sample_columns(session, "mini-1", "blue_light", within=spans, thins=True)
    assert len(every) == 1000
    assert len(some) == 20
    assert (some.value[0], some.value[-1]) == (0.0, 999.0)
    assert np.diff(some.value).max() <= 100.0


def test_the_newest_state_is_the_one_measured_last_not_the_one_that_came_last(store):
    store.append([report(2, depth_m=0.7), report(1, depth_m=0.3)]).result(60)
    with store.read() as session:
        assert newest_state(session, "mini-1") == report(2, depth_m=0.7)


def test_a_robot_that_never_reported_has_no_state(store):
    with store.read() as session:
        assert newest_state(session, "mini-1") is None
        assert newest_plan_report(session, "mini-1") is None
        with pytest.raises(UnknownIdError):
            newest_state(session, "nobody")


def test_what_a_robot_said_of_its_plan_comes_back_as_it_was(store):
    said = PlanReport(
        robot=RobotId("mini-1"),
        sha256=PlanHash("ab" * 32),
        state=OnboardPlanState.RUNNING,
        leg=2,
        legs=7,
        energy_used=4.5,
        reason="",
        measured_at=START,
        received_at=START + timedelta(seconds=1),
    )
    store.append([said, RawFrame(None, "xbee", False, b"\x7e\x00", START)]).result(60)
    with store.read() as session:
        assert newest_plan_report(session, "mini-1") == said


def test_every_channel_has_a_history(store):
    store.append([report(second) for second in range(3)]).result(60)
    with store.read() as session:
        for channel in (*STATE_CHANNELS, "speed_m_s"):
            assert len(history(session, "mini-1", channel).value) == 3
        assert history(session, "mini-1", "speed_m_s").value[0] == pytest.approx(0.05)


def test_a_field_variable_is_a_channel_too(store):
    store.append([sample(number, value=number * 1.5) for number in range(4)]).result(60)
    with store.read() as session:
        found = history(session, "mini-1", "blue_light", max_points=10)
    assert found.value == [0.0, 1.5, 3.0, 4.5]
    assert not found.decimated


def test_a_range_includes_both_of_its_ends(store):
    store.append([report(second, depth_m=second) for second in range(10)]).result(60)
    start, end = START + timedelta(seconds=3), START + timedelta(seconds=5)
    with store.read() as session:
        assert history(session, "mini-1", "depth_m", start, end).value == [3.0, 4.0, 5.0]
        assert len(track(session, "mini-1", start, end).points) == 3


def test_a_track_is_what_the_rows_of_the_table_say(store):
    said = [
        replace(report(i, i / 3), measured_at=START + timedelta(microseconds=i * 333_333),
                has_fix=i % 3 == 0, mode=list(RobotMode)[i % 4])
        for i in range(50)
    ]  # fmt: skip
    store.append(said).result(60)
    with store.read() as session:
        found = track(session, "mini-1")
        rows = session.scalars(select(StateRow).order_by(StateRow.measured_at)).all()
    assert not found.decimated
    assert [point.measured_at for point in found.points] == [row.measured_at for row in rows]
    for point, row in zip(found.points, rows, strict=True):
        assert point.position_ned == (row.north_m, row.east_m, row.depth_m)
        assert point.position_std_m == row.position_std_m
        assert (point.has_fix, point.mode) == (row.has_fix, RobotMode(row.mode))


def test_a_long_track_is_read_by_column_and_no_object_is_made_for_a_row(store):
    count = 4000
    store.append([report(second) for second in range(count)]).result(60)
    with store.read() as session:
        track(session, "mini-1", max_points=count)
        profile = Profile()
        found = profile.runcall(track, session, "mini-1", None, None, count)
    calls = sum(entry.callcount for entry in profile.getstats())
    assert len(found.points) == count
    assert calls < 3 * count


@given(
    depths=st.lists(st.floats(0, 100), min_size=30, max_size=200),
    max_points=st.integers(min_value=4, max_value=25),
)
@settings(
    max_examples=25,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
def test_decimation_keeps_the_extremes_and_the_order(store, depths, max_points):
    robot = f"mini-{uuid4()}"  # another one for each example
    store.change(lambda session: add_robot(session, robot_record(robot, None))).result(60)
    store.append([report(i, depth, robot) for i, depth in enumerate(depths)]).result(60)
    with store.read() as session:
        found = history(session, robot, "depth_m", max_points=max_points)
        points = track(session, robot, max_points=max_points).points
    assert found.decimated
    assert 0 < len(found.value) <= max_points
    assert min(found.value) == min(depths)
    assert max(found.value) == max(depths)
    assert found.measured_at == sorted(set(found.measured_at))
    originals = {START + timedelta(seconds=i): depth for i, depth in enumerate(depths)}
    assert all(
        originals[at] == value for at, value in zip(found.measured_at, found.value, strict=True)
    )
    assert [point.position_ned[2] for point in points] == found.value


@ON_SQLITE
def test_a_decimated_history_is_read_along_the_primary_key(store):
    """Every interval is one range of the table's own order: no sorting of the whole, no scan."""
    store.append([report(second) for second in range(100)]).result(60)
    plans = []

    def explain(connection, cursor, statement, parameters, *rest):
        if statement.startswith(("SELECT", "WITH")):
            steps = connection.connection.driver_connection.execute(
                f"EXPLAIN QUERY PLAN {statement}", parameters
            ).fetchall()
            plans.extend(step[3] for step in steps)

    engine = store._read_engine
    sqlalchemy_event.listen(engine, "before_cursor_execute", explain)
    with store.read() as session:
        assert history(session, "mini-1", "depth_m", max_points=10).decimated
    used = [step for step in plans if "state_report" in step]
    assert used
    assert all(step.startswith("SEARCH state_report USING PRIMARY KEY") for step in used)


def test_samples_come_as_columns_in_order_of_time(store):
    late = replace(sample(9), measured_at=START - timedelta(seconds=5), value=1.0)
    store.append([sample(0), sample(1), late, sample(2, variable="temperature")]).result(60)
    with store.read() as session:
        columns = sample_columns(session, "mini-1", "blue_light")
        assert columns.sequence.tolist() == [9, 0, 1]
        assert columns.position_ned.shape == (3, 3)
        assert columns.value.tolist() == [1.0, 3.0, 3.0]
        assert len(sample_columns(session, "mini-1", "chlorophyll")) == 0
        assert len(sample_columns(session, "mini-1", "blue_light", start=START)) == 2
        assert len(sample_columns(session, "mini-1", "blue_light", log=8)) == 0
        assert sampled_variables(session, "mini-1") == {"blue_light": 3, "temperature": 1}
        assert [s.variable for s in iterate_samples(session, "mini-1", start=START)] == [
            "blue_light",
            "blue_light",
            "temperature",
        ]


def test_values_survive_the_journey_to_the_last_bit(store):
    value = math.nextafter(0.1, 1.0)
    store.append([sample(0, value=value)]).result(60)
    with store.read() as session:
        assert sample_columns(session, "mini-1", "blue_light").value[0] == value


def test_how_many_samples_there_are_is_kept_and_hardly_counted(store):
    """A sample that is sent twice, in one batch or another, counts once."""
    store.append([sample(0), sample(1), sample(1), sample(2, variable="temperature")]).result(60)
    early = replace(sample(4), measured_at=START - timedelta(seconds=1))
    store.append([sample(1), sample(3), early]).result(60)
    statements = []
    sqlalchemy_event.listen(
        store._read_engine,
        "before_cursor_execute",
        lambda connection, cursor, statement, *rest: statements.append(statement),
    )
    with store.read() as session:
        assert sampled_variables(session, "mini-1") == {"blue_light": 4, "temperature": 1}
        assert not [said for said in statements if "count(" in said]
        of_deployment = kept_counts(session, "mini-1", deployment="deployment-1")
        since = sampled_variables(session, "mini-1", start=START + timedelta(microseconds=1))
    assert since == {"blue_light": 2, "temperature": 1}
    assert of_deployment == {"blue_light": 3, "temperature": 1}
    assert statements
    counted = [said for said in statements if "count(" in said]
    assert counted
    assert all("measured_at >=" in said and "measured_at <" in said for said in counted)


def test_samples_of_a_time_are_those_that_one_by_one_lie_in_it(store):
    """Whole days and five-minute stretches are summed up, the ends counted; both ends belong."""
    seconds = [0, 1, 299, 300, 86_399, 86_400, 86_401, 3 * 86_400, 3 * 86_400 + 77, 5 * 86_400]
    taken = [
        replace(sample(number), measured_at=START + timedelta(seconds=second))
        for number, second in enumerate(seconds)
    ]
    store.append(taken).result(60)
    with store.read() as session:
        for first in seconds:
            for last in seconds:
                start, end = (START + timedelta(seconds=one) for one in (first, last))
                found = sampled_variables(session, "mini-1", start=start, end=end)
                expected = sum(first <= second <= last for second in seconds)
                assert found.get("blue_light", 0) == expected


def test_numbers_of_a_log_come_in_any_order_and_each_once(store):
    order = np.random.default_rng(3).permutation(np.arange(60).repeat(2)).tolist()
    for first in range(0, len(order), 7):
        store.append([sample(number) for number in order[first : first + 7]]).result(60)
    with store.read() as session:
        columns = sample_columns(session, "mini-1", "blue_light")
        runs = session.execute(select(SampleRun.first, SampleRun.last)).all()
    assert columns.sequence.tolist() == list(range(60))
    assert runs == [(0, 59)]


def test_a_long_history_is_drawn_from_its_stretches_with_the_same_extremes(store, monkeypatch):
    rng = np.random.default_rng(4)
    values = rng.normal(size=3000)
    taken = [
        replace(sample(i, value=float(value)), measured_at=START + timedelta(seconds=10 * i))
        for i, value in enumerate(values)
    ]
    store.append(taken).result(60)
    with store.read() as session:
        exact = history(session, "mini-1", "blue_light", max_points=20)
        monkeypatch.setattr(decimation, "READ_ROWS_MAX", 100)
        summed = history(session, "mini-1", "blue_light", max_points=20)
        first, last = taken[3].measured_at, taken[-5].measured_at
        part = history(session, "mini-1", "blue_light", first, last, max_points=20)
    originals = {one.measured_at: one.value for one in taken}
    for found in (exact, summed, part):
        assert found.decimated
        assert found.measured_at == sorted(set(found.measured_at))
        assert [originals[at] for at in found.measured_at] == found.value
    for found in (exact, summed):
        assert (min(found.value), max(found.value)) == (values.min(), values.max())
    assert first <= part.measured_at[0] <= part.measured_at[-1] <= last
    assert (min(part.value), max(part.value)) == (values[3:-4].min(), values[3:-4].max())
    assert 10 <= len(summed.value) <= 20


def test_readings_are_kept_once_and_have_a_history(store):
    def reading(second, value):
        at = START + timedelta(seconds=second)
        return Reading(RobotId("mini-1"), "humidity", value, at, at)

    store.append([reading(0, 40.0), reading(1, 41.0), reading(1, 99.0)]).result(60)
    store.append([reading(1, 77.0), reading(2, 42.5)]).result(60)
    with store.read() as session:
        assert history(session, "mini-1", "humidity").value == [40.0, 41.0, 42.5]
        (newest,) = newest_readings(session, "mini-1")
        assert sampled_variables(session, "mini-1") == {}
    assert (newest.channel, newest.value) == ("humidity", 42.5)
