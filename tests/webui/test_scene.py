from dataclasses import replace

import numpy as np
import pytest

from autonomy.frames import ned_to_enu
from autonomy.site import LAKE, TANK, Area
from autonomy.vehicle.hull import Hull
from tests.webui.fake_source import FakeSource
from webui.scene.colour import fidelity_colours, mapped
from webui.scene.lake_bed import bed
from webui.scene.plan import hose
from webui.scene.projection import VIEW_WIDTH, Projection
from webui.scene.server import RobotScene
from webui.scene.track import CHUNK_POINTS


@pytest.fixture
def source():
    return FakeSource()


@pytest.fixture
def scene(source):
    scene = RobotScene(source)
    yield scene
    scene.stop()


@pytest.mark.parametrize("site", [TANK, LAKE], ids=["tank", "lake"])
def test_every_site_fills_the_view(site):
    projection = Projection.of_site(site)
    water = site.water
    corners = np.array(
        [[water.x_min_m, water.y_min_m, 0.0], [water.x_max_m, water.y_max_m, water.depth_max_m]]
    )
    placed = projection.point(corners, 1.0)
    assert np.abs(placed[:, :2]).max() == pytest.approx(VIEW_WIDTH / 2)


def test_a_shallow_lake_is_stretched_and_a_tank_is_not():
    assert Projection.of_site(TANK).default_exaggeration == 1.0
    assert Projection.of_site(LAKE).default_exaggeration > 4.0


def test_depth_goes_down_in_the_view():
    placed = Projection.of_site(TANK).point(np.array([1.0, 2.0, 3.0]), 1.0)
    assert placed[2] < 0.0


def test_a_constant_map_has_one_colour_and_no_division_by_zero():
    colours = mapped(np.full((4, 3), 2.5), 2.5, 2.5, "viridis")
    assert len(np.unique(colours.reshape(-1, 3), axis=0)) == 1


def test_the_best_located_samples_are_the_brightest():
    shades = fidelity_colours(np.array([0, 1, 2]), 3).sum(axis=1)
    assert list(shades) == sorted(shades)


def test_the_robot_is_drawn_where_it_says_it_is(scene, source):
    scene.update()
    projection = Projection.of_site(source.site)
    wanted = projection.point(np.array(source.pose().position_ned), 1.0)
    assert scene._robot._body.position == pytest.approx(wanted, abs=1e-6)
    assert scene._robot._body.visible


@pytest.mark.parametrize("length_m", [0.57, 1.7])
def test_a_robot_has_the_proportions_of_its_hull(length_m):
    source = FakeSource()
    source.hull = Hull(
        length_m=0.7 * length_m, tail_to_nose_m=length_m, wingspan_m=0.5 * length_m,
        width_m=0.2 * length_m, height_m=0.1 * length_m,
    )  # fmt: skip
    scene = RobotScene(source)
    body, wing, port, fin = scene._robot._parts
    scene.stop()
    nose = body.position[0] + body.scale[0]
    tip = scene._robot._tail.position[0] + fin.vertices[:, 0].min()
    span = wing.vertices[:, 1].max() - port.vertices[:, 1].min()
    assert span / (nose - tip) == pytest.approx(0.5)
    assert np.array(body.scale) / body.scale[0] == pytest.approx([1.0, 2 / 7, 1 / 7])
    assert nose - tip == pytest.approx(length_m * Projection.of_site(TANK).view_per_m)


def test_an_old_pose_turns_grey(scene, source):
    scene.update()
    alive = tuple(scene._robot._parts[0].color)
    pose = replace(source.pose(), is_old=True)
    scene._robot.show(pose, 1.0)
    assert tuple(scene._robot._parts[0].color) != alive


def lengthen(source, track_ned, is_adrift=False):
    """Let the source have flown on, or drifted."""
    source.track_ned = np.concatenate([source.track_ned, track_ned])
    source.std_m = np.full(len(source.track_ned), 0.02)
    source.is_adrift = np.concatenate([source.is_adrift, np.full(len(track_ned), is_adrift)])


def test_a_long_track_is_sent_in_chunks_and_only_the_tail_again(scene, source):
    lengthen(source, np.repeat(source.track_ned, 9, axis=0))
    scene.update()
    before = dict(scene._track.survey.pieces)
    assert len(before) - 1 == len(source.track_ned) // CHUNK_POINTS
    lengthen(source, source.track_ned[-5:])
    scene.update()
    after = scene._track.survey.pieces
    assert [piece for piece in before if after[piece] is not before[piece]] == ["tail"]
    assert len(after["tail"].points) < CHUNK_POINTS + 6


def test_a_restarted_track_replaces_what_was_drawn(scene, source):
    lengthen(source, np.repeat(source.track_ned, 9, axis=0))
    scene.update()
    source.restarted = True
    source.track_ned = source.track_ned[:10]
    source.std_m = source.std_m[:10]
    source.is_adrift = source.is_adrift[:10]
    scene._track._cursor = 0
    scene.update()
    [tail] = scene._track.survey.pieces.values()
    assert len(tail.points) == 9


