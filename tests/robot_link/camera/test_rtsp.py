"""A network camera by RTSP: its pictures come, its silence ends, its password is in no log."""

import socket
from functools import cache
from itertools import count, cycle, islice

import cv2
import numpy as np
import pytest

from robot_link.camera.sighting import Sighting, SourceReport, SourceSettings
from robot_link.camera.source import stream
from robot_link.camera.source.frame import SourceError
from robot_link.camera.source.newest import open_source
from robot_link.camera.uri import camera_uri
from tests.robot_link.camera.drawn import scene
from tests.robot_link.camera.rtsp_server import playing
from tests.robot_link.camera.test_camera_process import Process

RNG = np.random.default_rng()
SIZE = (640, 400)


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """A machine that stands still for seconds makes no camera silent."""
    monkeypatch.setattr(stream, "TIMEOUT_S", 60.0)


@cache
def pictures():
    """Return a few pictures again and again: to draw one takes longer than to send many."""
    drawn = []
    for _ in range(4):
        grey, _ = scene(RNG, SIZE, {0: (100, 120, 40), 101: (400, 250, 60)})
        colour = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
        drawn.append(cv2.imencode(".jpg", colour, [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes())
    return cycle(drawn)


def picture():
    return next(pictures())


def frames(uri, **settings):
    return open_source(camera_uri(uri), SourceSettings("tank-1", uri, **settings))


def test_pictures_come_by_rtsp_on_one_connection():
    with playing(picture, SIZE) as camera:
        got = list(islice(frames(f"{camera.address}/h?transport=tcp"), 3))
    assert {frame.content.shape for frame in got} == {(SIZE[1], SIZE[0], 3)}
    assert (got[0].arrived_at - got[0].taken_at).total_seconds() == pytest.approx(0.30)
    assert any("RTP/AVP/TCP" in transport for _, _, transport in camera.asked)


def test_a_slow_camera_is_open_with_its_first_pictures(monkeypatch):
    monkeypatch.setattr(stream, "TIMEOUT_S", 3600.0)  # what waits for more pictures does not end
    sent = count()

    def slow():
        if next(sent) >= 4:
            camera.is_stopped.wait()
        return picture()

    with playing(slow, SIZE) as camera:
        got = next(frames(f"{camera.address}/h"))
    assert got.content.shape == (SIZE[1], SIZE[0], 3)


def test_a_wrong_password_is_told_and_is_in_no_words():
    with playing(picture, SIZE) as camera:
        got = next(frames(f"{camera.address}/closed", user="tank", password="secret"))
        assert got.content.size
        with pytest.raises(SourceError, match="another user and password") as refusal:
            next(frames(f"{camera.address}/closed", user="tank", password="hidden"))
    assert "hidden" not in str(refusal.value)


def test_a_camera_that_sends_elsewhere_is_not_followed():
    with playing(picture, SIZE) as camera, playing(picture, SIZE) as other:
        camera.elsewhere = f"{other.address}/h"
        with pytest.raises(SourceError, match="sends elsewhere, which is not followed"):
            next(frames(f"{camera.address}/elsewhere", user="tank", password="secret"))
    assert other.asked == []


def test_a_camera_that_says_nothing_is_given_up(monkeypatch):
    monkeypatch.setattr(stream, "TIMEOUT_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        uri = f"rtsp://127.0.0.1:{silent.getsockname()[1]}/x"
        with pytest.raises(SourceError, match="cannot be reached"):
            next(frames(uri))


@pytest.mark.process
def test_the_process_sees_tags_by_rtsp_and_prints_no_password():
    with playing(picture, SIZE) as camera:
        uri = f"{camera.address}/closed"
        process = Process(uri=uri, user="tank", password="hidden")
        report = process.until(lambda m: isinstance(m, SourceReport) and m.state == "failed")
        assert "hidden" not in report.words
        process.child.stdin.close()
        process.child.wait()
        assert b"hidden" not in process.child.stderr.read()
        process.end()
        process = Process(uri=uri, user="tank", password="secret")
        seen = process.until(lambda m: isinstance(m, Sighting) and len(m.tags) == 2)
        assert sorted(tag.id for tag in seen.tags) == [0, 101]
        assert process.end() == 0
