"""The thesis's formula: right in air, far off under water."""

import numpy as np
import pytest

from autonomy.vision.camera import Rig
from autonomy.vision.fix import find_robot
from autonomy.vision.rigid import Pose, turned_by_rad
from autonomy.vision.thesis_formula import formula_pose
from tests.autonomy.vision.tank import ROBOT, overhead_cameras, random_pose, see, tank_layout

CAMERAS, LAYOUT = overhead_cameras(), tank_layout()
FLOOR = [tag for tag in LAYOUT.tags if tag.id < 120]


def test_in_air_with_exact_corners_the_formula_is_exact():
    rng = np.random.default_rng(0)
    dry = {"level_m": 2.0, "noise": 0.0, "edge_share": 0.0}
    pose = Pose.of_angles([2.3, 1.5, 0.4], 0.1, -0.2, 1.0)
    seen = see(CAMERAS, ROBOT.tags, pose, rng, **dry)
    seen += see(CAMERAS, FLOOR, Pose.identity(), rng, **dry)
    found = formula_pose(Rig(CAMERAS, level_m=2.0), LAYOUT, ROBOT, seen)
    assert found.position_m == pytest.approx(pose.position_m, abs=1e-6)
    assert turned_by_rad(found.rotation, pose.rotation) < 1e-5
    assert formula_pose(Rig(CAMERAS, level_m=2.0), LAYOUT, ROBOT, seen[:2]) is None


def test_one_least_squares_is_ten_times_better_under_water():
    rng = np.random.default_rng(1)
    ours, theirs = [], []
    for _ in range(40):
        pose = random_pose(rng, float(rng.uniform(0.0, 1.12)))
        seen = see(CAMERAS, ROBOT.tags, pose, rng)
        floor = see(CAMERAS, FLOOR, Pose.identity(), rng)
        fix = find_robot(Rig(CAMERAS), ROBOT.tags, seen)
        formula = formula_pose(Rig(CAMERAS), LAYOUT, ROBOT, [*seen, *floor])
        ours.append(np.linalg.norm(fix.pose.position_m - pose.position_m))
        theirs.append(np.linalg.norm(formula.position_m - pose.position_m))
    assert np.mean(theirs) > 10.0 * np.mean(ours)
