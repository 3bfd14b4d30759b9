"""What is compiled ahead is what is called: no user waits for a compiler at the first fix."""

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from autonomy.vision import corner_kernel, lens_kernel, pose_kernel, refraction_kernel, sight_kernel
from autonomy.vision.camera import Rig
from autonomy.vision.corner import fit_corners
from autonomy.vision.fix import find_robot
from autonomy.vision.refraction import FlatPort, surface_sights, underwater_rays
from autonomy.vision.rigid import Pose
from autonomy.warm_up import LATER
from tests.autonomy.vision.tank import ROBOT, overhead_cameras, see

ENTRIES = (
    lens_kernel.project,
    lens_kernel.rays,
    refraction_kernel.seen,
    refraction_kernel.into_water,
    refraction_kernel.through_port,
    refraction_kernel.port_rays,
    sight_kernel.views,
    pose_kernel.solve_into,
    corner_kernel.fit_into,
)


def test_each_kernel_is_compiled_once_for_all_its_calls():
    if not isinstance(lens_kernel.rays, Dispatcher):
        pytest.skip("numba is switched off")
    for module in (corner_kernel, lens_kernel, pose_kernel, refraction_kernel, sight_kernel):
        assert module.__name__ in LATER
        module.warm_up()
    cameras = overhead_cameras()
    pose = Pose.of_angles([2.3, 1.5, 0.4], 0.0, 0.1, 1.0)
    find_robot(Rig(cameras), ROBOT.tags, see(cameras, ROBOT.tags, pose, np.random.default_rng(0)))
    cameras[0].lens.project([0.0, 0.0, 1.0])
    surface_sights([0.0, 0.0, -1.0], [[1.0, 1.0, 1.0]])
    underwater_rays(np.array([0.0, 0.0, -1.0]), [0.0, 0.0, 1.0])
    sights, _ = FlatPort().sights([0.1, 0.0, 1.0])
    FlatPort().rays(sights / np.linalg.norm(sights))
    fit_corners(np.zeros((40, 40), dtype=np.uint8), np.zeros((4, 2)))
    assert [len(entry.signatures) for entry in ENTRIES] == [1] * len(ENTRIES)
