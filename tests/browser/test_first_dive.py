"""The first dive in a tank: a robot is added, checked, zeroed, flown, surfaced, looked back at."""

import re
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from robot_link.mavlink.codec import STATION_COMPONENT, STATION_SYSTEM, Codec
from server.base.settings import LINK_FOLDER
from simulator.fleet import MINI_1
from tests.browser.figure import Journey, told_live, wall_s, watch_channel
from tests.browser.test_checklist import THUMB_PX
from tests.browser.walk import CHROMIUM, SHOTS, press
from tests.e2e.demo import ROOT
from tests.free_port import free_port
from tests.server.cli.test_process import serve

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1500),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]
ROBOT = str(MINI_1.robot)
DEPTH_M = 0.5
WATCHED_S = 20.0
HOLD_MS = 1000.0
CLICKS_MAX = 2


class Station:
    """A station without a robot, and a robot at the end of a serial port."""

    def __init__(self, data: Path) -> None:
        desk = ("--demo-port", str(free_port()))
        self.data = data
        self._station, self.url = serve(data, "--simulation", *desk)
        assert self._station.stdout is not None
        self.code = self._station.stdout.readline().split()[-1]
        with (data / "simulator.log").open("wb") as log:
            self._robot = subprocess.Popen(
                [sys.executable, "-m", "server.cli", "simulate", "--data", str(data),
                 "--speed", "1", "--robots", ROBOT, *desk],
                cwd=ROOT, stdout=log, stderr=log,
            )  # fmt: skip
        self.port = data / LINK_FOLDER / MINI_1.link_name

    def stop(self) -> None:
        for process in (self._robot, self._station):
            process.send_signal(signal.SIGTERM)
            process.wait(60)
        if self._station.stdout is not None:
            self._station.stdout.close()


@pytest.fixture
def tank(tmp_path: Path) -> Iterator[Station]:
    station = Station(tmp_path)
    yield station
    station.stop()


@pytest.fixture
def page(browser: Browser, tank: Station) -> Iterator[Page]:
    page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
    page.context.set_default_timeout(120_000)
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(tank.url)
    page.get_by_label("Code from the terminal").fill(tank.code)
    page.get_by_label("Name", exact=True).fill("Ann")
    page.get_by_label(re.compile("New password")).fill("correct horse battery")
    page.locator("form button").last.click()
    expect(page.get_by_role("link", name="Add a robot")).to_be_visible()
    yield page
    page.context.close()
    assert faults == []


def test_a_first_dive_in_the_tank(tank: Station, page: Page):
    journey = Journey("J2")
    add_by_its_port(tank, page, journey)
    watch_channel(page, "depth_m")
    page.goto(f"{tank.url}/robot/{ROBOT}")
    expect(page.get_by_text("Idle at the surface").first).to_be_visible()
    check_it(page, journey)
    zero_the_depth(tank, page, journey)
    refuse_two_metres(tank, page, journey)
    complete_the_list(page, journey)
    dive(tank, page, journey)
    surface(tank, page, journey)
    look_back(tank, page, journey)


def ask(page: Page, method: str, path: str, body: Any = None) -> Any:
    """Ask the station as the page does; return its answer's status and JSON."""
    return page.evaluate(
        """async ([method, path, body]) => {
          const { csrf_token } = await (await fetch('/api/session')).json();
          const headers = { 'Content-Type': 'application/json', 'X-CSRF-Token': csrf_token };
          const answer = await fetch(path, {
            method, headers, body: body === null ? null : JSON.stringify(body),
          });
          const text = await answer.text();
          return { status: answer.status, body: text === '' ? null : JSON.parse(text) };
        }""",
        [method, path, body],
    )


