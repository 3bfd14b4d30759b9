"""How robots that do not exist, and onboard programs, come by the key that signs their radio."""

import json

import pytest

from onboard.memory import read_key
from server.base.secret import SecretStore
from server.cli.demo.gateway import MEMORY_FOLDER, decide_signing, give_keys
from server.cli.main import main
from simulator.fleet import GRACE_1, MINI_1
from simulator.robot_process import RobotSettings

MINI, GRACE = MINI_1.robot, GRACE_1.robot


@pytest.fixture
def secrets(tmp_path):
    return SecretStore(tmp_path / "secret")


def on_board(folder, robot):
    return folder / MEMORY_FOLDER / robot / "signing.key"


def test_a_demo_makes_each_key_once_and_gives_it_to_its_robot(tmp_path, secrets):
    decide_signing(secrets, (MINI, GRACE))
    keys = [secrets.signing_key(robot) for robot in (MINI, GRACE)]
    assert None not in keys
    assert keys[0] != keys[1]
    decide_signing(secrets, (MINI, GRACE))
    give_keys(tmp_path, secrets, (MINI, GRACE))
    assert [read_key(on_board(tmp_path, robot)) for robot in (MINI, GRACE)] == keys
    assert on_board(tmp_path, MINI).stat().st_mode & 0o777 == 0o600


def test_who_turned_signing_off_finds_it_off_in_the_next_demo(tmp_path, secrets):
    decide_signing(secrets, (MINI,))
    give_keys(tmp_path, secrets, (MINI,))
    secrets.turn_signing_off(MINI)
    decide_signing(secrets, (MINI,))
    give_keys(tmp_path, secrets, (MINI,))
    assert secrets.is_signing_off(MINI)
    assert not on_board(tmp_path, MINI).exists()


def test_a_simulated_robot_keeps_the_key_file_that_it_was_given_by_hand(tmp_path, secrets):
    on_board(tmp_path, MINI).parent.mkdir(parents=True)
    on_board(tmp_path, MINI).write_text(bytes(range(32)).hex())
    give_keys(tmp_path, secrets, (MINI,))
    assert read_key(on_board(tmp_path, MINI)) == bytes(range(32))


@pytest.mark.parametrize("content", [b"", b"no key", b"\xff\xfe"])
@pytest.mark.parametrize("kind", ["signing", "robot"])
def test_a_damaged_key_keeps_no_other_robot_from_its_own(tmp_path, secrets, capsys, kind, content):
    decide_signing(secrets, (GRACE,))
    give_keys(tmp_path, secrets, (GRACE,))
    before = read_key(on_board(tmp_path, GRACE))
    file = tmp_path / "secret" / f"{kind}-{GRACE}"
    file.write_bytes(content)
    decide_signing(secrets, (GRACE, MINI))
    give_keys(tmp_path, secrets, (GRACE, MINI))
    assert file.read_bytes() == content
    assert read_key(on_board(tmp_path, GRACE)) == before, "its own copy stays"
    assert read_key(on_board(tmp_path, MINI)) == secrets.signing_key(MINI)
    told = capsys.readouterr().err
    assert f"{GRACE} is given no new key: secret/{kind}-{GRACE}" in told
    assert (f"{GRACE} has no radio" in told) is (kind == "signing")


def test_an_onboard_program_begins_without_a_key_only_when_it_is_told_to(
    tmp_path, capsys, monkeypatch
):
    flown: list[RobotSettings] = []
    monkeypatch.setattr("simulator.robot_process.run", flown.append)
    nodes = tmp_path / "nodes.json"
    nodes.write_text(json.dumps({"body": "tcp://127.0.0.1:9"}))
    words = ["robot", GRACE, "--nodes", str(nodes), "--radio", "udp://127.0.0.1:9"]
    words += ["--memory", str(tmp_path)]
    assert main(words) != 0
    assert "say --unsigned" in capsys.readouterr().err
    assert flown == []
    assert main([*words, "--unsigned"]) == 0
    (tmp_path / "signing.key").write_text(bytes(range(32)).hex())
    assert main(words) == 0
    assert len(flown) == 2
