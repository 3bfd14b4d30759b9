"""Deployments planned, begun and ended in the browser, the past one read only; tags."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.walk import CHROMIUM, browser_page, open_page, tell_anew
from tests.e2e.demo import Demo

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(600),
    pytest.mark.skipif(CHROMIUM is None, reason="needs chromium"),
]

HEAD = (
    "Date and Time (UTC),Receiver,Transmitter,Transmitter Name,Transmitter Serial,Sensor Value,"
    "Sensor Unit,Station Name,Latitude,Longitude"
)


def detections() -> str:
    """Return an export of VUE with two tags that pass a receiver in the lake."""
    rows = [
        f"2026-07-01 09:{minute:02}:17,VR2C-480123,A69-1601-{tag},,,,,Jetty,42.7615,-84.3780"
        for minute in range(0, 50, 4)
        for tag in (179, 180)
    ]
    return "\n".join([HEAD, *rows])


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    with Demo(tmp_path_factory.mktemp("lake"), "--robots", "grace-1") as demo:
        yield demo


@pytest.fixture(scope="module")
def sheet(browser, lake):
    with browser_page(browser, lake) as page:
        yield page


def test_a_planned_deployment_begins_on_the_robot_page_and_the_one_before_is_read_only(sheet, lake):
    open_page(sheet, lake, "/data/grace-1")
    deployments = sheet.get_by_role("region", name="Deployments")
    deployments.get_by_role("button", name="Plan a deployment").click()
    deployments.get_by_label("Name, if it has one").fill("Autumn bloom")
    deployments.get_by_role("button", name="Plan it").click()
    expect(deployments.get_by_text("Autumn bloom")).to_be_visible()
    expect(deployments.get_by_text("planned", exact=True)).to_be_visible()

    open_page(sheet, lake, "/robot/grace-1")
    line = sheet.get_by_role("region", name="Deployment of grace-1")
    line.get_by_role("button", name="End the deployment").click()
    line.get_by_role("button", name=re.compile("^End .* now$")).click()
    expect(line.get_by_role("heading", name="In the workshop")).to_be_visible()
    line.get_by_role("button", name="Begin a deployment").click()
    line.get_by_label("Purpose").fill("kept while the robot is told anew")
    tell_anew(sheet, "grace-1")
    expect(line.get_by_label("Purpose")).to_have_value("kept while the robot is told anew")
    line.get_by_role("button", name="Begin Autumn bloom now").click()
    expect(line.get_by_role("heading", name="In the water")).to_be_visible()
    expect(line.get_by_text("Autumn bloom")).to_be_visible()

    open_page(sheet, lake, "/data/grace-1")
    deployments.get_by_role("link", name=re.compile("^grace-1, from ")).click()
    past = sheet.get_by_role("region", name=re.compile("^Deployment grace-1, from "))
    expect(past.get_by_text("Past, read-only")).to_be_visible()
    for part in ("Track", "Events", "Alarms"):
        expect(sheet.get_by_role("region", name=part, exact=True)).to_be_visible()
    main = sheet.get_by_role("main")
    changing = re.compile("^(Begin|End|Correct|Split|Void|Plan|Import)")
    expect(main.get_by_role("button", name=changing)).to_have_count(0)


def test_an_export_of_vue_comes_in_and_its_tags_are_plotted_and_exported(sheet, lake, tmp_path):
    export = tmp_path / "vue.csv"
    export.write_text(detections())
    open_page(sheet, lake, "/data/grace-1")
    tags = sheet.get_by_role("region", name="Tags", exact=True)
    tags.locator("input[type=file]").set_input_files(export)
    expect(tags.get_by_text("26 detections imported")).to_be_visible()
    expect(tags.get_by_role("img", name="Tags of grace-1 by time")).to_be_visible()
    expect(tags.get_by_role("table")).to_contain_text("A69-1601-179")
    address = tags.get_by_role("link", name="CSV").get_attribute("href")
    written = sheet.request.get(f"{lake.url}{address}").text()
    assert written.count("A69-1601-180") == 13

    broken = tmp_path / "broken.csv"
    broken.write_text(detections().replace("A69-1601-179", "fish", 1))
    tags.locator("input[type=file]").set_input_files(broken)
    expect(tags.get_by_text(re.compile("Line 2: .*Transmitter"))).to_be_visible()
