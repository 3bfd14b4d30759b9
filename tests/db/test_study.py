"""Vehicles and studies in the database, and reports as arrays."""

import numpy as np
import pytest

from db.column import moment
from db.fault import UnknownIdError
from db.query.fleet.deployments import list_deployments
from db.query.fleet.robots import add_robot
from db.query.fleet.vehicles import (
    VehicleExistsError,
    VehicleRecord,
    add_vehicle,
    get_vehicle,
    list_vehicles,
)
from db.query.measured.state_columns import begin_of_last_dives, state_columns
from db.query.mission.studies import (
    add_study,
    end_study,
    get_checkpoint,
    get_study,
    interrupt_studies,
    keep_checkpoint,
    list_studies,
    reopen_study,
    set_job,
    use_only_study,
    use_study,
    used_studies,
)
from db.query.station.jobs import add_job
from tests.db.conftest import START, report, robot_record

WHATIF = {"title": "PID", "vehicle": "miniglider", "scenario": {"runs": 2}, "controllers": [{}]}


def write(store, function):
    return store.change(function).result(60)


def read(store, function):
    with store.read() as session:
        return function(session)


def vehicle(key="mine"):
    return VehicleRecord(key, "Mine", "", "file", {"key": key}, START, "ann")


def run(session, robot="mini-1"):
    return add_study(session, "whatif", robot, asked=WHATIF, at=START, by="ann").id


def begun(session, by="ann"):
    (deployment,) = list_deployments(session)
    asked = {"deployment": deployment.id, "base_vehicle": "miniglider"}
    return add_study(session, "identification", "mini-1", asked=asked, at=START, by=by).id


def test_a_vehicle_is_kept_once(store):
    write(store, lambda session: add_vehicle(session, vehicle()))
    with pytest.raises(VehicleExistsError, match="mine"):
        write(store, lambda session: add_vehicle(session, vehicle()))
    assert read(store, list_vehicles) == [vehicle()]
    assert read(store, lambda session: get_vehicle(session, "other")) is None


def test_a_whatif_lists_without_its_result_and_is_read_with_it(store):
    made = write(store, run)
    job = write(store, lambda s: add_job(s, "whatif", at=START, by="ann"))
    write(store, lambda s: set_job(s, "whatif", made, job.id))
    end = {"at": START, "message": "", "result": {"a": 1}}
    write(store, lambda s: end_study(s, "whatif", made, "done", **end))
    (listed,) = read(store, lambda s: list_studies(s, "whatif", "mini-1"))
    assert (listed.state, listed.job, listed.result) == ("done", job.id, None)
    found = read(store, lambda s: get_study(s, "whatif", made))
    assert (found.result, found.asked) == ({"a": 1}, WHATIF)
    assert read(store, lambda s: list_studies(s, "whatif", "mini-1", before=made)) == []


def test_at_most_one_whatif_of_a_robot_is_shown(store):
    ids = [write(store, run) for _ in range(2)]
    use = {"origin_ned": [1.0, 2.0, 0.0]}
    for made in ids:
        write(store, lambda s, made=made: use_only_study(s, "whatif", "mini-1", made, use))
    (shown,) = read(store, lambda s: used_studies(s, "whatif"))
    assert (shown.id, shown.use) == (ids[1], use)
    write(store, lambda s: use_only_study(s, "whatif", "mini-1", None, None))
    assert read(store, lambda s: used_studies(s, "whatif")) == []


def test_a_whatif_of_another_robot_is_not_shown(store):
    write(store, lambda s: add_robot(s, robot_record("grace-1", 2)))
    made = write(store, run)
    with pytest.raises(UnknownIdError):
        write(store, lambda s: use_only_study(s, "whatif", "grace-1", made, {}))


def test_each_kind_of_study_counts_for_itself(store):
    ids = [write(store, add) for add in (run, begun, run, begun)]
    assert ids == ["whatif-1", "identification-1", "whatif-2", "identification-2"]


def test_studies_left_behind_are_interrupted(store):
    whatif = write(store, run)
    search = write(store, begun)
    write(store, lambda s: interrupt_studies(s, "whatif", START, "stopped"))
    assert read(store, lambda s: get_study(s, "identification", search)).state == "running"
    write(store, lambda s: interrupt_studies(s, "identification", START, "stopped"))
    assert read(store, lambda s: get_study(s, "whatif", whatif)).state == "interrupted"
    ended = read(store, lambda s: get_study(s, "identification", search))
    assert (ended.state, ended.message) == ("interrupted", "stopped")
    write(store, lambda s: interrupt_studies(s, "identification", START, "again"))
    assert read(store, lambda s: get_study(s, "identification", search)).message == "stopped"


