"""A night of three people at three browsers: everything that a watch is for, in one story.

Ann has the watch, ben relieves her, a scientist looks by a public link. A script runs wild, two
want one robot, the watch is handed over, water gets into a hull, and nobody acknowledges.
"""

import json
import os
import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.crew import act, charge, name_of, open_sheet, second_pilot, sheet
from tests.browser.figure import Journey
from tests.browser.test_look import SIZES
from tests.browser.test_look_everywhere import THEMES
from tests.browser.test_night import Hook
from tests.browser.walk import CHROMIUM, SHOTS, browser_page, hold, open_page
from tests.e2e.demo import Demo
from tests.free_port import free_port

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(2400),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]
SPEED = 10
NAMES = ("wide", "tablet", "phone")
HELD = 423


@pytest.fixture
def hook() -> Iterator[Hook]:
    hook = Hook()
    yield hook
    hook.shutdown()
    hook.server_close()


@pytest.fixture
def night(tmp_path: Path) -> Iterator[Demo]:
    port = free_port()
    origins = json.dumps([f"http://127.0.0.1:{port}"])
    options = ("--robots", "mini-1", "--port", str(port), "--speed", str(SPEED))
    environment = {**os.environ, "GRACE_PUBLIC_ORIGINS": origins}
    with Demo(tmp_path, *options, environment=environment) as demo:
        yield demo


class WildScript(threading.Thread):
    """Orders a robot about as fast as the station answers."""

    def __init__(self, url: str, token: str) -> None:
        super().__init__(daemon=True)
        self._url, self._token = url, token
        self.answers: list[tuple[float, int, str]] = []
        """When, s since 1970, each order was sent, its status, and what was said."""
        self.is_over = threading.Event()

    def run(self) -> None:
        headers = {"Authorization": f"Bearer {self._token}"}
        with httpx.Client(base_url=self._url, headers=headers, timeout=60.0) as client:
            while not self.is_over.wait(0.05):
                sent_s = time.time()
                answer = client.post("/api/robots/mini-1/commands", json={"kind": "resume"})
                self.answers.append((sent_s, answer.status_code, answer.text))

    def statuses(self) -> set[int]:
        return {status for _, status, _ in self.answers}


class Gallery:
    """Pictures of moments in three themes and sizes, for people to look at."""

    def take(self, page: Page, name: str) -> None:
        theme_was = page.evaluate("document.documentElement.dataset.theme")
        size_was = page.viewport_size
        for (width, height), size in zip(SIZES, NAMES, strict=True):
            page.set_viewport_size({"width": width, "height": height})
            for theme in THEMES:
                page.evaluate("theme => (document.documentElement.dataset.theme = theme)", theme)
                page.screenshot(path=SHOTS / f"watch-{name}-{size}-{theme}.png", timeout=240_000)
        page.evaluate("theme => (document.documentElement.dataset.theme = theme)", theme_was)
        assert size_was is not None
        page.set_viewport_size(size_was)


@contextmanager
def scientist(browser: Browser, address: str) -> Iterator[Page]:
    """Let somebody who has the address alone open it."""
    page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
    page.context.set_default_timeout(120_000)
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(address)
    expect(page.get_by_text("read-only link")).to_be_visible()
    yield page
    page.context.close()
    assert faults == []


def test_a_night_of_three_people(browser: Browser, night: Demo, hook: Hook):
    journey, gallery = Journey("night"), Gallery()
    with browser_page(browser, night) as ann:
        me = name_of(ann)
        with second_pilot(browser, night, ann) as ben:
            prepare(ann, night, hook, me)
            address = make_link(ann, night)
            with scientist(browser, address) as guest:
                look_only(guest, night, journey, gallery)
                take_the_watch(ann, night)
                stop_the_script(ann, ben, night, journey, gallery)
                want_one_robot(ann, ben, journey, gallery, me)
                relieve(ann, ben, night, journey, gallery, me)
                leak(ann, ben, guest, night, hook, journey, gallery, me)


def prepare(ann: Page, night: Demo, hook: Hook, me: str) -> None:
    """Ben is told first, ann a minute later; the station has a minute of its clock for it."""
    for one in ann.context.cookies():
        night.client.cookies.set(one.get("name", ""), one.get("value", ""))
    night.client.headers["X-CSRF-Token"] = night.get("/api/session")["csrf_token"]
    for person in (me, "ben"):
        contact = {"title": "phone", "form": "webhook", "address": hook.url(person)}
        night.post(f"/api/notices/people/{person}/contacts", contact)
    quiet = {"alarms": dict.fromkeys(("alarm", "contact", "battery", "station"), "none")}
    night.client.put(f"/api/notices/people/{me}", json=quiet).raise_for_status()
    steps = {"steps": [{"people": [me], "after_minutes": 1}], "escalate_from": "critical"}
    night.client.put("/api/notices/station", json=steps).raise_for_status()


