"""The real process of a camera, before a camera in the network or a folder."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from robot_link.camera import eye
from robot_link.camera.process import COMMAND
from robot_link.camera.sighting import (
    BoardView,
    Order,
    Region,
    Sighting,
    SourceReport,
    SourceSettings,
)
from robot_link.camera.uri import camera_uri
from robot_link.camera.wire import HEAD, CameraReader, framed
from tests.robot_link.camera.camera_server import jpeg, noise, serving
from tests.robot_link.camera.drawn import board_picture, scene

pytestmark = pytest.mark.process
RNG = np.random.default_rng()
WAIT_S = 60.0
SIZE = (640, 400)


class Process:
    """A camera's process and what it has said."""

    def __init__(self, **settings):
        self.child = subprocess.Popen(
            COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        os.set_blocking(self.child.stdout.fileno(), False)
        self.reader = CameraReader()
        self.said = []
        if settings:
            self.tell(SourceSettings("tank-1", **settings))

    def tell(self, message):
        self.child.stdin.write(framed(message))
        self.child.stdin.flush()

    def hear(self):
        data = self.child.stdout.read()
        if data:
            self.said += self.reader.take(data)
        else:
            time.sleep(0.02)

    def since(self, seen):
        """Yield what was said and what comes, but for the first ``seen`` messages."""
        deadline = time.monotonic() + WAIT_S
        while time.monotonic() < deadline:
            for message in self.said[seen:]:
                seen += 1
                yield message
            self.hear()
        raise AssertionError(f"not said; the last was {self.said[-1:]}")

    def until(self, wanted, since=0):
        """Return the first message that is wanted, of those after the first ``since``."""
        return next(message for message in self.since(since) if wanted(message))

    def end(self):
        if not self.child.stdin.closed:
            self.child.stdin.close()
        try:
            return self.child.wait(WAIT_S)
        finally:
            self.child.kill()
            self.child.wait()
            self.child.stdout.close()
            self.child.stderr.close()


@pytest.fixture
def begin():
    begun = []

    def one(**settings):
        begun.append(Process(**settings))
        return begun[-1]

    yield one
    for process in begun:
        process.end()


def is_state(*states):
    return lambda message: isinstance(message, SourceReport) and message.state in states


def is_sighting(sought):
    return lambda message: isinstance(message, Sighting) and message.sought == sought


def two_tags():
    return jpeg(scene(RNG, SIZE, {0: (100, 120, 36), 101: (400, 250, 50)})[0])


def test_it_sees_everywhere_then_in_regions_and_everywhere_once_a_second(begin):
    with serving(two_tags, 0.05) as camera:
        process = begin(uri=f"{camera.address}/stream?fps=20")
        seen = process.until(is_sighting("whole"))
        assert sorted(tag.id for tag in seen.tags) == [0, 101]
        assert seen.size == SIZE
        assert (seen.arrived_at - seen.taken_at).total_seconds() == pytest.approx(0.03)
        process.tell(Order(regions=[Region(20, 40, 180, 200)]))
        seen = process.until(is_sighting("region"), len(process.said))
        assert [tag.id for tag in seen.tags] == [0]
        assert seen.tags[0].is_fitted
        begun = len(process.said)
        sought = Counter()
        for message in process.since(begun):
            sought[getattr(message, "sought", "")] += 1
            if sought["region"] > sought["whole"] >= 2:
                break
        report = process.until(is_state("running"))
        assert report.words == ""
        frames = [m.frame for m in process.said if isinstance(m, Sighting)]
        assert frames == sorted(set(frames))
    assert process.end() == 0


def test_previews_come_only_when_somebody_looks_and_at_most_two_a_second(begin):
    with serving(lambda: jpeg(noise(RNG)), 0.02) as camera:
        process = begin(uri=f"{camera.address}/stream?fps=30")
        process.until(is_sighting("whole"))
        assert not [m for m in process.said if isinstance(m, bytes)]
        process.tell(Order(wants_previews=True))
        first = process.until(lambda m: isinstance(m, bytes))
        assert first.startswith(b"\xff\xd8")
        reports = [m for m in process.said if isinstance(m, SourceReport)]
        begun = len(process.said)
        for _ in range(4):
            process.until(is_state("running"), len(process.said))
        reports = [m for m in process.said[begun:] if isinstance(m, SourceReport)]
        previews = [m for m in process.said[begun:] if isinstance(m, bytes)]
        assert 1 <= len(previews) <= 2 * (len(reports) + 1)


def test_the_board_is_told_once_for_each_time_it_is_asked_for(begin):
    board = board_picture(40.0, (640, 480), 0.1)[0]

    def picture():
        return jpeg(np.clip(board + RNG.normal(0.0, 2.0, board.shape), 0, 255).astype(np.uint8))

    with serving(picture, 0.05) as camera:
        process = begin(uri=f"{camera.address}/stream")
        process.tell(Order(board_views=1))
        view = process.until(lambda m: isinstance(m, BoardView))
        assert len(view.corners) >= 60
        assert view.size == (640, 480)
        process.tell(Order(board_views=2))
        process.until(lambda m: isinstance(m, BoardView), len(process.said))
        process.until(is_state("running"), len(process.said))
        process.until(is_state("running"), len(process.said))
        assert len([m for m in process.said if isinstance(m, BoardView)]) == 2


def test_bad_pictures_are_counted_and_good_ones_go_on(begin):
    good = two_tags()
    kinds = [good[: len(good) // 2], b"nonsense", jpeg(noise(RNG, (5000, 64)))]
    sent = []

    def picture():
        sent.append(len(sent))
        return two_tags() if len(sent) % 4 == 0 else kinds[len(sent) % 4 - 1]

    with serving(picture, 0.1) as camera:
        process = begin(uri=f"{camera.address}/stream?fps=60")
        reasons = {"cut", "neither JPEG nor PNG", "a side is not 64 to 4096 px"}
        report = process.until(
            lambda m: isinstance(m, SourceReport) and reasons <= m.refused.keys()
        )
        assert sum(report.refused.values()) + report.pictures + report.dropped <= len(sent)
        process.until(is_sighting("whole"), len(process.said))


@pytest.mark.parametrize(("grey", "state"), [(4, "dark"), (253, "glare")])
def test_a_black_or_white_picture_is_told(begin, grey, state):
    def picture():
        return jpeg(np.clip(grey + RNG.normal(0.0, 1.0, (240, 320)), 0, 255).astype(np.uint8))

    with serving(picture, 0.05) as camera:
        process = begin(uri=f"{camera.address}/stream")
        assert process.until(is_state(state)).words


def test_a_frozen_picture_is_told_and_seen_only_once(begin):
    frozen = two_tags()
    with serving(lambda: frozen, 0.05) as camera:
        process = begin(uri=f"{camera.address}/stream")
        again = "the same picture again"
        report = process.until(
            lambda m: is_state("silent")(m) and m.refused.get(again, 0) > 3  # after a late begin
        )
        assert again in report.words
        assert report.pictures == 1
        assert len([m for m in process.said if isinstance(m, Sighting)]) == 1


def test_the_time_that_the_process_takes_to_load_is_no_silence_of_the_camera(monkeypatch):
    passed_s = [0.0]
    clock = SimpleNamespace(monotonic=lambda: time.monotonic() + passed_s[0])
    monkeypatch.setattr(eye, "time", clock)
    monkeypatch.setattr(eye.corner_kernel, "warm_up", lambda: passed_s.insert(0, 100.0))
    begin, end = os.pipe()
    with serving(two_tags) as camera:
        settings = SourceSettings("tank-1", f"{camera.address}/silent")
        wishes = SimpleNamespace(settings=settings, order=Order())
        looking = eye.Eye(camera_uri(settings.uri), wishes, end)
        thread = threading.Thread(target=looking.run)
        thread.start()
        [report, *_] = CameraReader().take(os.read(begin, 65536))
        assert report.state == "opening"
        looking._newest.has_ended = True
        os.close(begin)
        thread.join()
    os.close(end)


def test_a_camera_that_comes_back_is_seen_again(begin):
    with serving(two_tags, 0.02) as camera:
        process = begin(uri=f"{camera.address}/cut")
        assert "ended its stream" in process.until(is_state("failed")).words
        process.until(is_sighting("whole"), len(process.said))


@pytest.mark.parametrize(
    ("uri", "words"),
    [
        ("file:///etc/passwd", "unknown kind of camera 'file'"),
        ("folder:tank", "GRACE_CAMERA_DIR"),
        ("v4l2:///dev/video987", "is the camera plugged in"),
        ("http://127.0.0.1:9/x", "nobody answers there"),
    ],
)
def test_what_cannot_be_opened_is_told_in_words(begin, uri, words):
    process = begin(uri=uri)
    assert words in process.until(is_state("failed")).words
    assert process.end() == 0


def test_a_folder_is_seen_and_its_end_told(begin, tmp_path):
    (tmp_path / "tank").mkdir()
    for i in range(3):
        (tmp_path / "tank" / f"{i}.jpg").write_bytes(two_tags())
    process = begin(uri="folder:tank?fps=20", folder=str(tmp_path))
    process.until(lambda m: is_state("silent")(m) and "all 3 pictures" in m.words)
    ids = {tag.id for m in process.said if isinstance(m, Sighting) for tag in m.tags}
    assert ids == {0, 101}


def test_it_ends_when_its_input_does_even_before_it_was_told_anything():
    assert Process().end() == 0


@pytest.mark.parametrize("nonsense", [b"\xff" * 64, HEAD.pack(2, 17) + b"{}", HEAD.pack(1, 16)])
def test_orders_that_are_none_end_it(nonsense):
    process = Process()
    process.child.stdin.write(nonsense + b" " * 8)
    process.child.stdin.flush()
    assert process.child.wait(WAIT_S) == 2
    assert process.end() == 2


def test_it_ends_by_itself_when_the_station_is_killed(tmp_path):
    """Its input closes with whoever held the other end."""
    script = (
        "import json, subprocess, sys, time\n"
        "from robot_link.camera.process import COMMAND\n"
        "p = subprocess.Popen(COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE)\n"
        "print(json.dumps(p.pid), flush=True)\n"
        "time.sleep(600)\n"
    )
    station = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE)
    child = json.loads(station.stdout.readline())
    os.kill(station.pid, signal.SIGKILL)
    station.wait()
    station.stdout.close()
    deadline = time.monotonic() + WAIT_S
    while time.monotonic() < deadline and _is_alive(child):
        time.sleep(0.05)
    assert not _is_alive(child)


def _is_alive(pid):
    try:
        with open(f"/proc/{pid}/stat", "rb") as stat:
            return stat.read().rpartition(b")")[2].split()[0] != b"Z"
    except FileNotFoundError:
        return False


def test_without_the_extra_it_says_what_to_install(begin, tmp_path, monkeypatch):
    (tmp_path / "sitecustomize.py").write_text(
        "import importlib.util\n"
        "find = importlib.util.find_spec\n"
        "importlib.util.find_spec = lambda name, *a: None if name == 'cv2' else find(name, *a)\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    process = begin(uri="http://127.0.0.1:9/x")
    words = process.until(is_state("failed")).words
    assert "OpenCV is not installed: install the extra camera" in words
