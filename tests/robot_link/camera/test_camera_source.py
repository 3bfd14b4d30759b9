"""Pictures come from the network, webcams and files, and every fault of theirs is told."""

import ssl
import time
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from itertools import islice

import cv2
import httpx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_link.camera.sighting import SourceSettings
from robot_link.camera.source import device, http
from robot_link.camera.source import newest as newest_module
from robot_link.camera.source.frame import SourceEndedError, SourceError
from robot_link.camera.source.multipart import MultipartReader, boundary_of
from robot_link.camera.source.newest import Newest, open_source
from robot_link.camera.uri import DeviceUri, camera_uri
from robot_link.camera.wire import BODY_MAX
from tests.free_port import free_port
from tests.robot_link.camera.camera_server import jpeg, noise, serving

RNG = np.random.default_rng()


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """A machine that stands still for seconds makes no camera silent."""
    monkeypatch.setattr(http, "TIMEOUT_S", 60.0)


def a_jpeg():
    return jpeg(noise(RNG))


def frames(uri, **settings):
    return open_source(camera_uri(uri), SourceSettings("tank-1", uri, **settings))


@pytest.mark.parametrize("path", ["stream", "lengthless", "one"])
def test_pictures_come_whole_however_the_camera_sends_them(path):
    sent = [a_jpeg() for _ in range(5)]
    waiting = iter([*sent, *(a_jpeg() for _ in range(50))])
    with serving(lambda: next(waiting)) as camera:
        got = list(islice(frames(f"{camera.address}/{path}?fps=60"), 5))
        assert [frame.content for frame in got] == sent


def test_a_picture_was_taken_before_it_arrived():
    with serving(a_jpeg) as camera:
        usual = next(frames(f"{camera.address}/stream"))
        told = next(frames(f"{camera.address}/stream", latency_s=0.25))
    assert usual.arrived_at - usual.taken_at == timedelta(seconds=0.03)
    assert told.arrived_at - told.taken_at == timedelta(seconds=0.25)
    assert abs((datetime.now(UTC) - told.arrived_at).total_seconds()) < 60.0


@pytest.mark.parametrize(
    ("path", "complaint"),
    [
        ("page", "answers with text/html, which is no picture"),
        ("elsewhere", "sends elsewhere, which is not followed"),
        ("closed", "wants a user and a password"),
        ("endless", "longer than 8388608"),
        ("cut", "ended its stream"),
        ("nowhere", "answers 404 Not Found"),
    ],
)
def test_a_camera_that_answers_wrongly_is_told_in_words(path, complaint):
    with serving(a_jpeg, 0.001) as camera, pytest.raises(SourceError, match=complaint):
        list(islice(frames(f"{camera.address}/{path}"), 10))


def test_a_redirect_is_not_followed():
    with serving(a_jpeg) as camera:
        with pytest.raises(SourceError):
            next(frames(f"{camera.address}/elsewhere"))
        assert camera.asked == ["/elsewhere"]


def test_a_password_is_told_only_where_the_camera_asks_for_it_and_is_in_no_address():
    with serving(a_jpeg) as camera:
        got = next(frames(f"{camera.address}/closed", user="tank", password="secret"))
        assert got.content.startswith(b"\xff\xd8")
        with pytest.raises(SourceError, match="others than these") as refusal:
            next(frames(f"{camera.address}/closed", user="tank", password="hidden"))
        assert "hidden" not in str(refusal.value)
        assert not any("secret" in path for path in camera.asked)


def test_a_camera_that_says_nothing_is_given_up(monkeypatch):
    monkeypatch.setattr(http, "TIMEOUT_S", 0.2)
    with serving(a_jpeg) as camera, pytest.raises(SourceError, match="says nothing"):
        next(frames(f"{camera.address}/silent"))


def test_nobody_at_an_address_is_told():
    with pytest.raises(SourceError, match="nobody answers there"):
        next(frames(f"http://127.0.0.1:{free_port()}/stream"))


