"""``grace deployment``: a life from the water to whoever gets the data, on a data folder."""

import hashlib
import json
import re
import zipfile

import pytest

from tests.server.cli.test_cli import grace
from tests.server.cli.test_robot_verb import BAY, add
from tests.server.delivery.test_file_api import METADATA


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "data"
    assert add(folder, "our-1", *BAY, "--deployment", "First") == 0
    return folder


def step(folder, *words):
    return grace("deployment", *words, "--data", folder)


def test_a_deployment_ends_is_reviewed_delivered_and_reopened(folder, capsys):
    capsys.readouterr()
    one = "deployment-1"
    assert step(folder, "review", one) == 1
    assert "would have to be recovered" in capsys.readouterr().err
    for words, state in (
        (("end", one), "recovered"),
        (("review", one, "--note", "One spike"), "reviewed"),
        (("deliver", one, "--to", "A data centre"), "delivered"),
        (("reopen", one, "--reason", "A bad stretch"), "recovered"),
    ):
        assert step(folder, *words) == 0
        assert capsys.readouterr().out == f"{one} of our-1 is {state}.\n"
    step(folder, "list", "--robot", "our-1")
    assert capsys.readouterr().out.split() == [one, "our-1", "recovered", "0", "samples", "First"]


def test_a_moment_that_has_not_come_and_an_unknown_id_are_refused(folder, capsys):
    assert step(folder, "end", "deployment-1", "--at", "2999-01-01T00:00:00") == 2
    assert "has not come yet" in capsys.readouterr().err
    assert step(folder, "end", "deployment-9") == 1
    assert "deployment-9" in capsys.readouterr().err


def test_data_are_checked_and_flagged_by_hand(folder, capsys):
    capsys.readouterr()
    assert step(folder, "check", "deployment-1") == 0
    lines = capsys.readouterr().out.splitlines()
    assert " ".join(lines[-1].split()) == "depth all 0 good, 0 not evaluated, 0 suspect, 0 fail"
    flag = ("flag", "deployment-1", "--series", "depth", "--flag", "probably-bad")
    past = ("--from", "2001-01-01T00:00", "--to", "2001-01-01T00:05", "--reason", "Mud")
    assert step(folder, *flag, *past) == 1
    assert "first_at" in capsys.readouterr().err


def test_a_file_is_written_once_the_metadata_say_who_answers_for_it(folder, tmp_path, capsys):
    out = tmp_path / "out"
    assert step(folder, "netcdf", "deployment-1", str(out)) == 2
    out.mkdir()
    assert step(folder, "netcdf", "deployment-1", str(out)) == 1
    said = capsys.readouterr().err
    assert "metadata.principal_investigator.name: Principal investigator, name" in said
    assert list(out.iterdir()) == []
    words = tmp_path / "metadata.json"
    words.write_text(json.dumps({"license": "none at all"}))
    assert step(folder, "metadata", "--robot", "our-1", "--file", str(words)) == 1
    assert "license" in capsys.readouterr().err
    words.write_text(json.dumps(METADATA))
    assert step(folder, "metadata", "--robot", "our-1", "--file", str(words)) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["principal_investigator"] == METADATA["principal_investigator"]
    assert step(folder, "netcdf", "deployment-1", str(out)) in (0, 1)
    (file,) = out.iterdir()
    assert re.fullmatch(r"our-1_\d{8}T\d{6}_R\.nc", file.name)
    assert "own: passed" in capsys.readouterr().out
    assert step(folder, "netcdf", "deployment-1", str(out)) == 1
    assert "is there already" in capsys.readouterr().err


def test_a_delivery_is_packed_whole_or_not_at_all(folder, tmp_path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    assert step(folder, "pack", "deployment-1", str(out)) == 1
    assert "metadata.principal_investigator.name" in capsys.readouterr().err
    assert list(out.iterdir()) == []
    words = tmp_path / "metadata.json"
    words.write_text(json.dumps(METADATA))
    assert step(folder, "metadata", "--file", str(words)) == 0
    capsys.readouterr()
    assert step(folder, "pack", "deployment-1", str(out), "--journal") == 0
    (file,) = out.iterdir()
    assert re.fullmatch(r"our-1_\d{8}T\d{6}_R\.zip", file.name)
    sha256 = hashlib.sha256(file.read_bytes()).hexdigest()
    assert capsys.readouterr().out == f"deployment-1 is in {file}, SHA-256 {sha256}.\n"
    with zipfile.ZipFile(file) as packed:
        names = {name.split("/", 1)[1] for name in packed.namelist()}
    assert {"bagit.txt", "manifest-sha256.txt", f"data/netcdf/{file.stem}.nc"} <= names
    assert step(folder, "pack", "deployment-1", str(out)) == 1
    assert "is there already" in capsys.readouterr().err
    assert list(out.iterdir()) == [file]
