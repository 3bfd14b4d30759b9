"""A robot that finds itself by its own camera, from the node of the camera to its fixes."""

import asyncio
import json
import math
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest

from autonomy.vision.onboard.own_camera import AIR_LENS_REFUSED
from autonomy.vision.rigid import Pose
from onboard.node.camera import CameraNode, CameraWords, TagView
from onboard.node.client import NodeClient
from onboard.own_camera_file import (
    CAMERA_FILE,
    TANK_FILE,
    OwnCameraFileError,
    read_own_camera,
)
from onboard.own_camera_listener import OwnCameraListener
from robot_link.camera.sighting import TagSeen
from robot_link.clock import ScaledClock
from simulator.background import alongside
from simulator.own_camera import CAMERA_DOCUMENT, SimulatedEye, write_files
from tests.robot_link.rig import until

NOW = datetime(2026, 7, 1, 9, 30, tzinfo=UTC)
BODY = Pose.of_angles([1.6, 0.7, 0.5], 0.03, -0.2, 0.4)


class Robot:
    """Stands for the onboard program: it takes fixes and tells its tilt and depth."""

    def __init__(self, pose=BODY):
        roll, pitch, _ = pose.angles_rad
        depth = float(pose.position_m[2])
        readings = SimpleNamespace(roll_rad=roll, pitch_rad=pitch, depth_m=depth)
        self.estimate = SimpleNamespace(readings=readings, velocity_ned=(0.0, 0.0, 0.0))
        self.now = NOW + timedelta(seconds=20.2)
        self.fixes, self.notes = [], []

    def hear_own_fix(self, fix):
        self.fixes.append(fix)

    def note(self, sentence):
        self.notes.append(sentence)


def listener_of(folder, robot, node=None):
    node = node or SimpleNamespace(subscribe=lambda _topic: None)
    setup = read_own_camera(folder)
    return OwnCameraListener(robot, node, setup, lambda s: NOW + timedelta(seconds=s), robot)


def eye_of(pose=BODY, seed=3):
    clock = ScaledClock(datetime.now(UTC), NOW, 10.0)
    return SimulatedEye(lambda: pose, lambda: 20.0, clock, np.random.default_rng(seed))


@pytest.fixture
def memory(tmp_path):
    write_files(tmp_path)
    return tmp_path


@asynccontextmanager
async def watching(memory, source, robot):
    node = CameraNode(source)
    async with node.server.serve() as address:
        client = NodeClient(address)
        listener = listener_of(memory, robot, client)
        async with (
            alongside(client.run(), "client"),
            alongside(listener.run(), "listener"),
            alongside(listener.watch(), "state"),
        ):
            await client.connected()
            await client.ask("describe")
            async with alongside(node.run(), "node"):
                yield client, listener


async def test_what_the_node_publishes_becomes_a_fix_where_the_robot_was(memory):
    robot = Robot()
    async with watching(memory, eye_of(), robot) as (client, _):
        await until(lambda: len(robot.fixes) >= 3)
        counts = await client.ask("counts")
    fix = robot.fixes[0]
    assert math.dist(fix.ned_m, BODY.position_m) < 0.05
    assert fix.measured_at == NOW + timedelta(seconds=20.0)
    assert abs(fix.heading_rad - 0.4) < 0.06
    assert (fix.cameras, fix.tags >= 1) == (1, True)
    assert counts["pictures"] >= 3
    assert counts["tags"] >= 3 * fix.tags


def test_fixes_claim_what_they_err_over_many_robots(memory):
    rng = np.random.default_rng(17)
    squares, errors = [], []
    for seed in range(60):
        place = rng.uniform([-0.2, -0.2, 0.25], [2.9, 1.5, 0.9])
        roll, pitch = rng.normal(0.0, 0.1, 2)
        pose = Pose.of_angles(place, roll, pitch, rng.uniform(-3.1, 3.1))
        robot = Robot(pose)
        listener = listener_of(memory, robot)
        seen = eye_of(pose, seed).truth.seen(pose, 0.0, rng)
        listener.take({"count_s": 20.0, "tags": [_said(tag) for tag in seen]})
        for fix in robot.fixes:
            off = np.subtract(fix.ned_m[:2], place[:2])
            xx, xy, yy = fix.covariance_ne_m2
            squares.append(float(off @ np.linalg.solve([[xx, xy], [xy, yy]], off)))
            errors.append(float(np.hypot(*off)))
    assert len(squares) >= 45
    assert np.median(errors) < 0.02
    assert 0.5 <= np.mean(squares) <= 4.0  # 2 is right


def _said(tag):
    return {"id": tag.id, "corners_px": tag.corners_px, "sigma_px": tag.sigma_px}


def test_a_node_that_does_not_tell_the_noise_is_believed_at_the_usual_noise(memory):
    robot = Robot()
    seen = eye_of().truth.seen(BODY, 0.0, np.random.default_rng(1))
    tags = [{"id": tag.id, "corners_px": tag.corners_px} for tag in seen]
    listener_of(memory, robot).take({"count_s": 20.0, "tags": tags})
    assert len(robot.fixes) == 1


