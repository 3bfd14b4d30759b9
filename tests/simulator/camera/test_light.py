"""What pictures show: the kernel against its reference, shadows of hulls, ripples, caustics."""

from dataclasses import replace

import numpy as np
import pytest

from autonomy.vision.corner import fit_corners
from autonomy.vision.rigid import Pose
from autonomy.vision.sight import corners_seen
from autonomy.vision.tag import Bundle, Tag
from simulator.camera.body import Body, Prints, plate, robot_body, shown
from simulator.camera.caustics import caustic_net
from simulator.camera.laboratory import true_scene
from simulator.camera.painter import Painter
from simulator.camera.reference import seen_at
from simulator.camera.scene import Lighting, Motion, Sensor

pytest.importorskip("cv2", reason="the extra camera is not installed")

QUIET = Sensor(blur_px=0.0, shot_variance=0.0, read_std=0.0, exposure_s=0.0)


def quiet(robots=("mini-1",), **changes):
    return replace(true_scene(list(robots), seed=3), sensor=QUIET, **changes)


def light_of(picture, gamma=2.2):
    return (picture / 255.0) ** gamma


@pytest.mark.parametrize(
    ("depth_m", "level_m"), [(-0.06, 0.0), (0.0, 0.0), (0.06, 0.02), (0.4, 0.0), (1.0, 0.02)]
)
def test_the_kernel_sees_what_its_reference_sees(depth_m, level_m):
    scene = quiet(level_m=level_m, lighting=Lighting(caustics_std=0.0))
    camera = scene.cameras[1]
    painter = Painter(scene, camera)
    pose = Pose.of_angles([1.2, 0.6, depth_m], 0.2, -0.35, 2.0)
    picture = light_of(painter.picture(0.0, {"mini-1": Motion(pose)}))
    fixed = Body(tuple(plate(tag) for tag in scene.layout.tags))
    robot = robot_body(scene.bundles[0].tags, scene.shades.hull)
    things = [(fixed, Pose.identity()), (robot, pose)]
    boxes = shown(scene, camera, robot, Motion(pose), Prints()).boxes
    rng = np.random.default_rng(2)
    near = (boxes[:, ::2].min(axis=0), boxes[:, 1::2].max(axis=0))
    pixels = np.vstack([rng.integers(*near, (150, 2)), rng.integers([0, 0], [720, 1280], (100, 2))])
    expected = [[seen_at(scene, camera, np.array([v + du, u + dv]), things).base
                 for du, dv in ((0, 0), (-0.45, -0.45), (0.45, -0.45), (-0.45, 0.45), (0.45, 0.45))]
                for u, v in pixels.tolist()]  # fmt: skip
    drawn = picture[pixels[:, 0], pixels[:, 1]]
    is_plain = np.ptp(expected, axis=1) < 0.01  # no edge goes through the pixel
    assert is_plain.sum() > 120
    off = np.abs(drawn - np.array(expected)[:, 0])[is_plain]
    step = 2.2 / 255.0  # of a grey value at most, in light
    assert np.quantile(off, 0.97) < step
    between = (drawn >= np.min(expected, axis=1) - 0.05) & (
        drawn <= np.max(expected, axis=1) + 0.05
    )
    assert between.mean() > 0.97


