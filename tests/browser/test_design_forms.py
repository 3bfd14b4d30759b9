"""Forms around a design: templates with their numbers, rules of surfacing, and sending later."""

import re

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.person import Person
from tests.browser.walk import CHROMIUM, expect_scene, open_page

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1800),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

ROBOT = "grace-1"
WIDE = {"width": 1440, "height": 900}


def kept(page: Page) -> None:
    keeping = page.get_by_role("status", name="Keeping of the design")
    expect(keeping).to_have_text(re.compile("Kept .*Z"))


@pytest.fixture(scope="module")
def desk(screen: Page, calm) -> Page:
    """A star over the lake."""
    screen.set_viewport_size(WIDE)
    open_page(screen, calm, f"/design/{ROBOT}")
    screen.get_by_role("button", name=re.compile("^Star")).click()
    kept(screen)
    return screen


def test_a_template_is_made_begun_from_and_deleted(desk):
    desk.get_by_text("Save as a template").click()
    form = desk.get_by_role("form", name="Save as a template")
    save = form.get_by_role("button", name="Save the template")
    form.get_by_label("Name of the template").fill("Search")
    form.get_by_label("Radius", exact=True).check()
    radius = form.get_by_role("group", name="Radius")
    most = radius.get_by_label("Most, m")
    most.fill("1")
    most.press("Enter")
    expect(radius.get_by_role("alert")).to_contain_text("is more than the most, 1 m")
    expect(save).to_be_disabled()
    most.fill("150")
    most.press("Enter")
    usual = radius.get_by_label("Usual, m")
    usual.fill("")
    usual.press("Enter")
    Person().shoot(desk, "template-saved")
    save.click()
    expect(form.get_by_role("status")).to_contain_text("Search is a template")
    desk.get_by_role("link", name="All designs").click()
    templates = desk.get_by_role("list", name="Templates")
    templates.get_by_role("button", name="Search", exact=True).click()
    begin = templates.get_by_role("button", name="Begin with it")
    expect(begin).to_be_disabled()
    expect(templates.get_by_role("status")).to_have_text("Still to be said: Radius.")
    field = templates.get_by_label("Radius, m")
    field.fill("151")
    field.press("Enter")
    expect(templates.get_by_text("It must be at most 150.")).to_be_visible()
    field.fill("80")
    field.press("Enter")
    Person().shoot(desk, "template-begun")
    begin.click()
    kept(desk)
    expect(desk.get_by_label("Radius, m")).to_have_value("80")
    desk.get_by_role("link", name="All designs").click()
    templates.get_by_role("button", name="Delete the template Search").click()
    templates.get_by_role("button", name="Delete Search", exact=True).click()
    expect(templates).to_have_count(0)


def test_rules_that_the_robot_keeps_are_said_and_stay(desk):
    desk.get_by_role("link", name="Star", exact=True).click()
    manner = desk.get_by_role("region", name="Manner of the legs")
    manner.get_by_label("If samples wait").fill("500")
    manner.get_by_label("If samples wait").press("Enter")
    kept(desk)
    manner.get_by_label("Comes up on a value of").select_option("dissolved_oxygen")
    rules = manner.get_by_role("list", name="Values that bring it up")
    rules.get_by_label("Side of value 1").select_option("above")
    rules.get_by_label(re.compile("^Value")).fill("12")
    rules.get_by_label(re.compile("^Value")).press("Enter")
    hold = manner.get_by_label("Then not again for, min")
    expect(hold).to_have_value("10")
    hold.fill("25")
    hold.press("Enter")
    moment = manner.get_by_label("At a time, UTC")
    moment.fill("4:30 PM")
    moment.press("Enter")
    expect(manner.get_by_role("alert")).to_contain_text("Say it like 2026-11-21 14:30")
    moment.fill("2030-02-03 16:30")
    moment.press("Enter")
    expect(manner.get_by_text("2030-02-03 16:30Z")).to_be_visible()
    kept(desk)
    Person().shoot(desk, "design-surfacing")
    desk.reload()
    kept(desk)
    expect(rules.get_by_label("Side of value 1")).to_have_value("above")
    expect(rules.get_by_label(re.compile("^Value"))).to_have_value("12")
    expect(hold).to_have_value("25")
    expect(manner.get_by_label("If samples wait")).to_have_value("500")
    account = desk.get_by_role("region", name="Account of the design")
    expect(account.get_by_role("status")).to_have_text("checked")


def test_a_place_and_a_deep_turn_are_dragged_in_three_dimensions(desk):
    desk.get_by_role("link", name="All designs").click()
    desk.get_by_role("button", name=re.compile("^Lawnmower")).click()
    kept(desk)
    desk.get_by_text("N, E in m", exact=True).click()
    desk.get_by_text("3D", exact=True).click()
    drawn = desk.get_by_role("group", name="The design in the 3D view")
    corner = drawn.get_by_role("button", name="corner 1", exact=True)
    field = desk.get_by_label("North and east of corner 1", exact=True)
    depth = desk.get_by_label("Deep turn, m")
    expect(corner).to_be_visible()
    expect_scene(desk)
    before = field.input_value()
    drag(desk, corner.locator(".mark"), 40.0, 10.0)
    expect(field).not_to_have_value(before)
    turn = drawn.get_by_role("button", name=re.compile("^Deep turn on the way to corner 1"))
    drag(desk, turn.locator("rect"), 0.0, -25.0)
    expect(depth).to_have_value(re.compile(r"^[\d.]+$"))
    expect(turn).to_have_accessible_name(re.compile(rf"{float(depth.input_value()):.3g} m$"))
    kept(desk)
    Person().shoot(desk, "design-3d")
    desk.get_by_role("button", name="Undo: Deep turn changed").click()
    expect(depth).to_have_value("")
    desk.get_by_role("button", name="Undo: Moved corner 1").click()
    expect(field).to_have_value(before)
    kept(desk)


def drag(page: Page, handle: Locator, right_px: float, down_px: float) -> None:
    handle.hover()  # once the view has come to rest
    box = handle.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + right_px, y + down_px, steps=6)
    page.mouse.up()
