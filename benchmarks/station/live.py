"""From what the station knows to what a person sees, and how soon a station is there at all.

A real demo in real time, a real browser on a robot's page. A level of an order is seen late by the
time between the moment at which the link proved it, as the station writes it down with the level,
and the moment at which the page's document shows it: the transaction, the live stream and the
drawing of the page are all in it. Station and browser read the same clock of the machine.

The 3D view is drawn in the thread of the page around it. Where the machine draws without a graphics
card, each of its pictures holds up the page for up to a second, which says nothing of the station;
so the bar is held against the page as it is with the map in its place.
"""

import re
import statistics
import tempfile
import time
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Page, ViewportSize, expect

from benchmarks.calibration import PYTHON, calibrated, scaled_row
from tests.browser.walk import CHROMIUM, browser_page, chromium, hold, open_page
from tests.e2e.demo import Demo
from tests.server.cli.test_process import health, serve

ROBOT = "mini-1"
ORDERS = 30
LATE_BAR_MS = 100.0
WIDE: ViewportSize = {"width": 1600, "height": 950}
NARROW: ViewportSize = {"width": 500, "height": 950}
STARTS = 5
READY_BAR_S = 5.0
"""Where the Python loop takes what ``calibration`` says of the reference machine."""
STEPS = {"queued": "Queued", "radio": "Delivered", "applied": "Done"}
"""Levels of an order, and what the page calls them."""
OBSERVE = """
() => {
  window.seen = {};
  new MutationObserver(() => {
    const list = document.querySelector('[aria-label="Progress of the order"]');
    for (const step of list?.querySelectorAll('.proved .title') ?? []) {
      window.seen[step.textContent] ??= Date.now();
    }
  }).observe(document.body, { subtree: true, childList: true, attributes: true });
}
"""


def measure() -> list[dict[str, Any]]:
    """Give orders in a page and note when it shows their levels; then start the station again."""
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder)
        with Demo(data, "--robots", ROBOT) as demo:
            rows += _seen(demo) if CHROMIUM else [_row("Level of an order seen in the page", None)]
        with calibrated(PYTHON) as begun:
            ready_s = [_ready_s(data) for _ in range(STARTS)]
    for word, value in (("least", min(ready_s)), ("median", statistics.median(ready_s))):
        name = f"Station with data to its health, {word} of {STARTS}"
        rows.append(scaled_row("live", name, value, "s", READY_BAR_S, begun, by="wall"))
    return rows


def _seen(demo: Demo) -> list[dict[str, Any]]:
    """Return the rows of a page beside the map; beside the 3D view, the same without a bar."""
    name = "Level of an order, proved to seen in the page"
    with chromium() as browser, browser_page(browser, demo) as page:
        with calibrated(PYTHON) as seen:
            late_ms = _late_ms(page, demo, NARROW)
        shares = [(percent, float(np.percentile(late_ms, percent))) for percent in (50, 95)]
        drawn_ms = float(np.percentile(_late_ms(page, demo, WIDE), 95))
    return [
        scaled_row("live", f"{name}, p{percent}", value, "ms", LATE_BAR_MS, seen, by="wall")
        for percent, value in shares
    ] + [_row(f"{name}, p95 beside a 3D view drawn without a graphics card", drawn_ms)]


def _late_ms(page: Page, demo: Demo, size: ViewportSize) -> list[float]:
    """Return how long after its proof each level of each order was seen, ms.

    Args:
        page: Signed in.
        demo: Where its robot is.
        size: Of the window while the page opens; one that is narrow begins with the map.
    """
    page.set_viewport_size(size)
    open_page(page, demo, f"/robot/{ROBOT}")
    page.set_viewport_size(WIDE)
    page.wait_for_load_state("networkidle")
    page.evaluate(OBSERVE)
    return [late_ms for _ in range(ORDERS) for late_ms in _of_one_order(page, demo)]


def _of_one_order(page: Page, demo: Demo) -> list[float]:
    page.evaluate("seen = {}")
    hold(page, re.compile(f"Surface {ROBOT} now"))
    ladder = page.get_by_role("list", name="Progress of the order").first
    expect(ladder).to_contain_text(re.compile(r"Done\s*\d\d:\d\d:\d\dZ"))
    seen = page.evaluate("seen")
    page.get_by_role("button", name="Put this away").click()
    answer = page.request.get(f"{demo.url}/api/robots/{ROBOT}/commands?limit=1")
    [order] = answer.json()
    return [
        seen[STEPS[level["level"]]] - 1e3 * datetime.fromisoformat(level["at"]).timestamp()
        for level in order["levels"]
    ]


def _ready_s(data: Path) -> float:
    """Return how long a station on a data folder takes from its command to its word, s."""
    began_s = time.monotonic()
    process, url = serve(data)
    with process:
        while not health(url)["ready"]:
            time.sleep(0.01)
        taken_s = time.monotonic() - began_s
        process.terminate()
    return taken_s


def _row(name: str, value: float | None) -> dict[str, Any]:
    unit = "ms; no chromium" if value is None else "ms"
    return {"area": "live", "name": name, "value": value, "unit": unit, "bar": None, "met": None}
