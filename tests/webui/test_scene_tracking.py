import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.frames import ned_to_enu
from autonomy.site import TANK
from tests.webui.fake_source import NOON, FakeSource
from webui.scene.projection import VIEW_WIDTH, Projection
from webui.scene.server import RobotScene
from webui.scene.source import TargetHypothesis, TargetView
from webui.scene.target import semi_axes

PROJECTION = Projection.of_site(TANK)
STD_95 = 2.4477
LIKELY = TargetHypothesis((1.4, 0.7, 0.2), (0.04, 0.0, 0.01), 0.8)
MIRRORED = TargetHypothesis((0.6, 0.9, 0.2), (0.09, 0.02, 0.05), 0.2)
SEEN = TargetView(
    measured_at=NOON,
    robot_ned=(1.0, 0.5, 0.0),
    hypotheses=(LIKELY, MIRRORED),
    range_m=0.5,
    true_ned=(1.38, 0.72, 0.2),
    is_old=False,
)


@pytest.fixture
def source():
    source = FakeSource()
    source.followed = SEEN
    return source


@pytest.fixture
def scene(source):
    scene = RobotScene(source)
    scene.update()
    yield scene
    scene.stop()


def layer(scene):
    return next(one for one in scene.state.layers if one.key == "target")


def in_view(position_ned):
    return PROJECTION.point(np.array(position_ned), 1.0)


def test_each_hypothesis_is_drawn_where_the_robot_believes_its_target(scene):
    target = scene._target
    for estimate, hypothesis in zip(target._estimates, SEEN.hypotheses, strict=True):
        assert estimate.mark.visible
        assert estimate.mark.position == pytest.approx(in_view(hypothesis.position_ned), abs=1e-6)
    assert target._true.position == pytest.approx(in_view(SEEN.true_ned), abs=1e-6)
    assert target._estimates[0].mark.scale > target._estimates[1].mark.scale, "the likelier one"


def test_ellipse_has_the_axes_of_the_covariance(scene):
    ellipse = scene._target._estimates[0].ellipse
    long, short, flat = ellipse.scale
    assert long == pytest.approx(STD_95 * 0.2 * PROJECTION.view_per_m)
    assert short == pytest.approx(STD_95 * 0.1 * PROJECTION.view_per_m)
    assert flat < 0.01 * VIEW_WIDTH
    # Its longer axis points north, the y axis of the view.
    w, _, _, z = ellipse.wxyz
    assert 2.0 * math.atan2(z, w) == pytest.approx(math.pi / 2)


def test_semi_axes_agree_with_the_eigenvectors_of_the_covariance():
    rng = np.random.default_rng(7)
    for _ in range(200):
        root = rng.normal(size=(2, 2))
        east_north = root @ root.T
        (ee, ne), (_, nn) = east_north
        major_m, minor_m, angle = semi_axes((nn, ne, ee))
        values = np.linalg.eigvalsh(east_north)
        assert (minor_m, major_m) == pytest.approx(STD_95 * np.sqrt(values))
        along = np.array([math.cos(angle), math.sin(angle)])
        assert east_north @ along == pytest.approx(values[1] * along)


def test_range_ring_lies_around_the_robot(scene):
    ring = scene._target._ring
    assert ring.visible
    assert ring.position == pytest.approx(in_view(SEEN.robot_ned), abs=1e-6)
    assert ring.scale[:2] == pytest.approx([0.5 * PROJECTION.view_per_m] * 2)
    assert np.linalg.norm(ring.points[:, :, :2], axis=-1) == pytest.approx(1.0)


def test_line_of_sight_leads_from_the_robot_to_the_likeliest_estimate(scene):
    wanted = [in_view(SEEN.robot_ned), in_view(LIKELY.position_ned)]
    assert scene._target._sight.points[0] == pytest.approx(np.array(wanted), abs=1e-5)


def test_a_new_report_moves_the_nodes_and_makes_none(scene, source):
    target = scene._target
    nodes = [*(one.mark for one in target._estimates), target._ring, target._sight, target._true]
    source.followed = replace(SEEN, hypotheses=(replace(LIKELY, position_ned=(1.5, 0.6, 0.2)),))
    scene.update()
    again = [*(one.mark for one in target._estimates), target._ring, target._sight, target._true]
    assert all(one is other for one, other in zip(nodes, again, strict=True))
    assert nodes[0].position == pytest.approx(in_view((1.5, 0.6, 0.2)), abs=1e-6)
    assert not nodes[1].visible, "one hypothesis was given up"


