"""A mission whole: drawn, undone, tried, compared, sent, flown, opened again, sent beside."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.person import Person
from tests.browser.test_design import corner, drag, kept
from tests.browser.walk import CHROMIUM, browser_page, hold, open_page
from tests.e2e.demo import LASTING, Demo, Json

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(3600),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

ROBOT = "grace-1"
SHIFT_M = 20.0
LONG_MS = 900_000


@pytest.fixture(scope="module")
def lake(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Demo]:
    with Demo(tmp_path_factory.mktemp("mission"), "--robots", ROBOT, "--speed", "20") as demo:
        yield demo


@pytest.fixture(scope="module")
def desk(browser: Browser, lake: Demo) -> Iterator[Page]:
    with browser_page(browser, lake) as page:
        page.set_viewport_size({"width": 1440, "height": 900})
        for one in page.context.cookies():
            lake.client.cookies.set(one.get("name", ""), one.get("value", ""))
        lake.client.headers["X-CSRF-Token"] = lake.get("/api/session")["csrf_token"]
        lake.patch("/api/config/planner", LASTING, robot=ROBOT)
        yield page


def plan_shown(page: Page) -> str:
    """The plan that the page *Plan* shows."""
    expect(page).to_have_url(re.compile(rf"/plan/{ROBOT}#plan-\d+$"))
    return page.url.rsplit("#", 1)[1]


def send(page: Page) -> None:
    page.get_by_role("button", name=re.compile(f"^Send plan [0-9]+ to {ROBOT} …")).click()
    held = re.compile(f"^Send plan [0-9]+ to {ROBOT} by (radio|satellite)")
    expect(page.get_by_role("button", name=held)).to_be_enabled()
    Person().shoot(page, "mission-send")
    hold(page, held)


def state_of(lake: Demo, plan: str) -> str:
    return str(lake.get(f"/api/plans/{plan}")["state"])


def begin(lake: Demo, plan: str) -> Json:
    lake.wait("flown", lambda: state_of(lake, plan) in ("running", "done"), 180.0)
    return lake.get(f"/api/plans/{plan}")


def tried(page: Page) -> str:
    """Try what is drawn, and go to where it is sent from."""
    panel = page.get_by_role("region", name="Try the design")
    panel.get_by_role("button", name="Try it", exact=True).click()
    expect(panel.get_by_role("status").first).to_contain_text(": draft", timeout=LONG_MS)
    return str(panel.get_by_role("link", name="Send it from Plan").get_attribute("href"))


def test_a_lawnmower_is_drawn_dragged_and_taken_back(lake: Demo, desk: Page):
    lake.wait("a place", lambda: lake.get(f"/api/robots/{ROBOT}/state")["position"], 60.0)
    open_page(desk, lake, f"/design/{ROBOT}")
    desk.get_by_role("button", name=re.compile("^Lawnmower")).click()
    kept(desk)
    desk.get_by_text("N, E in m", exact=True).click()
    before = corner(desk, 3)
    drag(desk, desk.locator(".map-spot").nth(2), 40.0, -20.0)
    field = desk.get_by_label("North and east of corner 3", exact=True)
    expect(field).not_to_have_value(before)
    desk.get_by_role("button", name="Undo: Moved corner 3").click()
    expect(field).to_have_value(before)
    desk.get_by_text("Move, turn, scale").click()
    desk.get_by_label("Factor").fill("0.25")
    desk.get_by_label("Factor").press("Enter")
    desk.get_by_role("button", name="Scale", exact=True).click()
    kept(desk)
    account = desk.get_by_role("region", name="Account of the design")
    expect(account).to_contain_text("No limit is violated.")
    Person().shoot(desk, "mission-drawn")


def test_it_is_tried_and_set_beside_the_planners_own_survey(desk: Page):
    tried(desk)
    expect(desk.get_by_role("region", name="Rehearsal of the plan")).to_be_visible()
    Person().shoot(desk, "mission-tried")
    desk.get_by_role("button", name="Ask the planner for as much").click()
    beside = desk.get_by_role("table", name=re.compile("^The design beside"))
    expect(beside).to_contain_text("Worst uncertainty", timeout=LONG_MS)
    expect(beside).to_contain_text(re.compile("variance.*%.*%"), timeout=LONG_MS)
    beside.scroll_into_view_if_needed()
    Person().shoot(desk, "mission-compared")


def test_it_is_flown_opened_again_and_flown_twenty_metres_beside(lake: Demo, desk: Page):
    desk.get_by_role("link", name="Send it from Plan").click()
    first = plan_shown(desk)
    send(desk)
    begin(lake, first)
    Person().shoot(desk, "mission-flown")
    lake.wait("the end", lambda: state_of(lake, first) == "done", 900.0)
    open_page(desk, lake, f"/design/{ROBOT}")
    again = re.compile(f"^Reopen as design: {first.replace('-', ' ')}$", re.IGNORECASE)
    desk.get_by_role("button", name=again).click()
    kept(desk)
    desk.get_by_text("Move, turn, scale").click()
    north = desk.get_by_label("North, m", exact=True).last
    north.fill(f"{SHIFT_M:g}")
    north.press("Enter")
    desk.get_by_role("button", name="Move", exact=True).click()
    kept(desk)
    Person().shoot(desk, "mission-shifted")
    tried(desk)
    desk.get_by_role("link", name="Send it from Plan").click()
    second = plan_shown(desk)
    send(desk)
    ends = [begin(lake, plan)["legs"][-1]["end_ned"] for plan in (first, second)]
    assert ends[1][0] - ends[0][0] == pytest.approx(SHIFT_M, abs=0.01)