def make_link(ann: Page, night: Demo) -> str:
    """Make a public link to one robot, by the form that an administrator has."""
    open_page(ann, night, "/settings")
    panel = ann.get_by_role("region", name="Read-only links", exact=True)
    panel.get_by_label("What it is for").fill("Oxygen group")
    panel.get_by_label("mini-1").check()
    panel.get_by_role("button", name="Make a read-only link").click()
    return panel.locator("code").inner_text()


def look_only(guest: Page, night: Demo, journey: Journey, gallery: Gallery) -> None:
    """The scientist sees the robot, and whatever is asked of the station by hand is refused."""
    surface = guest.get_by_role("button", name=re.compile("Surface mini-1 now"))
    seen = 0
    for path in ("/robot/mini-1", "/map/mini-1", "/plan/mini-1", "/log#alarms", "/"):
        open_page(guest, night, path)
        expect(surface).to_be_disabled()
        expect(guest.get_by_role("button", name=re.compile("^Take charge"))).to_have_count(0)
        seen += 1
    gallery.take(guest, "guest")
    csrf = guest.evaluate("fetch('/api/session').then(a => a.json()).then(a => a.csrf_token)")
    refused = [
        guest.request.fetch(
            f"{night.url}{path}", method=method, data=body, headers={"X-CSRF-Token": csrf or ""}
        ).status
        for method, path, body in (
            ("POST", "/api/robots/mini-1/commands", {"kind": "surface"}),
            ("POST", "/api/robots/mini-1/plans", {"kind": "primitives", "legs": []}),
            ("PATCH", "/api/config/planner?robot=mini-1", {}),
            ("PUT", "/api/demo/faults/mini-1/leak", {}),
            ("POST", "/api/tokens", {"name": "x", "role": "admin", "days": 1}),
            ("GET", "/api/people", None),
        )
    ]
    assert set(refused) <= {401, 403}
    figure = f"{seen} pages without a button that acts; {len(refused)} requests by hand: {refused}"
    journey.tell("link", "a public read-only link can do nothing but look", figure)


def take_the_watch(ann: Page, night: Demo) -> None:
    open_page(ann, night, "/log#handover")
    ann.get_by_role("button", name="Begin my watch").click()
    expect(ann.get_by_role("button", name="End my watch without a page")).to_be_visible()
    act(ann, "Take charge of mini-1")
    expect(charge(ann, "You are in charge")).to_be_visible()


def stop_the_script(ann: Page, ben: Page, night: Demo, journey: Journey, gallery: Gallery) -> None:
    """A script is let act, runs wild, and *Hold automation* stops it for good."""
    token = night.post("/api/tokens", {"name": "follow-front", "role": "pilot", "days": 1})["token"]
    script = WildScript(night.url, token)
    script.start()
    night.wait("a refusal", lambda: 409 in script.statuses(), 30.0)
    open_sheet(ann)
    expect(sheet(ann).get_by_text("The script follow-front was refused.")).to_be_visible()
    act(ann, "Let follow-front act")
    night.wait("orders of the script", lambda: 202 in script.statuses(), 30.0)
    act(ann, "Hold automation of the station")
    held_s = time.time()
    for page in (ann, ben):
        expect(page.get_by_text("Automation is held")).to_be_visible()
    night.wait("it is held", lambda: HELD in script.statuses(), 30.0)
    seen = len(script.answers)
    night.wait("more tries", lambda: len(script.answers) > seen + 20, 60.0)
    script.is_over.set()
    script.join(60.0)
    first_s = next(at for at, status, _ in script.answers if status == HELD)
    after = [status for at, status, _ in script.answers if at > first_s]
    assert set(after) == {HELD}
    said = json.loads(script.answers[-1][2])["detail"]
    obeyed = sum(status == 202 for _, status, _ in script.answers)
    gallery.take(ben, "held")
    figure = (
        f"{obeyed} orders taken; refused {max(0.0, first_s - held_s):.2f} s after the click, then"
        f" {len(after)} of {len(after)}: “{said}”"
    )
    journey.tell("script", "a script that runs wild is stopped", figure)


