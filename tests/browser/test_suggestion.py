"""A robot flies a searched plan: the strip counts, a better plan is suggested, taken and flown."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from tests.browser.walk import CHROMIUM, SHOTS, browser_page, open_page
from tests.e2e.demo import LASTING, Demo, Json

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1800),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

ROBOT = "mini-1"
WIDTHS = (1440, 900, 400)
UNDER_WATER = ("diving", "gliding", "spiralling")
DIVES = {
    "planning_time_s": 60.0,
    "search": {"iterations_max": 15},
    "round_budget": 20.0,
    "total_budget": 40.0,
    "max_uncertainty_m": 5.0,
    "mission": LASTING["mission"],
}


@pytest.fixture(scope="module")
def tank(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Demo]:
    with Demo(tmp_path_factory.mktemp("suggestion"), "--robots", ROBOT, "--speed", "1") as demo:
        yield demo


@pytest.fixture(scope="module")
def window(browser: Browser, tank: Demo) -> Iterator[Page]:
    with browser_page(browser, tank) as page:
        for one in page.context.cookies():
            tank.client.cookies.set(one.get("name", ""), one.get("value", ""))
        tank.client.headers["X-CSRF-Token"] = tank.get("/api/session")["csrf_token"]
        yield page


def state(tank: Demo) -> Json:
    return tank.get(f"/api/robots/{ROBOT}/state")


def plan_of(tank: Demo, plan: str) -> Json:
    return tank.get(f"/api/plans/{plan}")


def suggestion(tank: Demo) -> Json:
    return tank.get(f"/api/robots/{ROBOT}/suggestion")


def shoot(page: Page, name: str) -> None:
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 950})
        page.wait_for_timeout(800)
        page.screenshot(path=SHOTS / f"{name}-{width}.png")
    page.set_viewport_size({"width": 1440, "height": 950})


def asked_until_offered(tank: Demo, window: Page, panel: Locator) -> Json:
    """Ask at one surfacing after the other; what was found in haste may be good by chance."""
    done: Json = {}
    for _ in range(4):
        tank.wait("something to suggest", lambda: suggestion(tank)["can_ask"], 300.0)
        ask = panel.get_by_role("button", name=re.compile("^Suggest a"))
        expect(ask).to_be_enabled(timeout=60_000)
        ask.click()
        tank.wait("a search", lambda: suggestion(tank)["job"], 30.0)
        window.screenshot(path=SHOTS / "suggestion-searching.png")
        done = tank.wait("a verdict", lambda: (s := suggestion(tank))["job"] is None and s, 300.0)
        if done["state"] == "replace":
            break
    return done


def test_suggestion_is_seen_with_its_gain_taken_and_flown(tank: Demo, window: Page):
    tank.wait("a place", lambda: state(tank)["position"] is not None, 60.0)
    tank.patch("/api/config/automation", {"suggestions": "asked", "least_gain": 0.0})
    wish = {"kind": "adaptive_survey", "config": DIVES}
    first = tank.post(f"/api/robots/{ROBOT}/plans", wish)["id"]
    tank.wait("a draft", lambda: plan_of(tank, first)["state"] == "draft", 300.0)
    tank.post(f"/api/plans/{first}/upload", {"start": True, "confirmed": True})
    tank.wait("its flight", lambda: plan_of(tank, first)["state"] == "running", 120.0)
    # the flown plan was searched for in haste; a suggestion may take its time
    better = {"planning_time_s": 60.0, "search": {"iterations_max": 1500}}
    tank.patch("/api/config/planner", better, robot=ROBOT)
    open_page(window, tank, f"/robot/{ROBOT}")
    panel = window.get_by_role("region", name=re.compile("^Suggestion for"))
    expect(panel).to_contain_text("By itself")
    done = asked_until_offered(tank, window, panel)
    assert done["state"] == "replace", done["text"]
    expect(panel).to_contain_text("more of the tank")
    expect(panel).to_contain_text("not measured")
    shoot(window, "suggestion-verdict")
    events = tank.get("/api/events", robot=ROBOT, kind="plan.suggested")["events"]
    assert events
    assert {one["data"]["instead_of"] for one in events} == {first}
    hold = panel.get_by_role("button", name=re.compile("^(Send|Have) "))
    hold.scroll_into_view_if_needed()
    hold.hover()
    window.mouse.down()
    window.wait_for_timeout(1600)
    window.mouse.up()
    new = done["plan"]
    tank.wait("it to be flown", lambda: plan_of(tank, new)["state"] in {"running", "done"}, 400.0)
    tank.wait("the end", lambda: plan_of(tank, first)["state"] == "superseded", 60.0)
    expect(panel).to_contain_text("is running")
    shoot(window, "suggestion-taken")


def test_strip_counts_down_to_the_dive(tank: Demo, window: Page):
    open_page(window, tank, f"/robot/{ROBOT}")
    strip = window.get_by_role("region", name="Robot in hand")

    def counted() -> Json | None:
        found = tank.get(f"/api/robots/{ROBOT}/contact")
        return found if found["closes"] else None

    found = tank.wait("a surfacing between two dives", counted, 600.0)
    assert found["closes"]["source"]
    # of this surfacing or the next: a page on a busy machine may see this one too late
    expect(strip).to_contain_text(re.compile("dives (in|any moment)"), timeout=300_000)
    shoot(window, "contact-clock")
