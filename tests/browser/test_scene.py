"""The 3D view in a browser without a graphics processor: what it draws and when."""

import os
import re
import signal
from collections.abc import Iterator
from io import BytesIO

import pytest
from PIL import Image, ImageStat
from playwright.sync_api import ConsoleMessage, Frame, Page, expect

from tests.browser.walk import CHROMIUM, expect_scene, open_page
from tests.e2e.demo import LASTING, Demo

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

OWN_READBACK = "GPU stall due to ReadPixels"
"""Chromium says so of itself where it has no graphics processor to show a canvas with."""
PAGES = ["", "robot/mini-1", "plan/mini-1", "track/mini-1", "map/mini-1", "control/mini-1",
         "data/mini-1", "log", "settings"]  # fmt: skip
TRIES = 60
LONGEST_TASK_MS = 5000
"""The page hung for a minute; a busy machine needs a second for what should take a tenth."""


@pytest.fixture
def view(screen: Page, calm: Demo) -> Frame:
    """The frame of the 3D view of mini-1, which has drawn."""
    open_page(screen, calm, "/robot/mini-1")
    expect_scene(screen)
    return next(frame for frame in screen.frames if "/view/" in frame.url)


@pytest.fixture
def silent(calm: Demo) -> Iterator[None]:
    """No robot says anything meanwhile."""
    simulator = calm.children()["simulate"]
    os.kill(simulator, signal.SIGSTOP)
    yield
    os.kill(simulator, signal.SIGCONT)


def pictures(view: Frame) -> int:
    return view.evaluate("Number(document.documentElement.dataset.pictures)")


def until_drawn_again(screen: Page, view: Frame) -> None:
    before = pictures(view)
    view.wait_for_function(
        "before => Number(document.documentElement.dataset.pictures) > before", arg=before
    )
    expect_scene(screen)


def middle(screen: Page) -> tuple[float, float, float]:
    """Mean colour of the upper edge of the 3D view, where its sky is."""
    shown = screen.locator("iframe").screenshot(timeout=120_000)
    picture = Image.open(BytesIO(shown)).convert("RGB")
    red, green, blue = ImageStat.Stat(picture.crop((0, 0, picture.width, 20))).mean
    return red, green, blue


def test_the_scene_is_there_after_loading_turning_and_news(screen, view):
    turn(screen)
    until_drawn_again(screen, view)
    until_drawn_again(screen, view)  # a robot in the water is never quite still


def turn(screen: Page) -> None:
    box = screen.locator("iframe").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    screen.mouse.move(x, y)
    screen.mouse.down()
    for step in range(10):
        screen.mouse.move(x + 12 * step, y + 2 * step)
    screen.mouse.up()


def test_nothing_is_drawn_while_nothing_changes(screen, view, silent):
    for _ in range(TRIES):
        before = pictures(view)
        screen.wait_for_timeout(4000)
        if pictures(view) == before:
            return
    raise AssertionError("pictures go on while every robot is silent")


def test_another_page_is_shown_while_the_camera_still_moves(screen, view):
    turn(screen)
    screen.get_by_role("link", name="Log").first.click()
    expect(screen.get_by_role("heading", name="Log").first).to_be_attached(timeout=15_000)
    drawn = "new Promise(then => requestAnimationFrame(() => requestAnimationFrame(then)))"
    screen.evaluate(drawn)
    before = pictures(view)
    screen.wait_for_timeout(3000)
    assert pictures(view) <= before + 1, "a view that nobody sees is drawn"


def test_the_sky_follows_the_theme_while_the_view_is_open(screen, view):
    dark = middle(screen)
    choose_theme(screen, "Day")
    expect(screen.locator("html")).to_have_attribute("data-theme", "day")
    view.wait_for_function("document.documentElement.dataset.theme === 'day'")
    for _ in range(TRIES):
        light = middle(screen)
        if sum(light) > 2 * sum(dark):
            break
        screen.wait_for_timeout(500)
    choose_theme(screen, "Dark")
    assert sum(light) > 2 * sum(dark), (light, dark)


