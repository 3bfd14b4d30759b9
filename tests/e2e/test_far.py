"""The lake robot far out of radio range: a plan by satellite, proved step by step."""

import pytest

from tests.e2e.demo import Demo

pytestmark = pytest.mark.process

ROBOT = "grace-1"


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    demo = Demo(
        tmp_path_factory.mktemp("far"),
        *("--robots", ROBOT, "--far", "--speed", "40", "--satellite-loss", "0.3", "--seed", "3"),
    )
    demo.sign_in()
    yield demo
    demo.stop()


def legs(demo, count: int) -> list[dict]:
    """Dives on a line from where the robot is."""
    north, east, _ = demo.get(f"/api/robots/{ROBOT}/state")["position"]["ned_m"]
    flown = []
    for n in range(count):
        depth = 5.3 + 0.1 * (n % 7) if n % 2 == 0 else 0.0
        north -= depth or flown[-1]["end_ned"][2]
        flown.append({"kind": "glide", "end_ned": [north, east, depth]})
    return flown


@pytest.mark.timeout(300)
def test_plan_by_satellite_is_flown_though_the_station_dies_on_the_way(demo):
    """Quote, send, kill the station, and the robot flies exactly that plan."""
    demo.wait(
        "the robot's first call",
        lambda: demo.get(f"/api/robots/{ROBOT}/state")["position"],
        60.0,
    )
    budget = {"round_budget": 100.0, "total_budget": 100.0}
    wanted = {"kind": "primitives", "legs": legs(demo, 24), "config": budget}
    plan = demo.post(f"/api/robots/{ROBOT}/plans", wanted)["id"]

    def seen() -> dict:
        return demo.get(f"/api/plans/{plan}")

    demo.wait("a draft", lambda: seen()["state"] == "draft", 60.0)
    quote = demo.get(f"/api/plans/{plan}/satellite")
    assert quote["refusal"] is None
    assert quote["auto"]["route"] == "satellite"
    assert quote["credits"] == sum(message["credits"] for message in quote["messages"])

    transfer = demo.post(f"/api/plans/{plan}/upload", {"start": True})["transfer"]

    def on_its_way() -> dict:
        return demo.get(f"/api/transfers/{transfer}")

    demo.wait(
        "the gateway having a part",
        lambda: any(part["level"] != "waiting" for part in on_its_way()["parts"]),
        30.0,
    )
    assert on_its_way()["carrier"] == "rockblock"
    assert seen()["ladder"]["on_board_at"] is None
    old = demo.kill_station()
    demo.wait("a new station", lambda: demo.children().get("serve", old) != old, 30.0)
    demo.wait("its health", lambda: demo.get("/api/health")["ready"], 30.0)

    demo.wait("the plan on board", lambda: seen()["ladder"]["on_board_at"], 180.0)
    parts = on_its_way()["parts"]
    assert all(part["level"] == "radio" for part in parts)
    assert on_its_way()["sha256"] == quote["sha256"]
    demo.wait("the plan being flown", lambda: seen()["state"] in {"running", "done"}, 120.0)
    log = next((demo.data / "robots" / ROBOT / "log").glob("events-*")).read_text()
    assert log.count(f"mission {seen()['sha256'][:16]} by satellite is on board") == 1
