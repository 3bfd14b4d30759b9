"""A person at the browser, and what they did so far."""

import time

from playwright.sync_api import Locator, Page

from tests.browser.walk import SHOTS

SIZES = {"wide": (1440, 900), "tablet": (900, 1100), "phone": (400, 860)}


class Person:
    """Does what a person does, and counts it."""

    def __init__(self) -> None:
        self.interactions = 0
        self._began_s = time.monotonic()

    @property
    def minutes(self) -> float:
        """Since they sat down, without the time that pictures took."""
        return (time.monotonic() - self._began_s) / 60.0

    def fill(self, field: Locator, text: str) -> None:
        self.interactions += 2  # into the field, and typed
        field.fill(text)

    def click(self, button: Locator) -> None:
        self.interactions += 1
        button.click()

    def choose(self, field: Locator, label: str) -> None:
        self.interactions += 2
        field.select_option(label=label)

    def give(self, field: Locator, file: object) -> None:
        """Choose a file: the button, the file, *Open*."""
        self.interactions += 3
        field.set_input_files(str(file))

    def shoot(self, page: Page, name: str) -> None:
        """Take a picture of a page on a desk, a tablet and a phone."""
        at_s = time.monotonic()
        _shoot(page, name)
        self._began_s += time.monotonic() - at_s


def _shoot(page: Page, name: str) -> None:
    SHOTS.mkdir(parents=True, exist_ok=True)
    before = page.viewport_size
    for size, (width, height) in SIZES.items():
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_timeout(400)
        page.screenshot(path=SHOTS / f"{name}-{size}.png", timeout=240_000)
    if before is not None:
        page.set_viewport_size(before)
