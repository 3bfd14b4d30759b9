"""Where cameras see tags: kernel against the readable optics, and all derivatives."""

import numpy as np
import pytest

from autonomy.vision.camera import Camera, Rig
from autonomy.vision.constants import CAMERA_ERRORS
from autonomy.vision.lens import Lens
from autonomy.vision.reference import optics
from autonomy.vision.refraction import FlatPort
from autonomy.vision.rigid import Pose
from autonomy.vision.sight import corners_seen, sights
from autonomy.vision.tag import Tag
from tests.autonomy.vision.slopes import finite_differences
from tests.autonomy.vision.tank import looking, overhead_cameras

FISHEYE = Lens("fisheye", 1280, 960, (560.0, 560.0), (640.0, 480.0), (-0.02, 0.004))
OVERHEAD = Camera("tank-1", overhead_cameras()[0].lens, overhead_cameras()[0].pose, edge_px=0.2)
WIDE = Camera("wide", FISHEYE, looking((2.0, 1.5, -2.5), (2.2, 1.6, 0.0)), edge_px=-0.1)
ONBOARD = Camera("own", OVERHEAD.lens, looking((1.0, 1.0, 0.5), (1.8, 1.1, 0.9)), 0.1, FlatPort())
CASES = pytest.mark.parametrize("camera", [OVERHEAD, WIDE, ONBOARD], ids=lambda c: c.name)
TAG = Tag(100, 0.15, (1.6, 1.3, 0.9), 10.0, -20.0, 40.0)
CARRIER = Pose.of_angles([0.2, 0.1, -0.05], 0.1, 0.2, -0.1)


def seen(camera, carrier, level=0.02, index=1.333):
    numbers = np.zeros(1, dtype=np.int64)
    found = sights(camera.packed[None], numbers, [carrier], TAG.corners_m[None], level, index)
    return found.pixels[0], found.slopes[0]


@CASES
def test_kernel_does_what_the_readable_optics_do(camera):
    corners = CARRIER.of_points(TAG.corners_m)
    wanted = optics.corners_seen(camera, corners, 0.02, 1.333)
    assert corners_seen(camera, corners, 0.02, 1.333) == pytest.approx(wanted, abs=1e-8)
    assert seen(camera, CARRIER)[0] == pytest.approx(wanted, abs=1e-8)


@CASES
def test_a_plate_that_is_half_out_of_the_water_is_seen_corner_by_corner(camera):
    corners = Tag(100, 0.2, (1.5, 1.3, 0.6), pitch_deg=60.0).corners_m
    level = 0.6
    assert (corners[:, 2] > level).sum() == 2
    wanted = optics.corners_seen(camera, corners, level, 1.333)
    assert corners_seen(camera, corners, level, 1.333) == pytest.approx(wanted, abs=1e-8)


@CASES
def test_all_slopes_are_those_of_finite_differences(camera):
    def moved(by):
        carrier = CARRIER.moved(by[:3], by[3:6])
        other = camera.moved(by[6:22])
        return seen(other, carrier, 0.02 + by[22], 1.333 + by[23])[0].reshape(8)

    slopes = seen(camera, CARRIER)[1]
    wanted = finite_differences(moved, np.zeros(6 + CAMERA_ERRORS + 2), 1e-4)
    if camera.lens.kind == "fisheye":
        wanted[:, 20] = 0.0  # it has no fifth coefficient
    assert slopes == pytest.approx(wanted, abs=2e-5, rel=1e-6)


def test_a_camera_under_water_without_a_port_sees_nothing():
    under = Camera("wet", OVERHEAD.lens, Pose(OVERHEAD.pose.rotation, np.array([1.0, 1.0, 0.3])))
    assert np.isnan(corners_seen(under, TAG.corners_m, 0.0, 1.333)).all()
    assert np.isnan(corners_seen(OVERHEAD, TAG.corners_m, -3.0, 1.333)).all()


def test_the_edge_moves_corners_inwards_along_both_sides():
    plain = Camera("plain", OVERHEAD.lens, OVERHEAD.pose)
    corners = TAG.corners_m
    inner = corners_seen(OVERHEAD, corners, 0.0, 1.333)
    outer = corners_seen(plain, corners, 0.0, 1.333)
    ahead = outer[1] - outer[0]
    back = outer[3] - outer[0]
    wanted = 0.2 * (ahead / np.linalg.norm(ahead) + back / np.linalg.norm(back))
    assert inner[0] - outer[0] == pytest.approx(wanted)


def test_a_rig_leaves_out_a_camera_and_takes_another_level():
    cameras = overhead_cameras()
    covariance = np.diag(np.arange(1.0, 50.0))
    rig = Rig(cameras, 0.01, covariance)
    assert rig.root @ rig.root.T == pytest.approx(covariance)
    less = rig.without("tank-2")
    assert [camera.name for camera in less.cameras] == ["tank-1", "tank-3"]
    assert np.diag(less.covariance).tolist() == [*range(1, 17), *range(33, 50)]
    assert rig.at_level(-0.02, 0.001).covariance[-1, -1] == pytest.approx(1e-6)
    assert Rig(cameras).at_level(0.0, 0.01).root.shape == (49, 1)
    assert rig.number("tank-3") == 2
    assert rig.number("tank-9") is None
    assert Rig(cameras).without("tank-1").covariance is None


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"index": 1.5}, "index"),
        ({"covariance": np.eye(3)}, "covariance"),
        ({"covariance": np.full((49, 49), np.nan)}, "covariance"),
        ({"covariance": -np.eye(49) + 2.0 * np.ones((49, 49))}, "negative"),
        ({"cameras": (OVERHEAD, OVERHEAD)}, "tank-1 is there twice"),
    ],
)
def test_an_impossible_rig_is_refused(changes, word):
    with pytest.raises(ValueError, match=word):
        Rig(**{"cameras": overhead_cameras(), **changes})


def test_a_camera_without_a_place_is_refused():
    with pytest.raises(ValueError, match="not finite"):
        Camera("x", FISHEYE, Pose(np.eye(3), np.array([0.0, np.nan, 0.0])))
