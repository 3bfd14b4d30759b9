"""Table 3.3 with poses by cameras over the tank in place of the thesis's."""

import numpy as np
import pytest

from autonomy.site import TANK
from reproduction import table_3_3_cameras
from reproduction.camera_poses import laboratory, pose_errors
from reproduction.catalogue import REPRODUCTIONS
from reproduction.result import Row
from server.cli.main import main

HORIZONTAL, PITCH = 1, 2
PROPOSED, BASELINE, PID = range(3)


def silent(done, doing):
    assert 0.0 <= done <= 1.0
    assert doing


@pytest.fixture(scope="module")
def sets():
    return {each.title: each for each in table_3_3_cameras.camera_sets(5, silent, trials=2)}


def test_cameras_tell_the_pose_far_better_than_the_poses_of_the_thesis(sets):
    for each in sets.values():
        across = np.sqrt(np.mean(each.off[:, :, :2] ** 2))
        assert 0.0 < across < 0.005
        assert across < 0.1 * np.sqrt(np.mean(each.pose_off[:, :, :2] ** 2))
        heading = np.sqrt(np.mean(each.off[:, :, 5] ** 2))
        assert heading < 0.5 * np.sqrt(np.mean(each.pose_off[:, :, 5] ** 2))
        assert each.found > 0.95


def test_fixes_from_drawn_pictures_are_off_by_as_much_as_those_from_drawn_corners(sets):
    pytest.importorskip("pyapriltags")
    drawn = sets["diagonal"]
    assert len(drawn.in_pictures) >= 0.9 * table_3_3_cameras.PICTURED
    by_corners = np.sqrt(np.mean(drawn.off[..., :2] ** 2))
    by_pictures = np.sqrt(np.mean(drawn.in_pictures[:, :2] ** 2))
    assert 0.4 * by_corners < by_pictures < 2.5 * by_corners


def test_with_better_poses_no_controller_is_farther_off(sets):
    for each in sets.values():
        by_poses = each.by_poses[:, :, HORIZONTAL].mean(axis=1)
        by_cameras = each.by_cameras[:, :, HORIZONTAL].mean(axis=1)
        assert (by_cameras < 1.03 * by_poses).all()


def test_a_slow_mass_makes_the_pids_pitch_swing_by_cameras_too(sets):
    slow, nominal = (
        sets[f"figure of eight{variant}"].by_cameras[PID, :, PITCH].mean()
        for variant in (table_3_3_cameras.SHOWN, "")
    )
    assert slow > 2.0 * nominal


def test_every_number_by_cameras_stands_beside_that_by_poses_and_the_thesis_s(sets):
    rows: list[Row] = table_3_3_cameras._rows(sets["figure of eight"])
    cells = {(row.row, row.column): row for row in rows}
    for (name, column), row in cells.items():
        if name.endswith("error, by cameras"):
            beside = cells[name.replace("by cameras", "by poses"), column]
            assert row.thesis == beside.thesis
            assert row.thesis is not None
    assert "table-3.3-cameras" in REPRODUCTIONS


def test_a_robot_out_of_every_picture_keeps_the_error_of_its_last_fix():
    known = laboratory(2)
    water = TANK.water
    middle = [0.5 * (water.x_min_m + water.x_max_m), 0.5 * (water.y_min_m + water.y_max_m), 0.4]
    far = [50.0, 50.0, 0.4]
    states = np.array([[*place, 0.0, 0.1, 0.5] for place in (middle, middle, far, far)])
    errors, found = pose_errors(known, states, 1)
    assert found == 0.5
    assert (errors[2:] == errors[1]).all()
    assert np.abs(errors[:2, :3]).max() < 0.01


def test_only_a_table_that_has_cameras_is_reproduced_with_them(capsys):
    assert main(["reproduce", "table-3.1", "--cameras"]) == 2
    assert "Cameras are only for table-3.3." in capsys.readouterr().err