@pytest.mark.parametrize(
    "said",
    [
        {},
        {"count_s": "soon", "tags": []},
        {"count_s": math.nan, "tags": []},
        {"count_s": 1e300, "tags": []},
        {"count_s": 1.0, "tags": [{"id": 140, "corners_px": [[0, 0]]}]},
        {"count_s": 1.0, "tags": [{"id": None, "corners_px": [[0, 0]] * 4}]},
        {"count_s": 1.0, "tags": [{"id": 140, "corners_px": [[0, "x"]] * 4}]},
        {"count_s": 1.0, "tags": [{"id": 140}] * 300},
        {"count_s": 1.0, "tags": 7},
    ],
)
def test_nonsense_of_the_node_is_counted_and_written_down(memory, said):
    robot = Robot()
    listener = listener_of(memory, robot)
    listener.take(said)
    assert robot.fixes == []
    assert listener.refused.total() == 1
    assert "cannot be read" in robot.notes[0]


def test_tags_that_do_not_fit_together_give_no_fix_and_the_log_says_so_once(memory):
    robot = Robot()
    listener = listener_of(memory, robot)
    seen = eye_of().truth.seen(BODY, 0.0, np.random.default_rng(1))
    assert len(seen) >= 2
    wrong = [_said(tag) for tag in seen]
    wrong[0]["id"], wrong[1]["id"] = wrong[1]["id"], wrong[0]["id"]
    for _ in range(5):
        listener.take({"count_s": 20.0, "tags": wrong})
    assert robot.fixes == []
    assert listener.refused.total() == 5
    assert len(robot.notes) == 1


def test_a_picture_that_is_too_old_is_refused_before_anything_is_sought_in_it(memory, monkeypatch):
    def sought(*_arguments, **_options):
        raise AssertionError("the flying loop does not wait for what nobody may take")

    monkeypatch.setattr("onboard.own_camera_listener.find_self", sought)
    robot = Robot()
    listener = listener_of(memory, robot)
    tags = [_said(tag) for tag in eye_of().truth.seen(BODY, 0.0, np.random.default_rng(1))]
    listener.take({"count_s": 18.0, "tags": tags})
    assert robot.fixes == []
    assert robot.notes == ["own camera: no fix: the picture is 2.2 s old; it may be 1.5 s"]


def test_strangers_and_empty_pictures_give_no_fix(memory):
    robot = Robot()
    listener = listener_of(memory, robot)
    listener.take({"count_s": 20.0, "tags": []})
    assert listener.refused.total() == 0
    corners = [[100.0, 100.0], [200.0, 100.0], [200.0, 200.0], [100.0, 200.0]]
    listener.take({"count_s": 20.0, "tags": [{"id": 7, "corners_px": corners}]})
    assert robot.fixes == []
    assert robot.notes == ["own camera: no fix: no tag of it is seen"]


async def test_what_is_wrong_with_the_camera_is_written_into_the_robots_log(memory):
    class Broken:
        async def views(self):
            yield CameraWords("there is no /dev/video0")
            yield TagView(1.0, [])
            await asyncio.Event().wait()

    robot = Robot()
    async with watching(memory, Broken(), robot):
        await until(lambda: robot.notes)
    assert robot.notes == ["own camera: there is no /dev/video0"]


def test_a_robot_above_the_water_sees_nothing(memory):
    flying = Pose.of_angles([1.6, 0.7, -0.3], 0.0, 0.0, 0.0)
    assert eye_of(flying).truth.seen(flying, 0.0, np.random.default_rng(0)) == []


def test_the_simulated_eye_says_tags_that_the_wire_believes(memory):
    for tag in eye_of().truth.seen(BODY, 0.0, np.random.default_rng(0)):
        assert isinstance(tag, TagSeen)
        assert all(-0.5 <= u <= 1295.5 and -0.5 <= v <= 971.5 for u, v in tag.corners_px)


@pytest.mark.parametrize(
    ("file", "text", "says"),
    [
        (CAMERA_FILE, None, "camera.json: there is no such file on the robot"),
        (TANK_FILE, None, "tank.json: there is no such file on the robot"),
        (CAMERA_FILE, "{", "camera.json: is no JSON"),
        (TANK_FILE, "[]", "tank.json: is not a JSON object"),
        (TANK_FILE, '{"tags": []}', "tank.json: tags: there is none"),
        (TANK_FILE, '{"tags": [{"id": 140}]}', r"tank.json: tags\[0\].position_m"),
        (CAMERA_FILE, '{"lens": {}}', "camera.json: lens.width_px"),
    ],
)
def test_a_wrong_file_is_refused_with_its_name_and_field(memory, file, text, says):
    if text is None:
        (memory / file).unlink()
    else:
        (memory / file).write_text(text)
    with pytest.raises(OwnCameraFileError, match=says):
        read_own_camera(memory)


def test_a_level_beyond_reason_is_refused_with_its_limit(memory):
    tank = json.loads((memory / TANK_FILE).read_text())
    (memory / TANK_FILE).write_text(json.dumps({**tank, "level_m": 1e9}))
    with pytest.raises(OwnCameraFileError, match="level_m: is not a number within -100 and 100"):
        read_own_camera(memory)


def test_a_lens_of_the_air_is_refused_on_the_robot_in_words(memory):
    bare = {name: value for name, value in CAMERA_DOCUMENT.items() if name != "port"}
    (memory / CAMERA_FILE).write_text(json.dumps(bare))
    with pytest.raises(OwnCameraFileError, match=AIR_LENS_REFUSED[:40]):
        read_own_camera(memory)


def test_files_of_a_laboratory_are_not_written_over(memory):
    (memory / CAMERA_FILE).write_text("mine")
    write_files(memory)
    assert (memory / CAMERA_FILE).read_text() == "mine"
