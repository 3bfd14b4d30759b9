"""Tags in space, who has which id, and what a wrong document is told."""

import copy

import numpy as np
import pytest

from autonomy.vision.rigid import Pose
from autonomy.vision.tag import (
    CORNERS,
    Bundle,
    Layout,
    Registry,
    Tag,
    bundle_of,
    corners_from_apriltag,
    from_enlarged,
    layout_of,
    planes,
)

BUNDLE = {
    "robot": "mini-1",
    "tags": [
        {"id": 0, "size_m": 0.100, "position_m": [0.02, 0.0, -0.085]},
        {"id": 1, "size_m": 0.080, "position_m": [-0.10, -0.09, -0.06], "roll_deg": -45},
        {"id": 2, "size_m": 0.080, "position_m": [-0.10, 0.09, -0.06], "roll_deg": 45.0},
    ],
}
TANK = {
    "tags": [
        {"id": 100, "size_m": 0.15, "position_m": [1.0, 1.0, 1.2]},
        {"id": 101, "size_m": 0.15, "position_m": [2.0, 1.0, -0.1], "position_std_m": 0.001},
    ]
}


def test_a_tag_that_lies_flat_has_its_top_edge_north():
    corners = Tag(100, 0.2, (1.0, 2.0, 3.0)).corners_m
    assert corners == pytest.approx(
        np.array([[1.1, 1.9, 3.0], [1.1, 2.1, 3.0], [0.9, 2.1, 3.0], [0.9, 1.9, 3.0]])
    )


def test_a_tag_on_the_north_wall_faces_south_with_its_top_edge_up():
    tag = Tag(100, 0.2, (4.0, 2.0, 0.5), pitch_deg=90.0)
    corners = tag.corners_m
    assert corners[:, 0] == pytest.approx(np.full(4, 4.0))
    assert corners[:2, 2] == pytest.approx(np.full(2, 0.4))
    assert tag.pose.rotation[:, 2] == pytest.approx([1.0, 0.0, 0.0])  # into the wall
    assert corners[1, 1] - corners[0, 1] == pytest.approx(0.2)  # who looks north has east right


def test_a_starboard_tag_that_is_canted_faces_up_and_to_starboard():
    normal = -Tag(2, 0.08, (0.0, 0.0, 0.0), roll_deg=45.0).pose.rotation[:, 2]
    assert normal == pytest.approx([0.0, np.sqrt(0.5), -np.sqrt(0.5)])


def test_a_tag_is_told_again_by_its_pose():
    tag = Tag(7, 0.08, (0.1, -0.2, 0.3), 10.0, -30.0, 120.0)
    again = Tag.at_pose(7, 0.08, tag.pose)
    assert again.corners_m == pytest.approx(tag.corners_m)
    assert again.heading_deg == pytest.approx(120.0)


def test_corners_of_the_library_come_in_our_order_and_pixels():
    theirs = [[20.5, 10.5], [10.5, 10.5], [10.5, 20.5], [20.5, 20.5]]
    assert corners_from_apriltag(theirs).tolist() == [[10, 10], [20, 10], [20, 20], [10, 20]]
    assert from_enlarged(-0.25, 2.0) == pytest.approx(-0.375)
    assert from_enlarged(from_enlarged(3.3, 2.0), 0.5) == pytest.approx(3.3)


def test_corners_run_around_the_print_clockwise():
    ahead = np.roll(CORNERS, -1, axis=0) - CORNERS
    assert (np.cross(ahead, np.roll(ahead, -1, axis=0))[:, 2] > 0.0).all()


