"""How long the page of a design is busy with one move of a pointer that drags a waypoint.

A real demo, a real browser, a design of 500 waypoints. What a move costs is the processor's time of
the page's own thread from one picture to the next: handlers, effects, style, layout, painting. With
it the page could show so many pictures a second. Beside it stands how long after a move the way,
the table and the account of the page have it, by the clock, which other programs lengthen.
"""

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import CDPSession, Page, expect

from benchmarks.calibration import PYTHON, NotMeasuredError, calibrated, scaled_row
from tests.browser.walk import CHROMIUM, browser_page, chromium, open_page
from tests.e2e.demo import Demo

ROBOT = "grace-1"
WAYPOINTS = 500
MOVES = 200
CHANGE_BAR_MS = 16.0
NAME = f"Change of a design of {WAYPOINTS} waypoints in the page"
DRAG = """async ([moves, x, y]) => {
  const map = document.querySelector('.leaflet-container');
  const account = document.querySelector('[aria-label="Account of the design"]');
  const told = [], taken = [];
  const flushed = () => new Promise(go => {
    const { port1, port2 } = new MessageChannel();
    port1.onmessage = go;
    port2.postMessage(0);
  });
  for (let i = 0; i < moves; i++) {
    const at = { clientX: x + 30 * Math.sin(i / 9), clientY: y + 30 * Math.cos(i / 9) };
    const move = new PointerEvent('pointermove', { ...at, pointerId: 1, bubbles: true });
    const begun = performance.now();
    map.dispatchEvent(move);
    await flushed();
    void document.body.offsetHeight;
    taken.push(performance.now() - begun);
    told.push(account.innerText);
    await new Promise(requestAnimationFrame);
  }
  return { taken, told: new Set(told).size };
}"""


def measure() -> list[dict[str, Any]]:
    """Drag one of many waypoints and time each move."""
    if CHROMIUM is None:
        none = {"value": None, "unit": "ms; no chromium", "bar": CHANGE_BAR_MS, "met": None}
        return [{"area": "design_page", "name": NAME} | none]
    with (
        tempfile.TemporaryDirectory() as folder,
        Demo(Path(folder), "--robots", ROBOT) as demo,
        chromium() as browser,
        browser_page(browser, demo) as page,
        calibrated(PYTHON) as begun,
    ):
        busy_ms, taken_ms = _dragged(page, demo)
    row = {"area": "design_page", "unit": "ms", "bar": None, "met": None}
    return [
        scaled_row("design_page", NAME, busy_ms, "ms", CHANGE_BAR_MS, begun, by="median"),
        *(
            row | {"name": f"{NAME}, seen after, p{share}",
                   "value": float(np.percentile(taken_ms, share))}
            for share in (50, 95)
        ),
    ]  # fmt: skip


def _dragged(page: Page, demo: Demo) -> tuple[float, list[float]]:
    """Return the processor's time of one move, and how long after each move it was seen, ms."""
    page.set_viewport_size({"width": 1440, "height": 900})
    open_page(page, demo, f"/design/{ROBOT}")
    made = page.evaluate(
        """async ([robot, document]) => {
          const session = await (await fetch('/api/session')).json();
          const answer = await fetch(`/api/robots/${robot}/designs`, {
            method: 'POST',
            headers: { 'Content-Type': 'application/json', 'X-CSRF-Token': session.csrf_token },
            body: JSON.stringify({ name: 'Many', document }),
          });
          return (await answer.json()).id;
        }""",
        [ROBOT, {"content": {"kind": "waypoints", "waypoints": _spiral()}}],
    )
    open_page(page, demo, f"/design/{ROBOT}#{made}")
    expect(page.locator(".map-spot")).to_have_count(WAYPOINTS)
    spot = page.locator(".map-spot").nth(WAYPOINTS - 1).bounding_box()
    if spot is None:
        raise NotMeasuredError("the last waypoint is not drawn")
    x, y = spot["x"] + spot["width"] / 2.0, spot["y"] + spot["height"] / 2.0
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 20.0, y, steps=4)
    inside = page.context.new_cdp_session(page)
    inside.send("Performance.enable", {"timeDomain": "threadTicks"})
    before_s = _busy_s(inside)
    found = page.evaluate(DRAG, [MOVES, x, y])
    busy_ms = 1e3 * (_busy_s(inside) - before_s) / MOVES
    page.mouse.up()
    if found["told"] < MOVES // 4:
        raise NotMeasuredError(f"the account changed {found['told']} times in {MOVES} moves")
    return busy_ms, found["taken"]


def _busy_s(inside: CDPSession) -> float:
    metrics = inside.send("Performance.getMetrics")["metrics"]
    [busy_s] = [one["value"] for one in metrics if one["name"] == "TaskDuration"]
    return busy_s


def _spiral() -> list[dict[str, float]]:
    """Return waypoints on a spiral about the middle of the lake, farther out each."""
    turns = [0.2 * number for number in range(WAYPOINTS)]
    return [
        {
            "north_m": 250.0 + (20.0 + 1.1 * turn) * math.cos(turn),
            "east_m": 250.0 + (20.0 + 1.1 * turn) * math.sin(turn),
        }
        for turn in turns
    ]
