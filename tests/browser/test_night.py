"""A leak at night: it sounds, tells by webhook, escalates, and is acknowledged from a phone."""

import json
import os
import re
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.figure import Journey, told_live, wall_s, watch_channel
from tests.browser.walk import CHROMIUM, SHOTS, browser_page, expect_done, hold, open_page
from tests.e2e.demo import Demo, Json
from tests.free_port import free_port

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]
SPEED = 5
"""Ten minutes without an acknowledgement are two of the wall, and outlast a restart."""
ESCALATES_S = 600.0 / SPEED


class Hook(HTTPServer):
    """A webhook that keeps what it is told: when, at which path, and what."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.taken: list[tuple[float, str, dict[str, Any]]] = []
        threading.Thread(target=self.serve_forever, daemon=True).start()

    def url(self, path: str) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/{path}"

    def told(self, path: str, words: str) -> str | None:
        """Return the first message at a path that holds these words."""
        messages = [body["message"] for _, where, body in self.taken if where == f"/{path}"]
        return next((text for text in messages if words in text), None)


class _Handler(BaseHTTPRequestHandler):
    server: Hook

    def do_POST(self) -> None:
        body = json.loads(self.rfile.read(int(self.headers["content-length"])))
        self.server.taken.append((time.time(), self.path, body))
        self.send_response(200)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


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


def touch(page: Page) -> None:
    """Click slowly: the notice that the page is silent goes, and the click still counts."""
    silent = page.get_by_text("alarms are silent here")
    expect(silent).to_be_visible()
    page.get_by_role("navigation", name="Pages").get_by_role("link", name="Log").hover()
    page.mouse.down()
    page.wait_for_timeout(1000)
    page.mouse.up()
    expect(page).to_have_url(re.compile("/log$"))
    expect(silent).to_be_hidden()


NOTE_TITLE = """() => {
  const note = () => (window.named_ms ??= /^[(]\\d+[)] /.test(document.title) ? Date.now() : null);
  new MutationObserver(note).observe(document.head, { childList: true, subtree: true });
  note();
}"""
LEVELS = ("severe", "critical")
"""What sounds on until somebody acknowledges."""


def alarm_of(night: Demo, word: str) -> Json:
    """Return the newest alarm of mini-1 that says this, closed or open."""
    found = [
        one
        for state in ("open", "closed")
        for one in night.get("/api/alarms", state=state)["alarms"]
        if word in one["text"]
    ]
    return max(found, key=lambda one: one["raised_at"])


def acknowledge_but(night: Demo, *words: str) -> None:
    """See to what a busy machine raises beside the alarms that are looked at here."""
    for other in night.get("/api/alarms")["alarms"]:
        waits = other["state"] in ("unacknowledged", "returned")
        if waits and not any(word in other["text"] for word in words):
            night.post(f"/api/alarms/{other['id']}/ack")


def falls_silent(night: Demo, page: Page) -> None:
    """Wait until the page sounds no more, with every cause seen but those that come meanwhile."""
    sounds = page.get_by_text("This page sounds until somebody acknowledges.")

    def is_silent() -> bool:
        acknowledge_but(night)
        page.wait_for_timeout(200)
        return sounds.is_hidden()

    night.wait("silence", is_silent, 20.0)


def sign_in_by_cookie(night: Demo, page: Page) -> str:
    for one in page.context.cookies():
        night.client.cookies.set(one.get("name", ""), one.get("value", ""))
    session = night.get("/api/session")
    night.client.headers["X-CSRF-Token"] = session["csrf_token"]
    return session["name"]


def call_in_turn(night: Demo, hook: Hook, me: str) -> None:
    """Let whoever is on watch be told of everything, and ben ten minutes later of what is grave."""
    night.post("/api/people", {"name": "ben", "role": "pilot", "password": "long enough it is"})
    contact = {"title": "phone", "form": "webhook", "address": hook.url("ben")}
    night.post("/api/notices/people/ben/contacts", contact)
    quiet = {"alarms": dict.fromkeys(("alarm", "contact", "battery", "station"), "none")}
    night.client.put("/api/notices/people/ben", json=quiet).raise_for_status()
    steps = {"steps": [{"people": ["ben"], "after_minutes": 10}], "escalate_from": "critical"}
    night.client.put("/api/notices/station", json=steps).raise_for_status()
    assert me != "ben"


def enter_contact(page: Page, night: Demo, hook: Hook, me: str) -> str:
    """Enter a webhook and send a test to it; return the reply that the page shows."""
    open_page(page, night, "/settings")
    panel = page.get_by_role("region", name="Notices", exact=True)
    panel.get_by_role("combobox", name="Kind", exact=True).select_option("webhook")
    panel.get_by_label("Name of the contact").fill("phone")
    panel.get_by_role("textbox", name="URL", exact=True).fill(hook.url(me))
    panel.get_by_role("button", name="Add the contact").click()
    panel.get_by_role("button", name="Send a test to phone").click()
    reply = panel.get_by_text(re.compile("The service took it after"))
    expect(reply).to_be_visible()
    return reply.inner_text()


def told_at(hook: Hook, path: str, words: str) -> float:
    return next(
        at_s for at_s, where, body in hook.taken if where == f"/{path}" and words in body["message"]
    )


def test_a_leak_wakes_the_next_person_and_is_acknowledged_by_its_link(
    browser: Browser, night: Demo, hook: Hook
):
    journey = Journey("J7")
    with browser_page(browser, night) as page:
        me = sign_in_by_cookie(night, page)
        reply = enter_contact(page, night, hook, me)
        journey.tell("1a", "a test button that works by day", f"“{reply}”")
        call_in_turn(night, hook, me)
        watch_channel(page, "leak")
        open_page(page, night, "/")
        acknowledge_but(night)
        page.wait_for_function("!document.title.startsWith('(')")
        page.evaluate(NOTE_TITLE)
        night.client.put("/api/demo/faults/mini-1/leak").raise_for_status()

        # 1. Sound, page and webhook; 2. what the message says.
        first = night.wait("the first is told", lambda: hook.told(me, "Leak"), 60.0)
        expect(page).to_have_title(re.compile(r"^\(\d+\) "))
        icon = page.locator('link[rel="icon"]')
        expect(icon).to_have_attribute("href", re.compile("^data:image/png"))
        leak = alarm_of(night, "Leak")
        heard = next(one for one in told_live(page) if one["value"] > 0.5)
        heard_s = wall_s(night.data, heard["received_at"])
        raised_s = wall_s(night.data, leak["raised_at"]) - heard_s
        named_s = page.evaluate("window.named_ms") / 1e3 - heard_s
        hook_s = told_at(hook, me, "Leak") - heard_s
        figure = f"raised after {raised_s:.2f} s, in the page's title after {named_s:.2f} s"
        journey.tell("1b", "leak bit received to alarm <= 2 s", figure)
        journey.tell("1c", "to the webhook <= 5 s", f"{hook_s:.2f} s")
        for words in ("Critical", "mini-1", "mini-1: last at ", f"{night.url}/robot/mini-1"):
            assert words in first
        journey.tell("2", "vehicle, value, limit, position, link", repr(first))
        touch(page)
        sounds = page.get_by_text("This page sounds until somebody acknowledges.")
        expect(sounds).to_be_visible()
        page.screenshot(path=SHOTS / "night-sounds.png")

        # A power cut loses neither the alarm nor whom it is still to wake.
        night.restart_station()
        back_s = time.time()
        assert alarm_of(night, "Leak") | {"text": ""} == leak | {"text": ""}

        # 5. Ten minutes of the station's clock later the next is called.
        second = night.wait("the next is told", lambda: hook.told("ben", "Leak"), 240.0)
        assert "Nobody has acknowledged this yet." in second
        first_s, second_s = told_at(hook, me, "Leak"), told_at(hook, "ben", "Leak")
        late_s = second_s - max(first_s + ESCALATES_S, back_s)
        figure = (
            f"{SPEED * (second_s - first_s) / 60.0:.1f} min of its clock, over a station that was "
            f"killed between and back {SPEED * (back_s - first_s) / 60.0:.1f} min after the first"
        )
        journey.tell("5", "unacknowledged 10 min -> on call", figure)
        assert -6.0 < late_s < 12.0

        # 4. ben acknowledges on a phone, by the link, once.
        link = re.search(r"http://\S+/ack/\S+", second)
        assert link is not None
        phone = browser.new_context(viewport={"width": 360, "height": 740}).new_page()
        phone.goto(link[0])
        phone.screenshot(path=SHOTS / "night-phone.png")
        phone.get_by_role("button", name="Acknowledge").click()
        expect(phone.get_by_text(re.compile("Acknowledged by ben"))).to_be_visible()
        phone.goto(link[0])
        expect(phone.get_by_text(re.compile("was used already"))).to_be_visible()
        phone.context.close()
        leak = alarm_of(night, "Leak")
        assert (leak["state"], leak["acknowledged_by"]) == ("acknowledged", "ben")
        falls_silent(night, page)

        # Silent for this cause only: another of the same robot sounds and is told.
        night.client.put("/api/demo/faults/mini-1/battery").raise_for_status()
        night.wait("the battery is told", lambda: hook.told(me, "battery"), 60.0)
        expect(sounds).to_be_visible()
        battery = alarm_of(night, "battery")
        assert (battery["level"], battery["state"]) == ("critical", "unacknowledged")
        assert alarm_of(night, "Leak")["state"] == "acknowledged"
        journey.tell(
            "4", "acknowledged by name and time; silent for this cause only",
            f"by {leak['acknowledged_by']} at {leak['acknowledged_at']}; the battery sounds beside",
        )  # fmt: skip

        # 3. and 6. On a phone in night red: what to do, and an abort within two touches.
        touches = surface_from_a_phone(browser, page, night)
        journey.tell("3", "night red, 360 px", "build/screenshots/night-red-phone.png")
        journey.tell("6", "suggested action; abort within two touches", f"{touches}")
        assert touches <= 2

        # 7. The leak is mended and was seen: closed. The battery is mended and was not: it waits.
        for fault in ("leak", "battery"):
            mend(night, fault)
        night.wait("the leak closed", lambda: alarm_of(night, "Leak")["state"] == "closed", 30.0)
        night.wait(
            "the battery back",
            lambda: alarm_of(night, "battery")["state"] == "returned",
            30.0,
        )
        acknowledge_with_note(page, battery["id"])
        closed = night.wait(
            "the battery closed",
            lambda: (one := alarm_of(night, "battery"))["state"] == "closed" and one,
            30.0,
        )
        assert (closed["acknowledged_by"], closed["note"]) == (me, "Charger was off")
        falls_silent(night, page)
        figure = "seen + normal: closed; normal and unseen: waits, closed when seen"
        journey.tell("7", "clears only on normal + acknowledged", figure)


def mend(night: Demo, fault: str) -> None:
    """Undo a fault; hands reach the robot only while it lies at the surface."""

    def is_mended() -> bool:
        return night.client.delete(f"/api/demo/faults/mini-1/{fault}").is_success

    night.wait(f"{fault} mended", is_mended, 60.0)


def surface_from_a_phone(browser: Browser, page: Page, night: Demo) -> int:
    """Look at the alarm in the middle of the night, and order the robot up; return the touches."""
    phone = browser.new_context(
        viewport={"width": 360, "height": 740}, storage_state=page.context.storage_state()
    ).new_page()
    phone.context.set_default_timeout(120_000)
    phone.add_init_script(
        "localStorage.setItem('grace.preference', JSON.stringify({ theme: 'night-red' }))"
    )
    open_page(phone, night, "/log#alarms")
    assert phone.evaluate("document.documentElement.dataset.theme") == "night-red"
    expect(phone.get_by_text("Hold Surface now on its page to bring it up.")).to_be_visible()
    phone.screenshot(path=SHOTS / "night-red-phone.png")
    touches = 1
    other = phone.get_by_role("link", name=re.compile("mini-1, Surface now"))
    if other.is_visible():  # another robot is in hand
        other.click()
        touches += 1
    hold(phone, re.compile("Surface mini-1 now"))
    expect_done(phone)
    phone.screenshot(path=SHOTS / "night-red-surfaced.png")
    phone.context.close()
    return touches


def acknowledge_with_note(page: Page, alarm: str) -> None:
    page.get_by_role("button", name=f"More about {alarm}").click()
    page.get_by_label("Note").fill("Charger was off")
    page.get_by_role("button", name="Acknowledge with note").click()
