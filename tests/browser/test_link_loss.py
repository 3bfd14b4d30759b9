"""A robot is lost: what the page says of it meanwhile, over a power cut of the station too."""

import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from tests.browser.figure import Journey
from tests.browser.test_lost import vees
from tests.browser.test_night import acknowledge_but, sign_in_by_cookie
from tests.browser.walk import CHROMIUM, SHOTS, browser_page, open_page
from tests.e2e.demo import LASTING, Demo, Json

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1800),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]
ROBOT = "grace-1"
SPEED = 10
NEAR = "mini-1"
"""A robot that cannot drift out of the radio's reach while it is lost."""
NEAR_SPEED = 3
SILENT_S = 90.0
DEPTH_M = 0.5
COLOURS = """gauge => {
  const style = getComputedStyle(gauge.querySelector('.value'));
  const muted = getComputedStyle(gauge.querySelector('.title')).color;
  const watch = document.createElement('i');
  watch.style.color = 'var(--watch)';
  gauge.append(watch);
  const found = {
    isGrey: style.color === muted,
    turned: getComputedStyle(gauge.querySelector('.age')).color === getComputedStyle(watch).color,
  };
  watch.remove();
  return found;
}"""
"""Whether a value is grey, and whether its age has the colour of what is to be watched."""


@pytest.fixture
def lake(tmp_path: Path) -> Iterator[Demo]:
    with Demo(tmp_path, "--robots", ROBOT, "--speed", str(SPEED)) as demo:
        yield demo


def test_a_robot_is_lost_over_a_power_cut_as_its_stations_people_see_it(
    browser: Browser, lake: Demo
):
    journey = Journey("J5")
    with browser_page(browser, lake) as page:
        sign_in_by_cookie(lake, page)
        lake.patch("/api/config/planner", LASTING, robot=ROBOT)
        flown, waiting = start_a_plan(lake)
        open_page(page, lake, f"/robot/{ROBOT}")
        page.get_by_text("From above", exact=True).click()
        lake.wait("the dive", lambda: state(lake)["link"]["state"] == "submerged", 120.0)
        lake.client.put(f"/api/demo/faults/{ROBOT}/antenna").raise_for_status()
        lost_at = now(lake)

        values_age(page, journey)
        next_contact(page, journey)
        first_m = ellipse_m(lake)
        own_acts(page, flown, journey)
        alarm = overdue(lake, page, lost_at, journey)
        grows(lake, page, first_m, journey)

        # A power cut while nobody hears it.
        send = lake.post(f"/api/plans/{waiting}/schedule", send_at_the_surface(lake))["id"]
        order = lake.post(f"/api/robots/{ROBOT}/commands", {"kind": "hold"})["id"]
        lake.restart_station()
        survives(lake, page, flown, send, order, alarm, journey)


@pytest.fixture
def tank(tmp_path: Path) -> Iterator[Demo]:
    with Demo(tmp_path, "--robots", NEAR, "--speed", str(NEAR_SPEED)) as demo:
        yield demo


def test_a_robot_that_returns_fills_in_what_it_could_not_say(browser: Browser, tank: Demo):
    journey = Journey("J5-return")
    with browser_page(browser, tank) as page:
        sign_in_by_cookie(tank, page)
        tank.patch("/api/config/planner", LASTING, robot=NEAR)
        start_dives(tank)
        tank.client.put(f"/api/demo/faults/{NEAR}/antenna").raise_for_status()
        lost_at = now(tank)
        tank.wait("a silence", lambda: silent_s(tank) > SILENT_S, 60.0)
        before, *_ = numbers(tank)
        tank.client.delete(f"/api/demo/faults/{NEAR}/antenna").raise_for_status()
        fills_in(tank, page, before, journey)
        written_down(tank, page, lost_at, journey)


def silent_s(tank: Demo) -> float:
    found = prediction(tank, NEAR)
    return found["age_s"] if found["is_silent"] else 0.0


def start_dives(tank: Demo) -> None:
    tank.wait("a place", lambda: state(tank, NEAR)["position"] is not None, 60.0)
    north, east, _ = state(tank, NEAR)["position"]["ned_m"]
    legs = [{"kind": "dive", "end_ned": [north, east, d]} for d in (DEPTH_M, 0.0) * 6]
    config = {"total_budget": 80.0, "round_budget": 80.0, "mission": {"draft_distance_m": 1.0}}
    body = {"kind": "primitives", "legs": legs, "config": config}
    plan = tank.post(f"/api/robots/{NEAR}/plans", body)["id"]
    tank.wait("a draft", lambda: tank.get(f"/api/plans/{plan}")["state"] == "draft", 120.0)
    tank.post(f"/api/plans/{plan}/upload", {"start": True})
    tank.wait("flight", lambda: tank.get(f"/api/plans/{plan}")["state"] == "running", 120.0)


def state(lake: Demo, robot: str = ROBOT) -> Json:
    return lake.get(f"/api/robots/{robot}/state")


