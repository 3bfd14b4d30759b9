"""Which robots a demo has where nobody names any."""

import pytest

from db.query.fleet.robots import add_robot, list_robots
from db.store import Store
from server.base.settings import Settings
from server.cli import demo_verb
from server.cli.main import main
from simulator.fleet import SUB_1
from tests.server.conftest import LAKE, robot_record


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


def robots_of(folder):
    store = Store.open(Settings(data_dir=folder).resolved_database_url)
    with store.read() as session:
        found = list_robots(session)
    store.close()
    return {one.id: one for one in found}


def test_a_demo_has_a_vehicle_that_is_not_ours(tmp_path, supervised):
    for _ in range(2):
        assert main(("demo", "--no-browser", "--data", str(tmp_path))) == 0
        robots = robots_of(tmp_path)
        assert list(robots) == ["mini-1", "grace-1", "sub-1"]
        assert robots["sub-1"].protocol == "mavlink"
    assert "mini-1,grace-1,sub-1" in supervised[0]


def test_a_robot_of_the_folder_keeps_its_system_id(tmp_path, supervised):
    store = Store.open(Settings(data_dir=tmp_path).resolved_database_url)
    own = robot_record("own-1", SUB_1.system_id, "miniglider", LAKE)
    store.change(lambda session: add_robot(session, own)).result()
    store.close()
    assert main(("demo", "--no-browser", "--data", str(tmp_path))) == 0
    assert set(robots_of(tmp_path)) == {"own-1", "mini-1", "grace-1"}
    assert supervised