def test_a_hull_hides_a_plate_below_it_and_is_hidden_by_a_plate_above_it():
    scene = quiet(lighting=Lighting(caustics_std=0.0, glare=0.0))
    camera = scene.cameras[1]
    painter = Painter(scene, camera)
    floor = scene.layout.tag(105) or scene.layout.tags[0]
    north, east, _ = floor.position_m
    box = np.round(corners_seen(camera, floor.corners_m, 0.0, scene.index)).astype(int)
    columns, rows = slice(box[:, 0].min(), box[:, 0].max()), slice(box[:, 1].min(), box[:, 1].max())
    free = painter.picture(0.0)[rows, columns]
    over = Pose.of_angles([north, east, floor.position_m[2] - 0.08], 0.0, 0.0, 0.3)
    hidden = painter.picture(0.0, {"mini-1": Motion(over)})[rows, columns]
    assert free.max() > 180
    middle = tuple(n // 2 for n in hidden.shape)
    top = corners_seen(camera, over.of_points(scene.bundles[0].tags[0].corners_m), 0.0, scene.index)
    assert fit_corners(painter.picture(0.0, {"mini-1": Motion(over)}), top).is_fitted
    assert (hidden != free).mean() > 0.9
    assert painter.picture(0.0)[rows, columns][middle] == free[middle]


def test_a_robot_that_swims_away_leaves_the_picture_as_it_was():
    scene = quiet(lighting=Lighting(caustics_std=0.0))
    painter = Painter(scene, scene.cameras[0])
    before = painter.picture(0.0)
    for north in np.linspace(0.0, 2.0, 7):
        pose = Pose.of_angles([north, 0.5, 0.2], 0.0, 0.0, north)
        assert (painter.picture(0.0, {"mini-1": Motion(pose)}) != before).any()
    assert (painter.picture(0.0) == before).all()


def test_ripples_move_corners_as_far_as_their_slope_says():
    slope = np.radians(0.4)
    still = quiet(lighting=Lighting(caustics_std=0.0, glare=0.0), ripple_slope_rad=slope)
    scene = replace(still, sensor=replace(QUIET, blur_px=0.5))
    camera = scene.cameras[1]
    painter = Painter(scene, camera)
    tags = [tag for tag in scene.layout.tags if tag.id < 120]
    truths = {tag.id: corners_seen(camera, tag.corners_m, 0.0, scene.index) for tag in tags}
    whole = [tag for tag in tags if camera.lens.shows(truths[tag.id], 15.0).all()]
    moved = []
    for time_s in np.arange(0.0, 40.0, 2.6):
        picture = painter.picture(float(time_s))
        for tag in whole:
            fit = fit_corners(picture, truths[tag.id])
            if fit.is_fitted:
                moved.append((fit.corners_px - truths[tag.id]).mean(axis=0))
    moved = np.array(moved)
    assert len(moved) > 80
    focal, height, depth = camera.lens.focal_px[0], 2.5, float(tags[0].position_m[2])
    away = height + depth / scene.index
    expected = focal / away * depth * (1.0 - 1.0 / scene.index) * slope
    # all corners of a tag are averaged, over which the slope changes, and rays are oblique
    assert 0.75 * expected < np.sqrt((moved**2).mean()) < 1.35 * expected
    assert np.abs(moved.mean(axis=0)).max() < 0.4 * expected


def test_the_slope_of_the_ripples_is_the_one_that_is_told():
    scene = quiet(ripple_slope_rad=0.01)
    rng = np.random.default_rng(1)
    slopes = []
    for time_s in rng.uniform(0.0, 100.0, 400):
        waves = scene.waves(float(time_s))
        place = rng.uniform(-2.0, 4.0, 2)
        phases = np.cos(waves[:, :2] @ place + waves[:, 2])
        slopes.append(phases @ waves[:, 3:])
    assert np.sqrt((np.array(slopes) ** 2).mean(axis=0)) == pytest.approx([0.01, 0.01], rel=0.15)
    assert np.abs(np.mean(slopes, axis=0)).max() < 0.002


def test_the_mean_of_the_caustics_is_1_and_they_move():
    net = caustic_net(0)
    assert net.mean() == pytest.approx(0.0, abs=1e-4)
    assert net.std() == pytest.approx(1.0, abs=1e-4)
    scene = quiet(robots=())
    calm = Painter(replace(scene, lighting=Lighting(caustics_std=0.0)), scene.cameras[0])
    rough = Painter(scene, scene.cameras[0])
    usual = light_of(calm.picture(0.0))
    times = np.arange(0.0, 200.0, 5.3)
    pictures = np.array([light_of(rough.picture(float(t)))[200:500, 400:900] for t in times])
    ratio = pictures.mean(axis=0) / usual[200:500, 400:900]
    assert ratio.mean() == pytest.approx(1.0, abs=0.01)
    spread = (pictures / usual[200:500, 400:900]).std(axis=0)
    assert 0.08 < np.median(spread) < 0.16  # haze and depth take a part of 0.15


def test_a_level_and_a_bump_change_the_picture_as_the_projection_says():
    scene = quiet(lighting=Lighting(caustics_std=0.0, glare=0.0))
    scene = replace(scene, sensor=replace(QUIET, blur_px=0.5))
    camera = scene.cameras[0]
    low = replace(scene, level_m=0.05)
    turned = replace(camera, pose=camera.pose.moved(np.array([0.01, 0.0, 0.0]),
                                                    np.radians([0.2, -0.3, 0.1])))  # fmt: skip
    for changed, hung in ((low, camera), (scene, turned)):
        picture = Painter(changed, hung).picture(0.0)
        off, way = [], []
        for tag in scene.layout.tags:
            before = corners_seen(camera, tag.corners_m, scene.level_m, scene.index)
            after = corners_seen(hung, tag.corners_m, changed.level_m, scene.index)
            if hung.lens.shows(after, 12.0).all() and (tag.id < 120 or hung is turned):
                off.append(fit_corners(picture, after).corners_px - after)
                way.append(np.linalg.norm(after - before, axis=1))
        assert np.max(way) > 1.0
        assert np.abs(off).max() < 0.2


def test_a_plate_seen_from_behind_shows_no_tag():
    scene = quiet(lighting=Lighting(caustics_std=0.0, glare=0.0))
    scene = replace(scene, bundles=(Bundle("mini-1", (Tag(0, 0.15, (0.0, 0.0, -0.2)),)),))
    painter = Painter(scene, scene.cameras[1])
    up, down = (
        painter.picture(0.0, {"mini-1": Motion(Pose.of_angles([1.4, 0.7, d], roll, 0.0, 0.0))})
        for roll, d in ((0.0, 0.6), (np.pi, 0.2))
    )
    rest = painter.picture(0.0)
    assert (up[up != rest] > 190).any()
    assert not (down[down != rest] > 190).any()
