"""Deployments begin and end, never overlap, and hold what was said in their time."""

from dataclasses import replace
from datetime import timedelta
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from db.deployment_span import LiveSpan
from db.ingest import append_telemetry
from db.query.fleet.deployment_change import (
    DeploymentOverlapError,
    DeploymentStateError,
    DeploymentTimesError,
    add_deployment,
    begin_deployment,
    correct_deployment,
    end_deployment,
    split_deployment,
    void_deployment,
)
from db.query.fleet.deployments import (
    NotBegunError,
    deployment_in_water,
    get_deployment,
    joint_spans,
    list_deployments,
)
from db.query.fleet.robots import (
    RobotExistsError,
    RobotStateError,
    add_robot,
    change_robot,
    get_robot,
    restore_robot,
    retire_robot,
)
from db.query.measured.samples import kept_counts, sample_columns
from tests.db.conftest import START, robot_record, sample

FIRST = "deployment-1"


def at(second):
    return START + timedelta(seconds=second)


@pytest.fixture
def do(store):
    """Return what makes a change and returns its outcome."""
    return lambda change, *args, **kwargs: store.change(
        lambda session: change(session, *args, **kwargs)
    ).result()


@pytest.fixture
def ask(store):
    def read(query, *args, **kwargs):
        with store.read() as session:
            return query(session, *args, **kwargs)

    return read


def test_a_robot_is_in_one_deployment_or_in_the_workshop(do, ask):
    assert ask(deployment_in_water, "mini-1").id == FIRST
    ended = do(end_deployment, FIRST, at(60))
    assert (ended.state, ended.ended_at) == ("recovered", at(60))
    assert ask(deployment_in_water, "mini-1") is None
    planned = do(add_deployment, "mini-1", title="Transect", purpose="light", people=["Ann", "Bo"])
    assert (planned.state, planned.started_at, planned.people) == ("planned", None, ("Ann", "Bo"))
    with pytest.raises(NotBegunError):
        _ = planned.period
    assert do(begin_deployment, planned.id, at(90)).state == "in_water"
    assert ask(deployment_in_water, "mini-1").title == "Transect"


def test_two_deployments_of_a_robot_do_not_overlap_and_the_other_is_named(do):
    planned = do(add_deployment, "mini-1", title="Next")
    with pytest.raises(DeploymentOverlapError, match=r"deployment-1 \(mini-1, from 2026-11-21\)"):
        do(begin_deployment, planned.id, at(10))
    do(end_deployment, FIRST, at(60))
    assert do(begin_deployment, planned.id, at(60)).started_at == at(60)
    with pytest.raises(DeploymentOverlapError, match="deployment-2"):
        do(correct_deployment, FIRST, ended_at=at(60.000001))
    with pytest.raises(DeploymentOverlapError, match="deployment-1"):
        do(correct_deployment, planned.id, started_at=at(59))
    assert do(correct_deployment, planned.id, started_at=at(70)).started_at == at(70)


def test_times_that_do_not_fit_are_refused_and_change_nothing(do, ask):
    with pytest.raises(DeploymentTimesError):
        do(end_deployment, FIRST, START)
    with pytest.raises(DeploymentTimesError):
        do(correct_deployment, FIRST, ended_at=at(5))
    with pytest.raises(DeploymentTimesError):
        do(split_deployment, FIRST, at(-1), "no")
    with pytest.raises(DeploymentTimesError):
        do(add_deployment, "mini-1", title="no", ended_at=at(-5))
    with pytest.raises(DeploymentStateError, match="in water"):
        do(begin_deployment, FIRST, at(5))
    (only,) = ask(list_deployments)
    assert (only.state, only.started_at, only.ended_at) == ("in_water", START, None)


def test_samples_belong_to_the_deployment_of_their_time_and_are_counted_there(do, ask):
    do(append_telemetry, [sample(second) for second in range(10)])
    first, second = do(split_deployment, FIRST, at(4), "Second part")
    assert (first.ended_at, second.started_at, second.state) == (at(4), at(4), "in_water")
    assert ask(kept_counts, "mini-1", deployment=first.id) == {"blue_light": 4}
    assert ask(kept_counts, "mini-1", deployment=second.id) == {"blue_light": 6}
    do(end_deployment, second.id, at(8))
    do(append_telemetry, [sample(20), sample(7, log=8)])
    assert ask(kept_counts, "mini-1", deployment=second.id) == {"blue_light": 5}
    assert ask(kept_counts, "mini-1") == {"blue_light": 12}
    do(correct_deployment, second.id, started_at=at(6))
    assert ask(kept_counts, "mini-1", deployment=second.id) == {"blue_light": 3}