def test_an_old_report_turns_grey_and_shows_no_range(scene, source):
    mark = scene._target._estimates[0].mark
    alive = tuple(mark.color)
    source.followed = replace(SEEN, is_old=True, range_m=None)
    scene.update()
    assert tuple(mark.color) != alive
    assert not scene._target._ring.visible
    source.followed = SEEN
    scene.update()
    assert tuple(mark.color) == alive


def test_nothing_is_drawn_of_a_robot_that_follows_nothing(scene, source):
    assert layer(scene).has_content
    source.followed = None
    scene.update()
    target = scene._target
    nodes = [target._true, target._ring, target._sight]
    nodes += [node for one in target._estimates for node in (one.mark, one.ellipse)]
    assert not any(node.visible for node in nodes)
    assert not layer(scene).has_content


def test_a_real_target_has_no_true_place(scene, source):
    source.followed = replace(SEEN, true_ned=None)
    scene.update()
    assert not scene._target._true.visible


def test_an_estimate_that_diverged_is_drawn_no_larger_than_the_view_takes(scene, source):
    far = TargetHypothesis((300.0, -900.0, 0.0), (1e8, 0.0, 1e8), 1.0)
    source.followed = replace(SEEN, hypotheses=(far,), range_m=1e6)
    scene.update()
    assert max(scene._target._estimates[0].ellipse.scale) <= 2.0 * VIEW_WIDTH
    assert max(scene._target._ring.scale) <= 2.0 * VIEW_WIDTH


def test_the_layer_switches_all_of_it_off(scene, source):
    source.followed_path = np.array([[1.0, 0.5, 0.0], [1.5, 0.7, 0.0]])
    scene.change({"layers": {"target": False}})
    assert not scene._target._estimates[0].mark.visible
    source.followed = replace(SEEN, range_m=0.7)
    scene.update()
    assert not scene._target._ring.visible
    assert not layer(scene).visible
    scene.change({"layers": {"target": True}})
    assert scene._target._ring.visible


def test_path_of_a_virtual_target_is_drawn_once_and_goes_with_its_plan(scene, source):
    path = np.array([[1.0, 0.5, 0.1], [1.5, 0.7, 0.1], [1.6, 0.9, 0.1]])
    source.followed, source.followed_path = None, path
    scene.update()
    drawn = scene._stage._nodes["target/path"]
    enu = ned_to_enu(path)
    points = drawn.points.reshape(-1, 3)
    assert (points >= enu.min(axis=0) - 1e-5).all()
    assert (points <= enu.max(axis=0) + 1e-5).all()
    scene.update()
    assert scene._stage._nodes["target/path"] is drawn
    assert layer(scene).has_content
    source.followed_path = None
    scene.update()
    assert "target/path" not in scene._stage._nodes


def test_target_stays_where_it_is_when_depth_is_stretched(scene):
    before = tuple(scene._target._estimates[0].mark.position)
    scene.change({"exaggeration": 3.0})
    after = scene._target._estimates[0].mark.position
    assert tuple(after[:2]) == pytest.approx(before[:2])
    assert after[2] == pytest.approx(3.0 * before[2])


def test_the_legend_explains_the_marks_that_are_drawn_and_no_other(scene, source):
    told = scene.state.target_legend
    for mark in ("orange dot in its ellipse", "95 %", "second hypothesis", "newest range", "true"):
        assert mark.lower() in told.lower()
    assert "dashed" not in told
    source.followed = replace(SEEN, hypotheses=(LIKELY,), range_m=None, true_ned=None, is_old=True)
    scene.update()
    assert scene.state.target_legend == (
        "Target. Grey dot in its ellipse: where the robot believes it, with 95 %."
    )
    source.followed, source.followed_path = None, np.array([[1.0, 0.5, 0.0], [1.5, 0.7, 0.0]])
    scene.update()
    assert scene.state.target_legend == "Target. Dashed line: where the virtual target goes."
    scene.change({"layers": {"target": False}})
    assert scene.state.target_legend == ""


def test_viser_own_panel_has_the_legend_too(scene):
    scene.update()
    assert scene.state.target_legend in scene._panel._legend.content


def test_a_mission_for_teaching_is_marked_at_its_target(scene, source):
    label = scene._target._teaching
    assert not label.visible
    source.followed = replace(SEEN, is_barrier_on=False)
    scene.update()
    assert label.visible
    assert label.position[:2] == pytest.approx(in_view(LIKELY.position_ned)[:2], abs=1e-6)
    assert scene.state.target_legend.endswith("Teaching: the barrier is off.")
    source.followed = replace(SEEN, is_barrier_on=False, hypotheses=())
    scene.update()
    assert label.position[:2] == pytest.approx(in_view(SEEN.robot_ned)[:2], abs=1e-6)
    scene.change({"layers": {"target": False}})
    assert not label.visible
