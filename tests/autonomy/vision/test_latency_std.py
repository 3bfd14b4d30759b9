"""A camera whose latency is not exactly known does not know exactly where a moving robot is."""

from dataclasses import replace

import numpy as np
import pytest

from autonomy.vision.camera import Rig
from autonomy.vision.fix import Fix, find_robot
from autonomy.vision.rigid import Pose
from server.camera.used_rig import UsedRig
from server.camera.vision import rig_document, rig_of, with_exact
from tests.autonomy.vision.tank import ROBOT, overhead_cameras, see, tank_layout

CAMERA = overhead_cameras()[1]
STD_S, SPEED_M_S = 0.05, 0.2
BODY = Pose.of_angles([2.3, 1.5, 0.4], 0.0, 0.0, 0.6)


def considered_m2(latency_std_s, velocity):
    rig = Rig((replace(CAMERA, latency_std_s=latency_std_s),))
    seen = see(rig.cameras, ROBOT.tags, BODY, np.random.default_rng(3))
    fix = find_robot(rig, ROBOT.tags, seen, guess=BODY, velocity_ned_m_s=velocity)
    assert isinstance(fix, Fix)
    return fix.considered_covariance[:3, :3]


def test_what_a_robot_makes_meanwhile_is_in_the_part_that_does_not_average_out():
    east = (0.0, SPEED_M_S, 0.0)
    more = considered_m2(STD_S, east) - considered_m2(0.0, east)
    assert more[1, 1] == pytest.approx((SPEED_M_S * STD_S) ** 2, rel=0.05)
    assert abs(more[0, 0]) < 0.05 * more[1, 1]
    still = (0.0, 0.0, 0.0)
    assert considered_m2(STD_S, still) == pytest.approx(considered_m2(0.0, still))


def test_cameras_that_are_used_know_how_well_their_latency_was_measured():
    rig = Rig((CAMERA,))
    document = rig_document(rig, {CAMERA.name: 1}, tank_layout(), 1.0, {})
    late = {CAMERA.name: STD_S}
    used = UsedRig(1, document, with_exact(rig), (CAMERA.name,), 0.0, latency_std_s=late)
    assert rig_of(used).cameras[0].latency_std_s == STD_S
