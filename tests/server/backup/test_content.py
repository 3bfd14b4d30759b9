"""Nothing of a data folder is forgotten: each of its folders is in a backup, or left out."""

import ast
import io
import json
import tarfile
from pathlib import Path

import pytest

import server
from server.backup.archive import drain, read_archive, write_archive
from server.backup.content import KEPT, LEFT_OUT, MANIFEST, files_of, is_member
from server.backup.failure import BackupError
from server.base.settings import Settings


def folders_in_code() -> set[str]:
    """Return the names that the station's code has for folders of the data folder."""
    found = {Settings().secret_dir.name, "parameters"}
    for path in Path(server.__file__).parent.rglob("*.py"):
        for node in ast.parse(path.read_text()).body:
            match node:
                case (
                    ast.Assign(targets=[ast.Name(id=name)], value=ast.Constant(value=str(value)))
                    | ast.AnnAssign(target=ast.Name(id=name), value=ast.Constant(value=str(value)))
                ) if name.endswith("FOLDER"):
                    found.add(value)
    return found


def test_every_folder_of_a_data_folder_is_backed_up_or_left_out_on_purpose():
    assert not set(KEPT) & set(LEFT_OUT)
    assert {"secret", "delivery", "film"} <= folders_in_code()
    assert folders_in_code() - {*KEPT, *LEFT_OUT} == set()


def test_what_is_half_written_or_points_elsewhere_is_not_packed(tmp_path):
    for name in ("secret/robot-a", "secret/.robot-a.new", "log_pictures/.part/one.png",
                 "camera_pictures/deployment-1/cam-1/1.jpg", "film/1.mp4"):  # fmt: skip
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    (tmp_path / "secret/link").symlink_to("/etc/passwd")
    names = [name for name, _ in files_of(tmp_path)]
    assert names == ["secret/robot-a", "camera_pictures/deployment-1/cam-1/1.jpg"]
    assert all(map(is_member, names))


@pytest.mark.parametrize(
    "name", ["../secret/a", "secret/../../a", "/secret/a", "film/1", "other", "secret"]
)
def test_no_member_leads_anywhere_else(name):
    assert not is_member(name)


def packed(folder: Path, **about: str) -> bytes:
    sink = io.BytesIO()
    files = [(name, folder / name) for name in ("secret/a", "log/b", "log/gone")]
    write_archive(sink, files, about, lambda _: None)
    return sink.getvalue()


@pytest.fixture
def folder(tmp_path):
    for name in ("secret/a", "log/b"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text(name * 1000)
    return tmp_path


def test_other_programs_can_unpack_it_and_the_manifest_tells_what_is_in_it(folder):
    data = packed(folder, schema="0043")
    with tarfile.open(fileobj=io.BytesIO(data)) as archive:
        assert archive.getnames() == ["secret/a", "log/b", MANIFEST]
        assert {member.mode for member in archive} == {0o600}
        document = json.load(archive.extractfile(MANIFEST))
    assert (document["format"], document["schema"]) == (1, "0043")
    assert document["files"]["secret/a"]["bytes"] == 8000
    read = read_archive(io.BytesIO(data), "lake", drain)
    assert {name: one.sha256 for name, one in read.items()} == {
        name: one["sha256"] for name, one in document["files"].items()
    }


def repacked(data: bytes, change) -> bytes:
    """Return an archive with another content, whole in all but its manifest."""
    sink = io.BytesIO()
    with (
        tarfile.open(fileobj=io.BytesIO(data)) as old,
        tarfile.open(fileobj=sink, mode="w:gz") as new,
    ):
        for member in old:
            content = change(member.name, old.extractfile(member).read())
            if content is not None:
                member.size = len(content)
                new.addfile(member, io.BytesIO(content))
    return sink.getvalue()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda name, data: data + b"!" if name == "log/b" else data, "log/b is not what"),
        (lambda name, data: None if name == "secret/a" else data, "secret/a is not what"),
        (lambda name, data: b"{" if name == MANIFEST else data, "manifest cannot be read"),
        (lambda name, data: b'{"format": 2}' if name == MANIFEST else data, "format 2"),
    ],
)
def test_an_archive_that_is_not_what_its_manifest_says_is_refused(folder, change, said):
    with pytest.raises(BackupError, match=said):
        read_archive(io.BytesIO(repacked(packed(folder), change)), "lake", drain)


def test_an_archive_of_before_there_was_a_manifest_is_read(folder):
    old = repacked(packed(folder), lambda name, data: None if name == MANIFEST else data)
    assert set(read_archive(io.BytesIO(old), "lake", drain)) == {"secret/a", "log/b"}
