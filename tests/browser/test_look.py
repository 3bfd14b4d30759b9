"""What a page weighs and how it is laid out, measured in a real browser at three sizes."""

from itertools import pairwise

import pytest
from playwright.sync_api import expect

from tests.browser.walk import CHROMIUM, open_page

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

FIRST_LOAD_BYTES = 250_000
SIZES = [(1600, 950), (820, 1180), (360, 780)]


@pytest.fixture
def fresh(browser, screen):
    """A browser of somebody who is signed in and has nothing of the app yet."""
    context = browser.new_context(storage_state=screen.context.storage_state())
    context.set_default_timeout(120_000)
    yield context.new_page()
    context.close()


def test_the_first_page_is_light_and_says_nothing_on_the_console(fresh, calm):
    sizes: dict[str, int] = {}
    said: list[str] = []

    def weigh(response):
        sizes[response.url] = int(response.headers.get("content-length", 0))

    fresh.on("response", weigh)
    fresh.on("console", lambda line: said.append(line.text))
    open_page(fresh, calm, "/")
    expect(fresh.locator(".leaflet-container").first).to_be_visible()
    fresh.wait_for_load_state("networkidle")
    assert sum(sizes.values()) <= FIRST_LOAD_BYTES, sizes
    assert not any("/view/" in url or "/Control-" in url for url in sizes)
    assert said == []


@pytest.mark.parametrize("size", SIZES, ids=["wide", "tablet", "phone"])
def test_no_word_of_a_card_is_cut(screen, calm, size):
    screen.set_viewport_size({"width": size[0], "height": size[1]})
    open_page(screen, calm, "/")
    titles = screen.locator("article dt")
    expect(titles.first).to_be_visible()
    cut = "each => each.filter(one => one.scrollWidth > one.clientWidth).map(one => one.innerText)"
    assert titles.evaluate_all(cut) == []


@pytest.mark.parametrize("size", SIZES, ids=["wide", "tablet", "phone"])
def test_large_gauges_stand_on_one_line(screen, calm, size):
    screen.set_viewport_size({"width": size[0], "height": size[1]})
    open_page(screen, calm, "/robot/mini-1")
    values = screen.locator(".gauge.large .value")
    expect(values).to_have_count(4)
    tops = values.evaluate_all("each => each.map(one => one.getBoundingClientRect().bottom)")
    assert tops[0] == pytest.approx(tops[1], abs=0.6)
    assert tops[2] == pytest.approx(tops[3], abs=0.6)


@pytest.mark.parametrize("size", SIZES, ids=["wide", "tablet", "phone"])
def test_labels_of_a_map_do_not_lie_over_each_other(screen, calm, size):
    screen.set_viewport_size({"width": size[0], "height": size[1]})
    open_page(screen, calm, "/")
    labels = screen.locator(".leaflet-container").last.locator(".map-label-below")
    expect(labels.first).to_be_attached()
    boxes = labels.evaluate_all(
        "each => each.map(one => one.getBoundingClientRect()).map(box => [box.left, box.right])"
    )
    boxes.sort()
    assert all(left[1] <= right[0] for left, right in pairwise(boxes)), boxes


def test_charts_take_the_colours_of_the_theme_that_was_chosen(screen, calm):
    """The depth of a robot is drawn in the theme's colour of text."""
    screen.set_viewport_size({"width": 1600, "height": 950})
    open_page(screen, calm, "/robot/mini-1")
    chart = screen.get_by_role("img", name="Depth of mini-1").locator("canvas").first
    expect(chart).to_be_visible()
    screen.get_by_role("button", name="demo").click()
    screen.get_by_text("Night red", exact=True).first.click()
    reddish = """canvas => {
      const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
      for (let i = 0; i < data.length; i += 4)
        if (data[i + 3] > 200 && data[i + 1] > 190 && data[i + 2] > 190) return false;
      return true;
    }"""
    screen.wait_for_function(f"each => ({reddish})(each)", arg=chart.element_handle())
    screen.get_by_role("button", name="demo").click()
    screen.get_by_text("Dark", exact=True).first.click()
