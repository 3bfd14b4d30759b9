"""Cameras over the tank as a person meets them: set up from nothing by REST, then trusted."""

import os
import re
import signal
import sys
import time
from pathlib import Path

import pytest

from tests.e2e.demo import Demo, alive, fly_dives

pytest.importorskip("cv2", reason="the extra camera is not installed")
pytestmark = [pytest.mark.walk, pytest.mark.timeout(1800)]
ROBOTS = ("--robots", "mini-1,mini-2")
NAMES = ("tank-1", "tank-2", "tank-3")
DEEP_M = 0.3
"""Deeper than this no robot that is as delivered takes a fix."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("cameras")


@pytest.fixture(scope="module")
def demo(folder):
    """A demo whose cameras are calibrated; fixes count in all of the tank's water."""
    with Demo(folder, "--cameras", "--fix-depth", "1.2", *ROBOTS) as demo:
        demo.sign_in()
        calibrate(demo)
        yield demo


def calibrate(demo):
    for name in NAMES:
        demo.wait(f"pictures of {name}", lambda name=name: is_running(demo, name), 60.0)
    for name in NAMES:
        cause(demo, name, "board")
    missing = list(NAMES)
    give_up = time.monotonic() + 1200.0
    while missing:
        assert time.monotonic() < give_up, missing
        for name in missing:  # one after the other, while the boards are held elsewhere
            ended(demo, f"/api/cameras/{name}/boards")
        missing = [one for one in missing if demo.get(f"/api/cameras/{one}/boards")["missing"]]
    for name in NAMES:
        mend(demo, name, "board")
    for name in NAMES:
        lens(demo, name)
    job = ended(demo, "/api/cameras/adjust", {"level_m": 0.0})
    assert job["state"] == "done", job["message"]


def lens(demo, name):
    """Calibrate a lens, and leave out what the station says does not fit, as a person would."""
    for _ in range(5):
        job = ended(demo, f"/api/cameras/{name}/lens")
        bad = re.search(r"picture (\d+) does not fit", job["message"])
        if bad is None:
            break
        demo.client.delete(f"/api/cameras/{name}/boards", params={"number": bad[1]})
    assert job["state"] == "done", job["message"]


def ended(demo, path, body=None):
    answer = demo.client.post(path, json=body or {})
    assert answer.status_code == 202, answer.text
    job = f"/api/jobs/{answer.json()['id']}"

    def state():
        found = demo.get(job)
        return found if found["state"] not in {"queued", "running"} else None

    return demo.wait(path, state, 120.0)


def camera(demo, name):
    return demo.get(f"/api/cameras/{name}")


def is_running(demo, name):
    return camera(demo, name)["state"] == "running"


def cause(demo, who, fault):
    assert demo.client.put(f"/api/demo/faults/{who}/{fault}").is_success


def mend(demo, who, fault):
    assert demo.client.delete(f"/api/demo/faults/{who}/{fault}").is_success


def place(demo, robot="mini-1"):
    return demo.get(f"/api/robots/{robot}/state")["position"]


def is_fixed(demo, robot="mini-1"):
    """Tell whether the robot itself says that cameras fixed it."""
    found = place(demo, robot)
    return found["has_fix"] and found["fix_text"].startswith("fixed by")


def newest_fix(demo, robot="mini-1"):
    fixes = demo.get(f"/api/robots/{robot}/fixes")["fixes"]
    return fixes[-1] if fixes else None


def is_told_silent(demo, name):
    """Tell whether an alarm stands that says that a camera sends no pictures."""
    return any(
        one["text"].startswith(f"{name} sends no pictures") and one["cleared_at"] is None
        for one in demo.get("/api/alarms")["alarms"]
    )


def camera_processes(demo):
    """Ids of the processes that look through cameras: the station's children."""
    station = demo.children()["serve"]
    found = []
    for entry in Path("/proc").iterdir():
        try:
            words = (entry / "cmdline").read_bytes().decode().split("\0")
            parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
        except (OSError, ValueError):
            continue
        if parent == station and "robot_link.camera.process" in words:
            found.append(int(entry.name))
    return sorted(found)


def test_robots_say_that_cameras_fixed_them(demo):
    begun = time.monotonic()
    for robot in ("mini-1", "mini-2"):
        demo.wait(f"{robot} fixed by cameras", lambda robot=robot: is_fixed(demo, robot), 30.0)
    sys.stdout.write(f"fixed {time.monotonic() - begun:.1f} s after the calibration\n")
    fix = newest_fix(demo)
    assert fix["quality"] == "good"
    assert demo.get("/api/tags/strangers") == []


