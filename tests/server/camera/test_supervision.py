"""Processes of cameras: started, watched, ended, started again; what they say is judged."""

import asyncio
import os
import subprocess
import sys
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import pytest

from robot_link.camera import extra
from robot_link.camera.config import CameraConfig
from robot_link.camera.sighting import BoardCorner, BoardView, Region, Sighting
from robot_link.clock import ScaledClock, SystemClock
from server.access.role import Role
from server.camera.event import PictureSeen
from server.camera.moment import AHEAD, BACK, OLD, PictureMoments
from server.camera.picture import newest
from server.camera.picture.newest import Pictures
from server.camera.picture.route import _marks
from server.camera.processes import CameraProcesses
from server.camera.rig import CameraRig
from server.camera.set_up.boards import CORNERS_MOST, Boards
from server.camera.status import CameraStatuses
from tests.server.camera.conftest import STAND_IN
from tests.server.conftest import api_client, until

ROOT = Path(__file__).parents[3]


def uri(**options):
    query = "&".join(f"{name}={value}" for name, value in options.items())
    return f"http://127.0.0.1:9/camera/1?{query}"


@pytest.fixture
def seen(foundation):
    found = []
    foundation.bus.subscribe(PictureSeen, found.append)
    return found


@pytest.fixture
def processes(foundation):
    return foundation.services.get(CameraProcesses)


async def added(client, **options):
    body = {"id": "tank-1", "uri": uri(**options)}
    answer = await client.post("/api/cameras", json=body)
    assert answer.status_code == 201, answer.text


async def camera(client):
    return (await client.get("/api/cameras/tank-1")).json()


def impatient(processes, **changes):
    values = {"silent_s": 1.0, "silent_alarm_s": 2.0, **changes}
    processes.config = CameraConfig(**values)


def alive(process_id):
    try:
        os.kill(process_id, 0)
    except ProcessLookupError:
        return False
    return True


async def test_what_a_camera_sees_is_told_with_the_stations_time(client, foundation, seen):
    await added(client)
    await until(lambda: len(seen) >= 2)
    age = foundation.clock.now() - seen[0].taken_at
    assert seen[0].camera == "tank-1"
    assert [tag.id for tag in seen[0].sighting.tags] == [100]
    assert timedelta(0) < age < timedelta(minutes=2)
    shown = await camera(client)
    assert shown["state"] == "running"
    assert shown["tags"] == shown["strangers"] == [100]
    assert shown["size"] == [320, 240]


async def test_a_killed_process_comes_back_by_itself(client, processes, seen):
    await added(client)
    await until(lambda: seen)
    first = processes.process_id("tank-1")
    os.kill(first, 9)
    await until(lambda: processes.process_id("tank-1") not in {None, first})
    count = len(seen)
    await until(lambda: len(seen) > count)
    # On a machine that stands still it may have been silent, too, and was started once more.
    assert (await camera(client))["restarts"] >= 1


async def test_a_camera_without_pictures_is_told_and_started_again(client, foundation, processes):
    impatient(processes)
    await added(client, pictures=2)
    alarm = await until(lambda: foundation.alarms.standing("camera-silent:tank-1", None))
    assert alarm.text.startswith("tank-1 sends no pictures")
    shown = await until(lambda: _restarted(client))
    assert shown["restarts"] >= 1
    # Each life sends two pictures, so that the alarm is over again and again.
    await until(lambda: foundation.alarms.standing("camera-silent:tank-1", None) is None)


async def _restarted(client):
    shown = await camera(client)
    return shown if shown["restarts"] else None


async def test_a_process_that_speaks_nonsense_is_ended_and_counted(client, foundation, processes):
    said_by = []
    foundation.bus.subscribe(PictureSeen, lambda _: said_by.append(processes.process_id("tank-1")))
    await added(client, pictures=2, then="nonsense")

    async def counted():
        return (await camera(client))["refused"].get("nonsense")

    assert await until(counted) >= 1
    await until(lambda: said_by and not alive(said_by[0]))


