"""How soon all panes of a page show the moment, after a replay of a long deployment jumps.

A real station process on a prepared database and a real browser over loopback. A jump is the
slider's; it is over when every pane says that it shows that very moment, and the browser has drawn
it. The 3D view itself is another frame, which says so by its own mark.
"""

import random
import tempfile
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

import numpy as np
from playwright.sync_api import Page, expect
from sqlalchemy.orm import Session

from benchmarks.calibration import PYTHON, calibrated, scaled_row
from benchmarks.station.replay import ROWS, SEED, SEEK_BAR_MS, prepared
from benchmarks.station.station_process import served
from db.store import Store
from server.access.register import add_person, create_sign_in_link
from server.access.role import Role
from server.base.settings import Settings
from tests.browser.walk import CHROMIUM, chromium
from tests.db.conftest import START

SEEKS: Final = 60
_WARMING: Final = 3
PAGES: Final = {"Robot": "/robot/mini-1", "Data": "/data/mini-1"}
SPEED: Final = 100
_PLAYED_S: Final = 20.0
_LIMIT_MS: Final = 30_000
_SETTLE_MS: Final = 5_000
"""After which every pane of a page that was just opened has said what it shows."""
SEEK = """([at, limit, count]) => new Promise((done, fail) => {
  const slider = document.querySelector('.replay input[type=range]');
  const begun = performance.now();
  slider.value = at;
  slider.dispatchEvent(new Event('input', { bubbles: true }));
  const panes = () => [...document.querySelectorAll('[data-moment]')];
  const shows = pane => Math.abs(momentOf(pane) - slider.valueAsNumber) < 1;
  const momentOf = ({ dataset: { moment } }) =>
    /^[0-9.]+$/.test(moment) ? +moment : Date.parse(moment);
  const look = () => {
    const all = panes();
    if (all.length === count && all.every(shows)) {
      requestAnimationFrame(() => setTimeout(() => done(performance.now() - begun)));
    } else if (performance.now() - begun > limit) {
      fail(new Error(all.map(pane => `${pane.ariaLabel}: ${pane.dataset.moment}`).join('; ')));
    } else requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
})"""
PLAY = """([played_ms]) => new Promise(done => {
  const band = document.querySelector('.replay');
  const chart = document.querySelector('[aria-label="History of channels"]');
  const begun = performance.now(), from = +band.dataset.at;
  let frames = 0, empty = 0;
  const look = () => {
    frames += 1;
    if (chart.dataset.moment === undefined) empty += 1;
    if (performance.now() - begun < played_ms) requestAnimationFrame(look);
    else done({ frames, empty, speed: (+band.dataset.at - from) / (performance.now() - begun) });
  };
  requestAnimationFrame(look);
})"""


def measure() -> list[dict[str, Any]]:
    """Jump about on two pages, then play."""
    if CHROMIUM is None:
        none = {"value": None, "unit": "ms; no chromium", "bar": SEEK_BAR_MS, "met": None}
        return [{"area": "replay_page", "name": "Seek in the page"} | none]
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        token, end = prepared(folder, ROWS)
        link = _sign_in_link(folder)
        span_s = (end - START).total_seconds()
        draw = random.Random(SEED)
        with served(folder, token) as station, chromium() as browser:
            page = browser.new_page(viewport={"width": 1600, "height": 950})
            page.set_default_timeout(120_000)
            page.goto(f"http://{station.url}/sign-in?token={link}")
            expect(page.get_by_role("link", name="Data", exact=True).first).to_be_visible()
            for title, path in PAGES.items():
                with calibrated(PYTHON) as begun:
                    _open(page, f"http://{station.url}{path}")
                    took_ms, panes = _sought(page, draw, span_s)
                what = f"{title} page with {panes} panes: a seek in {ROWS:,} rows, p95"
                p95_ms = float(np.percentile(took_ms, 95))
                rows.append(
                    scaled_row("replay_page", what, p95_ms, "ms", SEEK_BAR_MS, begun, by="wall")
                )
            rows += _played(page)
    return rows


def _sign_in_link(folder: Path) -> str:
    """Return a one-time sign-in of a person who sees all."""
    at = datetime.now(UTC)

    def add(session: Session) -> str:
        add_person(session, "ann", Role.VIEWER, None, at=at, by="bench")
        return create_sign_in_link(session, "ann", timedelta(hours=1), at=at, by="bench").secret

    with closing(Store.open(Settings(data_dir=folder).resolved_database_url)) as store:
        return store.change(add).result()


def _open(page: Page, address: str) -> None:
    """Open a page in the middle of the deployment; on Data, with two charts around the moment."""
    page.goto(f"{address}?at={START.replace(hour=23):%Y-%m-%dT%H:%M:%SZ}")
    band = page.get_by_role("region", name="Replay")
    expect(band).to_contain_text("not live")
    expect(band.get_by_role("slider", name="Moment")).to_be_visible()
    page.wait_for_function(
        "() => [...document.querySelectorAll('[data-moment]')].some(one => one.dataset.moment)"
    )
    page.wait_for_timeout(_SETTLE_MS)


def _sought(page: Page, draw: random.Random, span_s: float) -> tuple[list[float], int]:
    """Return how long each jump took, ms, and how many panes there are."""
    took: list[float] = []
    panes = page.locator("[data-moment]").count()
    for number in range(_WARMING + SEEKS):
        at_ms = round((START.timestamp() + draw.uniform(0.02, 0.98) * span_s) * 10) * 100
        one_ms = page.evaluate(SEEK, [at_ms, _LIMIT_MS, panes])
        if number >= _WARMING:
            took.append(one_ms)
    return took, panes


def _played(page: Page) -> list[dict[str, Any]]:
    """Play the open page; return in which part of the frames its charts lacked a sample."""
    band = page.get_by_role("region", name="Replay")
    band.get_by_label("Speed").select_option(str(SPEED))
    band.get_by_role("button", name="Play").click()
    found = page.evaluate(PLAY, [_PLAYED_S * 1e3])
    what = f"Data page played at {SPEED}x for {_PLAYED_S:g} s"
    row = {"area": "replay_page", "bar": None, "met": None}
    lacking = {"value": found["empty"], "unit": "frames", "bar": 0, "met": found["empty"] == 0}
    return [
        row | {"name": f"{what}: its charts lack a sample in"} | lacking,
        row | {"name": f"{what}: frames", "value": found["frames"], "unit": "frames"},
        row | {"name": f"{what}: reached", "value": found["speed"], "unit": "x"},
    ]
