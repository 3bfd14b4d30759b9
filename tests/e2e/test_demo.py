"""The product as a person meets it: one command, two robots, a survey, a killed station."""

import os
import re
import socket
import subprocess
import sys
from urllib.parse import urlsplit

import pytest

from tests.e2e.demo import ROOT, Demo, alive, fly_dives

pytestmark = [pytest.mark.walk, pytest.mark.timeout(1200)]
FAST = ("--speed", "20")


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    with Demo(tmp_path_factory.mktemp("demo"), *FAST) as demo:
        demo.sign_in()
        yield demo


def test_two_robots_report_within_seconds(demo):
    def both_live():
        robots = demo.get("/api/robots")
        live = {robot["id"] for robot in robots if robot["link"]["state"] == "live"}
        return live == {"mini-1", "grace-1"}

    demo.wait("both robots being heard", both_live, 20.0)

    def state():
        return demo.get("/api/robots/mini-1/state")

    demo.wait("a first report", lambda: state()["channels"], 10.0)
    demo.wait("a fresh one", lambda: state()["channels"]["depth_m"]["age_s"] < 20 * 5, 10.0)
    assert state()["position"]["std_m"] > 0.0


def test_everything_is_marked_as_simulation(demo):
    assert demo.get("/api/health")["simulation"] is True
    assert all(robot["simulated"] for robot in demo.get("/api/robots"))


def test_every_radio_is_signed_with_a_key_that_was_made_for_this_demo(demo):
    def signed():
        links = [
            link
            for robot in ("mini-1", "grace-1")
            for link in demo.get(f"/api/robots/{robot}/links")
            if link["kind"] == "radio"
        ]
        return len(links) == 2 and all(
            link["is_signed"] and link["frames_received"] for link in links
        )

    demo.wait("signed frames of both robots", signed, 20.0)
    keys = {robot: demo.data / "secret" / f"signing-{robot}" for robot in ("mini-1", "grace-1")}
    assert len({file.read_text() for file in keys.values()}) == 2
    for robot, file in keys.items():
        on_board = demo.data / "robots" / robot / "signing.key"
        assert on_board.read_text() == file.read_text()
        assert {one.stat().st_mode & 0o077 for one in (on_board, file)} == {0}


def test_the_openapi_pages_are_there(demo):
    assert demo.client.get("/docs").status_code == 200
    assert "/api/robots" in demo.client.get("/openapi.json").json()["paths"]


def test_bad_input_names_its_field(demo):
    answer = demo.client.post(
        "/api/robots/mini-1/missions",
        json={"kind": "adaptive_survey", "config": {"max_uncertainty_m": -1}},
    )
    assert answer.status_code == 422
    assert any("max_uncertainty_m" in error["loc"] for error in answer.json()["errors"])
    assert demo.client.get("/api/robots/nobody/state").status_code == 404


@pytest.mark.timeout(1200)
def test_a_survey_by_rest_survives_the_death_of_the_station(demo):
    """Plan, fly, kill the station in mid-survey: no acknowledged sample is lost, and it goes on."""
    config = {"total_budget": 24.0, "round_budget": 12.0, "planning_time_s": 5.0, "seed": 3}
    mission = demo.post(
        "/api/robots/mini-1/missions", {"kind": "adaptive_survey", "config": config}
    )["id"]

    def state():
        return demo.get(f"/api/missions/{mission}")

    demo.wait("the first draft", lambda: state()["state"] == "ready", 60.0)
    draft = demo.get(f"/api/plans/{state()['plan_id']}")
    assert draft["state"] == "draft"
    assert draft["account"]["energy"] <= 12.0
    demo.post(f"/api/missions/{mission}/start")
    demo.wait("samples in the map", lambda: samples(demo) >= 20, 120.0)
    first = demo.get(f"/api/plans/{draft['id']}")
    assert first["ladder"]["sent_at"] <= first["ladder"]["on_board_at"]

    before = samples(demo)
    demo.restart_station()
    assert samples(demo) >= before

    ended = demo.wait(
        "the end of the survey", lambda: state()["state"] in {"done", "failed", "stopped"}, 300.0
    )
    assert ended
    mission_at_end = state()
    assert mission_at_end["state"] == "done", mission_at_end["message"]
    assert len(mission_at_end["rounds"]) >= 2
    scores = {score["model"]: score for score in mission_at_end["scores"]}
    assert set(scores) == {"single", "recursive", "joint", "position_noise"}
    assert all(score["rmse"] > 0.0 for score in scores.values())