def now(lake: Demo) -> datetime:
    return datetime.fromisoformat(lake.get("/api/health")["clock"]["now"])


def draft(lake: Demo) -> str:
    """Plan until a plan fits where the robot, which drifts, is by then."""

    def plan_that_fits() -> str | None:
        body = {"kind": "primitives", "legs": vees(lake), "config": {"max_uncertainty_m": 60.0}}
        plan = lake.post(f"/api/robots/{ROBOT}/plans", body)["id"]
        lake.wait("a draft", lambda: lake.get(f"/api/plans/{plan}")["state"] == "draft", 120.0)
        return plan if not lake.get(f"/api/plans/{plan}")["violations"] else None

    plan = lake.wait("a plan that fits", plan_that_fits, 120.0)
    assert plan is not None
    return plan


def start_a_plan(lake: Demo) -> tuple[str, str]:
    """Return a plan that is flown, and a draft beside it."""
    lake.wait("a place", lambda: state(lake)["position"] is not None, 60.0)
    waiting, flown = draft(lake), draft(lake)
    lake.post(f"/api/plans/{flown}/upload", {"start": True})
    lake.wait("flight", lambda: lake.get(f"/api/plans/{flown}")["state"] == "running", 120.0)
    return flown, waiting


def gauge(page: Page, title: str) -> Locator:
    gauges = page.get_by_role("region", name=f"Gauges of {ROBOT}")
    return gauges.locator(".gauge").filter(has_text=title).first


def values_age(page: Page, journey: Journey) -> None:
    """1. Values go grey and their ages turn once the robot ought to be heard and is not."""
    told = gauge(page, "Depth")
    while not told.evaluate(COLOURS)["isGrey"]:
        page.wait_for_timeout(200)
    age = told.locator(".age")
    first = age.inner_text()
    expect(age).not_to_have_text(first)
    turned = told.evaluate(COLOURS)["turned"]
    then = f"{age.inner_text()!r}, {'' if turned else 'not '}in the colour of a watch"
    journey.tell("1", "ages turn, values grey, not frozen", f"grey; age {first!r}, then {then}")


def next_contact(page: Page, journey: Journey) -> None:
    """2. A countdown, and the predicted way with its ellipse, marked as predicted."""
    strip = page.get_by_role("region", name="Robot in hand")
    told = strip.get_by_text(re.compile(r"^\s*next contact (in|overdue by) "))
    expect(told).to_be_visible()
    first = told.inner_text()
    expect(page.locator(".map-predicted-way").first).to_be_attached()
    expect(page.locator(".map-predicted-ellipse").first).to_be_attached()
    expect(page.get_by_text(re.compile("predicted; heard"))).to_be_visible()
    panel = page.get_by_role("region", name="Prediction")
    expect(panel.get_by_text("predicted", exact=True)).to_be_visible()
    page.screenshot(path=SHOTS / "link-loss-predicted.png")
    expect(told).not_to_have_text(first)
    journey.tell("2a", "countdown to the next contact", f"{first!r}, then {told.inner_text()!r}")


def prediction(lake: Demo, robot: str = ROBOT) -> Json:
    return lake.get(f"/api/robots/{robot}/prediction")


def ellipse_m(lake: Demo) -> float:
    found = lake.wait("a prediction", lambda: prediction(lake)["now"], 60.0)
    return found["ellipse_m"][0]


def grows(lake: Demo, page: Page, first_m: float, journey: Journey) -> None:
    half_axes = [place["ellipse_m"][0] for place in prediction(lake)["path"]]
    assert ellipse_m(lake) > first_m
    assert half_axes[-1] > half_axes[0]
    expect(page.locator(".map-predicted-ellipse").first).to_be_attached()
    page.screenshot(path=SHOTS / "link-loss-overdue.png")
    shrinks = min(after / before for before, after in pairwise(half_axes))
    figure = (
        f"{half_axes[0]:.1f} m to {half_axes[-1]:.1f} m, at the cut {first_m:.1f} m; from a place "
        f"to the next at least {shrinks:.2f} times"
    )
    journey.tell("2b", "predicted track with a growing ellipse", figure)


def own_acts(page: Page, plan: str, journey: Journey) -> None:
    """4. What the robot does by itself, of the plan whose hash it echoed."""
    acts = page.get_by_role("region", name="What it will do by itself")
    expect(acts.get_by_text("It ends its mission and comes up for good")).to_be_visible()
    expect(acts.get_by_text(f"{plan} on board").first).to_be_visible()
    rows = acts.get_by_role("listitem")
    first = rows.first.inner_text().replace("\n", " ")
    journey.tell("4", "what it will do by itself", f"{rows.count()} lines; the first: {first!r}")


def lost_alarms(lake: Demo, robot: str, lost_at: datetime) -> list[Json]:
    """Return what was raised of the robot since, but what a machine that is too slow says of it."""
    alarms = [
        one
        for which in ("open", "closed")
        for one in lake.get("/api/alarms", state=which)["alarms"]
        if one["robot"] == robot and datetime.fromisoformat(one["raised_at"]) >= lost_at
    ]
    return [one for one in alarms if "clock" not in one["text"]]


