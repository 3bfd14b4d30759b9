"""Vehicles and studies in the database, and reports as arrays."""

import numpy as np
import pytest

from db.column import moment
from db.fault import UnknownIdError
from db.query.deployments import list_deployments
from db.query.identifications import (
    AcceptedAlreadyError,
    accept_identification,
    add_identification,
    end_identification,
    get_checkpoint,
    get_identification,
    interrupt_identifications,
    keep_checkpoint,
    list_identifications,
    reopen_identification,
    set_identification_job,
)
from db.query.jobs import add_job
from db.query.robots import add_robot
from db.query.state_columns import begin_of_last_dives, state_columns
from db.query.trim import accept_advice, add_advice, get_advice
from db.query.vehicles import (
    VehicleExistsError,
    VehicleRecord,
    add_vehicle,
    get_vehicle,
    list_vehicles,
)
from db.query.whatifs import (
    add_whatif,
    end_whatif,
    get_whatif,
    interrupt_whatifs,
    list_whatifs,
    set_whatif_job,
    show_whatif,
    shown_whatifs,
)
from tests.db.conftest import START, report, robot_record

WHATIF = {"title": "PID", "vehicle": "miniglider", "scenario": {"runs": 2}, "controllers": [{}]}


def write(store, function):
    return store.change(function).result(60)


def read(store, function):
    with store.read() as session:
        return function(session)


def vehicle(key="mine"):
    return VehicleRecord(key, "Mine", "", "file", {"key": key}, START, "ann")


def begun(session, by="ann"):
    (deployment,) = list_deployments(session)
    return add_identification(
        session,
        "mini-1",
        deployment.id,
        vehicle="miniglider",
        vehicle_document={"key": "miniglider"},
        config={"particles": 4},
        data_start_at=START,
        data_end_at=START,
        at=START,
        by=by,
    ).id


def test_a_vehicle_is_kept_once(store):
    write(store, lambda session: add_vehicle(session, vehicle()))
    with pytest.raises(VehicleExistsError, match="mine"):
        write(store, lambda session: add_vehicle(session, vehicle()))
    assert read(store, list_vehicles) == [vehicle()]
    assert read(store, lambda session: get_vehicle(session, "other")) is None


def test_a_whatif_lists_without_its_result_and_is_read_with_it(store):
    made = write(store, lambda s: add_whatif(s, "mini-1", at=START, by="ann", **WHATIF))
    job = write(store, lambda s: add_job(s, "whatif", at=START, by="ann"))
    write(store, lambda s: set_whatif_job(s, made.id, job.id))
    write(store, lambda s: end_whatif(s, made.id, "done", at=START, message="", result={"a": 1}))
    (listed,) = read(store, lambda s: list_whatifs(s, "mini-1"))
    assert (listed.state, listed.job, listed.result) == ("done", job.id, None)
    assert read(store, lambda s: get_whatif(s, made.id)).result == {"a": 1}
    assert read(store, lambda s: list_whatifs(s, "mini-1", before=made.id)) == []


def test_at_most_one_whatif_of_a_robot_is_shown(store):
    ids = [
        write(store, lambda s: add_whatif(s, "mini-1", at=START, by="ann", **WHATIF)).id
        for _ in range(2)
    ]
    for whatif in ids:
        write(store, lambda s, whatif=whatif: show_whatif(s, "mini-1", whatif, (1.0, 2.0, 0.0)))
    (shown,) = read(store, shown_whatifs)
    assert (shown.id, shown.shown_from) == (ids[1], (1.0, 2.0, 0.0))
    write(store, lambda s: show_whatif(s, "mini-1", None, None))
    assert read(store, shown_whatifs) == []


def test_a_whatif_of_another_robot_is_not_shown(store):
    write(store, lambda s: add_robot(s, robot_record("grace-1", 2)))
    made = write(store, lambda s: add_whatif(s, "mini-1", at=START, by="ann", **WHATIF))
    with pytest.raises(UnknownIdError):
        write(store, lambda s: show_whatif(s, "grace-1", made.id, (0.0, 0.0, 0.0)))


