"""One demo and one browser for all walks: the operator's first hour, then the pilot's."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from tests.browser.walk import browser_page, chromium
from tests.e2e.demo import LASTING, Demo


@pytest.fixture(scope="package")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Demo]:
    demo = Demo(tmp_path_factory.mktemp("demo"), "--speed", "20")
    yield demo
    demo.stop()


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="package")
def page(browser: Browser, demo: Demo) -> Iterator[Page]:
    with browser_page(browser, demo) as page:
        yield page


@pytest.fixture(scope="package")
def station(demo: Demo, page: Page) -> Demo:
    """The same station by REST; the one-time address has gone to the browser."""
    [(name, value)] = [
        (each.get("name", ""), each.get("value", ""))
        for each in page.context.cookies()
        if each.get("name", "").startswith("grace_session")
    ]
    demo.client.cookies.set(name, value)
    demo.client.headers["X-CSRF-Token"] = demo.get("/api/session")["csrf_token"]
    demo.patch("/api/config/planner", LASTING, robot="mini-1")
    return demo


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Demo]:
    """A demo in real time, in which nothing happens by itself."""
    with Demo(tmp_path_factory.mktemp("calm")) as demo:
        yield demo


@pytest.fixture(scope="module")
def screen(browser: Browser, calm: Demo) -> Iterator[Page]:
    with browser_page(browser, calm) as page:
        yield page
