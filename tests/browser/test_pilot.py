"""A pilot on the Control page: polar, what-if run, identification and trim after some dives."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.walk import CHROMIUM, expect_scene, open_page, shoot, tell_anew
from tests.e2e.demo import fly_dives

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

DIVES = 3
ENDED = {"done", "stopped", "failed"}


def is_free(station):
    """Whether mini-1 waits at the surface with no survey to go on with."""
    [robot] = [each for each in station.get("/api/robots") if each["id"] == "mini-1"]
    missions = station.get("/api/robots/mini-1/missions")
    return robot["mode"] == "idle" and all(each["state"] in ENDED for each in missions)


@pytest.fixture(scope="module", autouse=True)
def dive(station):
    """The plan that mini-1 flies while the polar and the what-if run are looked at."""
    station.wait("robot without a mission", lambda: is_free(station), 240.0)
    return fly_dives(station, DIVES, 0.5)


@pytest.fixture(scope="module")
def recording(station, dive):
    """The dives are over."""
    path = f"/api/plans/{dive}"
    station.wait("flown plan", lambda: station.get(path)["state"] == "done", 200.0)


def test_the_polar_of_a_robot_is_read_cell_by_cell(page, demo):
    open_page(page, demo, "/control/mini-1#polar")
    expect(page.get_by_text("Glider polar")).to_be_visible(timeout=240_000)
    picture = page.get_by_role("button", name=re.compile("Speed against net buoyancy"))
    box = picture.bounding_box()
    picture.click(position={"x": 0.7 * box["width"], "y": 0.9 * box["height"]})
    reading = page.get_by_role("region", name="Polar as a map")
    expect(reading.get_by_text("Angle of attack")).to_be_visible()
    before = reading.locator("dd").first.inner_text()
    page.mouse.move(0, 0)
    picture.press("ArrowUp")
    picture.press("ArrowUp")
    expect(reading.locator("dd").first).not_to_have_text(before)
    expect(page.get_by_text(re.compile("a disturbance (halves|doubles) every"))).to_be_visible()
    page.get_by_label("Tail angle").fill("10")
    tell_anew(page, "mini-1")
    expect(reading.get_by_text("Angle of attack")).to_be_visible()
    expect(page.get_by_label("Tail angle")).to_have_value("10")
    page.get_by_role("button", name="Work out this motion").click()
    expect(page.get_by_text(re.compile("radius [0-9.]+ m"))).to_be_visible()
    shoot(page, "control-polar")


def test_a_scaled_vehicle_is_said_to_be_one(page, demo):
    open_page(page, demo, "/control/grace-1#polar")
    expect(page.get_by_text("scaled, not identified", exact=False)).to_be_visible(timeout=240_000)


def test_two_controllers_are_compared_before_anybody_flies(page, demo):
    open_page(page, demo, "/control/mini-1#what-if")
    expect(page.get_by_text("No what-if run yet")).to_be_visible()
    page.get_by_label("Duration").fill("60")
    page.get_by_role("button", name="Run what-if on mini-1").click()
    table = page.get_by_role("table")
    expect(table.get_by_text("Less is better")).to_be_visible(timeout=300_000)
    for title in ("Backstepping", "PID"):
        expect(table.get_by_text(title, exact=True)).to_be_visible()
    expect(table.get_by_role("columnheader")).to_have_count(3)
    expect(page.get_by_text("(best)").first).to_be_attached()
    for name in ("Depth error", "Horizontal error", "Pitch error", "Tail angle"):
        expect(page.get_by_role("img", name=re.compile(f"{name}.*predicted"))).to_be_visible()
    page.get_by_role("button", name="Show in 3D").click()
    expect(page.get_by_role("button", name="Take it out of 3D")).to_be_visible()
    expect_scene(page)
    shoot(page, "control-what-if")


def test_the_page_opens_with_what_was_run_and_says_what_it_was(page, demo):
    open_page(page, demo, "/control/mini-1#what-if")
    expect(page.get_by_text("Duration 60 s; Model thesis")).to_be_visible()
    expect(page.get_by_label("Duration")).to_have_value("60")
    expect(page.get_by_text("Straight path")).to_have_count(0)
    page.get_by_label("Reference", exact=True).select_option(label="Level swim")
    page.get_by_text("Straight path").click()
    expect(page.get_by_label("Swimming speed")).to_be_visible()
    page.get_by_role("button", name="Use these settings").click()
    expect(page.get_by_text("Straight path")).to_have_count(0)


def test_settings_that_stay_at_the_station_say_so(page, demo):
    open_page(page, demo, "/control/mini-1#settings")
    page.get_by_role("button", name="PID", exact=True).click()
    expect(page.get_by_text("Not on board: the robot flies its own settings")).to_be_visible()
    page.get_by_role("button", name="Planner", exact=True).click()
    expect(page.get_by_role("heading", name="Planner of mini-1")).to_be_visible()
    expect(page.get_by_text("Not on board")).to_have_count(0)


def test_a_wrong_scenario_is_refused_beside_its_field(page, demo):
    open_page(page, demo, "/control/mini-1#what-if")
    page.get_by_label("Duration").fill("-5")
    expect(page.get_by_text("More than 0 s.")).to_be_visible()
    expect(page.get_by_role("button", name="Run what-if on mini-1")).to_be_disabled()


@pytest.mark.usefixtures("recording")
def test_half_a_step_of_trim_is_accepted(page, demo):
    open_page(page, demo, "/control/mini-1#identify")
    expect(page.get_by_text("now 0.00 g, 0.0 mm")).to_be_visible()
    page.get_by_role("button", name="Ask for advice on mini-1").click()
    half = page.get_by_role("button", name="Accept half a step")
    expect(half).to_be_visible(timeout=240_000)
    half.click()
    expect(page.get_by_text(re.compile("Half a step is stored"))).to_be_visible()
    expect(page.get_by_text("now 0.00 g, 0.0 mm")).not_to_be_visible()


@pytest.mark.usefixtures("recording")
def test_an_identification_is_started_watched_and_called_off(page, demo):
    open_page(page, demo, "/control/mini-1#identify")
    page.get_by_role("button", name="Identify mini-1", exact=True).click()
    curve = page.get_by_role("img", name=re.compile("Cost of the best parameters"))
    expect(curve).to_be_visible(timeout=240_000)
    shoot(page, "control-identify")
    page.get_by_role("button", name="Cancel this identification").click()
    expect(page.get_by_role("button", name="Resume identification 1")).to_be_visible()
