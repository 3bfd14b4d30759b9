"""A leak at night: it sounds, tells by webhook, escalates, and is acknowledged from a phone."""

import json
import os
import re
import socket
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.walk import CHROMIUM, SHOTS, browser_page, open_page
from tests.e2e.demo import Demo

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]
SPEED = 20
"""Ten minutes without an acknowledgement are half a minute of the wall."""


class Hook(HTTPServer):
    """A webhook that keeps what it is told, by path."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.taken: list[tuple[str, dict[str, Any]]] = []
        threading.Thread(target=self.serve_forever, daemon=True).start()

    def url(self, path: str) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/{path}"

    def told(self, path: str, words: str) -> str | None:
        """Return the first message at a path that holds these words."""
        messages = [body["message"] for where, body in self.taken if where == f"/{path}"]
        return next((text for text in messages if words in text), None)


class _Handler(BaseHTTPRequestHandler):
    server: Hook

    def do_POST(self) -> None:
        body = json.loads(self.rfile.read(int(self.headers["content-length"])))
        self.server.taken.append((self.path, body))
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
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
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


def test_a_leak_wakes_the_next_person_and_is_acknowledged_by_its_link(
    browser: Browser, night: Demo, hook: Hook
):
    with browser_page(browser, night) as page:
        for one in page.context.cookies():
            night.client.cookies.set(one.get("name", ""), one.get("value", ""))
        night.client.headers["X-CSRF-Token"] = night.get("/api/session")["csrf_token"]
        me = night.get("/api/session")["name"]
        night.post("/api/people", {"name": "ben", "role": "pilot", "password": "long enough it is"})
        for person in (me, "ben"):
            contact = {"title": "phone", "form": "webhook", "address": hook.url(person)}
            night.post(f"/api/notices/people/{person}/contacts", contact)
        quiet = {"alarms": dict.fromkeys(("alarm", "contact", "battery", "station"), "none")}
        night.client.put("/api/notices/people/ben", json=quiet).raise_for_status()
        steps = {"steps": [{"people": ["ben"], "after_minutes": 10}], "escalate_from": "critical"}
        night.client.put("/api/notices/station", json=steps).raise_for_status()
        open_page(page, night, "/")
        night.client.put("/api/demo/faults/mini-1/leak").raise_for_status()

        first = night.wait("the first is told", lambda: hook.told(me, "Leak"), 60.0)
        assert "mini-1: last at " in first
        expect(page).to_have_title(re.compile(r"^\(\d+\) "))
        assert "mark-alarm" in str(page.locator('link[rel="icon"]').get_attribute("href"))
        touch(page)
        expect(page.get_by_text("This page sounds until somebody acknowledges.")).to_be_visible()
        page.screenshot(path=SHOTS / "night-sounds.png")

        second = night.wait("the next is told", lambda: hook.told("ben", "Leak"), 90.0)
        assert "Nobody has acknowledged this yet." in second
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

        alarms = night.get("/api/alarms")["alarms"]
        leak = next(one for one in alarms if "Leak" in one["text"])
        assert (leak["state"], leak["acknowledged_by"]) == ("acknowledged", "ben")
        for other in alarms:  # a busy machine raises alarms of the station beside it
            if other["state"] in ("unacknowledged", "returned"):
                night.post(f"/api/alarms/{other['id']}/ack")
        expect(page.get_by_text("This page sounds until somebody acknowledges.")).to_be_hidden()