def test_a_checkpoint_holds_until_there_is_a_result(store):
    search, kind = write(store, begun), "identification"
    assert not read(store, lambda s: get_study(s, kind, search)).has_checkpoint
    half = {"progress": 0.5, "convergence": [{"iteration": 1, "cost": 2.0}]}
    kept = {"checkpoint": {"x": [1.0]}, "news": half, "message": "half"}
    write(store, lambda s: keep_checkpoint(s, kind, search, **kept))
    found = read(store, lambda s: get_study(s, kind, search))
    assert (found.has_checkpoint, found.news) == (True, half)
    assert read(store, lambda s: get_checkpoint(s, kind, search)) == {"x": [1.0]}
    whole = {**half, "progress": 1.0}
    end = {"at": START, "message": "", "news": whole, "result": {"r": 1}}
    write(store, lambda s: end_study(s, kind, search, "done", **end))
    ended = read(store, lambda s: get_study(s, kind, search))
    assert (ended.has_checkpoint, ended.news, ended.result) == (False, whole, {"r": 1})
    assert read(store, lambda s: list_studies(s, kind, "mini-1"))[0].result is None


def test_a_search_that_goes_on_is_running_again(store):
    search, kind = write(store, begun), "identification"
    write(store, lambda s: interrupt_studies(s, kind, START, "stopped"))
    job = write(store, lambda s: add_job(s, kind, at=START, by="ann"))
    assert write(store, lambda s: reopen_study(s, kind, search))
    assert not write(store, lambda s: reopen_study(s, kind, search))
    write(store, lambda s: set_job(s, kind, search, job.id))
    write(store, lambda s: use_study(s, kind, search, {"vehicle": "mini-b"}))
    found = read(store, lambda s: get_study(s, kind, search))
    assert (found.state, found.job, found.ended_at) == ("running", job.id, None)
    assert found.use == {"vehicle": "mini-b"}


@pytest.mark.parametrize("identity", ["identification-9", "whatif-1", "identification-x"])
def test_an_unknown_search_is_named(store, identity):
    kind = "identification"
    with pytest.raises(UnknownIdError, match=identity):
        read(store, lambda s: get_study(s, kind, identity))
    nothing = {"checkpoint": {}, "news": {}, "message": ""}
    with pytest.raises(UnknownIdError, match=identity):
        write(store, lambda s: keep_checkpoint(s, kind, identity, **nothing))


def test_reports_come_as_arrays_in_order_with_both_ends(store):
    store.append([report(second, 0.1 * second) for second in (3, 1, 2, 0)]).result(60)
    times = [START.replace(second=second) for second in (1, 2)]
    columns = read(store, lambda s: state_columns(s, "mini-1", *times))
    assert len(columns) == 2
    np.testing.assert_allclose(columns.position_ned[:, 2], [0.1, 0.2])
    np.testing.assert_allclose(columns.attitude_rad, [[0.0, -0.4, 1.0]] * 2)
    assert np.diff(columns.measured_at_us).tolist() == [1_000_000]
    assert columns.mode.tolist() == [int(report(0).mode)] * 2


def test_no_report_gives_empty_arrays_of_the_right_shape(store):
    columns = read(store, lambda s: state_columns(s, "mini-1"))
    assert columns.position_ned.shape == columns.attitude_rad.shape == (0, 3)
    assert len(columns) == 0


def test_only_the_first_reports_come_where_no_more_are_wanted(store):
    store.append([report(second) for second in range(4)]).result(60)
    columns = read(store, lambda s: state_columns(s, "mini-1", limit=3))
    assert moment(int(columns.measured_at_us[-1])) == START.replace(second=2)


DEPTHS_M = [0.0, 0.5, 0.5, 0.5, 0.0, 0.0, 0.5, 0.0, 0.5, 0.5, 0.5, 0.0, 0.5, 0.5]
"""Every second: a dive, a splash of one report, a dive, and the one that the robot is on."""


@pytest.mark.parametrize(
    ("dives", "limit", "second"), [(1, 100, 12), (2, 100, 8), (3, 100, 1), (9, 100, 0), (9, 5, 9)]
)
def test_the_last_dives_begin_under_water(store, dives, limit, second):
    store.append([report(at, depth_m) for at, depth_m in enumerate(DEPTHS_M)]).result(60)
    begin = read(
        store,
        lambda session: begin_of_last_dives(
            session,
            "mini-1",
            None,
            None,
            dives=dives,
            surface_depth_m=0.05,
            shortest_s=1.5,
            limit=limit,
        ),
    )
    assert begin == START.replace(second=second)


def test_a_robot_without_reports_has_no_last_dive(store):
    begin = read(
        store,
        lambda session: begin_of_last_dives(
            session,
            "mini-1",
            START,
            START,
            dives=1,
            surface_depth_m=0.05,
            shortest_s=1.5,
            limit=9,
        ),
    )
    assert begin is None
