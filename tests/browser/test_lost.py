"""A robot of a lake is lost for an hour of its clock: predicted, then judged by its next fix."""

import math
import re
from collections.abc import Iterator
from datetime import datetime, timedelta

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.walk import CHROMIUM, SHOTS, browser_page, expect_scene, open_page
from tests.e2e.demo import LASTING, Demo, Json

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

ROBOT = "grace-1"
SPEED = 30.0
LOST_S = 3600.0
DEPTH_M = 11.5
GLIDE_M = 11.0
DIVES = 4
WIDTHS = (1440, 900, 400)
PANELS = ("Prediction", "What it will do by itself", "Battery")


@pytest.fixture(scope="module")
def lake(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Demo]:
    folder = tmp_path_factory.mktemp("lost")
    with Demo(folder, "--robots", ROBOT, "--speed", str(SPEED)) as demo:
        yield demo


@pytest.fixture(scope="module")
def window(browser: Browser, lake: Demo) -> Iterator[Page]:
    with browser_page(browser, lake) as page:
        cookies = {one.get("name", ""): one.get("value", "") for one in page.context.cookies()}
        for name, value in cookies.items():
            lake.client.cookies.set(name, value)
        lake.client.headers["X-CSRF-Token"] = lake.get("/api/session")["csrf_token"]
        lake.patch("/api/config/planner", LASTING, robot=ROBOT)
        yield page


def vees(lake: Demo) -> list[dict[str, object]]:
    """Return glides down and up towards the middle of the water and back."""
    robot = lake.get(f"/api/robots/{ROBOT}")
    north, east, _ = lake.get(f"/api/robots/{ROBOT}/state")["position"]["ned_m"]
    box = robot["site"]["domain"]
    to = math.atan2(
        0.5 * (box["y_min_m"] + box["y_max_m"]) - east,
        0.5 * (box["x_min_m"] + box["x_max_m"]) - north,
    )
    legs: list[dict[str, object]] = []
    for number in range(2 * DIVES):
        step = GLIDE_M if (number // 2) % 2 == 0 else -GLIDE_M
        north, east = north + step * math.cos(to), east + step * math.sin(to)
        depth_m = DEPTH_M if number % 2 == 0 else 0.0
        legs.append({"kind": "glide", "end_ned": [north, east, depth_m]})
    return legs


def switch(lake: Demo, is_on: bool) -> None:
    for link in state(lake)["links"]:
        body = {"uri": link["uri"], "plugged": is_on}
        lake.post(f"/api/robots/{ROBOT}/links/plug", body)


def state(lake: Demo) -> Json:
    return lake.get(f"/api/robots/{ROBOT}/state")


def shoot(page: Page, name: str, panels: tuple[str, ...] = ()) -> None:
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 950})
        page.wait_for_timeout(800)
        page.screenshot(path=SHOTS / f"{name}-{width}.png")
        for number, panel in enumerate(panels):
            path = SHOTS / f"{name}-panel{number}-{width}.png"
            page.get_by_role("region", name=panel, exact=True).screenshot(path=path)
    page.set_viewport_size({"width": 1440, "height": 950})


def test_lost_robot_is_predicted_and_then_judged_by_its_fix(lake: Demo, window: Page):
    lake.wait("a place", lambda: state(lake)["position"] is not None, 60.0)
    body = {"kind": "primitives", "legs": vees(lake), "config": {"max_uncertainty_m": 60.0}}
    plan = lake.post(f"/api/robots/{ROBOT}/plans", body)["id"]
    lake.wait("draft", lambda: lake.get(f"/api/plans/{plan}")["state"] == "draft", 120.0)
    draft = lake.get(f"/api/plans/{plan}")
    assert draft["violations"] == []
    open_page(window, lake, f"/plan/{ROBOT}")
    account = window.get_by_role("region", name="Account of the plan")
    expect(account.get_by_text("Battery", exact=True)).to_be_visible()
    expect(account.get_by_text(re.compile(r"Wh free"))).to_be_visible()
    shoot(window, "lost-account")
    lake.post(f"/api/plans/{plan}/upload", {"start": True})
    running = lake.wait(
        "flight", lambda: lake.get(f"/api/plans/{plan}")["state"] == "running", 120.0
    )
    assert running
    switch(lake, is_on=False)
    said = datetime.fromisoformat(state(lake)["position"]["measured_at"])
    silent = lake.wait(
        "prediction", lambda: lake.get(f"/api/robots/{ROBOT}/prediction")["is_silent"], 60.0
    )
    assert silent
    open_page(window, lake, f"/robot/{ROBOT}")
    window.get_by_text("From above", exact=True).click()
    panel = window.get_by_role("region", name="Prediction")
    expect(panel.get_by_text("predicted", exact=True)).to_be_visible()
    expect(panel.get_by_text("Should be at")).to_be_visible()
    expect(window.locator(".map-predicted-ellipse").first).to_be_attached()
    expect(window.get_by_text(re.compile("predicted; heard"))).to_be_visible()
    acts = window.get_by_role("region", name="What it will do by itself")
    expect(
        acts.get_by_text(re.compile("It ends its mission and comes up for good"))
    ).to_be_visible()
    expect(acts.get_by_text(f"{plan} on board").first).to_be_visible()
    expect(
        window.get_by_role("region", name="Battery", exact=True).get_by_text("Recover by")
    ).to_be_visible()

    def is_over() -> bool:
        found = lake.get(f"/api/robots/{ROBOT}/prediction")
        return found["age_s"] >= LOST_S

    lake.wait("lost hour", is_over, 1.5 * LOST_S / SPEED)
    found = lake.get(f"/api/robots/{ROBOT}/prediction")
    axes = [place["ellipse_m"][0] for place in found["path"]]
    assert axes[-1] > axes[0]
    assert datetime.fromisoformat(state(lake)["position"]["measured_at"]) - said < timedelta(
        minutes=10
    ), "what the robot said stays its last word"
    shoot(window, "lost-hour", PANELS)
    window.get_by_text("3D", exact=True).click()
    expect_scene(window)
    window.screenshot(path=SHOTS / "lost-hour-scene.png")
    switch(lake, is_on=True)
    judged = lake.wait(
        "verdict",
        lambda: [
            one
            for one in lake.get(f"/api/robots/{ROBOT}/predictions")["predictions"]
            if one["silent_s"] >= LOST_S
        ],
        180.0,
    )
    assert judged[0]["ellipse_units"] < 3.0, judged[0]
    expect(
        panel.get_by_role("heading", name=re.compile("fixes? after a silence inside"))
    ).to_be_visible()
    verdict = "inside" if judged[0]["is_inside"] else "outside"
    expect(panel.get_by_role("cell", name=verdict).first).to_be_visible()
    shoot(window, "lost-judged", PANELS)
    events = lake.get("/api/events", limit="1000")["events"]
    assert any(one["kind"] == "prediction.judged" for one in events)