def test_a_plate_of_a_robot_that_is_not_there_is_a_stranger(demo):
    answer = demo.client.get("/api/tags")
    told = answer.json()
    body = {
        "layout": told["layout"],
        "bundles": [one for one in told["bundles"] if one["robot"] != "mini-2"],
    }
    ids = {tag["id"] for one in told["bundles"] if one["robot"] == "mini-2" for tag in one["tags"]}
    assert demo.client.put("/api/tags", json=body).is_success
    demo.wait(
        "strangers",
        lambda: {one["tag"] for one in demo.get("/api/tags/strangers")} & ids,
        20.0,
    )
    assert {one["tag"] for one in demo.get("/api/tags/strangers")} <= ids
    whole = {"layout": told["layout"], "bundles": told["bundles"]}
    assert demo.client.put("/api/tags", json=whole).is_success
    demo.wait("no strangers", lambda: demo.get("/api/tags/strangers") == [], 20.0)
    demo.wait("mini-2 fixed by cameras", lambda: is_fixed(demo, "mini-2"), 30.0)


def deep(demo):
    """Return the robot's place while it is deep."""
    found = place(demo)
    return found if found["ned_m"][2] > DEEP_M else None


def test_a_robot_is_fixed_by_cameras_under_water(demo):
    fly_dives(demo, 1, 0.6)
    demo.wait("a robot that is deep and fixed", lambda: deep(demo) and is_fixed(demo), 60.0)

    def sent_under_water():
        fixes = demo.get("/api/robots/mini-1/fixes")["fixes"]
        return [one for one in fixes if one["sent_at"] and one["ned_m"][2] > 0.5 * DEEP_M]

    demo.wait("a fix that was sent under water", sent_under_water, 20.0)


@pytest.mark.parametrize("fault", ["cut", "frozen", "silent"])
def test_a_camera_that_fails_is_told_and_comes_back(demo, fault):
    station = demo.children()["serve"]
    cause(demo, "tank-2", fault)
    demo.wait(f"an alarm: {fault}", lambda: is_told_silent(demo, "tank-2"), 20.0)
    mend(demo, "tank-2", fault)
    demo.wait("pictures", lambda: is_running(demo, "tank-2"), 90.0)
    demo.wait("the alarm's end", lambda: not is_told_silent(demo, "tank-2"), 20.0)
    assert demo.children()["serve"] == station


def test_a_killed_camera_process_is_told_and_comes_back(demo):
    station, before = demo.children()["serve"], camera_processes(demo)
    restarts = {name: camera(demo, name)["restarts"] for name in NAMES}
    assert len(before) == len(NAMES)
    os.kill(before[0], signal.SIGKILL)

    def told():
        return [name for name in NAMES if camera(demo, name)["restarts"] > restarts[name]]

    (name,) = demo.wait("a restart", told, 10.0)
    demo.wait("pictures", lambda: is_running(demo, name), 60.0)
    assert before[0] not in camera_processes(demo)
    assert len(camera_processes(demo)) == len(NAMES)
    assert demo.children()["serve"] == station


def test_an_unplugged_link_by_cameras_sends_no_fixes_until_it_is_plugged(demo):
    demo.wait("a fix by cameras", lambda: is_fixed(demo), 60.0)
    uri = next(
        one["uri"] for one in demo.get("/api/robots/mini-1/links") if one["kind"] == "camera"
    )
    plug = {"uri": uri, "plugged": False}
    assert demo.client.post("/api/robots/mini-1/links/plug", json=plug).is_success
    demo.wait("no fix", lambda: not place(demo)["has_fix"], 10.0)
    plug["plugged"] = True
    assert demo.client.post("/api/robots/mini-1/links/plug", json=plug).is_success
    demo.wait("a fix by cameras", lambda: is_fixed(demo), 30.0)


def test_robot_as_delivered_reckons_under_water_while_fixes_are_stored(demo, folder):
    """The calibration outlives the demo; fixes count at the surface only."""
    demo.stop()
    with Demo(folder, "--cameras", *ROBOTS) as again:
        again.sign_in()
        again.wait("mini-1 fixed by cameras", lambda: is_fixed(again), 90.0)
        children = camera_processes(again)
        fly_dives(again, 1, 0.6)

        def reckons():
            found = deep(again)
            return found if found and not found["has_fix"] else None

        again.wait("a robot that reckons", reckons, 60.0)

        def stored():
            fix = newest_fix(again)
            return fix if fix and fix["ned_m"][2] > DEEP_M and fix["quality"] == "good" else None

        again.wait("a fix under water that is stored", stored, 60.0)
        if deep(again):
            assert not place(again)["has_fix"]
    again_alive = [pid for pid in children if alive(pid)]
    assert again_alive == []