def test_studies_left_behind_are_interrupted(store):
    whatif = write(store, lambda s: add_whatif(s, "mini-1", at=START, by="ann", **WHATIF)).id
    search = write(store, begun)
    write(store, lambda s: interrupt_whatifs(s, START, "stopped"))
    assert write(store, lambda s: interrupt_identifications(s, START, "stopped")) == [search]
    assert read(store, lambda s: get_whatif(s, whatif)).state == "interrupted"
    assert read(store, lambda s: get_identification(s, search)).state == "interrupted"
    assert write(store, lambda s: interrupt_identifications(s, START, "stopped")) == []


def test_a_checkpoint_holds_until_there_is_a_result(store):
    search = write(store, begun)
    assert not read(store, lambda s: get_identification(s, search)).has_checkpoint
    curve = [{"iteration": 1, "cost": 2.0}]
    write(
        store,
        lambda s: keep_checkpoint(
            s, search, checkpoint={"x": [1.0]}, convergence=curve, progress=0.5, message="half"
        ),
    )
    found = read(store, lambda s: get_identification(s, search))
    assert (found.has_checkpoint, found.convergence, found.progress) == (True, curve, 0.5)
    assert read(store, lambda s: get_checkpoint(s, search)) == {"x": [1.0]}
    write(
        store,
        lambda s: end_identification(
            s, search, "done", at=START, message="", convergence=curve, result={"r": 1}
        ),
    )
    ended = read(store, lambda s: get_identification(s, search))
    assert (ended.has_checkpoint, ended.progress, ended.result) == (False, 1.0, {"r": 1})
    assert read(store, lambda s: list_identifications(s, "mini-1"))[0].result is None


def test_a_search_that_goes_on_is_running_again(store):
    search = write(store, begun)
    write(store, lambda s: interrupt_identifications(s, START, "stopped"))
    job = write(store, lambda s: add_job(s, "identification", at=START, by="ann"))
    assert write(store, lambda s: reopen_identification(s, search))
    assert not write(store, lambda s: reopen_identification(s, search))
    write(store, lambda s: set_identification_job(s, search, job.id))
    write(store, lambda s: accept_identification(s, search, "mini-b"))
    found = read(store, lambda s: get_identification(s, search))
    assert (found.state, found.job, found.ended_at) == ("running", job.id, None)
    assert found.accepted_vehicle == "mini-b"
    with pytest.raises(AcceptedAlreadyError, match="as mini-b"):
        write(store, lambda s: accept_identification(s, search, "mini-c"))


@pytest.mark.parametrize("identity", ["identification-9", "whatif-1", "identification-x"])
def test_an_unknown_search_is_named(store, identity):
    with pytest.raises(UnknownIdError, match=identity):
        read(store, lambda s: get_identification(s, identity))
    with pytest.raises(UnknownIdError, match=identity):
        write(
            store,
            lambda s: keep_checkpoint(
                s, identity, checkpoint={}, convergence=[], progress=0.0, message=""
            ),
        )


def test_an_advice_remembers_who_took_it(store):
    def add(session):
        (deployment,) = list_deployments(session)
        return add_advice(
            session,
            "mini-1",
            deployment.id,
            trim_version='"config-1"',
            document={"dives": 3},
            at=START,
            by="ann",
        )

    advice = write(store, add)
    assert advice.accepted_by is None
    write(store, lambda s: accept_advice(s, advice.id, 0.5, at=START, by="bob"))
    taken = read(store, lambda s: get_advice(s, advice.id))
    assert (taken.accepted_by, taken.accepted_share, taken.robot) == ("bob", 0.5, "mini-1")
    with pytest.raises(UnknownIdError):
        read(store, lambda s: get_advice(s, "advice-9"))


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
