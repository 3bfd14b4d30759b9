"""Files that are replaced whole or not at all."""

import os

import pytest

from robot_link.whole_file import replace_file


def test_a_file_is_replaced_and_nothing_is_left_beside_it(tmp_path):
    path = tmp_path / "deep" / "memory.json"
    for data in (b"one", b"two"):
        replace_file(path, data)
        assert path.read_bytes() == data
    assert os.listdir(path.parent) == ["memory.json"]


def test_a_cut_before_the_end_leaves_the_old_file_and_the_next_one_goes_on(tmp_path, monkeypatch):
    path = tmp_path / "memory.json"
    replace_file(path, b"old")

    def cut(_descriptor):
        raise OSError(28, "no space left on device")

    with monkeypatch.context() as broken:
        broken.setattr(os, "fsync", cut)
        with pytest.raises(OSError, match="no space"):
            replace_file(path, b"new")
    assert path.read_bytes() == b"old"
    replace_file(path, b"newer")
    assert path.read_bytes() == b"newer"


def test_a_secret_is_never_readable_by_others(tmp_path):
    replace_file(tmp_path / "key", b"secret", mode=0o600)
    assert (tmp_path / "key").stat().st_mode & 0o777 == 0o600
