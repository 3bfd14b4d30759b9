"""A real browser on a station: chromium, its pages at two sizes, and what no page may do."""

import os
import re
import shutil
from collections.abc import Generator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from urllib.parse import urlsplit

from PIL import Image
from playwright.sync_api import Browser, Locator, Page, Request, expect, sync_playwright

from tests.e2e.demo import Demo

CHROMIUM = (
    os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
)
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
         "--disable-gpu-compositing", "--disable-quic", "--no-first-run",
         "--disable-background-networking", "--disable-component-update",
         "--disable-sync"]  # fmt: skip
"""Without a graphics processor a browser puts pages together on the processor, and so it must be
told where SwiftShader stands for one: it would draw every page with that, twenty times slower."""
SHOTS = Path("build/screenshots")
SIZES = {"wide": (1600, 950), "tablet": (820, 1180)}
PLAIN_COLOURS = 200
"""The shade behind the scene has fewer."""
DRAWN_TRIES = 60


@contextmanager
def chromium() -> Generator[Browser, None, None]:
    """Start the one browser of all walks: a process has room for one only."""
    expect.set_options(timeout=120_000)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@contextmanager
def browser_page(browser: Browser, demo: Demo) -> Generator[Page, None, None]:
    """Sign in with the one-time address; afterwards no page may have failed or asked elsewhere."""
    SHOTS.mkdir(parents=True, exist_ok=True)
    page = browser.new_context(viewport={"width": 1600, "height": 950}).new_page()
    page.context.set_default_timeout(120_000)
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("request", lambda request: _note_foreign(request.url, demo.url, faults))
    page.goto(demo.sign_in_url)
    yield page
    page.context.close()
    assert faults == []


def _note_foreign(url: str, own: str, faults: list[str]) -> None:
    if not url.startswith((own, own.replace("http", "ws"), "data:", "blob:")):
        faults.append(f"a request left the station: {url}")


@contextmanager
def requests_of(page: Page) -> Generator[list[str], None, None]:
    """Note method and path of everything that a page and its frames ask for; no WebSocket."""
    noted: list[str] = []

    def note(request: Request) -> None:
        address = urlsplit(request.url)
        if address.scheme == "http":  # a blob or data address is read from the page's own memory
            noted.append(f"{request.method} {address.path}")

    page.on("request", note)
    yield noted
    page.remove_listener("request", note)


def open_page(page: Page, demo: Demo, path: str) -> None:
    page.goto(f"{demo.url}{path}")
    expect(page.get_by_role("status").get_by_text("Live", exact=True)).to_be_visible()


def expect_scene(page: Page) -> None:
    """Wait until the 3D view has drawn: the middle of an empty one is a plain shade."""
    canvas = page.frame_locator("iframe").locator("canvas").first
    expect(canvas).to_be_visible(timeout=240_000)
    for _ in range(DRAWN_TRIES):
        picture = Image.open(BytesIO(canvas.screenshot(timeout=120_000))).convert("RGB")
        width, height = picture.size
        middle = picture.crop((width // 3, height // 3, 2 * width // 3, 5 * height // 6))
        if middle.getcolors(PLAIN_COLOURS) is None:
            return
        page.wait_for_timeout(1000)
    raise AssertionError("the 3D view stays empty")


def shoot(page: Page, name: str) -> None:
    for size, (width, height) in SIZES.items():
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_timeout(800)
        page.screenshot(path=SHOTS / f"{name}-{size}.png", timeout=240_000)
    page.set_viewport_size({"width": 1600, "height": 950})


def tell_anew(page: Page, robot: str) -> None:
    """Let the station tell a page its robots anew, as where somebody renames one, and back."""
    strip = page.get_by_role("region", name="Robot in hand")
    for name in (f"{robot} anew", robot):
        status = page.evaluate(_RENAME, [robot, name])
        assert status == 200
        named = re.compile(f"^Surface {name} now")
        expect(strip.get_by_role("button", name=named)).to_be_visible()


_RENAME = """async ([robot, name]) => {
  const session = await (await fetch('/api/session')).json();
  const answer = await fetch(`/api/robots/${robot}`, {
    method: 'PATCH',
    headers: { 'Content-Type': 'application/json', 'X-CSRF-Token': session.csrf_token },
    body: JSON.stringify({ name }),
  });
  return answer.status;
}"""


def ask_for_a_sure_plan(page: Page, robot: str) -> None:
    """Plan a survey with the form as it is, but for what may leave a search without a plan.

    That is a robot that believes little of what it knows of its place, by chance, and a machine
    that is so busy that a search of some seconds hardly begins.
    """
    page.get_by_label("Maximum position uncertainty").fill("5")
    page.get_by_label("Planning time").fill("20")
    page.get_by_role("button", name=f"Plan a survey for {robot}").click()


def expect_done(page: Page) -> None:
    """Wait until the robot said that it carries the order out; the row stands from the press on."""
    steps = page.get_by_role("list", name="Progress of the order")
    expect(steps).to_contain_text(re.compile(r"Done\s*\d\d:\d\d:\d\dZ"))


_NOTE_PRESS = """each => {
  window.isPressed = false;
  each.addEventListener('pointerdown', () => { window.isPressed = true; }, { once: true });
}"""


def hold(page: Page, name: re.Pattern[str]) -> None:
    """Hold a button for its second."""
    press(page, page.get_by_role("button", name=name))
    page.wait_for_timeout(1500)
    page.mouse.up()


def press(page: Page, button: Locator) -> None:
    """Press a button and keep it; again where the page moved it away before the press."""
    is_pressed = False
    while not is_pressed:
        button.evaluate(_NOTE_PRESS)
        button.hover()
        page.mouse.down()
        is_pressed = page.evaluate("window.isPressed")
        if not is_pressed:
            page.mouse.up()
