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
