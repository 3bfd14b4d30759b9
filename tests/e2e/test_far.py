"""The lake robot far out of radio range: a plan by satellite, proved step by step."""

import math

import pytest

from tests.e2e.demo import LASTING, Demo

pytestmark = [pytest.mark.walk, pytest.mark.timeout(1200)]

ROBOT = "grace-1"


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    options = (
        "--robots",
        ROBOT,
        "--far",
        "--speed",
        "50",
        "--satellite-loss",
        "0.3",
        "--seed",
        "3",
    )
    with Demo(tmp_path_factory.mktemp("far"), *options) as demo:
        demo.sign_in()
        yield demo


def legs(demo, count: int) -> list[dict]:
    """A swim to where the dives begin, for the robot drifts meanwhile, and crooked dives."""
    north, east, _ = demo.get(f"/api/robots/{ROBOT}/state")["position"]["ned_m"]
    east -= 12.0
    flown = [{"kind": "swim", "end_ned": [north, east, 0.0]}]
    for n in range(count):
        heading = math.pi + 0.6 * math.sin(7.3 * (n // 2))
        dive = 5.5 + 0.4 * math.sin(3.1 * (n // 2))
        north, east = north + dive * math.cos(heading), east + dive * math.sin(heading)
        flown.append({"kind": "glide", "end_ned": [north, east, (dive, 0.0)[n % 2]]})
    return flown


@pytest.mark.timeout(2000)
def test_plan_by_satellite_is_flown_though_the_station_dies_on_the_way(demo):
    """Quote, send, kill the station, and the robot flies exactly that plan."""
    demo.wait(
        "the robot's first call",
        lambda: demo.get(f"/api/robots/{ROBOT}/state")["position"],
        60.0,
    )
    config = {"round_budget": 200.0, "total_budget": 200.0, **LASTING}
    wanted = {"kind": "primitives", "legs": legs(demo, 44), "config": config}
    plan = demo.post(f"/api/robots/{ROBOT}/plans", wanted)["id"]

    def seen() -> dict:
        return demo.get(f"/api/plans/{plan}")

    demo.wait("a draft", lambda: seen()["state"] == "draft", 60.0)
    quote = demo.get(f"/api/plans/{plan}/satellite")
    assert quote["refusal"] is None
    assert quote["auto"]["route"] == "satellite"
    assert len(quote["messages"]) == 2
    assert quote["credits"] == sum(message["credits"] for message in quote["messages"])

    transfer = demo.post(f"/api/plans/{plan}/upload", {"start": True})["id"]

    def on_its_way() -> dict:
        return demo.get(f"/api/transfers/{transfer}")

    demo.wait(
        "the gateway having a part",
        lambda: any(part["level"] != "waiting" for part in on_its_way()["parts"]),
        30.0,
    )
    demo.wait("its carrier", lambda: on_its_way()["carrier"] == "rockblock", 10.0)
    demo.restart_station()

    demo.wait("the plan on board", lambda: seen()["ladder"]["on_board_at"], 180.0)
    parts = on_its_way()["parts"]
    assert all(part["level"] == "radio" for part in parts)
    assert on_its_way()["sha256"] == quote["sha256"]
    demo.wait("the plan being flown", lambda: seen()["state"] in {"running", "done"}, 120.0)
    log = next((demo.data / "robots" / ROBOT / "log").glob("events-*")).read_text()
    assert log.count(f"mission {seen()['sha256'][:16]} by satellite is on board") == 1
