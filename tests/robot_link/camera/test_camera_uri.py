"""A camera's URI says what it is, or is refused with what is wrong; files cannot leave."""

from urllib.parse import urlsplit

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_link.camera.uri import (
    CAMERA_SCHEMES,
    DeviceUri,
    FileUri,
    HttpUri,
    RtspUri,
    camera_uri,
)


@pytest.mark.parametrize(
    ("text", "camera"),
    [
        (
            "v4l2:///dev/video0?size=1920x1080&fps=5&exposure=0.01",
            DeviceUri("/dev/video0", (1920, 1080), 5, 0.01),
        ),
        ("v4l2:///dev/video12", DeviceUri("/dev/video12", (1280, 720), 10, None)),
        ("http://127.0.0.1:5000/camera/1?fps=7", HttpUri("http://127.0.0.1:5000/camera/1", 7)),
        (
            "https://cam.example.org/?action=stream&fps=2&quality=80",
            HttpUri("https://cam.example.org/?action=stream&quality=80", 2),
        ),
        ("http://[::1]:80/x", HttpUri("http://[::1]:80/x", 10)),
        ("rtsp://192.0.2.7/h264?transport=udp", RtspUri("rtsp://192.0.2.7/h264", "udp", 10)),
        ("rtsp://192.0.2.7:8554/a?x=1", RtspUri("rtsp://192.0.2.7:8554/a?x=1", "tcp", 10)),
        ("folder:tank-1/monday?fps=3", FileUri("tank-1/monday", False, 3)),
        ("video:dive.MP4", FileUri("dive.MP4", True, 5)),
    ],
)
def test_every_kind_of_camera_is_known_by_its_uri(text, camera):
    assert camera_uri(text) == camera
    assert 0.0 <= camera.latency_s <= 0.3


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "unknown kind of camera ''"),
        ("file:///etc/passwd", "unknown kind of camera 'file'"),
        ("ftp://192.0.2.7/x.jpg", "unknown kind of camera 'ftp'"),
        ("/dev/video0", "unknown kind of camera"),
        ("v4l2:///dev/sda", "a webcam is a device /dev/video"),
        ("v4l2:///dev/video0/../sda", "a webcam is a device /dev/video"),
        ("v4l2:///dev/../etc/video0", "a webcam is a device /dev/video"),
        ("v4l2://dev/video0", "three slashes"),
        ("v4l2:///dev/video0?size=1280", "size must be width x height"),
        ("v4l2:///dev/video0?size=9000x20", "size must be 64 to 4096 px a side, not 9000x20"),
        ("v4l2:///dev/video0?fps=0", "fps must be 1 to 60, not 0"),
        ("v4l2:///dev/video0?fps=9.5", "fps must be a whole number"),
        ("v4l2:///dev/video0?exposure=2", "exposure must be 0.0001 to 1, not 2"),
        ("v4l2:///dev/video0?exposure=nan", "exposure must be a number, not 'nan'"),
        ("v4l2:///dev/video0?gain=3", "unknown option gain"),
        ("http:///path", "needs its host"),
        ("http://me:secret@192.0.2.7/x", "no user name and no password"),
        ("http://me@192.0.2.7/x", "no user name"),
        ("http://192.0.2.7/x?user=a&PWD=b", "no user name and no password, and no option user"),
        ("http://192.0.2.7/x?fps=1&fps=2", "fps is given twice"),
        ("http://192.0.2.7:0/x", "port must be 1 to 65535"),
        ("http://192.0.2.7:99999/x", "[Pp]ort"),
        ("http://a\\b/x", "cannot be the name of a machine"),
        ("http://a..b/x", "cannot be the name of a machine"),
        ("http://a b/x", "spaces"),
        ("http://192.0.2.7/x#y", "after a #"),
        ("rtsp://192.0.2.7/x?transport=http", "transport must be tcp or udp, not 'http'"),
        ("folder:", "is named below GRACE_CAMERA_DIR"),
        ("folder:/etc", "is named below GRACE_CAMERA_DIR"),
        ("folder://etc/x", "is named below GRACE_CAMERA_DIR"),
        ("folder:../x", "is named below GRACE_CAMERA_DIR"),
        ("folder:a/../../x", "is named below GRACE_CAMERA_DIR"),
        ("folder:%2e%2e/x", "is named below GRACE_CAMERA_DIR"),
        ("folder:.ssh", "is named below GRACE_CAMERA_DIR"),
        ("folder:a?loop=1", "unknown option loop"),
        ("video:dive.m3u8", "a video ends in"),
        (f"http://192.0.2.7/{'a' * 5000}", "at most 2000 characters"),
    ],
)
def test_a_wrong_camera_is_refused_with_what_is_wrong(text, complaint):
    with pytest.raises(ValueError, match=complaint) as refusal:
        camera_uri(text)
    assert str(refusal.value).startswith(text[:20])


_WRITTEN = st.one_of(
    st.text(max_size=60),
    st.builds(
        "{}{}{}{}".format,
        st.sampled_from([*CAMERA_SCHEMES, "file", "HTTP", "gopher"]),
        st.sampled_from([":", "://", ":///", ":///dev/video", "://user@"]),
        st.text(alphabet="ab1.:/@\\%?#&=[]~ é\0-_", max_size=40),
        st.sampled_from(["", "?fps=3", "?size=1x1", "?exposure=1e9", "?transport=tcp", "#x"]),
    ),
)


def camera_or_complaint(text):
    try:
        return camera_uri(text)
    except ValueError as refusal:
        return str(refusal)


@given(text=_WRITTEN)
def test_whatever_is_written_is_a_camera_or_refused_in_words(text):
    match camera_or_complaint(text):
        case str(complaint):
            assert complaint.startswith(text[:20])
        case DeviceUri(device=device):
            assert device.startswith("/dev/video")
            assert device.count("/") == 2
        case FileUri(name=name):
            assert ".." not in name.split("/")
            assert not name.startswith("/")
        case HttpUri(url=url):
            assert urlsplit(url).scheme in ("http", "https")
            assert "@" not in urlsplit(url).netloc
        case RtspUri(url=url):
            assert urlsplit(url).scheme == "rtsp"
            assert "@" not in urlsplit(url).netloc


@given(name=st.text(alphabet="ab./~%_-", min_size=1, max_size=30))
def test_no_name_leads_out_of_the_folder_of_cameras(name, tmp_path_factory):
    folder = tmp_path_factory.getbasetemp() / "cameras"
    try:
        path = camera_uri(f"folder:{name}").path(folder)
    except ValueError:
        return
    assert path.is_relative_to(folder.resolve())


def test_a_link_out_of_the_folder_is_not_followed(tmp_path):
    outside, folder = tmp_path / "outside", tmp_path / "cameras"
    outside.mkdir()
    (folder / "real").mkdir(parents=True)
    (folder / "away").symlink_to(outside)
    (folder / "inside").symlink_to(folder / "real")
    with pytest.raises(ValueError, match="away leads out of GRACE_CAMERA_DIR"):
        camera_uri("folder:away").path(folder)
    with pytest.raises(ValueError, match="is not set"):
        camera_uri("folder:real").path(None)
    assert camera_uri("folder:inside").path(folder) == (folder / "real").resolve()


def test_a_device_that_is_no_video_device_is_not_opened():
    with pytest.raises(ValueError, match="no video device"):
        DeviceUri("/dev/null", (640, 480), 5, None).path()
