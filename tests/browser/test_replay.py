"""An alarm's moment is replayed from the log: moved, played, and never to be mistaken for now."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.walk import CHROMIUM, SHOTS, browser_page, expect_scene, open_page, requests_of
from tests.e2e.demo import Demo

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]
LOOKS = ((1440, "dark"), (768, "day"), (360, "night-red"))


@pytest.fixture(scope="module")
def leaky(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Demo]:
    """A demo in which a robot leaks, so that there is an alarm to go back to."""
    with Demo(tmp_path_factory.mktemp("leaky"), "--fault", "mini-1:leak@5") as demo:
        yield demo


@pytest.fixture(scope="module")
def desk(browser: Browser, leaky: Demo) -> Iterator[Page]:
    with browser_page(browser, leaky) as page:
        yield page


def moment(page: Page) -> float:
    return float(page.get_by_role("region", name="Replay").get_attribute("data-at") or "nan")


def expect_moved(page: Page, before: float, *, later: bool) -> float:
    """Wait until the cursor stands elsewhere, and what is shown with it."""
    page.wait_for_function(
        """([before, later]) => {
          const { at, shown } = document.querySelector('.replay').dataset;
          return at === shown && (later ? +at > before : +at < before);
        }""",
        arg=[before, later],
    )
    return moment(page)


def look(page: Page, name: str) -> None:
    for width, theme in LOOKS:
        page.set_viewport_size({"width": width, "height": 900})
        page.evaluate("theme => (document.documentElement.dataset.theme = theme)", theme)
        page.screenshot(path=SHOTS / f"{name}-{width}-{theme}.png", timeout=240_000)
        assert page.evaluate("document.querySelector('main').scrollWidth - innerWidth") <= 0
    page.evaluate("document.documentElement.dataset.theme = 'dark'")
    page.set_viewport_size({"width": 1600, "height": 950})


def test_the_moment_of_an_alarm_is_replayed_from_the_log_and_nothing_is_sent(
    leaky: Demo, desk: Page
) -> None:
    page = desk
    open_page(page, leaky, "/log#book")
    told = page.locator("p.told").filter(has_text=re.compile("leak", re.IGNORECASE))
    told.last.get_by_role("link", name="then").click()
    band = page.get_by_role("region", name="Replay")
    expect(band).to_contain_text(re.compile(r"REPLAY \d{4}-\d\d-\d\d \d\d:\d\d:\d\dZ, not live"))
    expect(page).to_have_url(re.compile(r"[?]at="))
    then = page.get_by_role("region", name="At the moment")
    expect(then.get_by_role("list", name="Log then")).to_contain_text(re.compile("leak", re.I))
    gauges = page.get_by_role("region", name="Gauges of mini-1")
    expect(gauges).to_have_attribute("data-moment", re.compile("Z$|\\+00:00$"))
    mark = page.frame_locator("iframe").locator("#then")
    expect(mark).to_have_text(re.compile(r"At \d\d:\d\d:\d\dZ, not live"))
    expect_scene(page)
    look(page, "replay-robot")

    with requests_of(page) as asked:
        begun = moment(page)
        page.locator("main").focus()
        page.keyboard.press("ArrowLeft")
        before = expect_moved(page, begun, later=False)
        page.keyboard.press("Shift+ArrowLeft")
        back = expect_moved(page, before, later=False)
        page.keyboard.press("]")
        at_event = expect_moved(page, back, later=True)
        band.get_by_label("Speed").select_option("10")
        page.locator("main").focus()
        page.keyboard.press("Space")
        expect(band.get_by_role("button", name="Pause")).to_be_visible()
        page.wait_for_function(
            "at => +document.querySelector('.replay').dataset.at > at + 3000", arg=at_event
        )
        page.keyboard.press("Space")
        expect(band.get_by_role("button", name="Play")).to_be_visible()
        page.keyboard.press("Home")
        expect_moved(page, at_event, later=False)

        # A click in a chart goes to the place under the pointer.
        chart = page.get_by_role("img", name=re.compile("^Depth of mini-1"))
        box = chart.bounding_box()
        assert box is not None
        first = moment(page)
        page.mouse.click(box["x"] + 0.75 * box["width"], box["y"] + 0.4 * box["height"])
        expect_moved(page, first, later=True)

        # Nothing is sent: no page that sends is open, and what is tried does not leave the page.
        expect(page.get_by_role("button", name=re.compile("^Surface mini-1 now"))).to_be_enabled()
        page.get_by_role("link", name="Plan", exact=True).first.click()
        expect(page.locator("main")).to_contain_text("Plan is of now")
        expect(band).to_contain_text("not live")
        page.get_by_role("link", name="Data", exact=True).first.click()
        expect(page.get_by_role("region", name="History of channels")).to_be_visible()
        look(page, "replay-data")
        page.get_by_role("link", name="Map", exact=True).first.click()
        expect(then).to_be_visible()
        look(page, "replay-map")
    changing = [one for one in asked if not one.startswith(("GET", "HEAD"))]
    assert all("/view/replay/" in one for one in changing), changing

    page.reload()
    expect(band).to_contain_text("not live")
    band.get_by_role("button", name="Back to live").click()
    expect(band).to_have_count(0)
    expect(page).not_to_have_url(re.compile(r"[?]at="))


def test_a_stretch_becomes_a_film_that_plays_without_a_station(
    browser: Browser, leaky: Demo, desk: Page, tmp_path: Path
) -> None:
    open_page(desk, leaky, "/data/mini-1")
    desk.get_by_role("button", name="Replay", exact=True).click()
    films = desk.get_by_role("region", name="Films")
    films.get_by_label("Stretch").select_option("around")
    films.get_by_label("Lasts").select_option("10 s")
    films.get_by_role("button", name="Make a film").click()
    kept = films.get_by_role("link", name=re.compile(r"^SIMULATION_mini-1_.*_page\.html$"))
    expect(kept).to_be_visible()
    look(desk, "replay-films")
    with desk.expect_download() as fetched:
        kept.click()
    film = tmp_path / "film.html"
    fetched.value.save_as(film)
    page = browser.new_context(offline=True).new_page()
    page.goto(film.as_uri())
    expect(page.locator("#then")).to_have_text(re.compile("SIMULATION.*not live$"))
    expect(page.locator("canvas").first).to_be_visible()
    page.screenshot(path=SHOTS / "film.png", timeout=240_000)
    page.context.close()