def add_by_its_port(tank: Station, page: Page, journey: Journey) -> None:
    """1. A robot is heard at its port, or a plain reason says why not."""
    page.get_by_role("link", name="Add a robot").click()
    form = page.get_by_role("region", name="Add a robot")
    form.get_by_label("Name", exact=True).fill(ROBOT)
    vehicle = form.get_by_role("combobox", name="Vehicle")
    vehicle.select_option(label=vehicle.locator("option").filter(has_text="ini").first.inner_text())
    water = form.get_by_role("combobox", name="Water")
    water.select_option(label=water.locator("option").filter(has_text="ank").first.inner_text())
    form.get_by_label("How link 1 reaches").select_option("XBee radio")
    told = form.get_by_role("status", name="Test of link 1")

    begun_s = time.monotonic()
    form.get_by_label("Where link 1 leads").fill("/dev/ttyNobody")
    reason = told.locator(".tone-watch, .tone-alarm").first
    expect(reason).to_be_visible()
    figure = f"“{reason.inner_text()}” after {time.monotonic() - begun_s:.1f} s"
    journey.tell("1a", "a plain reason where nothing is", figure)

    while not tank.port.exists():
        page.wait_for_timeout(100)
    begun_s = time.monotonic()
    form.get_by_label("Where link 1 leads").fill(str(tank.port))
    expect(told.get_by_text(re.compile("Heard system 1"))).to_be_visible()
    figure = f"“{told.locator('p').first.inner_text()}” after {time.monotonic() - begun_s:.1f} s"
    journey.tell("1b", "an XBee seen in <= 5 s", figure)
    form.get_by_label(re.compile("Its radio is signed")).uncheck()
    page.screenshot(path=SHOTS / "first-dive-heard.png")
    form.get_by_role("button", name=f"Add {ROBOT}").click()
    expect(page.get_by_role("link", name=f"Open {ROBOT}")).to_be_visible()


def checklist(page: Page) -> Locator:
    return page.get_by_label("Checklists of", exact=False).first


def check_it(page: Page, journey: Journey) -> None:
    """2. What the robot tells by itself, and what a person ticks under their name."""
    panel = checklist(page)
    panel.get_by_role("button", name="Pre-dive, tank").first.click()
    page.get_by_role("button", name="Begin Pre-dive, tank").click()
    dry = panel.get_by_role("listitem").filter(has_text="hull is dry").last
    expect(dry).to_contain_text(re.compile("dry, .* ago"))
    found = [
        row.inner_text().replace("\n", ": ")
        for words in ("battery is charged", "hull is dry", "depth is zero", "tank's frame")
        for row in [panel.get_by_role("listitem").filter(has_text=words).last]
    ]
    journey.tell("2a", "automatic: battery, leak, depth zero, GPS absent accepted", repr(found))
    for name in ("The hull is closed", "The robot floats level", "Surface now was tried", "Nobody"):
        tick = panel.get_by_role("checkbox", name=name)
        box = tick.bounding_box()
        assert box is not None
        assert min(box["width"], box["height"]) >= THUMB_PX
        tick.click()
        expect(tick).to_be_checked()
    row = panel.get_by_role("listitem").filter(has_text="The hull is closed").last
    expect(row).to_contain_text("Ann")
    journey.tell("2b", "manual ticks, stored with name", repr(row.inner_text()))


def zero_the_depth(tank: Station, page: Page, journey: Journey) -> None:
    """3. A zero that is off is taken; a depth below 0 m blocks the dive until it is zeroed anew."""
    panel = checklist(page)
    item = panel.get_by_role("listitem").filter(has_text="depth is zero").last
    fault = f"/api/demo/faults/{ROBOT}/depth"
    assert ask(page, "PUT", fault)["status"] < 300
    expect(item).to_contain_text(re.compile(r"0\.[12]\d m"))
    panel.get_by_role("button", name="Zero the depth").click()
    expect(panel.get_by_text("what its depth sensor reads now is the surface")).to_be_visible()
    expect(item).to_contain_text(re.compile(r"-?0\.0\d m"))
    assert ask(page, "DELETE", fault)["status"] < 300
    expect(item).to_contain_text(re.compile(r"-0\.[12]\d m"))
    expect(panel.get_by_role("button", name="Complete Pre-dive, tank")).to_be_disabled()
    refused = item.inner_text().replace("\n", ": ")
    page.screenshot(path=SHOTS / "first-dive-below-zero.png")
    panel.get_by_role("button", name="Zero the depth").click()
    expect(item).to_contain_text(re.compile(r"-?0\.0\d m"))
    journey.tell(
        "3", "zero depth; a reading below 0 m refused", f"blocks: {refused!r}; zeroed anew"
    )