def want_one_robot(ann: Page, ben: Page, journey: Journey, gallery: Gallery, me: str) -> None:
    """Ben wants the robot that ann has: he asks, she refuses, and both see the same."""
    ben.get_by_role("link", name="Plan", exact=True).click()
    expect(ben.get_by_text(f"{me} is in charge of mini-1; request it from them first.").first
           ).to_be_visible()  # fmt: skip
    begun_s = time.monotonic()
    ben.get_by_role("button", name="Request mini-1").click()
    asked = ann.get_by_role("alert").filter(has_text="ben requests mini-1")
    expect(asked).to_be_visible()
    seen_s = time.monotonic() - begun_s
    gallery.take(ann, "asked")
    asked.get_by_role("button", name="Refuse").click()
    expect(asked).to_have_count(0)
    expect(charge(ben, f"{me} is in charge")).to_be_visible()
    journey.tell("conflict", "a conflict over one robot", f"seen by both within {seen_s:.1f} s")


def relieve(ann: Page, ben: Page, night: Demo, journey: Journey, gallery: Gallery, me: str) -> None:
    """Ann signs the page of her watch and leaves; ben reads it, signs it and has the robot."""
    act(ann, "Hand over …")
    sheet(ann).get_by_label("To whom").fill("ben")
    sheet(ann).get_by_label("What they should know").fill("Its script is held")
    act(ann, "Hand mini-1 over")
    for page, words in ((ben, "You are in charge"), (ann, "ben is in charge")):
        expect(charge(page, words)).to_be_visible()
    open_page(ann, night, "/log#handover")
    ann.get_by_label("Wind, m/s").fill("4")
    ann.get_by_role("textbox", name="Remarks").fill("Calm night. **follow-front** is held.")
    gallery.take(ann, "handover")
    hold(ann, re.compile(r"^Sign \d+ entr(y|ies) and leave"))
    open_page(ben, night, "/log#handover")
    ben.get_by_role("button", name=re.compile("^Read page")).click()
    gallery.take(ben, "page")
    ben.get_by_role("button", name=re.compile(f"and take over from {me}")).click()
    pages = ben.get_by_role("region", name="Signed pages")
    expect(pages.get_by_text("taken over by ben")).to_be_visible()
    journey.tell(
        "change", "a hand-over at the change of shift", "signed by both, robot handed over"
    )


def leak(
    ann: Page,
    ben: Page,
    guest: Page,
    night: Demo,
    hook: Hook,
    journey: Journey,
    gallery: Gallery,
    me: str,
) -> None:
    """Water in the hull: ben is told and does nothing, ann is woken, acknowledges, surfaces."""
    open_page(guest, night, "/")
    night.client.put("/api/demo/faults/mini-1/leak").raise_for_status()
    caused_s = time.time()
    night.wait("ben is told", lambda: hook.told("ben", "Leak"), 60.0)
    for page in (ann, ben, guest):
        expect(page.get_by_role("alert").filter(has_text="Leak").first).to_be_visible()
    expect(guest.get_by_role("button", name="Acknowledge")).to_have_count(0)
    night.wait("ann is woken", lambda: hook.told(me, "Leak"), 60.0)
    told_s = [
        next(
            at for at, where, body in hook.taken if where == f"/{who}" and "Leak" in body["message"]
        )
        - caused_s
        for who in ("ben", me)
    ]
    figure = f"ben after {told_s[0]:.1f} s, {me} after {told_s[1]:.1f} s of the wall at {SPEED}x"
    journey.tell("leak", "told, and escalated after 1 min of the station", figure)
    open_page(ben, night, "/")
    gallery.take(ben, "leak-fleet")
    open_page(ann, night, "/log#alarms")
    gallery.take(ann, "leak-alarms")
    row = ann.get_by_role("listitem").filter(has_text="Leak says")
    row.get_by_role("button", name=re.compile("^More about")).first.click()
    ann.get_by_label("Note").fill("Brought up, boat is out")
    ann.get_by_role("button", name="Acknowledge with note").click()
    expect(row.get_by_text(f"acknowledged by {me}").first).to_be_visible()
    hold(ann, re.compile("Surface mini-1 now"))
    expect(ann.get_by_text("mini-1 is up, as ordered.").first).to_be_visible()
    expect(charge(ben, "You are in charge")).to_be_visible()
    alarm = next(one for one in night.get("/api/alarms")["alarms"] if "Leak says" in one["text"])
    assert (alarm["state"], alarm["acknowledged_by"]) == ("acknowledged", me)
    told = f"by {me}: “{alarm['note']}”; surfaced by {me} while ben is in charge"
    journey.tell("end", "acknowledged by name with a note; anyone may surface it", told)
