"""Smoothed samples, their track, and comparisons in the database."""

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from db.fault import UnknownIdError
from db.query.fleet.robots import add_robot
from db.query.measured.sample_places import sample_places
from db.query.measured.samples import count_since, sample_columns
from db.query.measured.smoothing import (
    SmoothedPlace,
    keep_smoothed,
    newest_fix,
    newest_sample,
    note_smoothed,
    track_columns,
    unsmoothed_from,
)
from db.query.mission.studies import get_arrays, get_study, list_studies, replace_study
from robot_link.messages import RobotId
from tests.db.conftest import START, report, robot_record, sample

OTHER = RobotId("mini-2")


def write(store, function):
    return store.change(function).result(60)


def read(store, function):
    with store.read() as session:
        return function(session)


def at(second):
    return START + timedelta(seconds=second)


def place(sequence, east_m=0.9, std_m=0.01):
    return SmoothedPlace(7, sequence, (1.0, east_m, 0.2), std_m)


def columns(store, robots="mini-1"):
    return read(store, lambda session: sample_columns(session, robots, "blue_light"))


def test_smoothed_places_stand_beside_the_robots_own_word(store):
    store.append([sample(i) for i in range(3)]).result(60)
    write(store, lambda session: keep_smoothed(session, "mini-1", [place(1)]))
    found = columns(store)
    assert found.position_ned[:, 1].tolist() == [0.5, 0.5, 0.5]
    assert found.smoothed_ned[:, 1].tolist() == [0.5, 0.9, 0.5]
    assert found.smoothed_std_m.tolist() == [0.03, 0.01, 0.03]
    assert found.is_smoothed.tolist() == [False, True, False]
    places = read(store, lambda session: sample_places(session, "mini-1", "blue_light"))
    np.testing.assert_array_equal(places.position_ned, found.smoothed_ned)
    assert places.is_smoothed.tolist() == [False, True, False]


def test_place_that_is_kept_twice_is_the_newer_one(store):
    store.append([sample(0)]).result(60)
    for east_m in (0.7, 0.8):
        write(
            store,
            lambda session, east_m=east_m: keep_smoothed(session, "mini-1", [place(0, east_m)]),
        )
    assert columns(store).smoothed_ned[:, 1].tolist() == [0.8]


def test_place_of_a_sample_that_is_not_there_is_refused_with_all_others(store):
    store.append([sample(0)]).result(60)
    with pytest.raises(UnknownIdError, match="5 of log 7"):
        write(store, lambda session: keep_smoothed(session, "mini-1", [place(0), place(5)]))
    assert not columns(store).is_smoothed.any()


def test_samples_of_two_robots_come_in_one_order_of_time(store):
    write(
        store,
        lambda session: add_robot(session, replace(robot_record("mini-2", 1), system_id=5)),
    )
    store.append([sample(i, robot=robot) for robot in ("mini-1", "mini-2") for i in (0, 2)])
    store.append([sample(1, robot="mini-2")]).result(60)
    found = columns(store, ("mini-2", "mini-1"))
    assert np.all(np.diff(found.measured_at_us) >= 0)
    assert sorted(found.robot[:2].tolist()) == [0, 1]
    assert found.robot[2] == 0
    assert np.count_nonzero(found.robot == 0) == 3
    with pytest.raises(UnknownIdError):
        columns(store, ("mini-1", "nobody"))
    assert len(columns(store, ())) == 0


def unseen(store):
    return read(store, lambda session: unsmoothed_from(session, "mini-1"))


def look(store, begin, end, numbers):
    """Keep what a look from one second to another found, as the station does."""

    def keep(session):
        keep_smoothed(session, "mini-1", [place(number) for number in numbers])
        note_smoothed(session, "mini-1", at(begin), at(end))

    write(store, keep)


def test_what_was_not_looked_at_is_known_without_a_search(store):
    assert unseen(store) is None
    store.append([sample(i) for i in range(6)]).result(60)
    assert unseen(store) == at(0)
    look(store, 0, 3, range(4))
    assert unseen(store) == at(4)
    look(store, 4, 9, (4, 5))
    assert unseen(store) is None
    store.append([sample(5)]).result(60)
    assert unseen(store) is None, "a sample that came again is none to look at"
    store.append([sample(8)]).result(60)
    assert unseen(store) == at(8)


def test_sample_that_came_while_others_were_looked_at_is_looked_at_next(store):
    store.append([sample(i) for i in (0, 1, 3, 4)]).result(60)
    store.append([sample(2)]).result(60)
    look(store, 0, 3, (0, 1, 3))
    assert unseen(store) == at(2)
    look(store, 2, 3, (2,))
    assert unseen(store) == at(4)


def test_earlier_sample_is_not_passed_over_by_a_look_that_began_after_it(store):
    store.append([sample(i) for i in (5, 6)]).result(60)
    store.append([sample(1)]).result(60)
    look(store, 5, 7, (5, 6))
    assert unseen(store) == at(1)
    look(store, 1, 7, (1,))
    assert unseen(store) is None


def test_newest_sample_of_all_channels_is_found(store):
    assert read(store, lambda session: newest_sample(session, "mini-1")) is None
    store.append([sample(3), replace(sample(5), variable="salinity"), sample(4)]).result(60)
    assert read(store, lambda session: newest_sample(session, "mini-1")) == at(5)


def test_track_is_what_reports_and_samples_say_together(store):
    fixes = (0, 9)
    store.append([report(i, has_fix=i in fixes) for i in (0, 3, 6, 9)]).result(60)
    store.append([sample(i) for i in (1, 4, 12)]).result(60)
    track = read(store, lambda s: track_columns(s, "mini-1", at(0), at(9), 100))
    seconds = (track.measured_at_us - track.measured_at_us[0]) // 1_000_000
    assert seconds.tolist() == [0, 1, 3, 4, 6, 9]
    assert track.is_sample.tolist() == [False, True, False, True, False, False]
    assert track.has_fix.tolist() == [True, False, False, False, False, True]
    cut = read(store, lambda s: track_columns(s, "mini-1", None, at(9), 3))
    assert cut.measured_at_us.tolist() == track.measured_at_us[:3].tolist()
    assert read(store, lambda s: newest_fix(s, "mini-1")) == at(9)
    assert read(store, lambda s: newest_fix(s, "mini-1", before=at(9))) == at(0)
    assert read(store, lambda s: newest_fix(s, "mini-1", before=at(0))) is None


def test_samples_that_were_taken_after_a_moment_are_counted(store):
    store.append([sample(i) for i in range(5)]).result(60)
    count = read(store, lambda s: count_since(s, ("mini-1",), "blue_light", at(2)))
    assert count == 2


def test_newest_comparison_takes_the_place_of_the_one_before(store):
    asked = {"asked": {"variable": "blue_light"}, "at": START, "by": "ann"}
    first = {**asked, "result": {"samples": 3}, "arrays": b"a"}
    newer = {**asked, "result": {"samples": 5}, "arrays": b"b"}
    for found in (first, newer):
        write(store, lambda s, found=found: replace_study(s, "comparison", "mini-1", **found))
    (kept,) = read(store, lambda s: list_studies(s, "comparison", "mini-1"))
    assert read(store, lambda s: get_study(s, "comparison", kept.id)).result == {"samples": 5}
    assert read(store, lambda s: get_arrays(s, "comparison", kept.id)) == b"b"
    with pytest.raises(UnknownIdError):
        write(store, lambda s: replace_study(s, "comparison", "nobody", **first))