def test_certificates_are_verified_and_proxies_not_asked(monkeypatch):
    monkeypatch.setenv("HTTPS_PROXY", "http://127.0.0.1:9")
    seen = {}

    class Client(httpx.Client):
        def __init__(self, **options):
            seen.update(options)
            super().__init__(**options)

    monkeypatch.setattr(httpx, "Client", Client)
    http._client().close()
    assert seen["verify"].verify_mode == ssl.CERT_REQUIRED
    assert seen["verify"].check_hostname
    assert (seen["trust_env"], seen["follow_redirects"]) == (False, False)


@given(
    pictures=st.lists(st.binary(max_size=80).map(lambda b: b"\xff\xd8" + b + b"\xff\xd9")),
    line=st.sampled_from([b"\r\n", b"\n"]),
    dashes=st.sampled_from(["", "--"]),
    with_length=st.booleans(),
    data=st.data(),
)
def test_parts_arrive_whole_however_the_stream_is_cut(pictures, line, dashes, with_length, data):
    boundary = boundary_of(f'multipart/x-mixed-replace;boundary="{dashes}b0und4ry"')
    stream = b""
    for picture in pictures:
        length = b"Content-Length: %d" % len(picture) + line if with_length else b""
        stream += boundary + line + b"Content-Type: image/jpeg" + line + length + line
        stream += picture + line
    stream += boundary + line
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=10)))
    reader, got = MultipartReader(boundary), []
    for begin, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        got += reader.take(stream[begin:end])
    assert got == pictures


@pytest.mark.parametrize(
    "stream",
    [
        b"--b\r\n" + b"X: y\r\n" * 4000,
        b"--b\r\nContent-Length: %d\r\n\r\n" % (BODY_MAX + 1),
        b"--b\r\n\r\n" + bytes(BODY_MAX + 100),
    ],
)
def test_a_part_without_end_is_refused(stream):
    with pytest.raises(SourceError, match="longer than"):
        MultipartReader(b"--b").take(stream)


@given(stream=st.binary(max_size=300))
def test_no_stream_brings_the_reader_down(stream):
    reader = MultipartReader(b"--b")
    assert all(len(part) <= len(stream) for part in reader.take(stream))
    assert len(reader._rest) <= len(stream)


def test_a_stream_that_tells_no_boundary_is_refused():
    with pytest.raises(SourceError, match="what stands between"):
        boundary_of("multipart/x-mixed-replace")


@pytest.mark.parametrize("of_camera", ["", "tank-1-"])
def test_a_folder_is_shown_in_order_from_now_on_as_its_names_say(tmp_path, of_camera):
    folder = tmp_path / "tank-1"
    folder.mkdir()
    names = [f"{of_camera}20261122T150405.{ms}000Z.jpg" for ms in (100, 150)]
    for name in names:
        (folder / name).write_bytes(a_jpeg())
    (tmp_path / "outside.jpg").write_bytes(a_jpeg())
    (folder / "20261122T150406.000000Z.jpg").symlink_to(tmp_path / "outside.jpg")
    (folder / "notes.txt").write_text("no picture")
    shown, begun = [], datetime.now(UTC)
    with pytest.raises(SourceEndedError, match="all 2 pictures"):
        shown.extend(frames("folder:tank-1", folder=str(tmp_path)))
    assert [frame.content for frame in shown] == [(folder / n).read_bytes() for n in names]
    first, second = shown
    assert second.taken_at - first.taken_at == timedelta(seconds=0.05)
    assert begun <= first.taken_at <= first.arrived_at
    assert second.taken_at <= second.arrived_at


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("folder:none", "there is no folder none"),
        ("folder:empty", "has no picture"),
        ("folder:away", "leads out"),
        ("video:none.mp4", "there is no film none.mp4"),
        ("video:list.mp4", "is no film that can be read"),
    ],
)
def test_files_that_are_none_are_told(tmp_path, uri, complaint):
    (tmp_path / "empty").mkdir()
    (tmp_path / "away").symlink_to("/etc")
    (tmp_path / "list.mp4").write_text("#EXTM3U\n#EXTINF:10,\nhttp://127.0.0.1:9/x.ts\n")
    with pytest.raises(SourceError, match=complaint):
        next(frames(uri, folder=str(tmp_path)))
    with pytest.raises(SourceError, match="GRACE_CAMERA_DIR"):
        next(frames(uri))


