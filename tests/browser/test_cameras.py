"""Three emulated cameras over the tank are set up from nothing by hand, and watch what happens."""

import json
import math
import re

import pytest
from playwright.sync_api import expect

from tests.browser.figure import Journey
from tests.browser.person import Person
from tests.browser.walk import CHROMIUM, browser_page, open_page
from tests.e2e.demo import Demo

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1800),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

CAMERAS = ("tank-1", "tank-2", "tank-3")
SET_UP_MS = 600_000
FOCAL_MOST, PLACE_MOST_MM, FIX_MOST_MM = 0.1, 8.0, 8.0
"""Percent of the focal length; a camera's place as claimed; a fixed tag's mean error."""
BUMPED = re.compile(r"tank-2 has moved")
WITHIN = re.compile(r"camera within ([\d.]+) mm")


@pytest.fixture(scope="module")
def tank(tmp_path_factory):
    with Demo(tmp_path_factory.mktemp("tank"), "--cameras", "--robots", "mini-1,mini-2") as demo:
        yield demo


@pytest.fixture(scope="module")
def desk(browser, tank):
    """The operator's page; what the demo told of its cameras and tags is taken away again."""
    with browser_page(browser, tank) as page:
        tank.client.cookies.update({each["name"]: each["value"] for each in page.context.cookies()})
        tank.client.headers["X-CSRF-Token"] = tank.get("/api/session")["csrf_token"]
        yield page


@pytest.fixture(scope="module")
def told(tank, desk, tmp_path_factory):
    """Addresses of the cameras by their names, and the survey of the tank as a file."""
    addresses = {one["id"]: one["uri"] for one in tank.get("/api/cameras")}
    tags = tank.get("/api/tags")
    survey = tmp_path_factory.mktemp("survey") / "tags.json"
    survey.write_text(json.dumps({"layout": tags["layout"], "bundles": tags["bundles"]}))
    for name in addresses:
        tank.client.delete(f"/api/cameras/{name}").raise_for_status()
    nothing = {"layout": {"tags": []}, "bundles": []}
    tank.client.put("/api/tags", json=nothing).raise_for_status()
    return addresses, survey


def region(page, name):
    return page.get_by_role("region", name=name, exact=True)


def cause(page, where, title, *, undo=False):
    """Let something happen to the emulated tank, or undo it."""
    faults = region(page, f"Demo: faults of {where}")
    verb = "Undo" if undo else "Cause"
    faults.get_by_role("button", name=f"{verb}: {title}").click()
    faults.get_by_role("button", name=f"{verb} it").click()
    other = "Cause" if undo else "Undo"
    expect(faults.get_by_role("button", name=f"{other}: {title}")).to_be_visible()


def camera_page(page, demo, name):
    page.goto("about:blank")
    open_page(page, demo, f"/camera#camera.{name}")
    expect(region(page, f"Camera {name}")).to_be_visible()


def add_by_keyboard(page, name, address):
    """Add a camera without a pointer."""
    page.get_by_role("button", name="Add a camera").focus()
    page.keyboard.press("Enter")
    form = region(page, "Add a camera")
    expect(form.get_by_label("Name, also in alarms")).to_have_value(name)
    form.get_by_label("Name, also in alarms").focus()
    page.keyboard.press("Tab")
    page.keyboard.type(address)
    page.keyboard.press("Enter")
    expect(region(page, f"Camera {name}")).to_be_visible()


def calibrate_lens(page, name):
    """Somebody holds the board before the camera until nothing is missing."""
    cause(page, name, "Board in front of it")
    lens = region(page, f"Lens of {name}")
    lens.get_by_role("button", name="Take pictures by itself").click()
    expect(lens.get_by_text("Nothing is missing.")).to_be_visible(timeout=SET_UP_MS)
    head = lens.locator(".panel-head").filter(has_text=re.compile(r"focal length to [\d.]+ %"))
    misfit = lens.get_by_role("button", name=re.compile(r"Forget picture \d+"))
    while True:
        calibrate = lens.get_by_role("button", name="Calibrate the lens")
        expect(calibrate).to_be_enabled(timeout=SET_UP_MS)
        calibrate.click()
        expect(head.or_(misfit).first).to_be_visible(timeout=SET_UP_MS)
        if head.is_visible():
            break
        misfit.click()
        expect(misfit).to_have_count(0)
    cause(page, name, "Board in front of it", undo=True)
    return float(re.search(r"focal length to ([\d.]+) %", head.inner_text())[1])


