from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest
from sqlalchemy.orm import Session

from db.fault import UnknownIdError
from db.query.camera.calibrations import (
    add_calibration,
    get_calibration,
    list_calibrations,
    rig_in_use,
    use_rig,
)
from db.query.camera.cameras import (
    CameraChangedError,
    CameraExistsError,
    add_camera,
    change_camera,
    get_camera,
    list_cameras,
    remove_camera,
)
from db.query.camera.fixes import add_fixes, list_fixes, mark_sent, newest_fix
from db.query.camera.tag_sets import (
    TagsChangedError,
    add_tag_set,
    newest_tag_set,
)
from robot_link.camera.fix import CameraFix
from tests.db.conftest import START, robot_record

URI = "http://127.0.0.1:8600/camera/tank-1?fps=10"
FIX = CameraFix(
    robot=robot_record().id,
    measured_at=START,
    ned_m=(1.402, 0.713, 0.482),
    covariance_m2=(1.4e-6, 0.0, 0.0, 1.5e-6, 0.0, 1.7e-6),
    considered_covariance_m2=(1.0e-6, 0.0, 0.0, 1.0e-6, 0.0, 1.0e-6),
    heading_rad=0.801,
    heading_std_rad=0.004,
    roll_rad=None,
    pitch_rad=-0.35,
    tilt_std_rad=0.011,
    cameras=("tank-1", "tank-2"),
    tags=(0, 2),
    rms=1.2,
    quality="good",
    reason="",
    calibration=None,
)


def in_turn(store, function):
    """Call a query in a transaction of its own, as the station does."""
    return store.change(function).result(60)


def test_a_change_from_an_older_version_is_refused(store):
    in_turn(store, lambda session: add_camera(session, "tank-1", URI, at=START, by="Ada"))

    def change(version: int):
        return lambda session: change_camera(
            session, "tank-1", {"latency_s": 0.05}, at=START, version=version
        )

    assert in_turn(store, change(1)).version == 2
    with pytest.raises(CameraChangedError):
        in_turn(store, change(1))
    with pytest.raises(CameraExistsError):
        in_turn(store, lambda session: add_camera(session, "tank-1", URI, at=START, by="Ada"))


def test_a_camera_of_a_removed_ones_id_has_nothing_of_its_calibrations(store):
    def story(session: Session) -> tuple[list, list]:
        first = add_camera(session, "tank-1", URI, at=START, by="Ada")
        add_calibration(
            session,
            "lens",
            result={"kind": "pinhole"},
            covariance=np.eye(9),
            inputs={},
            at=START,
            by="Ada",
            camera_key=first.key,
        )
        before = list_calibrations(session, first.key)
        remove_camera(session, "tank-1")
        session.flush()
        assert list_cameras(session) == []
        second = add_camera(session, "tank-1", URI, at=START, by="Ada")
        return before, list_calibrations(session, second.key)

    before, after = in_turn(store, story)
    assert [one.kind for one in before] == ["lens"]
    assert after == []
    with pytest.raises(UnknownIdError):
        in_turn(store, lambda session: get_camera(session, "tank-9"))


def test_a_calibration_keeps_its_covariance_to_the_last_bit(store):
    covariance = np.random.default_rng(3).standard_normal((17, 17))

    def keep(session: Session) -> int:
        tags = add_tag_set(session, {"tags": []}, (), at=START, by="Ada")
        assert rig_in_use(session) is None
        made = add_calibration(
            session,
            "rig",
            result={},
            covariance=covariance,
            inputs={},
            at=START,
            by="Ada",
            tag_set_key=tags.key,
        )
        use_rig(session, made.key)
        return made.key

    key = in_turn(store, keep)
    assert np.array_equal(
        in_turn(store, lambda session: get_calibration(session, key)).covariance, covariance
    )
    assert in_turn(store, rig_in_use).key == key


def test_newer_tags_follow_those_that_were_seen(store):
    def put(count: int, follows: int | None):
        layout = {"tags": [{"id": 100 + i} for i in range(count)]}
        return lambda session: add_tag_set(
            session, layout, ({"robot": "mini-1", "tags": []},), at=START, by="Ada", follows=follows
        )

    first = in_turn(store, put(1, 0))
    second = in_turn(store, put(2, first.key))
    assert in_turn(store, newest_tag_set) == second
    with pytest.raises(TagsChangedError):
        in_turn(store, put(3, first.key))


def test_a_fix_comes_back_as_it_was_kept(store):
    def keep(session: Session) -> None:
        add_fixes(session, [(FIX, START + timedelta(milliseconds=90))])
        mark_sent(session, "mini-1", START, START + timedelta(seconds=1))

    in_turn(store, keep)
    found = in_turn(store, lambda session: newest_fix(session, "mini-1"))
    assert found.fix == FIX
    assert found.received_at == START + timedelta(milliseconds=90)
    assert found.sent_at == START + timedelta(seconds=1)


def test_many_fixes_are_thinned_to_what_was_asked_for_and_the_newest_stays(store):
    fixes = [
        (replace(FIX, measured_at=START + timedelta(seconds=0.2 * i)), START) for i in range(101)
    ]
    refused = replace(FIX, measured_at=START + timedelta(seconds=60), quality="refused")

    def keep(session: Session) -> None:
        add_fixes(session, [*fixes, (refused, START)])

    in_turn(store, keep)
    some = in_turn(store, lambda session: list_fixes(session, "mini-1", max_points=10))
    assert 5 < len(some) <= 10
    assert some[-1].fix == refused
    taken = in_turn(store, lambda session: newest_fix(session, "mini-1", is_taken=True))
    assert taken.fix.measured_at == fixes[-1][0].measured_at
    within = in_turn(
        store,
        lambda session: list_fixes(
            session, "mini-1", START + timedelta(seconds=1), START + timedelta(seconds=2)
        ),
    )
    assert [one.fix.measured_at for one in within] == [at.measured_at for at, _ in fixes[5:11]]
