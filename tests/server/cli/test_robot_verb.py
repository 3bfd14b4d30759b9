"""``grace robot add``, ``list``, ``retire`` and ``restore``; the flight program beside them."""

import subprocess
import sys

import pytest

from server.base.secret import SecretStore
from server.cli.data_folder import hold_data_folder
from tests.server.cli.test_cli import grace

BAY = ("--model", "miniglider", "--water", "test-tank", "--unsigned")


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "data"


def add(folder, robot="our-1", *more):
    return grace(
        "robot",
        "add",
        robot,
        "--system",
        "9",
        "--link",
        "tcp://127.0.0.1:9",
        *more,
        "--data",
        folder,
    )


def test_a_robot_is_added_listed_retired_and_brought_back(folder, capsys):
    assert (
        add(folder, "our-1", *BAY, "--name", "Ours", "--deployment", "First", "--person", "Ann")
        == 0
    )
    assert "our-1 is added." in capsys.readouterr().out
    grace("robot", "list", "--data", folder)
    listed = capsys.readouterr().out
    assert "our-1: Ours, miniglider, system 9, Test tank, in the water: First\n" in listed
    assert grace("robot", "retire", "our-1", "--data", folder) == 1
    assert "end that deployment first" in capsys.readouterr().err
    assert add(folder, "our-2", *BAY) == 1
    assert "our-1" in capsys.readouterr().err


def test_a_robot_of_the_workshop_retires_and_its_system_id_is_free(folder, capsys):
    assert add(folder, "our-1", *BAY, "--workshop") == 0
    assert grace("robot", "retire", "our-1", "--data", folder) == 0
    assert add(folder, "our-2", *BAY, "--workshop") == 0
    capsys.readouterr()
    grace("robot", "list", "--data", folder)
    *_, second, first = capsys.readouterr().out.splitlines()
    assert second.endswith("in the workshop")
    assert "our-1" in first
    assert "retired since" in first
    assert grace("robot", "restore", "our-1", "--data", folder) == 1
    assert "our-2" in capsys.readouterr().err


def test_the_key_of_a_new_robot_is_printed_once_and_kept(folder, capsys):
    assert add(folder, "our-1", "--model", "miniglider", "--water", "test-tank") == 0
    key = capsys.readouterr().out.splitlines()[-1]
    assert SecretStore(folder / "secret").signing_key("our-1").hex() == key
    assert add(folder, "our-3", "--model", "miniglider", "--water", "test-tank") == 1
    assert not (folder / "secret" / "signing-our-3").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--model", "boat", "--water", "test-tank"), "--model must be one of"),
        (("--model", "miniglider", "--water", "mars"), "mars"),
        (("--model", "miniglider", "--water", "test-tank", "--link", "smoke://hill"), "smoke"),
        (("--model", "miniglider", "--water", "test-tank", "--system", "900"), "--system: "),
        ((*BAY, "--workshop", "--purpose", "x"), "--purpose"),
        ((*BAY, "--signed"), "not both"),
    ],
)
def test_what_does_not_fit_is_named_and_nothing_is_kept(folder, capsys, words, said):
    assert add(folder, "our-1", *words) != 0
    assert said in capsys.readouterr().err
    grace("robot", "list", "--data", folder)
    assert "our-1" not in capsys.readouterr().out


def test_a_folder_on_which_a_station_runs_is_left_to_it(folder, capsys):
    with hold_data_folder(folder):
        assert add(folder, "our-1", *BAY) == 1
    assert "--url" in capsys.readouterr().err


def test_the_action_of_the_flight_program_may_be_left_out(tmp_path, capsys):
    for action in ((), ("fly",)):
        flight = ("--nodes", tmp_path / "none.json", "--radio", "tcp://h:1", "--memory", tmp_path)
        assert grace("robot", *action, "grace-1", *flight) == 2
        assert "--nodes: " in capsys.readouterr().err


def test_the_flight_program_imports_nothing_of_the_station():
    code = (
        "import sys; from server.cli.robot_verb import run, add_arguments;"
        "print(sorted({'sqlalchemy', 'fastapi', 'httpx'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
