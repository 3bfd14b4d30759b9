"""A plan is sent while another is flown: seen waiting by both hashes, flown at the surfacing."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.walk import CHROMIUM, SHOTS, browser_page, hold, open_page
from tests.e2e.demo import Demo, Json, dives_inside

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

ROBOT = "mini-1"
WIDTHS = (1440, 900, 400)
UNDER_WATER = ("diving", "gliding")
CONFIG = {"max_uncertainty_m": 5.0, "total_budget": 80.0, "round_budget": 80.0}
"""Of plans that no limit forbids, however far a robot near the edge swims inward first."""


@pytest.fixture(scope="module")
def tank(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Demo]:
    with Demo(tmp_path_factory.mktemp("waiting"), "--robots", ROBOT, "--speed", "3") as demo:
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


def draft(tank: Demo, depths: tuple[float, ...]) -> str:
    legs = dives_inside(tank, depths)
    wish = {"kind": "primitives", "legs": legs, "config": CONFIG}
    made = tank.post(f"/api/robots/{ROBOT}/plans", wish)["id"]
    tank.wait("a draft", lambda: plan_of(tank, made)["state"] == "draft", 120.0)
    assert plan_of(tank, made)["violations"] == []
    return made


def kinds(tank: Demo) -> list[str]:
    events = tank.get(f"/api/events?robot={ROBOT}&limit=200")["events"]
    return [one["kind"] for one in events]


def shoot(page: Page, name: str) -> None:
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 950})
        page.wait_for_timeout(800)
        page.screenshot(path=SHOTS / f"{name}-{width}.png")
    page.set_viewport_size({"width": 1440, "height": 950})


def test_plan_waits_on_board_and_begins_at_the_surfacing(tank: Demo, window: Page):
    tank.wait("a place", lambda: state(tank)["position"] is not None, 60.0)
    # its first dive lasts long: a busy machine, too, looks at what waits before it ends
    first = draft(tank, (0.6, 0.3, 0.6, 0.3, 0.6, 0.0, 0.6, 0.0, 0.6, 0.0))
    second = draft(tank, (0.5, 0.0))
    open_page(window, tank, f"/robot/{ROBOT}")
    tank.post(f"/api/plans/{first}/upload", {"start": True, "confirmed": True})
    tank.wait("a dive", lambda: state(tank)["mode"] in UNDER_WATER, 180.0)
    tank.wait("its start told", lambda: plan_of(tank, first)["state"] == "running", 60.0)
    tank.post(f"/api/plans/{second}/upload", {"start": True, "confirmed": True})
    tank.wait("it to wait", lambda: (state(tank)["waiting_plan"] or {}).get("starts"), 120.0)
    panel = window.get_by_role("region", name=re.compile("^Plan that waits on board"))
    expect(panel).to_contain_text("waits on board for the next surfacing")
    for plan in (first, second):
        expect(panel).to_contain_text(plan_of(tank, plan)["sha256"][:8])
    shoot(window, "waiting-on-board")
    tank.wait("it to begin", lambda: plan_of(tank, second)["state"] in ("running", "done"), 300.0)
    tank.wait("the end", lambda: plan_of(tank, first)["state"] == "superseded", 60.0)
    expect(panel).to_be_hidden()
    # where no word of the short stay between two dives was heard, that of the end of the second
    tank.wait("the word on a surfacing", lambda: "robot.surfaced" in kinds(tank), 300.0)
    told = kinds(tank)
    assert told.index("plan.waiting") < told.index("plan.superseded")


def test_plan_is_scheduled_from_the_sheet_and_cancelled(tank: Demo, window: Page):
    tank.wait("rest", lambda: state(tank)["mode"] == "idle", 300.0)
    third = draft(tank, (0.4, 0.0))
    open_page(window, tank, f"/plan/{ROBOT}")
    bar = window.get_by_role("region", name="State of the plan")
    bar.get_by_role("button", name=re.compile("^Send ")).first.click()
    window.get_by_text("At the next surfacing", exact=True).click()
    shoot(window, "send-later")
    hold(window, re.compile("sent to .* later"))
    later = window.get_by_role("region", name=re.compile("^Plans that are sent later"))
    expect(later).to_contain_text("waits at the station for the next surfacing")
    shoot(window, "scheduled")
    later.get_by_role("button", name="Cancel").first.click()
    expect(later).to_contain_text("cancelled")
    assert plan_of(tank, third)["state"] == "draft"


def test_plan_is_sent_after_another_one_and_the_times_are_utc(tank: Demo, window: Page):
    first, second = draft(tank, (0.4, 0.0)), draft(tank, (0.3, 0.0))
    open_page(window, tank, f"/plan/{ROBOT}#{second}")
    bar = window.get_by_role("region", name="State of the plan")
    bar.get_by_role("button", name=re.compile("^Send ")).first.click()
    summary = window.get_by_role("region", name="Summary of what will be sent")
    expect(summary).to_contain_text("by itself, without another order")
    window.get_by_text("After another plan", exact=True).click()
    expect(summary).to_contain_text("Once it is sent,")
    before = window.get_by_label("After the end of")
    before.select_option(first)
    expires = window.get_by_label("Dropped, not sent, after, UTC")
    in_half_a_day = expires.input_value()
    assert re.fullmatch(r"\d{4}-\d{2}-\d{2} \d{2}:\d{2}", in_half_a_day)
    expires.fill("tomorrow")
    expires.press("Enter")
    expect(summary.get_by_role("alert")).to_contain_text("2026-11-21 14:30")
    expires.fill(in_half_a_day[-5:])
    expires.press("Enter")
    expect(expires).to_have_value(in_half_a_day)
    shoot(window, "send-after")
    hold(window, re.compile("sent to .* later"))
    later = window.get_by_role("region", name=re.compile("^Plans that are sent later"))
    name = first.replace("-", " ")
    expect(later).to_contain_text(re.compile(f"waits at the station for the end of {name}", re.I))
    later.get_by_role("button", name="Cancel").first.click()
    expect(later).to_contain_text("cancelled")
