"""Files about parameters: right, or refused with the line or the field."""

import json
import lzma

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_link.service import parameter_file
from robot_link.service.parameter_file import (
    ParameterFileError,
    descriptions,
    parameter_uri,
    saved_values,
)

ROW = {
    "name": "WPNAV_SPEED",
    "shortDesc": "Waypoint speed",
    "longDesc": "On the way to a waypoint.",
    "units": "cm/s",
    "default": 60,
    "min": 10.0,
    "max": 90,
    "values": [{"value": 1, "description": "slow"}, {"description": "nothing"}, 7],
    "rebootRequired": True,
}


def document(*rows):
    return json.dumps({"version": 1, "parameters": list(rows)}).encode()


def as_lzma(content):
    return lzma.compress(content, format=lzma.FORMAT_ALONE)


@pytest.mark.parametrize("pack", [bytes, lzma.compress, as_lzma])
def test_metadata_are_read_plain_and_compressed(pack):
    (one,) = descriptions(pack(document(ROW))).values()
    assert (one.name, one.title, one.unit) == ("WPNAV_SPEED", "Waypoint speed", "cm/s")
    assert (one.default, one.minimum, one.maximum) == (60.0, 10.0, 90.0)
    assert (one.values, one.needs_reboot) == (((1.0, "slow"),), True)


def test_what_metadata_do_not_say_is_absent():
    (one,) = descriptions(document({"name": "A", "default": float("nan"), "max": 10**400})).values()
    assert (one.default, one.maximum, one.unit, one.values) == (None, None, "", ())


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"{", "no JSON"),
        (b"[1]", "no JSON object"),
        (b"{}", "no list 'parameters'"),
        (document({"name": "A"}, 3), "entry 2 of 'parameters' is no object"),
        (document({"name": "A"}, {"units": "m"}), "parameter 2 of the file has no name"),
        (lzma.compress(document(ROW))[:-20], "ends too early|cannot be unpacked"),
        (b"\xfd7zXZ\x00rubbish rubbish rubbish", "cannot be unpacked"),
    ],
)
def test_what_is_no_metadata_is_refused_with_the_reason(content, words):
    with pytest.raises(ParameterFileError, match=words):
        descriptions(content)


def test_a_bomb_is_refused_before_it_is_unpacked_whole(monkeypatch):
    monkeypatch.setattr(parameter_file, "LARGEST_BYTES", 100_000)
    with pytest.raises(ParameterFileError, match="unpacked it is larger"):
        descriptions(lzma.compress(bytes(5_000_000)))
    with pytest.raises(ParameterFileError, match="larger than"):
        descriptions(bytes(200_000))


def test_general_json_names_the_file():
    types = [{"type": 2, "uri": "mftp:///a"}, {"type": 1, "uri": "mftp:///p.xz", "fileCrc": 9}]
    told = json.dumps({"metadataTypes": types}).encode()
    assert parameter_uri(told) == ("mftp:///p.xz", 9)
    with pytest.raises(ParameterFileError, match="names no file"):
        parameter_uri(b'{"metadataTypes": []}')


def test_saved_values_of_both_ground_stations_are_read():
    qgc = "# Onboard parameters\n1\t1\tWPNAV_SPEED\t60.5\t9\n1\t1\tFS_LEAK\t2\t2\n"
    assert saved_values(qgc) == {"WPNAV_SPEED": 60.5, "FS_LEAK": 2.0}
    ardupilot = "WPNAV_SPEED,60.5\nFS_LEAK 2  # comes up\n\n"
    assert saved_values(ardupilot) == saved_values(qgc)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("A 1\nB\n", "line 2 holds no name and value"),
        ("A 1\nB x\n", "line 2: 'x' of B is no number"),
        ("A nan\n", "line 1: 'nan' of A is no number"),
        ("A 1\nA 2\n", "line 2 names A a second time"),
        ("# nothing\n", "holds no parameter"),
        ("A_NAME_THAT_IS_TOO_LONG 1\n", "line 1"),
    ],
)
def test_saved_values_that_are_none_are_refused_with_their_line(text, words):
    with pytest.raises(ParameterFileError, match=words):
        saved_values(text)


@given(st.binary(max_size=300))
def test_no_bytes_break_the_reader(content):
    try:
        descriptions(content)
    except ParameterFileError:
        return


@given(st.text(max_size=200))
def test_no_text_breaks_the_reader(text):
    try:
        saved_values(text)
    except ParameterFileError:
        return