def samples(demo):
    history = demo.get("/api/robots/mini-1/samples", channel="blue_light", max_points=20000)
    return len(history["value"])


def pilot_of(demo):
    """Return the environment of a script that speaks as a pilot."""
    token = subprocess.run(
        [sys.executable, "-m", "server.cli", "token", "create", "--role", "pilot", "--data",
         str(demo.data)],
        cwd=ROOT, capture_output=True, text=True, check=True, timeout=300,
    ).stdout.split()[-1]  # fmt: skip
    return os.environ | {"GRACE_TOKEN": token, "PYTHONPATH": str(ROOT)}


def test_the_example_script_plans_and_sends_nothing_by_default(demo):
    done = subprocess.run(
        [sys.executable, "examples/adaptive_survey.py", "--url", demo.url, "--robot", "mini-1",
         "--planning-time-s", "10"],
        cwd=ROOT, env=pilot_of(demo), capture_output=True, text=True, check=False, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "nothing was sent" in done.stdout


@pytest.mark.timeout(1800)
def test_the_example_script_plans_when_the_robot_surfaces(demo, tmp_path):
    """It is told of a surfacing by the event log, without asking for the robot's mode."""
    cursor = tmp_path / "cursor"
    with subprocess.Popen(
        [sys.executable, "examples/plan_on_surfacing.py", "--url", demo.url, "--robot", "mini-1",
         "--depth-m", "0.4", "--times", "1", "--cursor", str(cursor)],
        cwd=ROOT, env=pilot_of(demo), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    ) as script:  # fmt: skip
        try:
            demo.wait("the end of the log", cursor.exists, 60.0)
            fly_dives(demo, 3, 0.4)
            said, _ = script.communicate(timeout=1200)
        finally:
            script.kill()
    assert script.returncode == 0, said
    assert "mini-1 is at the surface. Measured at" in said
    assert "nothing was sent" in said
    surfacings = demo.get("/api/events", robot="mini-1", kind="robot.surfaced")["events"]
    assert int(cursor.read_text()) >= surfacings[0]["cursor"]


@pytest.mark.timeout(1200)
def test_surface_now_brings_a_diving_robot_up(demo):
    """Each level is shown in its turn, and the robot really comes up."""
    plan = fly_dives(demo, 6, 0.3)
    demo.wait("running", lambda: demo.get(f"/api/plans/{plan}")["state"] == "running", 30.0)
    command = demo.post("/api/robots/mini-1/commands", {"kind": "surface"})["id"]
    done = demo.wait(
        "the robot's word",
        lambda: (c := demo.get(f"/api/commands/{command}"))["level"] == "applied" and c,
        30.0,
    )
    levels = [level["level"] for level in done["levels"]]
    # the robot's word may overtake that of the radio, which then proves nothing more
    assert levels in (["queued", "radio", "applied"], ["queued", "applied"])

    def at_surface():
        depth = demo.get("/api/robots/mini-1/state")["channels"]["depth_m"]
        return depth["value"] < 0.06

    demo.wait("the robot at the surface", at_surface, 40.0)


@pytest.mark.timeout(900)
def test_ctrl_c_says_a_closing_word_and_leaves_no_process_and_no_port(tmp_path):
    with Demo(tmp_path / "data", "--robots", "mini-1", *FAST) as demo:
        children = demo.children()
        assert set(children) == {"serve", "simulate"}
        assert demo.stop() == 0
    assert f"Everything has stopped. The data are kept in {demo.data}." in demo.output
    assert not any(alive(pid) for pid in children.values())
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", urlsplit(demo.url).port)) != 0
    for log in (demo.data / "log").iterdir():
        assert not re.search("WARNING|ERROR|Traceback", log.read_text()), log.read_text()