def test_a_film_is_shown_to_its_end(tmp_path):
    path = tmp_path / "dive.avi"
    film = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (320, 240))
    for _ in range(4):
        film.write(cv2.cvtColor(noise(RNG), cv2.COLOR_GRAY2BGR))
    film.release()
    shown = []
    with pytest.raises(SourceEndedError, match="all 4 pictures"):
        shown.extend(frames("video:dive.avi?fps=60", folder=str(tmp_path)))
    assert {frame.content.shape for frame in shown} == {(240, 320, 3)}


class Webcam:
    """What OpenCV gives of a webcam, for this machine has none."""

    def __init__(self, age_s):
        self.age_s, self.properties = age_s, {}
        self.jpeg = a_jpeg()
        self.is_released = False

    def isOpened(self):  # noqa: N802 - OpenCV's name
        return True

    def get(self, name):
        if name == cv2.CAP_PROP_POS_MSEC:
            return 1e3 * (time.clock_gettime(time.CLOCK_MONOTONIC) - self.age_s)
        return self.properties.get(name, 0.0)

    def set(self, name, value):
        self.properties[name] = value
        return True

    def read(self):
        return True, np.frombuffer(self.jpeg, dtype=np.uint8)[None]

    def release(self):
        self.is_released = True


@pytest.mark.parametrize(("age_s", "told_s"), [(0.4, 0.4), (1e6, 0.08), (-5.0, 0.08)])
def test_a_webcams_driver_tells_when_a_picture_was_taken(monkeypatch, age_s, told_s):
    webcam = Webcam(age_s)
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: webcam)
    monkeypatch.setattr(DeviceUri, "path", lambda _: device.Path("/dev/null"))
    monkeypatch.setattr(device, "_number", lambda _: 0)
    source = frames("v4l2:///dev/video0?size=640x480&fps=5&exposure=0.01")
    frame = next(source)
    assert frame.content == webcam.jpeg
    assert (frame.arrived_at - frame.taken_at).total_seconds() == pytest.approx(told_s, abs=0.3)
    assert webcam.properties[cv2.CAP_PROP_FRAME_WIDTH] == 640.0
    assert webcam.properties[cv2.CAP_PROP_EXPOSURE] == pytest.approx(100.0)
    assert webcam.properties[cv2.CAP_PROP_AUTO_EXPOSURE] == 1.0
    assert webcam.properties[cv2.CAP_PROP_CONVERT_RGB] == 0.0
    source.close()
    assert webcam.is_released


def test_a_webcam_that_is_not_there_is_told():
    with pytest.raises(SourceError, match="there is no /dev/video987: is the camera plugged in"):
        next(frames("v4l2:///dev/video987"))


@contextmanager
def reading(uri):
    """Read a camera, and call no more at its port once the test has ended: it may be another's."""
    newest = Newest(camera_uri(uri), SourceSettings("tank-1", uri))
    newest.start()
    try:
        yield newest
    finally:
        newest.has_ended = True


def test_the_newest_picture_is_kept_and_those_that_waited_are_counted(monkeypatch):
    monkeypatch.setattr(newest_module, "_PAUSES_S", (3600.0,))  # how the source ended stays told
    with serving(a_jpeg, 0.005) as camera, reading(f"{camera.address}/stream?fps=60") as newest:
        while newest.pictures < 30:
            time.sleep(0.01)
        frame = newest.take(1.0)
        assert frame is not None
        assert newest.dropped >= 25
        while newest.take(5.0) is None:
            pass
        camera.is_stopped.set()
        while not newest.failure:
            time.sleep(0.01)
    assert "ended" in newest.failure or "breaks off" in newest.failure


def test_a_source_that_ended_is_opened_again():
    with serving(a_jpeg) as camera, reading(f"{camera.address}/cut") as newest:
        while len(camera.asked) < 2:
            time.sleep(0.02)
        while newest.failure:
            time.sleep(0.01)
        assert newest.pictures > 3