async def test_a_frozen_picture_is_told(client, foundation, processes):
    impatient(processes)
    await added(client, still=1)
    alarm = await until(lambda: foundation.alarms.standing("camera-silent:tank-1", None))
    assert "sends no pictures" in alarm.text
    # A life of it may end with a picture that came too late, which is told as well.
    shown = await until(lambda: _with_words(client, "stands still"))
    assert shown["state"] == "silent"


async def test_old_pictures_are_dropped_and_told_after_ten(client, foundation, seen):
    await added(client, age_s=2)
    alarm = await until(lambda: foundation.alarms.standing("camera-times:tank-1", None))
    assert OLD in alarm.text
    assert (await camera(client))["refused"][OLD] >= 10
    assert not seen


async def test_times_that_go_back_are_told(client, foundation):
    await added(client, times="back", period_s=0.01)

    def told():
        alarm = foundation.alarms.standing("camera-times:tank-1", None)
        return alarm is not None and BACK in alarm.text

    await until(told)  # on a busy machine some come too late, which is told as well


def sighting(taken_at, frame=1, arrived_at=None):
    return Sighting("tank-1", frame, taken_at, arrived_at or taken_at, (640, 480), "whole", [])


def test_times_are_counted_back_by_the_speed_of_the_stations_clock():
    wall = datetime.now(UTC)
    clock = ScaledClock(wall - timedelta(hours=1), datetime(2030, 1, 1, tzinfo=UTC), 3.0)
    moments = PictureMoments(clock)
    now = datetime.now(UTC)
    before = clock.now()
    found = moments.taken_at(sighting(now - timedelta(seconds=0.2), arrived_at=now), now)
    assert before <= found + timedelta(seconds=0.6) <= clock.now()


@pytest.mark.parametrize(("shift_s", "why"), [(-1.5, OLD), (0.5, AHEAD), (-0.3, BACK), (0.0, BACK)])
def test_a_time_that_cannot_be_is_no_moment(shift_s, why):
    now = datetime.now(UTC)
    moments = PictureMoments(SystemClock())
    assert isinstance(moments.taken_at(sighting(now), now), datetime)
    taken = now + timedelta(seconds=shift_s)
    assert moments.taken_at(sighting(taken, 2, max(taken, now)), now) == why
    assert moments.doubted == 1


async def test_a_changed_address_starts_another_process(client, processes, seen):
    await added(client)
    await until(lambda: seen)
    first = processes.process_id("tank-1")
    await client.patch("/api/cameras/tank-1", json={"uri": uri(pictures=5)})
    await until(lambda: processes.process_id("tank-1") not in {None, first})
    assert not alive(first)


async def test_a_removed_cameras_process_is_gone(client, foundation, processes, seen):
    await added(client)
    await until(lambda: seen)
    first = processes.process_id("tank-1")
    await client.delete("/api/cameras/tank-1")
    await until(lambda: not alive(first))
    assert foundation.alarms.standing("camera-silent:tank-1", None) is None


async def test_a_fast_clock_keeps_cameras_off_and_says_so(client, foundation, monkeypatch):
    monkeypatch.setattr(type(foundation.clock), "speed", 5.0)
    await added(client)
    shown = await until(lambda: _in_state(client, "too_fast"))
    assert "up to 4 times" in shown["words"]


async def test_without_the_extra_a_camera_says_what_to_install(client, monkeypatch):
    monkeypatch.setattr(extra, "find_spec", lambda _: None)
    await added(client)
    shown = await until(lambda: _in_state(client, "not_installed"))
    assert "pip install 'grace-ground-station[camera]'" in shown["words"]


async def _with_words(client, words):
    shown = await camera(client)
    return shown if words in shown["words"] else None


async def _in_state(client, state):
    shown = await camera(client)
    return shown if shown["state"] == state else None


async def test_pictures_are_sent_while_somebody_looks_and_kept_nowhere(client, foundation, seen):
    await added(client)
    await until(lambda: seen)  # a picture without a sighting has no marks
    plain = await until(lambda: _picture(client))
    assert plain.headers["Content-Type"] == "image/jpeg"
    assert plain.headers["Cache-Control"] == "no-store"
    marked = await until(lambda: _picture(client, marks=1))
    assert marked.content != plain.content
    folder = foundation.settings.data_dir
    assert pictures_in(folder) == []


