"""Who pilots one robot: the app offers what they may do with each robot, and says why not."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.crew import act, charge, second_pilot, sheet
from tests.browser.walk import CHROMIUM, open_page

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(900),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]
SURFACE = re.compile("^Surface (mini|grace)-1 now")
WHY = "You may look at grace-1; this needs a pilot of it."


@pytest.fixture
def ben(browser, calm, screen):
    """Who looks at all robots and pilots mini-1, at a browser of his own."""
    with second_pilot(browser, calm, screen, only="mini-1") as page:
        yield page


def test_buttons_follow_the_right_on_each_robot_and_work_by_keyboard(ben, calm, screen):
    open_page(ben, calm, "/plan/grace-1")
    button = ben.get_by_role("button", name=SURFACE)
    expect(button).to_be_disabled()
    expect(button).to_have_attribute("title", WHY)
    expect(ben.get_by_role("note").filter(has_text=WHY)).to_be_visible()
    charge(ben, "Nobody is in charge", "grace-1").click()
    opened = sheet(ben, "grace-1")
    expect(opened.get_by_text(WHY)).to_be_visible()
    expect(opened.get_by_role("button", name=re.compile("Take charge"))).to_have_count(0)

    open_page(ben, calm, "/plan/mini-1")
    expect(ben.get_by_role("button", name=SURFACE)).to_be_enabled()
    expect(ben.get_by_text(re.compile("^You may look at"))).to_have_count(0)

    # The sheet by keyboard alone: opened, gone through, used, closed; the focus comes back.
    mark = charge(ben, "Nobody is in charge")
    mark.focus()
    ben.keyboard.press("Enter")
    opened = sheet(ben)
    expect(opened).to_contain_text("By its last word by radio, mini-1 obeys this station.")
    ben.keyboard.press("Tab")
    take = opened.get_by_role("button", name="Take charge of mini-1")
    expect(take).to_be_focused()
    ben.keyboard.press("Enter")
    mark = charge(ben, "You are in charge")
    expect(mark).to_be_visible()
    hold = opened.get_by_role("button", name="Hold automation of the station")
    expect(hold).to_be_visible()
    hold.focus()
    ben.keyboard.press("Escape")
    expect(opened).to_have_count(0)
    expect(mark).to_be_focused()

    # He may hold automation, and sees why it is not his to let it go on.
    ben.keyboard.press("Enter")
    act(ben, "Hold automation of the station")
    bar = ben.get_by_role("status").filter(has_text="Automation is held")
    on = bar.get_by_role("button", name="Let it go on")
    expect(on).to_be_disabled()
    expect(bar).to_contain_text("ben pilots chosen robots; this lets all of them go on.")
    open_page(screen, calm, "/plan/mini-1")
    screen.get_by_role("button", name="Let it go on").click()
    expect(bar).to_have_count(0)
