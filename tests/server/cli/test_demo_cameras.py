"""A demo with cameras: what the station is told of them, and what of it stays."""

import pytest

from db.query.camera.cameras import list_cameras
from db.query.camera.tag_sets import newest_tag_set
from db.query.fleet.robots import list_robots
from db.store import Store
from server.base.settings import Settings
from server.cli import demo_verb
from server.cli.main import main

pytest.importorskip("cv2", reason="the extra camera is not installed")


@pytest.fixture
def supervised(monkeypatch):
    """Keep the demo's processes from starting; their commands."""
    commands = []

    class Told:
        def __init__(self, children, *_) -> None:
            commands.extend(child.command for child in children)

        async def run(self) -> int:
            return 0

    monkeypatch.setattr(demo_verb, "Supervisor", Told)
    return commands


def told(folder):
    store = Store.open(Settings(data_dir=folder).resolved_database_url)
    with store.read() as session:
        found = list_cameras(session), newest_tag_set(session), list_robots(session)
    store.close()
    return found


def demo(folder, *options):
    assert main(("demo", "--no-browser", "--data", str(folder), *options)) == 0


def test_a_demo_without_the_option_has_no_cameras(tmp_path, supervised):
    demo(tmp_path)
    cameras, tags, robots = told(tmp_path)
    assert (cameras, tags) == ([], None)
    assert not any("cameras:" in link for robot in robots for link in robot.links)
    assert "--cameras" not in supervised[0]


def test_cameras_are_told_with_the_port_at_which_the_simulator_serves_them(tmp_path, supervised):
    for _ in range(2):
        supervised.clear()
        demo(tmp_path, "--cameras", "--robots", "mini-1,mini-2,grace-1")
        cameras, tags, robots = told(tmp_path)
        command = supervised[0]
        port = command[command.index("--camera-port") + 1]
        assert [camera.uri for camera in cameras] == [
            f"http://127.0.0.1:{port}/camera/tank-{number}" for number in (1, 2, 3)
        ]
        assert all(camera.lens_key is None for camera in cameras)
        assert [one["robot"] for one in tags.bundles] == ["mini-1", "mini-2"]
        assert len(tags.layout["tags"]) == 18
        links = {robot.id: robot.links[-1] for robot in robots}
        assert links["mini-1"] == "cameras:///?tags=mini-1"
        assert "cameras:" not in links["grace-1"]


def test_a_demo_tells_its_robots_to_which_depth_fixes_count(tmp_path, supervised, monkeypatch):
    demo(tmp_path, "--cameras", "--fix-depth", "1.2")
    command = supervised[0]
    assert command[command.index("--fix-depth") + 1] == "1.2"
    lived = []
    monkeypatch.setattr("simulator.process.run", lambda settings, _tell: lived.append(settings))
    options = command[command.index("simulate") :]
    assert main(options) == 0
    mini = lived[0].definition(lived[0].robots[0])
    assert mini.estimator.surface_depth_m == 1.2


def test_a_second_demo_in_a_folder_leaves_tags_as_they_are_and_adds_those_of_new_robots(
    tmp_path, supervised
):
    demo(tmp_path, "--cameras")
    first = told(tmp_path)[1]
    demo(tmp_path, "--cameras")
    assert told(tmp_path)[1].key == first.key
    demo(tmp_path, "--cameras", "--robots", "mini-2")
    bundles = told(tmp_path)[1].bundles
    ids = {one["robot"]: [tag["id"] for tag in one["tags"]] for one in bundles}
    assert ids == {"mini-1": [0, 1, 2], "mini-2": [3, 4, 5]}
    assert supervised


@pytest.mark.parametrize("depth", ["0", "2.5", "nan", "deep"])
def test_a_depth_that_no_robot_can_have_is_refused(tmp_path, supervised, capsys, depth):
    with pytest.raises(SystemExit):
        demo(tmp_path, "--cameras", "--fix-depth", depth)
    assert f"{depth} does not lie between 0.01 and 2 m" in capsys.readouterr().err
    assert not supervised