def test_drift_is_a_layer_of_its_own_that_is_hidden_at_first(scene, source):
    flown = len(source.track_ned) - 1
    lengthen(source, source.track_ned[:40] + 0.1, is_adrift=True)
    scene.update()
    survey, drift = scene._track.survey.pieces["tail"], scene._track.drift.pieces["tail"]
    assert (len(survey.points), len(drift.points)) == (flown, 40)
    assert (survey.visible, drift.visible) == (True, False)
    assert len(np.unique(drift.colors.reshape(-1, 3), axis=0)) == 1
    assert drift.thickness < survey.thickness
    scene._track.drift.show(True)
    lengthen(source, source.track_ned[:3] + 0.2, is_adrift=True)
    scene.update()
    assert scene._track.drift.pieces["tail"].visible


def test_the_panel_offers_drift_switched_off(scene):
    boxes = scene._server.gui._gui_input_handle_from_uuid.values()
    states = {box.label: box.value for box in boxes if isinstance(box.value, bool)}
    assert states["Track"]
    assert not states["Drift"]


def test_a_new_version_of_the_map_changes_colours_in_place(scene, source):
    scene.update()
    cells = scene._map._cells
    before = np.array(cells.batched_colors)
    source.map = replace(source.map, mean=-source.map.mean, version=2)
    scene.update()
    assert scene._map._cells is cells
    assert not np.array_equal(before, cells.batched_colors)


def test_a_slice_shows_one_layer_only(scene, source):
    scene.change({"form": "slices"})
    scene.update()
    opacity = np.array(scene._map._cells.batched_opacities).reshape(source.map.mean.shape)
    assert (opacity.max(axis=(0, 1)) > 0).sum() == 1


def test_a_recording_with_one_model_shows_its_map(scene, source):
    source.models = ("single",)
    scene.update()
    scene.update()
    assert scene._map._cells is not None
    assert not scene._panel._model.visible


@pytest.mark.parametrize("state", ["done", "failed", "superseded", "cancelled"])
def test_a_plan_that_ended_promises_nothing(scene, source, state):
    scene.update()
    parts = (scene._plan.legs, scene._plan.uncertainty)
    assert all(part.has_content for part in parts)
    source.set_plan_state(state)
    scene.update()
    assert not any(part.has_content for part in parts)


@pytest.mark.parametrize("state", ["draft", "sent", "on_board", "running"])
def test_a_plan_is_dashed_and_thinner_than_what_was_flown(scene, source, state):
    source.set_plan_state(state)
    scene.update()
    drawn, flown = scene._stage._nodes["plan/legs"], scene._stage._nodes["track/tail"]
    assert drawn.thickness < flown.thickness
    promised = np.linalg.norm(np.diff(source.plan().points[:, 1:4], axis=0), axis=1).sum()
    dashes = np.linalg.norm(np.diff(drawn.points, axis=1), axis=2).ravel()
    assert 0.5 < dashes.sum() / promised < 0.8
    assert dashes.max() < 0.05 * source.site.water.x_max_m


def test_exaggeration_moves_robot_and_surroundings_together(scene, source):
    scene.update()
    scene._panel._exaggeration.value = 4.0
    scene.update()
    depth = -scene._robot._body.position[2]
    projection = Projection.of_site(source.site)
    assert depth == pytest.approx(source.pose().position_ned[2] * projection.view_per_m * 4.0)
    assert scene._map._cells.scale[2] == pytest.approx(projection.view_per_m * 4.0)


def test_a_log_map_names_its_ends_in_the_unit_of_the_variable(scene):
    scene.update()
    assert "counts" in scene._map.legend


def test_the_colours_of_the_map_are_told_in_numbers_while_it_is_shown(scene, source):
    scene.update()
    colours = scene.state.colours
    low, high = float(np.nanmin(source.map.mean)), float(np.nanmax(source.map.mean))
    assert (colours.low, colours.high) == (low, high)
    assert (colours.unit, colours.is_log) == (source.map.variable.unit, True)
    scene.change({"layers": {"map": False}})
    assert scene.state.colours is None


def test_slices_are_cut_across_every_axis(scene, source):
    scene.change({"form": "slices", "slice_depth": None, "slice_north": 0.0, "slice_east": 1.0})
    opacity = np.array(scene._map._cells.batched_opacities).reshape(source.map.mean.shape)
    wanted = np.zeros(opacity.shape, np.bool_)
    wanted[0], wanted[:, -1] = True, True
    assert np.array_equal(opacity > 0, wanted)


