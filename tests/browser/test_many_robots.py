"""A dozen robots on the page Fleet: found, ordered by who needs somebody, and taken in hand."""

import re

import pytest
from playwright.sync_api import Page, expect

from tests.browser.crew import second_pilot
from tests.browser.walk import CHROMIUM, browser_page, open_page, shoot
from tests.e2e.demo import Demo

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

ROBOTS = 12
TROUBLED = "grace-4"


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    options = ("--fleet", str(ROBOTS), "--fault", f"{TROUBLED}:leak@1")
    with Demo(tmp_path_factory.mktemp("many"), *options) as demo:
        yield demo


@pytest.fixture(scope="module")
def page(browser, demo):
    with browser_page(browser, demo) as page:
        open_page(page, demo, "/")
        yield page


@pytest.fixture(autouse=True)
def _whole_list(page):
    """Begin each walk at the page Fleet with everybody on it."""
    page.get_by_role("navigation", name="Pages").get_by_role("link", name="Fleet").click()
    tools(page).get_by_label("Find a robot").fill("")
    tools(page).get_by_label("Show").select_option("")
    tools(page).get_by_label("Order").select_option("need")


def tools(page: Page):
    return page.get_by_role("search", name="Robots")


def names(page: Page):
    return page.get_by_role("region", name="Robots", exact=True).get_by_role("heading", level=2)


def test_who_needs_somebody_stands_first_and_the_others_by_their_numbers(page):
    expect(names(page).first).to_have_text(TROUBLED)
    expect(names(page)).to_have_count(ROBOTS)
    card = page.get_by_role("article", name=TROUBLED)
    expect(card).to_contain_text("severe or critical alarm")
    shoot(page, "fleet-many")
    tools(page).get_by_label("Order").select_option("name")
    numbered = [f"{kind}-{number}" for kind in ("grace", "mini") for number in range(1, 7)]
    expect(names(page)).to_have_text(numbered)


def test_a_robot_is_found_by_words_and_by_its_water(page):
    find = tools(page).get_by_label("Find a robot")
    find.fill("tank mini-3")
    expect(names(page)).to_have_text(["mini-3"])
    expect(tools(page).get_by_role("status")).to_have_text(f"1 of {ROBOTS} robots")
    find.fill("nautilus")
    expect(page.get_by_text("No robot is called so, or works there.")).to_be_visible()
    find.fill("")
    lake = tools(page).get_by_label("Show").locator("option", has_text=re.compile("lake", re.I))
    tools(page).get_by_label("Show").select_option(lake.first.get_attribute("value"))
    expect(names(page)).to_have_count(ROBOTS // 2)


def test_a_card_is_opened_and_collapsed_by_keys_alone(page):
    fold = page.get_by_role("button", name="Open the card of mini-2")
    expect(fold).to_have_attribute("aria-expanded", "false")
    fold.focus()
    page.keyboard.press("Enter")
    collapse = page.get_by_role("button", name="Collapse the card of mini-2")
    expect(collapse).to_be_focused()
    expect(page.get_by_role("article", name="mini-2")).to_contain_text("Plan on board")
    page.keyboard.press("Enter")
    expect(fold).to_be_focused()
    tools(page).get_by_role("button", name="Whole cards").click()
    expect(page.get_by_text("Plan on board")).to_have_count(ROBOTS)
    tools(page).get_by_role("button", name="Whole cards").click()
    expect(fold).to_be_visible()


def test_a_robot_is_taken_in_hand_by_typing_a_part_of_its_name(page):
    box = page.get_by_role("combobox", name="Robot in hand")
    box.focus()
    options = page.get_by_role("listbox", name="Robot in hand").get_by_role("option")
    box.press_sequentially("grace")
    expect(options).to_have_count(ROBOTS // 2)
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    strip = page.get_by_role("region", name="Robot in hand")
    expect(strip.get_by_role("button", name=re.compile("^Surface grace-2 now"))).to_be_visible()
    expect(box).to_have_value("grace-2")
    box.press_sequentially("mini-5")
    expect(options).to_have_text([re.compile("mini-5")])
    page.keyboard.press("Escape")
    expect(box).to_have_value("grace-2")
    expect(options).to_have_count(0)


def test_a_group_is_shown_alone(page, demo):
    csrf = page.evaluate("fetch('/api/session').then(a => a.json()).then(a => a.csrf_token)")
    made = page.request.put(
        f"{demo.url}/api/groups/east",
        data={"robots": ["grace-1", "mini-3"], "seen": []},
        headers={"X-CSRF-Token": csrf},
    )
    assert made.ok, made.text()
    page.reload()
    tools(page).get_by_label("Show").select_option("group east")
    expect(names(page)).to_have_text(["grace-1", "mini-3"])
    expect(tools(page).get_by_role("status")).to_have_text(f"2 of {ROBOTS} robots")


def test_who_pilots_one_of_many_may_surface_that_one_alone(browser, page, demo):
    with second_pilot(browser, demo, page, only="mini-6") as ben:
        box = ben.get_by_role("combobox", name="Robot in hand")
        for robot, may in (("mini-6", True), ("mini-5", False)):
            box.focus()
            box.press_sequentially(robot)
            ben.keyboard.press("Enter")
            button = ben.get_by_role("button", name=re.compile(f"^Surface {robot} now"))
            expect(button).to_be_enabled(enabled=may)
            box.blur()