def refuse_two_metres(tank: Station, page: Page, journey: Journey) -> None:
    """4. The tank's box is the limit; a plan to 2 m is refused in words."""
    legs = [{"kind": "dive", "end_ned": [1.0, 0.5, depth]} for depth in (2.0, 0.0)]
    answer = ask(page, "POST", f"/api/robots/{ROBOT}/plans", {"kind": "primitives", "legs": legs})
    said = str(answer["body"])
    if answer["status"] == 202:
        plan = answer["body"]["id"]
        wait_for_plan(page, plan, "draft")
        said = str(ask(page, "GET", f"/api/plans/{plan}")["body"])
    found = re.search(r"[^'\"]*tank floor 1\.2 m[^'\"]*", said)
    assert found is not None, said
    journey.tell("4", "a plan to 2 m refused: “tank floor 1.2 m”", f"by REST: {found[0]!r}")

    page.goto(f"{tank.url}/plan/{ROBOT}")
    deepest = page.get_by_label("Deepest").first
    deepest.wait_for(state="attached")
    page.evaluate("document.querySelectorAll('details').forEach(fold => { fold.open = true; })")
    deepest.fill("2")
    page.get_by_role("button", name=f"Plan a survey for {ROBOT}").click()
    words = page.get_by_text(re.compile("tank floor 1.2 m")).first
    expect(words).to_be_visible()
    page.screenshot(path=SHOTS / "first-dive-floor.png")
    journey.tell("4", "the same in the page", repr(words.inner_text()))


def complete_the_list(page: Page, journey: Journey) -> None:
    page.goto(page.url.split("/plan/")[0] + f"/robot/{ROBOT}")
    panel = checklist(page)
    panel.get_by_role("button", name="Pre-dive, tank").first.click()
    complete = panel.get_by_role("button", name="Complete Pre-dive, tank")
    expect(complete).to_be_enabled()
    complete.click()
    expect(panel.get_by_text("completed it").first).to_be_visible()
    told = panel.get_by_text("completed it").first.inner_text()
    journey.tell("2c", "checklist completed by name", repr(told))


def wait_for_plan(page: Page, plan: str, state: str) -> None:
    while ask(page, "GET", f"/api/plans/{plan}")["body"]["state"] != state:
        page.wait_for_timeout(250)


def dive(tank: Station, page: Page, journey: Journey) -> None:
    """5. A dive that is seen live: how often a depth comes, and how old it is in the page."""
    north, east, _ = ask(page, "GET", f"/api/robots/{ROBOT}/state")["body"]["position"]["ned_m"]
    legs = [{"kind": "dive", "end_ned": [north, east, d]} for d in (DEPTH_M, 0.0) * 6]
    config = {"total_budget": 80.0, "round_budget": 80.0, "mission": {"draft_distance_m": 1.0}}
    body = {"kind": "primitives", "legs": legs, "config": config}
    plan = ask(page, "POST", f"/api/robots/{ROBOT}/plans", body)["body"]["id"]
    wait_for_plan(page, plan, "draft")
    sent = ask(page, "POST", f"/api/plans/{plan}/upload", {"start": True})
    assert sent["status"] < 300, sent
    wait_for_plan(page, plan, "running")
    page.evaluate("window.told = []")
    page.wait_for_timeout(1e3 * WATCHED_S)
    told = [one for one in told_live(page) if one["robot"] == ROBOT]
    values = {one["measured_at"]: one for one in reversed(told)}
    late_ms = sorted(
        one["at_ms"] - 1e3 * wall_s(tank.data, one["measured_at"]) for one in values.values()
    )
    p95 = late_ms[int(0.95 * len(late_ms))]
    deepest = max(one["value"] for one in told)
    figure = f"{len(values) / WATCHED_S:.1f} Hz, p95 {p95:.0f} ms, to {deepest:.2f} m"
    journey.tell("5", "live at >= 5 Hz, end to end <= 500 ms p95", figure)
    page.screenshot(path=SHOTS / "first-dive-live.png")


