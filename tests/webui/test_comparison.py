"""What-if runs in the 3D scene: drawn as predicted, each controller told apart."""

from dataclasses import replace

import numpy as np
import pytest

from tests.webui.fake_source import FakeSource
from webui.scene.colour import REFERENCE, RUNS, linear
from webui.scene.comparison import dashes
from webui.scene.framing import FIELD_OF_VIEW_RAD, WATER, frame_of
from webui.scene.panel import WHAT_IF
from webui.scene.server import RobotScene
from webui.scene.source import ComparisonTrack


@pytest.fixture
def source():
    source = FakeSource()
    source.compare("Backstepping", "PID")
    return source


@pytest.fixture
def scene(source):
    scene = RobotScene(source)
    scene.update()
    yield scene
    scene.stop()


def nodes(scene):
    return {name: node for name, node in scene._stage._nodes.items() if name.startswith("whatif/")}


def labels(scene):
    names = scene._stage._labels
    return {name: names[name][0] for name in names if name.startswith("whatif/")}


def test_a_reference_and_every_controller_have_a_line_and_a_label_that_says_what_if(scene):
    assert len(nodes(scene)) == 3
    assert [label.text for label in labels(scene).values()] == [
        "what-if: reference", "what-if: Backstepping", "what-if: PID",
    ]  # fmt: skip


def test_controllers_are_told_apart_by_colour(scene):
    shades = [tuple(np.asarray(node.colors).reshape(-1, 3)[0]) for node in nodes(scene).values()]
    assert shades == [tuple(linear(colour)) for colour in (REFERENCE, RUNS[0], RUNS[1])]


def test_labels_of_controllers_do_not_lie_on_one_another(scene):
    places = [np.array(label.position) for label in labels(scene).values()]
    gaps = [np.linalg.norm(a - b) for i, a in enumerate(places) for b in places[:i]]
    assert min(gaps) > 0.5


def test_the_same_comparison_is_drawn_once(scene):
    before = nodes(scene)
    scene.update()
    assert nodes(scene) == before


def test_another_comparison_replaces_the_one_drawn_and_none_clears_it(scene, source):
    source.compare("Backstepping")
    scene.update()
    assert len(nodes(scene)) == len(labels(scene)) == 2
    source.shown_comparison = None
    scene.update()
    assert nodes(scene) == labels(scene) == {}


def test_the_switch_of_the_panel_hides_lines_and_labels(scene, source):
    scene._comparison.show(False)
    assert not any(node.visible for node in nodes(scene).values())
    assert not any(label.visible for label in labels(scene).values())
    source.compare("Backstepping", "PID", "Governor")
    scene.update()
    assert not any(node.visible for node in nodes(scene).values())


def test_the_layers_of_the_panel_name_the_what_if(scene):
    gui = scene._server.gui
    names = {getattr(handle, "label", None) for handle in gui._gui_input_handle_from_uuid.values()}
    assert "What-if" in names


@pytest.fixture
def far_scene(scene, source):
    """A what-if run that goes many waters far, with one controller that loses its way."""
    far = np.linspace([1.0, 0.5, 0.1], [200.0, 0.5, 40.0], 500)
    first, second = source.shown_comparison.runs
    runs = (replace(first, position_ned=far + 1.0), replace(second, position_ned=far * 100.0))
    source.shown_comparison = replace(source.shown_comparison, reference_ned=far, runs=runs)
    scene.update()
    return scene


def sees(frame, points, aspect):
    """Angles of points from a camera's axis, as shares of its half fields of view."""
    axis = frame.look_at - frame.position
    axis = axis / np.linalg.norm(axis)
    right = np.cross(axis, [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    rays = points - frame.position
    ahead = rays @ axis
    half = np.tan(FIELD_OF_VIEW_RAD / 2)
    across = rays @ right / ahead / (half * aspect)
    upward = rays @ np.cross(right, axis) / ahead / half
    return ahead, np.abs(np.stack([across, upward])).max()


@pytest.mark.parametrize("aspect", [0.6, 1.0, 1.8])
def test_a_run_that_leaves_the_water_is_framed_whole_with_its_labels(far_scene, source, aspect):
    points = far_scene._comparison.extent()
    assert far_scene._comparison.leaves_water
    projection = far_scene._stage.projection
    places = [np.array(label.position) for label in labels(far_scene).values()]
    shown = np.array(places) + np.array(projection.offset())
    reference = projection.point(source.shown_comparison.reference_ned, 1.0)
    for wanted in (points, shown, reference):
        ahead, share = sees(frame_of(points, aspect), wanted, aspect)
        assert (ahead > 0.0).all()
        assert share < 0.95


def test_labels_stay_apart_where_tracks_begin_far_from_a_short_reference(scene, source):
    reference = np.linspace([1.0, 0.5, 0.0], [1.2, 0.5, 0.1], 50)
    track = np.linspace([-1.0, -0.5, 0.0], [1.2, 0.5, 0.1], 50)
    runs = tuple(replace(run, position_ned=track) for run in source.shown_comparison.runs)
    source.shown_comparison = replace(
        source.shown_comparison, reference_ned=reference, runs=runs, version="short"
    )
    scene.update()
    first, second = [np.array(label.position) for label in list(labels(scene).values())[1:]]
    assert np.linalg.norm(first - second) > 0.5


def test_a_run_inside_the_water_leaves_the_camera_where_it_is(scene):
    assert not scene._comparison.leaves_water
    assert tuple(scene._server.initial_camera.position) == pytest.approx(tuple(WATER.position))


def test_later_browsers_begin_with_a_run_that_is_shown_and_with_the_water_after_it(
    far_scene, source
):
    camera = far_scene._server.initial_camera
    assert np.linalg.norm(camera.position) > 5 * np.linalg.norm(WATER.position)
    source.shown_comparison = None
    far_scene.update()
    assert tuple(camera.position) == pytest.approx(tuple(WATER.position))


def test_the_panel_frames_a_what_if_only_while_there_is_one(scene, source):
    button = scene._panel._views[WHAT_IF]
    assert button.visible
    source.shown_comparison = None
    scene.update()
    assert not button.visible


def test_a_track_that_diverged_is_drawn_as_far_as_it_is_known(scene, source):
    track = source.shown_comparison.runs[0]
    broken = track.position_ned.copy()
    broken[20:] = np.nan
    runs = (replace(track, position_ned=broken), ComparisonTrack("stuck", np.zeros((5, 3))))
    source.shown_comparison = replace(source.shown_comparison, runs=runs)
    scene.update()
    assert [label.text for label in labels(scene).values()][1:] == ["what-if: Backstepping"]
    assert np.isfinite(nodes(scene)["whatif/1"].points).all()


def test_dashes_cover_two_thirds_of_a_line_and_follow_its_bends():
    corner = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 3.0, 0.0]])
    pieces = dashes(corner, 0.4)
    assert np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1).sum() == pytest.approx(4.0)
    assert (np.isclose(pieces[..., 0], 3.0) | np.isclose(pieces[..., 1], 0.0)).all()