def test_a_void_deployment_is_hidden_and_holds_nothing(do, ask):
    do(append_telemetry, [sample(1)])
    do(void_deployment, FIRST, "Never left the bench.", at(9))
    assert ask(list_deployments) == []
    (void,) = ask(list_deployments, is_void=True)
    assert (void.void_reason, void.ended_at) == ("Never left the bench.", at(9))
    assert ask(kept_counts, "mini-1", deployment=FIRST) == {}
    assert ask(deployment_in_water, "mini-1") is None
    with pytest.raises(DeploymentStateError, match="void"):
        do(end_deployment, FIRST, at(10))
    assert do(add_deployment, "mini-1", title="Again", started_at=START).state == "in_water"


def test_the_joint_map_takes_robots_that_are_in_the_water_together(do, ask):
    for name, system in (("grace-1", 2), ("grace-2", 3)):
        record = replace(robot_record(name, system), links=())
        do(add_robot, record, is_deployed=False)
        do(add_deployment, name, title=name, started_at=START, ended_at=at(50))
    everyone = ("mini-1", "grace-1", "grace-2")
    assert set(ask(joint_spans, everyone)) == set(everyone)
    do(correct_deployment, FIRST, started_at=at(50))
    assert set(ask(joint_spans, everyone)) == {"mini-1"}
    do(end_deployment, FIRST, at(60))
    assert set(ask(joint_spans, everyone)) == {"mini-1"}
    do(append_telemetry, [sample(second) for second in (10, 55, 65)])
    within = ask(joint_spans, everyone)
    columns = ask(sample_columns, everyone, "blue_light", within=within)
    assert columns.sequence.tolist() == [55]
    assert len(ask(sample_columns, everyone, "blue_light", within={})) == 0


def test_what_changes_of_the_water_is_kept_by_the_deployment_that_is_over(do, ask):
    site = get_deployment_site(ask)
    do(end_deployment, FIRST, at(60))
    other = robot_record("x", 9).site
    do(change_robot, "mini-1", site=other.model_dump())
    assert get_deployment_site(ask) == site != other
    assert do(add_deployment, "mini-1", title="New", started_at=at(70)).site == other


def get_deployment_site(ask):
    return ask(get_deployment, FIRST).site


def test_a_retired_robot_frees_its_system_id_and_comes_back_if_that_is_free(do, ask):
    with pytest.raises(RobotStateError, match="in the water"):
        do(retire_robot, "mini-1", at(5))
    do(end_deployment, FIRST, at(60))
    retired = do(retire_robot, "mini-1", at(61))
    assert (retired.system_id, retired.former_system_id) == (None, 1)
    with pytest.raises(RobotStateError, match="retired"):
        do(change_robot, "mini-1", name="no")
    with pytest.raises(DeploymentStateError, match="retired"):
        do(add_deployment, "mini-1", title="no")
    do(add_robot, replace(robot_record("mini-2", 1), links=()), is_deployed=False)
    with pytest.raises(RobotExistsError, match="System id 1 belongs to 'mini-2'"):
        do(restore_robot, "mini-1")
    do(retire_robot, "mini-2", at(62))
    assert do(restore_robot, "mini-1").system_id == 1
    assert ask(get_robot, "mini-1").retired_at is None
    assert [one.id for one in ask(list_deployments, robot="mini-1")] == [FIRST]


def test_a_modem_is_one_robot_s_alone_and_a_radio_is_many_s(do):
    imei = "rockblock://300234010753370"
    do(change_robot, "mini-1", links=["xbee:///dev/ttyUSB0", imei])
    shared = replace(robot_record("mini-2", 2), links=("xbee:///dev/ttyUSB0",))
    do(add_robot, shared)
    taken = replace(robot_record("mini-3", 3), links=(imei,))
    with pytest.raises(RobotExistsError, match="300234010753370 belongs to 'mini-1'"):
        do(add_robot, taken)
    do(end_deployment, FIRST, at(60))
    do(retire_robot, "mini-1", at(61))
    do(add_robot, taken)
    with pytest.raises(RobotExistsError, match="belongs to 'mini-3'"):
        do(restore_robot, "mini-1")


@given(st.lists(st.integers(0, 50), min_size=2, max_size=8, unique=True), st.integers(0, 50))
def test_a_moment_belongs_to_at_most_one_of_deployments_that_meet(edges, moment):
    edges = sorted(edges)
    spans = [LiveSpan(i + 1, at(a), at(b)) for i, (a, b) in enumerate(pairwise(edges))]
    holding = [span.key for span in spans if span.holds(at(moment))]
    assert len(holding) == (edges[0] <= moment < edges[-1])