def test_data_answers_at_once_after_the_theme_was_changed_beside_an_open_view(screen, view):
    screen.get_by_role("link", name="Data").first.click()
    expect(screen.get_by_role("region", name="History of channels")).to_be_visible()
    screen.evaluate(
        """window.longest = 0;
        new PerformanceObserver(list => {
          for (const { duration } of list.getEntries())
            window.longest = Math.max(window.longest, duration);
        }).observe({ type: 'longtask' })"""
    )
    choose_theme(screen, "Night red")
    shown = "new Promise(then => requestAnimationFrame(() => requestAnimationFrame(then)))"
    screen.evaluate(shown)
    choose_theme(screen, "Dark")
    screen.evaluate(shown)
    assert screen.evaluate("window.longest") < LONGEST_TASK_MS


def choose_theme(screen: Page, title: str) -> None:
    screen.get_by_role("button", name="demo").click()
    screen.get_by_text(title, exact=True).first.click()


def test_no_page_says_anything_on_the_console(screen, calm, view):
    said: list[str] = []

    def note(line: ConsoleMessage) -> None:
        if OWN_READBACK not in line.text:
            said.append(f"{screen.url}: {line.type}: {line.text}")

    screen.on("console", note)
    screen.on("pageerror", lambda error: said.append(f"{screen.url}: {error}"))
    for path in PAGES:
        open_page(screen, calm, f"/{path}")
        screen.wait_for_load_state("networkidle")
        if path.startswith("robot"):
            expect_scene(screen)
    for name in ("Robot", "Plan", "Map", "Data", "Fleet"):
        screen.get_by_role("link", name=name).first.click()
        expect(screen).to_have_title(re.compile(rf"^(\(\d+\) )?{name}"))
    screen.remove_listener("console", note)
    assert said == []


def test_a_view_without_its_stream_says_so_and_finds_it_again(screen, calm, view):
    lost = screen.get_by_text("The 3D view lost its connection")
    expect(lost).to_have_count(0)
    calm.restart_station()
    expect(lost).to_be_visible()
    expect(lost).to_have_count(0)
    until_drawn_again(screen, view)


def test_the_map_of_the_fleet_shows_the_trail_and_dashed_where_a_plan_leads(screen, calm):
    sign_in_as(calm, screen)
    calm.patch("/api/config/planner", LASTING, robot="mini-1")
    north, east, _ = calm.get("/api/robots/mini-1/state")["position"]["ned_m"]
    there = {"kind": "swim", "end_ned": [north + 0.4, east, 0.0]}
    wish = {"kind": "primitives", "legs": [there], "config": {"total_budget": 80.0}}
    plan = calm.post("/api/robots/mini-1/plans", wish)["id"]
    calm.wait("draft", lambda: calm.get(f"/api/plans/{plan}")["state"] == "draft", 60.0)
    calm.post(f"/api/plans/{plan}/upload", {"start": False})
    calm.wait("on board", lambda: calm.get(f"/api/plans/{plan}")["state"] == "on_board", 60.0)
    open_page(screen, calm, "/")
    tank = screen.get_by_role("group", name="Test tank from above with its robots")
    expect(tank.locator(".map-track").first).to_be_attached()
    leg = tank.locator(".map-leg").first
    expect(leg).to_be_attached()
    expect(leg).not_to_have_css("stroke-dasharray", "none")


def sign_in_as(demo: Demo, page: Page) -> None:
    """Let the demo's own client be who the browser is: the one-time address has gone to it."""
    for each in page.context.cookies():
        if each.get("name", "").startswith("grace_session"):
            demo.client.cookies.set(each["name"], each["value"])
    demo.client.headers["X-CSRF-Token"] = demo.get("/api/session")["csrf_token"]
