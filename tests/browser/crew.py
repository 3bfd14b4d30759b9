"""More people than one: each in a browser of their own, and who is in charge of which robot."""

import re
from collections.abc import Generator
from contextlib import contextmanager

from playwright.sync_api import Browser, Locator, Page, expect

from tests.e2e.demo import Demo

PASSWORD = "a long pass phrase"


def name_of(page: Page) -> str:
    """Return who is signed in at a page."""
    return page.evaluate("fetch('/api/session').then(a => a.json()).then(a => a.name)")


@contextmanager
def second_pilot(
    browser: Browser, demo: Demo, first: Page, only: str | None = None
) -> Generator[Page]:
    """Let the first, an administrator, make the pilot ben known, and let him sign in.

    Where he pilots one robot ``only``, he looks at the others.
    """
    csrf = first.evaluate("fetch('/api/session').then(a => a.json()).then(a => a.csrf_token)")
    person: dict[str, object] = {"name": "ben", "role": "pilot", "password": PASSWORD}
    if only is not None:
        person |= {"role": "viewer", "grants": [{"robot": only, "role": "pilot"}]}
    made = first.request.post(f"{demo.url}/api/people", data=person, headers={"X-CSRF-Token": csrf})
    assert made.status == 201, made.text()
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    context.set_default_timeout(120_000)
    page = context.new_page()
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(demo.url)
    page.get_by_label("Name").fill("ben")
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_role("status").get_by_text("Live", exact=True)).to_be_visible()
    yield page
    context.close()
    assert faults == []


def charge(page: Page, text: str, robot: str = "mini-1") -> Locator:
    """Return what the header says of who is in charge."""
    return page.get_by_role("button", name=re.compile(f"^{robot}: {text}"))


def sheet(page: Page, robot: str = "mini-1") -> Locator:
    """Return what opens under it."""
    return page.get_by_role("region", name=f"Pilot in charge of {robot}")


def open_sheet(page: Page, robot: str = "mini-1") -> None:
    """Open it, if it is not: it closes when the button that had the keyboard is gone."""
    if not sheet(page, robot).is_visible():
        charge(page, "", robot).click()


def act(page: Page, button: str, robot: str = "mini-1") -> None:
    """Click what may be done about a lease."""
    open_sheet(page, robot)
    sheet(page, robot).get_by_role("button", name=button).click()
