"""Draws the pictures of the operator's manual anew: ``python -m tests.browser.manual_pictures``.

A demo is driven in Chromium to each moment that the manual shows, and what is seen is written to
``docs/manual/images``, with few colours, so that a picture is small.
"""

import re
import tempfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

from PIL import Image
from playwright.sync_api import Locator, Page, expect

from tests.browser.walk import browser_page, chromium, expect_scene, open_page
from tests.e2e.demo import LASTING, ROOT, Demo

INTO = ROOT / "docs" / "manual" / "images"
SIZE = {"width": 1120, "height": 720}
COLOURS = 256
SETTLE_MS = 1500
"""Charts and maps ease into their place."""


def fleet(page: Page, demo: Demo) -> None:
    open_page(page, demo, "/")
    expect(page.locator(".leaflet-container").first).to_be_visible()
    keep(page, "fleet")


def night(page: Page, demo: Demo) -> None:
    _wear(page, demo, "night-red")
    open_page(page, demo, "/")
    expect(page.locator(".leaflet-container").first).to_be_visible()
    keep(page, "night")
    _wear(page, demo, "dark")


def robot(page: Page, demo: Demo) -> None:
    open_page(page, demo, "/robot/mini-1")
    page.get_by_text("3D", exact=True).first.click()
    expect_scene(page)
    keep(page, "robot")


def surface_now(page: Page, demo: Demo) -> None:
    open_page(page, demo, "/robot/grace-1")
    keep(page, "surface-now", page.get_by_role("region", name="Robot in hand"))


def plan(page: Page, demo: Demo) -> None:
    open_page(page, demo, "/plan/mini-1")
    page.get_by_label("Planning time").fill("2")
    page.get_by_role("button", name="Plan a survey for mini-1").click()
    send = page.get_by_role("button", name=re.compile(r"^Send plan \d+ to mini-1 …$"))
    expect(send).to_be_enabled(timeout=600_000)
    page.get_by_text("From above", exact=True).first.click()
    page.get_by_role("main").evaluate("each => each.scrollTo(0, 0)")
    keep(page, "plan")
    send.click()
    summary = page.get_by_role("region", name="Summary of what will be sent")
    expect(summary.get_by_role("button", name=re.compile("^Send plan"))).to_be_enabled()
    keep(page, "send", summary)
    button = summary.get_by_role("button", name=re.compile("^Send plan"))
    button.focus()
    page.keyboard.down("Enter")
    expect(summary).to_have_count(0)
    page.keyboard.up("Enter")
    ladder = page.get_by_role("list", name="State of the plan")
    expect(ladder).to_contain_text(re.compile(r"Running\s*\d\d:\d\d:\d\dZ"), timeout=600_000)


def design(page: Page, demo: Demo) -> None:
    open_page(page, demo, "/design/grace-1")
    page.get_by_role("button", name=re.compile("^Lawnmower")).click()
    expect(page.get_by_role("heading", name="Account")).to_be_visible()
    expect(page.locator(".leaflet-container").first).to_be_visible()
    keep(page, "design")


def drive(page: Page, demo: Demo) -> None:
    open_page(page, demo, "/drive/grace-1")
    expect(page.get_by_role("button", name=re.compile("Hold to drive grace-1"))).to_be_enabled()
    page.get_by_text("From above", exact=True).click()
    keep(page, "drive")


def track(page: Page, demo: Demo) -> None:
    open_page(page, demo, "/track/grace-1")
    expect(page.get_by_role("heading", name="Why it circles")).to_be_visible()
    keep(page, "track")


def current(page: Page, demo: Demo) -> None:
    open_page(page, demo, "/map/grace-1")
    page.get_by_text("Current", exact=True).click()
    expect(page.get_by_role("region", name="Current")).to_be_visible()
    keep(page, "current")


def field_map(page: Page, demo: Demo) -> None:
    open_page(page, demo, "/map/mini-1")
    symbols = page.get_by_role("list", name="What the symbols mean")
    near = re.compile("[1-9][0-9]* samples near this slice")
    expect(symbols).to_contain_text(near, timeout=600_000)
    page.set_viewport_size({"width": 1440, "height": 925})  # both slices side by side
    keep(page, "map")
    page.set_viewport_size({"width": SIZE["width"], "height": SIZE["height"]})


def data(page: Page, demo: Demo) -> None:
    open_page(page, demo, "/data/mini-1")
    expect(page.locator(".uplot").first).to_be_visible()
    keep(page, "data")


def alarms(page: Page, demo: Demo) -> None:
    """A leak that the simulator causes, as its panel does."""
    open_page(page, demo, "/robot/mini-1")
    panel = page.get_by_role("region", name="Demo: faults of mini-1")
    panel.get_by_role("button", name="Cause: Leak").click()
    panel.get_by_role("button", name="Cause it").click()
    expect(page.get_by_role("alert").first).to_be_visible(timeout=600_000)
    open_page(page, demo, "/log#alarms")
    keep(page, "alarms")


PICTURES: tuple[Callable[[Page, Demo], None], ...] = (
    surface_now, design, drive, track, fleet, night, current, plan, robot, field_map, data,
    alarms,
)  # fmt: skip


def keep(page: Page, name: str, part: Locator | None = None) -> None:
    """Write what is seen, or a part of it, with few colours."""
    page.mouse.move(1, 1)
    page.wait_for_timeout(SETTLE_MS)
    shot = page.screenshot() if part is None else part.screenshot()
    picture = Image.open(BytesIO(shot)).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    picture.save(INTO / f"{name}.png", optimize=True)


def _wear(page: Page, demo: Demo, theme: str) -> None:
    page.evaluate(
        "theme => localStorage.setItem('grace.preference', JSON.stringify({ ...JSON.parse("
        "localStorage.getItem('grace.preference') ?? '{}'), theme }))",
        theme,
    )
    open_page(page, demo, "/")


def main() -> None:
    """Draw all pictures."""
    INTO.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory() as folder,
        Demo(Path(folder), "--speed", "4") as demo,
        chromium() as browser,
        browser_page(browser, demo) as page,
    ):
        page.set_viewport_size({"width": SIZE["width"], "height": SIZE["height"]})
        demo.client.cookies.update(
            {each["name"]: each["value"] for each in page.context.cookies()}  # type: ignore[typeddict-item]
        )
        demo.client.headers["X-CSRF-Token"] = demo.get("/api/session")["csrf_token"]
        demo.patch("/api/config/planner", LASTING, robot="mini-1")
        page.get_by_role("button", name="Not now").click()  # of the tour
        for draw in PICTURES:
            draw(page, demo)


if __name__ == "__main__":
    main()
