"""``grace camera``: what is asked wrongly is refused, what is right is printed or looked at."""

import pytest

from robot_link.camera import extra
from server.cli.main import main
from tests.robot_link.camera.camera_server import serving
from tests.robot_link.camera.test_camera_doctor import fixed_tags


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["print", "0-2,99"], 2, "are not ids of robots"),
        (["print", "0", "--size", "5"], 2, "size: 5 mm is not 20 to 600 mm"),
        (["print", "0", "--out", "/proc/none/tags.pdf"], 1, "/proc/none/tags.pdf"),
        (["doctor", "ftp://x"], 2, "unknown kind of camera"),
        (["doctor", "http://192.0.2.7/x", "--seconds", "0"], 2, "--seconds must be above 0"),
        (["doctor", "http://127.0.0.1:9/x", "--password-file", "/none"], 2, "cannot be read"),
    ],
)
def test_what_cannot_be_done_is_refused_in_words(words, status, said, capsys):
    assert main(["camera", *words]) == status
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("ids", ["0-2,100", "board"])
def test_sheets_are_written(ids, tmp_path, capsys):
    out = tmp_path / "sheet.pdf"
    assert main(["camera", "print", ids, "--out", str(out)]) == 0
    assert out.read_bytes().startswith(b"%PDF-")
    assert "Print at 100 %" in capsys.readouterr().out


@pytest.mark.process
def test_the_doctor_looks_and_its_status_says_whether_tags_are_seen(capsys, tmp_path):
    with serving(fixed_tags, 0.1) as camera:
        uri = f"{camera.address}/stream"
        # As long as a busy machine needs to begin looking.
        assert main(["camera", "doctor", uri, "--seconds", "5", "--data", str(tmp_path)]) == 0
        assert "Tag 100 (fixed)" in capsys.readouterr().out
        uri = f"{camera.address}/page"
        assert main(["camera", "doctor", uri, "--seconds", "1", "--data", str(tmp_path)]) == 1


def test_without_the_extra_the_verb_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setattr(extra, "_PACKAGES", {"no_such_package": "OpenCV"})
    assert main(["camera", "print", "0"]) == 1
    assert "OpenCV is not installed: install the extra camera" in capsys.readouterr().err
