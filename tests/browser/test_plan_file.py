"""A plan of another program is read on the page, answered, made a design of, and saved again."""

import json
import re

import pytest
from playwright.sync_api import Page, expect

from tests.browser.person import Person
from tests.browser.walk import CHROMIUM, open_page
from tests.server.plan_file.public import canberra

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1800),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

ROBOT = "grace-1"
WIDE = {"width": 1440, "height": 900}


@pytest.fixture(scope="module")
def desk(screen: Page, calm) -> Page:
    screen.set_viewport_size(WIDE)
    open_page(screen, calm, f"/design/{ROBOT}")
    return screen


def test_a_drone_plan_of_elsewhere_becomes_a_design_once_its_questions_are_answered(desk):
    panel = desk.get_by_role("region", name="Import a plan file")
    plan = {"name": "simple.plan", "mimeType": "application/json", "buffer": canberra()}
    panel.get_by_label("Read a file").set_input_files(plan)
    refused = panel.get_by_role("list", name="Refused")
    expect(refused.get_by_role("listitem")).to_have_count(9)
    expect(refused).to_contain_text("km from Practice lake")
    make = panel.get_by_role("button", name="Make a design of it")
    expect(make).to_be_disabled()
    Person().shoot(desk, "import-refused")
    panel.get_by_label(re.compile("move its middle")).check()
    expect(refused).to_contain_text("50.0 m above the water")
    panel.get_by_label(re.compile("depths as positive numbers")).check()
    expect(refused.get_by_role("listitem")).to_have_count(1)
    expect(refused).to_contain_text("command 22 (takeoff)")
    panel.get_by_label(re.compile("import the rest")).check()
    expect(panel).to_contain_text("8 waypoints over 2640.9 m")
    expect(make).to_be_enabled()
    Person().shoot(desk, "import-answered")
    make.click()
    expect(desk.get_by_title("Name of the design")).to_have_value("simple")
    expect(desk.locator(".map-spot")).to_have_count(8)


def test_the_design_is_saved_for_other_programs_after_its_losses_are_told(desk):
    panel = desk.get_by_role("region", name="Save as a file")
    panel.get_by_role("button", name="Save as").click()
    expect(panel.get_by_role("list", name="Not in the file")).to_contain_text("glide angle")
    Person().shoot(desk, "export")
    with desk.expect_download() as saved:
        panel.get_by_role("link", name="Save").click()
    assert saved.value.suggested_filename == "simple.plan"
    content = json.loads(saved.value.path().read_text())
    flown = [item for item in content["mission"]["items"] if item["command"] == 16]
    assert [item["params"][6] for item in flown] == [-50.0] * len(flown)


REEDS = """<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>
<Placemark><name>Way</name><LineString><coordinates>-84.3775,42.7620 -84.3765,42.7625
</coordinates></LineString></Placemark>
<Placemark><name>Reed bed</name><Polygon><outerBoundaryIs><LinearRing><coordinates>
-84.3790,42.7630 -84.3785,42.7630 -84.3785,42.7635 -84.3790,42.7635 -84.3790,42.7630
</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>
<Placemark><name>Old dock</name><Point><coordinates>-84.3770,42.7615</coordinates></Point>
</Placemark></Document></kml>"""


def test_areas_and_marks_of_a_file_are_taken_into_the_water_and_an_area_is_covered(desk):
    desk.get_by_role("link", name="All designs").click()
    panel = desk.get_by_role("region", name="Import a plan file")
    file = {"name": "reeds.kml", "mimeType": "application/xml", "buffer": REEDS.encode()}
    panel.get_by_label("Read a file").set_input_files(file)
    panel.get_by_role("button", name="Keep out of it: Reed bed").click()
    expect(panel.get_by_text("a keep-out of Practice lake")).to_be_visible()
    panel.get_by_role("button", name="Mark it: Old dock").click()
    expect(panel.get_by_text("a place of Practice lake")).to_be_visible()
    waters = desk.evaluate("fetch('/api/waters').then((answer) => answer.json())")
    [lake] = [one["document"] for one in waters if ROBOT in one["robots"]]
    assert [len(one["corners_m"]) for one in lake["keep_outs"] if one["name"] == "Reed bed"] == [4]
    assert "Old dock" in [one["name"] for one in lake["places"]]
    panel.get_by_role("combobox").select_option("1")
    expect(panel).to_contain_text("KML: lawnmower")
    depth = panel.get_by_label(re.compile("say no depth"))
    depth.fill("3")
    depth.press("Enter")
    Person().shoot(desk, "import-areas")
    panel.get_by_role("button", name="Make a design of it").click()
    expect(desk.get_by_title("Name of the design")).to_have_value("reeds")
    expect(desk.locator(".map-spot")).to_have_count(4)
