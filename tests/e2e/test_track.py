"""Following a target as an operator does it by REST: it is held, lost in silence, and found."""

import pytest

from tests.e2e.demo import Demo

pytestmark = [pytest.mark.walk, pytest.mark.timeout(1200)]
SPEED = 20
LOST_S = 200.0
"""Of the robot's clock: ten seconds of the wall; for some a busy machine may not run it."""
LASTS_S = 20_000.0
"""A quarter of an hour of the wall: a busy machine, too, ends the mission before this does."""


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    options = ("--speed", str(SPEED), "--robots", "mini-1")
    with Demo(tmp_path_factory.mktemp("track"), *options) as demo:
        demo.sign_in()
        yield demo


def tracking(demo):
    return demo.get("/api/robots/mini-1/state")["tracking"]


def in_phase(demo, phase):
    """Return the newest report once it says so; a mission that ended meanwhile fails the test."""
    plan = demo.get("/api/robots/mini-1/plans")[0]
    assert plan["state"] not in ("done", "failed", "cancelled"), plan["message"]
    report = tracking(demo)
    return report if report is not None and report["phase"] == phase else None


def reports(demo, plan):
    return demo.get("/api/robots/mini-1/tracking", plan=plan, limit=5000)["reports"]


def told(demo, kind):
    command = demo.post("/api/robots/mini-1/commands", {"kind": kind})["id"]
    demo.wait(
        f"the robot's word on {kind}",
        lambda: demo.get(f"/api/commands/{command}")["level"] == "applied",
        20.0,
    )


def events(demo, kind):
    found = demo.get("/api/events", after=0, limit=1000)["events"]
    return [event["text"] for event in found if event["kind"] == kind]


def test_a_target_is_held_lost_in_silence_and_found_again(demo):
    demo.wait("a first report", lambda: demo.get("/api/robots/mini-1/state")["position"], 20.0)
    config = {
        "motion": {"duration_s": LASTS_S},
        "ranging": {"coast_after_s": 5.0, "lost_after_s": LOST_S, "give_up_after_s": LASTS_S},
    }
    body = {"kind": "track_target", "config": config}
    plan = demo.post("/api/robots/mini-1/plans", body)["id"]
    draft = demo.get(f"/api/plans/{plan}")
    assert (draft["state"], draft["violations"], draft["warnings"]) == ("draft", [], [])
    demo.post(f"/api/plans/{plan}/upload", {"start": True})
    held = demo.wait(
        "a hold on the target",
        lambda: (report := in_phase(demo, "tracking")) and report["is_barrier_on"] and report,
        30.0,
    )
    assert held["hypotheses"]
    assert held["true_ne_m"] is not None
    demo.wait(
        "the robot's word on the plan",
        lambda: demo.get(f"/api/plans/{plan}")["state"] == "running",
        10.0,
    )

    told(demo, "quiet")
    lost = demo.wait(
        "the loss of the target",
        lambda: (report := in_phase(demo, "lost")) and report["is_quiet"] and report,
        30.0,
    )
    assert lost["range_age_s"] >= LOST_S
    losses = len(demo.wait("the word on the loss", lambda: events(demo, "track.lost"), 10.0))

    kept = reports(demo, plan)
    demo.restart_station()
    assert reports(demo, plan)[: len(kept)] == kept, "what was told survives a kill"
    demo.wait("the robot being heard again", lambda: in_phase(demo, "lost"), 30.0)
    assert len(events(demo, "track.lost")) == losses, "what was told is not told again"

    told(demo, "ping")
    found = demo.wait(
        "the return of the target",
        lambda: (report := in_phase(demo, "tracking")) and not report["is_quiet"] and report,
        40.0,
    )
    assert found["ranges_heard"] > held["ranges_heard"]
    *_, word = demo.wait("the word on its return", lambda: events(demo, "track.found"), 10.0)
    assert word.startswith("mini-1 found its target again after ")

    told(demo, "surface")
    ended = demo.wait(
        "the end of the mission",
        lambda: (found := demo.get(f"/api/plans/{plan}"))["state"] == "cancelled" and found,
        30.0,
    )
    assert "came up as ordered" in ended["message"]
    every = reports(demo, plan)
    assert {"tracking", "lost"} <= {one["phase"] for one in every}
    rows = demo.client.get("/api/robots/mini-1/tracking.csv", params={"plan": plan}).text
    assert len(rows.splitlines()) >= 3 + len(every)