def overdue(lake: Demo, page: Page, lost_at: datetime, journey: Journey) -> Json:
    """3. One alarm; no other comes beside it."""
    [alarm] = lake.wait("an alarm", lambda: lost_alarms(lake, ROBOT, lost_at), 200.0)
    assert "was to surface at" in alarm["text"]
    assert gauge(page, "Depth").evaluate(COLOURS)["turned"], "an age that is overdue turns"
    acknowledge_but(lake, "was to surface at")
    expect(page.get_by_role("alert").filter(has_text="was to surface at")).to_have_count(1)
    journey.tell("3", "at overdue one alarm, not ten", f"one: {alarm['text']!r}")
    return alarm


def send_at_the_surface(lake: Demo) -> Json:
    until = now(lake) + timedelta(days=2)
    return {"condition": {"kind": "surfacing"}, "expires_at": until.isoformat()}


def survives(
    lake: Demo, page: Page, plan: str, send: str, order: str, alarm: Json, journey: Journey
) -> None:
    """Look at a station that was killed in the loss: it has all that it had."""
    sends = {one["id"]: one for one in lake.get(f"/api/robots/{ROBOT}/schedule")["sends"]}
    assert sends[send]["state"] == "waiting"
    kept = lake.get(f"/api/commands/{order}")
    assert kept["level"] not in ("refused", "expired")
    assert lake.get(f"/api/plans/{plan}")["state"] == "running"
    acts = prediction(lake)["acts"]
    assert any(one["source"] == f"{plan} on board" for one in acts)
    same = next(one for one in lake.get("/api/alarms")["alarms"] if one["id"] == alarm["id"])
    open_page(page, lake, f"/robot/{ROBOT}")
    shown = page.get_by_role("region", name="What it will do by itself")
    expect(shown.get_by_text(f"{plan} on board").first).to_be_visible()
    expect(page.get_by_role("alert").filter(has_text="was to surface at")).to_have_count(1)
    figure = (
        f"send {sends[send]['state']}, order {kept['level']}, {plan} running on board with "
        f"{len(acts)} acts, alarm {same['state']}"
    )
    journey.tell("restart", "SIGKILL in the loss keeps queue and plan on board", figure)


NUMBERS = """
WITH numbered AS (
  SELECT first, last, lag(last) OVER (PARTITION BY log_key ORDER BY first) AS before FROM sample_run
)
SELECT
  (SELECT count(*) FROM sample),
  (SELECT sum(last - first + 1) FROM sample_run),
  (SELECT sum(first - before - 1) FROM numbered),
  (SELECT count(*) FROM detection WHERE measured_at < (SELECT max(measured_at) FROM sample))
"""
"""Samples, their distinct numbers, numbers between that no sample has, and tags that were heard,
which a robot numbers in the same log."""


def numbers(tank: Demo) -> tuple[int, int, int, int]:
    with closing(sqlite3.connect(f"file:{tank.data}/station.sqlite3?mode=ro", uri=True)) as db:
        samples, distinct, missing, tags = db.execute(NUMBERS).fetchone()
    return samples, distinct, missing or 0, tags


def fills_in(tank: Demo, page: Page, before: int, journey: Journey) -> None:
    """5. The robot returns: every number is there once, and the chart says where none was told."""
    tank.wait("the robot again", lambda: state(tank, NEAR)["link"]["state"] == "live", 600.0)

    def is_whole() -> bool:
        samples, distinct, missing, tags = numbers(tank)
        return samples > before and samples == distinct and missing == tags

    tank.wait(f"a log without a hole, not {numbers(tank)}", is_whole, 180.0)
    samples, distinct, missing, tags = numbers(tank)
    gap = page.get_by_text(re.compile(r"gaps?(, the longest)? from [0-9:]+"))
    open_page(page, tank, f"/robot/{NEAR}")
    expect(gap.first).to_be_visible()
    page.screenshot(path=SHOTS / "link-loss-back.png")
    figure = (
        f"{samples} samples, {before} before the return, with {distinct} numbers; the {missing} "
        f"between are {tags} tags that were heard; the chart: {gap.first.inner_text()!r}"
    )
    journey.tell("5", "back-fill in order, gaps marked, no duplicate", figure)


def written_down(tank: Demo, page: Page, lost_at: datetime, journey: Journey) -> None:
    """6. The log says how long it was lost, and why as far as is known."""

    def told() -> str | None:
        events = tank.get("/api/events", robot=NEAR, kind="robot.contact")["events"]
        texts = [one["text"] for one in events if datetime.fromisoformat(one["at"]) > lost_at]
        return next((text for text in texts if re.search("heard again by .* after", text)), None)

    text = tank.wait("the contact in the log", told, 60.0)
    assert re.search("; (it was under water|why it was not is not known)", text), text
    open_page(page, tank, "/log#events")
    expect(page.get_by_text(text).first).to_be_visible()
    journey.tell("6", "loss, duration and cause in the log", repr(text))