def test_three_cameras_are_set_up_from_nothing_by_hand(tank, desk, told):
    journey, person = Journey("cameras"), Person()
    addresses, survey = told
    open_page(desk, tank, "/camera")
    expect(desk.get_by_text("No cameras")).to_be_visible()
    for name in CAMERAS:
        add_by_keyboard(desk, name, addresses[name])
        open_page(desk, tank, "/camera")
    row = desk.get_by_role("listitem", name="tank-3")
    expect(row).to_contain_text("Running", timeout=SET_UP_MS)
    expect(row).to_contain_text("Uncalibrated")
    open_page(desk, tank, "/camera#tags")
    desk.get_by_label("Read a file").set_input_files(str(survey))
    desk.get_by_role("button", name="Keep these tags").press("Enter")
    expect(desk.get_by_text("Kept. Cameras are to be adjusted again")).to_be_visible()
    person.shoot(desk, "cameras-tags")
    focal = []
    for name in CAMERAS:
        camera_page(desk, tank, name)
        focal.append(calibrate_lens(desk, name))
    person.shoot(desk, "cameras-lens")
    journey.tell("lens", f"focal length <= {FOCAL_MOST} %", f"{max(focal)} %")
    assert max(focal) <= FOCAL_MOST
    desk.get_by_role("button", name="Adjust all cameras").press("Enter")
    pose = region(desk, "Pose of tank-3")
    expect(pose.get_by_text("Adjusted; the result is in use.")).to_be_visible(timeout=SET_UP_MS)
    head = pose.locator(".panel-head")
    expect(head).to_contain_text(WITHIN)
    within = WITHIN.search(head.inner_text())
    assert within is not None
    journey.tell("pose", f"claimed within {PLACE_MOST_MM} mm", f"{within[1]} mm")
    assert float(within[1]) <= PLACE_MOST_MM
    desk.get_by_role("button", name="Measure the accuracy").press("Enter")
    check = region(desk, "Check of all cameras")
    expect(check.get_by_text("Measured.")).to_be_visible(timeout=SET_UP_MS)
    rows = check.get_by_role("table", name="Accuracy by depth").locator("tbody tr")
    expect(rows.first).to_be_visible()
    means = [float(row.locator("td").nth(2).inner_text()) for row in rows.all()]
    journey.tell("check", f"mean <= {FIX_MOST_MM} mm at each depth", f"{max(means)} mm")
    assert max(means) <= FIX_MOST_MM
    steps = desk.get_by_role("list", name="Set-up of tank-3").get_by_role("listitem")
    expect(steps.filter(has_text="Check")).to_have_class(re.compile("proved"))
    person.shoot(desk, "cameras-check")


def test_the_robots_page_says_by_whom_it_is_fixed(tank, desk):
    """The gauge is the robot's own word; beside it stands what the cameras saw."""
    open_page(desk, tank, "/robot/mini-1")
    desk.get_by_text("From above", exact=True).first.click()
    gauges = region(desk, "Gauges of mini-1")
    expect(gauges).to_contain_text(re.compile(r"fixed by \d cameras?"), timeout=SET_UP_MS)
    cameras = region(desk, "Cameras of mini-1")
    expect(cameras).to_contain_text(re.compile(r"\d cameras?, \d+ a second, [\d.]+ s old"))
    expect(cameras).to_contain_text(re.compile(r"off by \d+ cm,\s+cameras"))
    expect(desk.locator(".map-seen-place")).to_have_count(1)
    Person().shoot(desk, "cameras-robot")


def test_two_robots_under_the_cameras_are_never_taken_for_each_other(tank):
    """Each fix is nearer to what its own robot says than to the other's word."""
    newest = {}

    def seen():
        for robot in ("mini-1", "mini-2"):
            fixes = tank.get(f"/api/robots/{robot}/fixes", max_points="2000")["fixes"]
            newest[robot] = [one["ned_m"] for one in fixes if one["quality"] == "good"]
        return all(len(places) >= 20 for places in newest.values())

    tank.wait("20 fixes of each robot", seen, 120.0)
    said = {robot: tank.get(f"/api/robots/{robot}/state")["position"]["ned_m"] for robot in newest}
    for robot, other in (("mini-1", "mini-2"), ("mini-2", "mini-1")):
        for place in newest[robot][-20:]:
            own = math.dist(place[:2], said[robot][:2])
            assert own < math.dist(place[:2], said[other][:2])


def test_a_camera_that_was_bumped_is_told_and_left_out(tank, desk):
    camera_page(desk, tank, "tank-2")
    cause(desk, "tank-2", "Bumped camera")
    bar = desk.get_by_role("alert").filter(has_text=BUMPED)
    expect(bar.first).to_be_visible(timeout=SET_UP_MS)
    camera = region(desk, "Camera tank-2")
    expect(camera).to_contain_text("moved, left out")
    expect(camera).to_contain_text(BUMPED)
    Person().shoot(desk, "cameras-bumped")
    desk.get_by_role("button", name="Adjust tank-2 alone").press("Enter")
    pose = region(desk, "Pose of tank-2")
    expect(pose.get_by_text("Adjusted; the result is in use.")).to_be_visible(timeout=SET_UP_MS)
    expect(camera).to_contain_text("where it was", timeout=SET_UP_MS)


def test_water_that_fell_is_seen(tank, desk):
    """By 3 cm, which the cameras find by the tags on the floor."""
    open_page(desk, tank, "/camera")
    cause(desk, "the tank", "Lower level")
    camera_page(desk, tank, "tank-1")
    pose = region(desk, "Pose of tank-1")
    lower = re.compile(r"(2\.[89]|3\.[012]) cm\s+lower than when adjusted")
    expect(pose).to_contain_text(lower, timeout=SET_UP_MS)
    Person().shoot(desk, "cameras-level")
