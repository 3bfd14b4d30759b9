"""One demo and one browser for all walks: the operator's first hour, then the pilot's."""

import pytest

from tests.browser.walk import browser_page, chromium
from tests.e2e.demo import LASTING, Demo


@pytest.fixture(scope="package")
def demo(tmp_path_factory):
    demo = Demo(tmp_path_factory.mktemp("demo"), "--speed", "20")
    yield demo
    demo.stop()


@pytest.fixture(scope="package")
def browser():
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="package")
def page(browser, demo):
    with browser_page(browser, demo) as page:
        yield page


@pytest.fixture(scope="package")
def station(demo, page):
    """The same station by REST; the one-time address has gone to the browser."""
    [cookie] = [each for each in page.context.cookies() if each["httpOnly"]]
    demo.client.cookies.set(cookie["name"], cookie["value"])
    demo.client.headers["X-CSRF-Token"] = demo.get("/api/session")["csrf_token"]
    demo.patch("/api/config/planner", LASTING, robot="mini-1")
    return demo