def test_documents_are_read():
    bundle, layout = bundle_of(BUNDLE), layout_of(TANK)
    registry = Registry(layout, (bundle,))
    assert bundle.tag(1).roll_deg == -45.0
    assert layout.tag(101).position_std_m == 0.001
    assert registry.robot_of(2) is bundle
    assert registry.robot_of(100) is None
    assert registry.is_stranger(3)
    assert not registry.is_stranger(100)
    assert layout.without(100).tag(100) is None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.pop("tags"), r"^tags: is not a list"),
        (lambda d: d["tags"].clear(), r"^tags: there is none"),
        (lambda d: d.update(robot=3), r"^robot: is not a name"),
        (lambda d: d.update(robot=""), r"^robot: has no name"),
        (lambda d: d["tags"].append("x"), r"^tags\[3\]: is not an object"),
        (lambda d: d["tags"][1].update(id=0), r"^tags\[1\].id: 0 is there twice"),
        (lambda d: d["tags"][1].update(id=True), r"^tags\[1\].id: is not a whole"),
        (lambda d: d["tags"][1].update(id=300), r"^tags\[1\].id: 300 is none of a robot"),
        (lambda d: d["tags"][1].update(id=100), r"^tags\[1\].id: 100 is not one of a robot"),
        (lambda d: d["tags"][1].update(id=3), r"^tags\[1\].id: 3 is not one of 0 to 2"),
        (lambda d: d["tags"][2].update(size_m=0), r"^tags\[2\].size_m: 0"),
        (lambda d: d["tags"][2].pop("size_m"), r"^tags\[2\].size_m: is missing"),
        (lambda d: d["tags"][2].update(size_m=float("nan")), r"^tags\[2\].size_m: is not a fin"),
        (lambda d: d["tags"][2].update(position_m=[1, 2]), r"^tags\[2\].position_m: are not"),
        (lambda d: d["tags"][2]["position_m"].__setitem__(1, "a"), r"^tags\[2\].position_m\[1\]"),
        (lambda d: d["tags"][2].update(position_m=[1e9, 0, 0]), r"^tags\[2\].position_m: "),
        (lambda d: d["tags"][0].update(roll_deg=1e9), r"^tags\[0\].roll_deg: "),
        (lambda d: d["tags"][0].update(angle_std_deg=-1), r"^tags\[0\].angle_std_deg: "),
        (lambda d: d["tags"][0].update(yaw_deg=1), r"^tags\[0\].yaw_deg: no tag has"),
    ],
)
def test_a_wrong_document_is_told_where_it_is_wrong(change, words):
    document = copy.deepcopy(BUNDLE)
    change(document)
    with pytest.raises(ValueError, match=words):
        bundle_of(document)


def test_an_id_is_used_once_in_a_site():
    one = bundle_of(BUNDLE)
    other = Bundle("mini-2", (Tag(2, 0.1, (0.0, 0.0, 0.0)),))
    with pytest.raises(ValueError, match=r"mini-2.tags\[0\].id: 2 belongs to mini-1"):
        Registry(Layout(()), (one, other))
    with pytest.raises(ValueError, match="two bundles"):
        Registry(Layout(()), (one, one))
    with pytest.raises(ValueError, match=r"tags\[0\].id: 5 is not one of the tank"):
        Layout((Tag(5, 0.1, (0.0, 0.0, 0.0)),))


def test_tags_of_the_floor_alone_lie_on_one_plane():
    floor = [Tag(100 + i, 0.15, (i % 3, i // 3, 1.2)) for i in range(6)]
    assert planes(floor) == 1
    assert planes(floor[:3]) == 1
    assert planes([*floor, Tag(110, 0.15, (0.0, 1.0, -0.1)), Tag(111, 0.15, (2.0, 1.0, -0.1))]) == 2


def test_a_robot_that_points_north_nose_down_to_starboard_says_so():
    pose = Pose.of_angles([0.0, 0.5, 0.2], 0.0, np.radians(-20.0), 0.0)
    top = pose @ Tag(0, 0.1, (0.02, 0.0, -0.085)).pose
    edge = top.of_points(CORNERS[:2] * 0.1).mean(axis=0) - top.position_m
    assert edge[0] > 0.0  # the top edge is forward, so north
    assert edge[2] > 0.0  # and the nose is down
    assert pose.position_m[1] > 0.0


def test_a_field_that_is_null_is_as_one_that_is_not_told():
    tag = {"id": 100, "size_m": 0.15, "position_m": [0.5, 0.5, 1.2]}
    told = {**tag, "position_std_m": None, "angle_std_deg": None}
    assert layout_of({"tags": [told]}) == layout_of({"tags": [tag]})