async def test_no_tag_is_called_used_in_a_camera_that_is_not_calibrated(
    client, foundation, seen, monkeypatch
):
    monkeypatch.setattr(newest, "PATIENCE_S", 60.0)
    tag = {"id": 100, "size_m": 0.15, "position_m": [1.0, 0.5, 1.2]}
    told = await client.put("/api/tags", json={"layout": {"tags": [tag]}, "bundles": []})
    assert told.status_code == 200, told.text
    await added(client)
    await until(lambda: seen)
    services = foundation.services
    picture = await services.get(Pictures).newest("tank-1")
    marks = _marks(picture, services.get(CameraStatuses).of("tank-1"), services.get(CameraRig))
    assert marks.tags
    assert marks.refused == {tag.id for tag in marks.tags}


def pictures_in(folder):
    """Return the files with a picture in them; fewer bytes than these are in a database by luck."""
    return holders_of(b"\xff\xd8\xff\xe0\x00\x10JFIF", folder)


def holders_of(content, folder):
    """Return the files that hold something, of a folder in which a station comes and goes."""
    found = []
    for file in folder.rglob("*"):
        with suppress(FileNotFoundError):
            if file.is_file() and content in file.read_bytes():
                found.append(file)
    return found


async def _picture(client, **query):
    answer = await client.get("/api/cameras/tank-1/picture.jpg", params=query)
    return answer if answer.status_code == 200 else None


async def test_no_picture_is_shown_to_who_is_not_signed_in(client, station):
    await added(client)
    path = "/api/cameras/tank-1/picture.jpg"
    async with api_client(station, Role.NONE) as nobody:
        assert (await nobody.get(path)).status_code in {403, 404}
        del nobody.headers["Authorization"]
        assert (await nobody.get(path)).status_code == 401


async def test_regions_reach_the_process_also_after_a_restart(client, foundation, processes, seen):
    await added(client)
    await until(lambda: seen)
    rig = foundation.services.get(CameraRig)
    rig.set_regions("tank-1", [Region(10, 20, 110, 120)])
    assert rig.regions("tank-1") == (Region(10, 20, 110, 120),)
    os.kill(processes.process_id("tank-1"), 9)
    count = len(seen)
    await until(lambda: len(seen) > count + 2)


async def test_a_board_picture_that_is_removed_leaves_the_kind_of_lens(foundation, monkeypatch):
    boards, kinds = foundation.services.get(Boards), []

    async def judged(_, problem):
        kinds.append(problem.kind)
        return ()

    async def view(_):
        corners = [BoardCorner(i, (float(i), 0.0)) for i in range(CORNERS_MOST)]
        return BoardView("tank-1", 1, (640, 480), corners)

    monkeypatch.setattr(foundation.workers, "run", judged)
    monkeypatch.setattr(boards, "_view", view)
    taken = await boards.take("tank-1", "fisheye", SimpleNamespace(report=lambda *_: None))
    await boards.remove("tank-1", taken["number"])
    assert kinds == ["fisheye", "fisheye"]


PARENT = """
import asyncio, sys
from server.camera.child import CameraChild
from robot_link.camera.sighting import SourceSettings

async def main():
    child = await CameraChild.start(sys.argv[1:], SourceSettings("tank-1", "http://127.0.0.1:9/"))
    async for message in child.messages():
        print(child.process_id, flush=True)

asyncio.run(main())
"""


@pytest.mark.process
async def test_a_killed_station_takes_its_cameras_along():
    station = await asyncio.create_subprocess_exec(
        sys.executable, "-c", PARENT, *STAND_IN, cwd=ROOT, stdout=subprocess.PIPE
    )
    process_id = int(await station.stdout.readline())
    assert alive(process_id)
    station.kill()
    await station.communicate()
    await until(lambda: not alive(process_id))