def orders_after(tank: Station, since: datetime) -> list[tuple[datetime, list[str]]]:
    """Return what left for the robot since a moment, frame by frame, and what it says."""
    codec = Codec(STATION_SYSTEM, STATION_COMPONENT)
    query = "select at, data from raw_frame where outgoing and at >= ? order by at"
    with closing(sqlite3.connect(f"file:{tank.data}/station.sqlite3?mode=ro", uri=True)) as db:
        rows = db.execute(query, (int(since.timestamp() * 1e6),)).fetchall()
    return [
        (
            datetime.fromtimestamp(at / 1e6, since.tzinfo),
            [one.get_type() for one in codec.unpack(data).messages],
        )
        for at, data in rows
    ]


def surface(tank: Station, page: Page, journey: Journey) -> None:
    """6. Hold: the order leaves the port, and the robot's reply is shown."""
    button = page.get_by_role("button", name=re.compile(f"Surface {ROBOT} now"))
    button.evaluate(
        "each => each.addEventListener('pointerdown', () => { window.pressed = Date.now(); })"
    )
    press(page, button)
    page.wait_for_timeout(HOLD_MS + 300.0)
    page.mouse.up()
    reply = page.get_by_text(re.compile(f"{ROBOT} (obeys|is up, as ordered)")).first
    expect(reply).to_be_visible()
    said = reply.inner_text()
    held_s = (page.evaluate("window.pressed") + HOLD_MS) / 1e3
    ordered = [
        at.timestamp()
        for at, types in orders_after(tank, datetime.fromtimestamp(held_s).astimezone())
        if any(one.startswith("COMMAND") for one in types)
    ]
    figure = f"{1e3 * (ordered[0] - held_s):.0f} ms after the hold; reply: {said!r}"
    journey.tell("6", "ABORT leaves the port <= 200 ms, reply shown", figure)
    page.screenshot(path=SHOTS / "first-dive-surfaced.png")


def look_back(tank: Station, page: Page, journey: Journey) -> None:
    """7. A plot, a file within two clicks, and the robot as it was in the dive."""
    clicks = 0
    page.get_by_role("navigation", name="Pages").get_by_role("link", name="Data").click()
    clicks += 1
    expect(page.locator(".uplot, canvas").first).to_be_visible()
    page.screenshot(path=SHOTS / "first-dive-plot.png")
    with page.expect_download() as saved:
        page.get_by_role("link", name="CSV").first.click()
        clicks += 1
    lines = saved.value.path().read_text().splitlines()
    assert clicks <= CLICKS_MAX
    assert len(lines) > 10
    journey.tell(
        "7a", "plot and CSV in <= 2 clicks", f"{clicks} clicks, {len(lines)} lines: {lines[0]!r}"
    )
    page.goto(f"{tank.url}/log#book")
    page.get_by_label("folded").uncheck()
    began = page.locator("p").filter(has_text=f"{ROBOT} began a dive").first
    began.get_by_role("link", name="then", exact=True).click()
    bar = page.get_by_role("region", name="Replay", exact=True)
    expect(bar.get_by_text(re.compile("^REPLAY 20.*, not live$"))).to_be_visible()
    told = bar.get_by_text(re.compile("^REPLAY")).inner_text()
    page.screenshot(path=SHOTS / "first-dive-replay.png")
    journey.tell("7b", "replay", f"the log's dive opens its robot: {told!r}")
