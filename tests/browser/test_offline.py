"""An installed page without its station says so, and shows a new station at once."""

import re
import shutil
import socket
import threading
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
import uvicorn
from fastapi import FastAPI
from playwright.sync_api import Browser, Page, expect

from tests.browser.walk import CHROMIUM, SHOTS
from tests.free_port import free_port
from webui.static import mount_app

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]
DIST = Path("webui/dist")
HEARD = "2026-11-21T12:00:00.000Z"
KEPT = """async () => {
  const names = await caches.keys();
  const all = await Promise.all(names.map(async (name) => (await caches.open(name)).keys()));
  return all.flat().map(({ url }) => new URL(url).pathname);
}"""
CONTROLLED = "() => navigator.serviceWorker.ready.then(() => navigator.serviceWorker.controller)"


@dataclass
class Pages:
    """The pages of a station that can be stopped, upgraded and started again at one address."""

    dist: Path

    def __post_init__(self) -> None:
        self.port = free_port()
        self.url = f"http://127.0.0.1:{self.port}"

    @contextmanager
    def running(self) -> Generator[None]:
        app = FastAPI(openapi_url=None)
        mount_app(app, self.dist)
        server = uvicorn.Server(uvicorn.Config(app, lifespan="off", log_level="error"))
        listening = socket.create_server(("127.0.0.1", self.port))
        thread = threading.Thread(target=server.run, args=([listening],))
        thread.start()
        try:
            yield
        finally:
            server.should_exit = True
            thread.join()
            listening.close()

    def upgrade(self, name: str, old: str, new: str) -> None:
        page = self.dist / name
        text = page.read_text()
        assert old in text
        page.write_text(text.replace(old, new))
        for packed in (".br", ".gz"):
            page.with_name(name + packed).unlink(missing_ok=True)


@pytest.fixture
def pages(tmp_path: Path) -> Pages:
    shutil.copytree(DIST, tmp_path / "dist")
    return Pages(tmp_path / "dist")


@pytest.fixture
def phone(browser: Browser) -> Generator[Page]:
    context = browser.new_context(viewport={"width": 360, "height": 740})
    context.set_default_timeout(120_000)
    yield context.new_page()
    context.close()


def open_and_keep(phone: Page, pages: Pages) -> None:
    """Open the app as somebody who heard the station once."""
    phone.goto(pages.url)
    phone.evaluate("at => localStorage.setItem('grace.contact', at)", HEARD)
    phone.wait_for_function(CONTROLLED)


def test_without_its_station_a_page_says_since_when_and_comes_back_by_itself(
    phone: Page, pages: Pages
):
    with pages.running():
        open_and_keep(phone, pages)
    phone.goto(f"{pages.url}/robot/mini-1")
    title = phone.get_by_role("heading", name="No contact with the station since")
    expect(title).to_have_text("No contact with the station since 2026-11-21 12:00:00Z")
    expect(phone.get_by_text("by the clock of this device")).to_be_visible()
    expect(phone.get_by_text(re.compile("in vain; asked again"))).to_be_visible()
    wide = phone.evaluate("document.documentElement.scrollWidth - innerWidth")
    assert wide <= 0
    SHOTS.mkdir(parents=True, exist_ok=True)
    for theme in ("dark", "day", "night-red"):
        phone.evaluate(f"localStorage.setItem('grace.preference', '{{\"theme\":\"{theme}\"}}')")
        phone.reload()
        expect(title).to_be_visible()
        expect(phone.locator("html")).to_have_attribute("data-theme", theme)
        phone.screenshot(path=SHOTS / f"offline-{theme}.png")
    with pages.running():
        expect(title).to_have_count(0)
        expect(phone).to_have_url(f"{pages.url}/robot/mini-1")
        expect(phone.locator("#app")).to_be_attached()


def test_an_upgraded_station_is_shown_at_once_and_nothing_of_it_is_kept(phone: Page, pages: Pages):
    with pages.running():
        open_and_keep(phone, pages)
        kept = phone.evaluate(KEPT)
    assert "/offline.html" in kept
    assert all(path == "/offline.html" or path.startswith("/assets/") for path in kept)
    named = (pages.dist / "offline.html").read_text()
    assert all(path == "/offline.html" or path in named for path in kept)
    pages.upgrade("index.html", "<title>", "<title>Second edition: ")
    pages.upgrade("offline.html", "The robots go on by", "The second edition goes on by")
    with pages.running():
        answer = phone.goto(pages.url)
        assert answer is not None
        assert "Second edition: " in answer.text()
        phone.wait_for_function(
            "async () => (await (await caches.match('/offline.html')).text()).includes('second')"
        )
    phone.goto(pages.url)
    expect(phone.get_by_text("The second edition goes on by")).to_be_visible()


def test_what_is_asked_of_the_station_is_never_answered_by_the_browser(phone: Page, pages: Pages):
    with pages.running():
        open_and_keep(phone, pages)
        phone.evaluate("fetch('/api/health')")
    asked = "fetch('/api/health').then(() => 'answered', () => 'no contact')"
    assert phone.evaluate(asked) == "no contact"
    assert not any(path.startswith("/api") for path in phone.evaluate(KEPT))