def test_nothing_is_drawn_where_no_water_is(scene, source):
    mean = source.map.mean.copy()
    mean[:5] = np.nan
    std = np.where(np.isnan(mean), np.nan, source.map.std)
    source.map = replace(source.map, mean=mean, std=std, version=2)
    for form in ("volume", "slices"):
        scene.change({"form": form, "slice_east": 0.5})
        opacity = np.array(scene._map._cells.batched_opacities).reshape(mean.shape)
        assert not opacity[:5].any()
        assert opacity[5:].any()
    assert "nan" not in scene._map.legend


def test_what_the_app_changes_is_what_the_view_says(scene):
    scene.update()
    scene.change(
        {"quantity": "std", "model": "single", "opacity": 0.3, "exaggeration": 3.0,
         "layers": {"samples": True, "track": False}}
    )  # fmt: skip
    state = scene.state
    assert (state.quantity, state.model, state.opacity) == ("std", "single", 0.3)
    assert scene._stage.exaggeration == state.exaggeration == 3.0
    shown = {layer.key: layer.visible for layer in state.layers}
    assert (shown["samples"], shown["track"]) == (True, False)
    assert scene._samples.visible
    assert not scene._track.survey.visible


def test_the_view_names_models_as_their_maps_do(scene):
    scene.update()
    scene.update()
    assert dict(scene.state.models) == {"recursive": "Recursive", "single": "Single"}
    assert tuple(scene._panel._model.options) == ("Recursive", "Single")


def test_a_model_without_a_map_changes_nothing(scene):
    scene.update()
    scene.change({"model": "none of them", "layers": {"none": True}})
    assert scene.state.model == "recursive"


def test_samples_are_drawn_by_fidelity_each_in_its_own_shape(scene, source):
    scene.update()
    nodes = {name: scene._stage._nodes[name] for name in scene._samples._names}
    assert sum(len(node.points) for node in nodes.values()) == len(source.sampled.fidelity)
    shapes = {name[len("samples/")]: node.point_shape for name, node in nodes.items()}
    assert len(shapes) == len(set(shapes.values())) == 3


def test_the_hose_is_as_wide_as_the_plan_is_uncertain():
    centres = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 2.0], [2.0, 1.0, 0.0]])
    radii = np.array([0.1, 0.5, 0.2])
    vertices, faces = hose(centres, radii)
    rings = vertices.reshape(3, -1, 3)
    away = np.linalg.norm(rings - centres[:, None], axis=2)
    assert np.allclose(away, radii[:, None])
    assert np.allclose(rings[..., 2], centres[:, None, 2])
    assert faces.max() == len(vertices) - 1


def test_a_rehearsed_track_is_dashed_and_goes_with_its_plan(scene, source):
    source.rehearse()
    scene.update()
    assert scene._plan.rehearsal.has_content
    source.set_plan_state("done")
    scene.update()
    assert not scene._plan.rehearsal.has_content


def test_legs_are_thin_beside_the_track_that_is_expected_of_them(scene, source):
    scene.update()
    assert "plan/straight" not in scene._stage._nodes
    source.expect()
    scene.update()
    assert "plan/straight" in scene._stage._nodes
    scene._plan.legs.show(visible=False)
    assert not scene._stage._nodes["plan/straight"].visible
    source.set_plan_state("done")
    scene.update()
    assert "plan/straight" not in scene._stage._nodes


def test_keep_outs_stand_from_the_surface_to_the_floor(scene, source):
    source.areas = (Area(name="Ladder", corners_m=((1.0, 0.2), (1.5, 0.2), (1.5, 0.6))),)
    scene.update()
    wall = np.array(scene._stage._nodes["keep_out/0"].vertices)
    assert sorted(set(wall[:, 2])) == pytest.approx([-source.site.water.depth_max_m, 0.0])
    scene.change({"layers": {"keep_outs": False}})
    assert not scene._stage._nodes["keep_out/0"].visible
    source.areas = ()
    scene.update()
    assert "keep_out/0" not in scene._stage._nodes


def test_the_floor_of_a_lake_lies_where_its_depths_say():
    vertices, faces = bed(LAKE)
    used = vertices[np.unique(faces)]
    assert len(used) > 100
    assert np.allclose(used[:, 2], LAKE.floor_m(used[:, 0], used[:, 1]))
    assert LAKE.shoreline.contains(used[:, 0], used[:, 1]).all()


def test_the_floor_is_seen_from_above_and_not_from_below():
    vertices, faces = bed(LAKE)
    enu = ned_to_enu(vertices)[faces]
    normals = np.cross(enu[:, 1] - enu[:, 0], enu[:, 2] - enu[:, 0])
    assert (normals[:, 2] > 0).all()


def test_a_map_without_samples_hides_nothing(scene, source):
    source.map = replace(source.map, samples_per_level=(0, 0, 0))
    scene.update()
    assert not scene._map.has_content
    source.map = replace(source.map, samples_per_level=(0, 0, 3), version=2)
    scene.update()
    assert scene._map.has_content
