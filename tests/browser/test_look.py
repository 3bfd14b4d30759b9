"""What a page weighs and how it is laid out, measured in a real browser at three sizes."""

import base64
import re
from itertools import pairwise

import pytest
from playwright.sync_api import expect

from tests.browser.walk import CHROMIUM, SHOTS, hold, open_page, press

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

FIRST_LOAD_BYTES = 207_500
"""Without what robots did until now, which grows with time, to 600 points a robot at most, and
without how robots do now, which is longer or shorter by chance."""
GROWING = re.compile("/(track|samples)[?]")
NOW = re.compile("/api/(alarms|automation|health|leases|robots)")
NOW_BYTES = 16_000
"""Of two robots; 8,000 while nothing is wrong with any of them."""
SIZES = [(1600, 950), (820, 1180), (360, 780)]
GLIDE_CSV = """time,latitude,longitude,depth,temperature
2026-08-01T10:00:00Z,42.70000,-84.40000,0.2,21.5
2026-08-01T10:00:02Z,42.70001,-84.40001,0.9,21.4
2026-08-01T10:00:04Z,42.70002,-84.40002,1.6,20.8
"""


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
        if not GROWING.search(response.url):
            sizes[response.url] = int(response.headers.get("content-length", 0))

    fresh.on("response", weigh)
    fresh.on("console", lambda line: said.append(line.text))
    open_page(fresh, calm, "/")
    expect(fresh.locator(".leaflet-container").first).to_be_visible()
    fresh.wait_for_load_state("networkidle")
    now = {url: size for url, size in sizes.items() if NOW.search(url)}
    assert sum(now.values()) <= NOW_BYTES, now
    assert sum(sizes.values()) - sum(now.values()) <= FIRST_LOAD_BYTES, sizes
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
    labels = screen.get_by_role("group", name="from above").last.locator(".map-label-below")
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
    chart = '[role="img"][aria-label^="Depth of mini-1"] canvas'
    expect(screen.locator(chart).first).to_be_visible()
    screen.get_by_role("button", name="demo").click()
    screen.get_by_text("Night red", exact=True).first.click()
    # looked for each time: a chart is made anew for another theme
    reddish = """chart => {
      const canvas = document.querySelector(chart);
      if (canvas === null) return false;
      const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
      for (let i = 0; i < data.length; i += 4)
        if (data[i + 3] > 200 && data[i + 1] > 190 && data[i + 2] > 190) return false;
      return true;
    }"""
    screen.wait_for_function(reddish, arg=chart)
    screen.get_by_role("button", name="demo").click()
    screen.get_by_text("Dark", exact=True).first.click()


ALARM = {
    "id": "alarm-1", "robot": "mini-1", "level": "critical", "state": "unacknowledged",
    "text": "mini-1 has come up where nobody expected it, and it does not say why it did that.",
    "raised_at": "2026-11-21T12:00:00Z", "acknowledged_at": None, "acknowledged_by": None,
    "cleared_at": None,
}  # fmt: skip


@pytest.fixture
def alarmed(screen):
    """The same browser, told of two alarms that nobody has acknowledged."""
    page = screen.context.new_page()
    alarms = [ALARM, ALARM | {"id": "alarm-2", "level": "watch"}]
    page.route(re.compile("/api/alarms"), lambda route: route.fulfill(json={"alarms": alarms}))
    yield page
    page.close()


def test_a_phone_in_alarm_keeps_three_quarters_for_its_page(alarmed, calm):
    alarmed.set_viewport_size({"width": 360, "height": 780})
    open_page(alarmed, calm, "/")
    bar = alarmed.get_by_role("alert")
    expect(bar.get_by_text("Critical", exact=True)).to_be_in_viewport(ratio=1)
    expect(bar.locator("svg").first).to_be_in_viewport(ratio=1)
    expect(bar.get_by_role("button", name=re.compile("Let it sound"))).to_be_in_viewport(ratio=1)
    expect(alarmed.get_by_text("SIMULATION")).to_be_in_viewport(ratio=1)
    room = alarmed.get_by_role("main").evaluate("each => each.clientHeight / innerHeight")
    assert room >= 0.73


COLOURS = """async (address) => {
  const image = new Image();
  image.src = address;
  await image.decode();
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [image.width, image.height];
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0);
  const at = (x, y) => Array.from(context.getImageData(x, y, 1, 1).data);
  return { size: [image.width, image.height], badge: at(30, 20), mark: at(4, 40) };
}"""
"""Colours of the tab's icon: at the left end of its badge, and of the mark under it."""


def test_icons_count_alarms_in_the_colour_of_the_gravest(alarmed, calm):
    alarmed.add_init_script(
        "window.told = []; navigator.setAppBadge = async (...each) => { told.push(each); };"
        "navigator.clearAppBadge = async () => { told.push('none'); };"
    )
    open_page(alarmed, calm, "/")
    icon = alarmed.locator('link[rel="icon"]')
    expect(icon).to_have_attribute("href", re.compile("^data:image/png"))
    alarmed.wait_for_function("told.length > 0 && String(told.at(-1)) === '2'")
    expect(alarmed).to_have_title(re.compile("Fleet"))
    drawn = alarmed.evaluate(COLOURS, icon.get_attribute("href"))
    red, green, blue, opaque = drawn["badge"]
    assert (drawn["size"], opaque) == ([64, 64], 255)
    assert red > 2 * max(green, blue)
    assert drawn["mark"][3] == 255
    (SHOTS / "icon.png").write_bytes(base64.b64decode(icon.get_attribute("href").split(",")[1]))


def test_the_first_click_on_a_page_in_alarm_does_what_it_says(alarmed, calm):
    alarmed.set_viewport_size({"width": 1600, "height": 950})
    open_page(alarmed, calm, "/robot/mini-1")
    silent = alarmed.get_by_text("This browser lets the page sound only after a touch")
    expect(silent).to_be_visible()
    choice = alarmed.get_by_role("radio", name="5 min", exact=True)
    expect(choice).not_to_be_checked()
    alarmed.get_by_text("5 min", exact=True).click(delay=300)
    expect(silent).to_have_count(0)
    expect(choice).to_be_checked()


@pytest.mark.parametrize(
    ("path", "name"),
    [("/", "Surface mini-1 now"), ("/robot/mini-1", "Hold mini-1 at its next surfacing")],
)
def test_a_button_that_is_held_stays_under_the_finger(screen, calm, path, name):
    screen.set_viewport_size({"width": 360, "height": 780})
    open_page(screen, calm, path)
    button = screen.get_by_role("button", name=re.compile(name))
    # However long it takes to look: who has held it for its second holds it no more.
    screen.evaluate(
        "const later = window.setTimeout; window.setTimeout = (work, ms, ...rest) =>"
        " ms === 1000 ? 0 : later(work, ms, ...rest); undefined"
    )
    press(screen, button)
    before = button.bounding_box()
    # What a sentence does that becomes longer above the button and beside it.
    screen.evaluate(
        "() => { for (const parent of document.querySelectorAll('.strip, .row')) {"
        " const more = document.createElement('p'); more.textContent = 'a longer sentence';"
        " more.style.cssText = 'grid-column: 1 / -1; flex-basis: 100%; order: -1; margin: 9px';"
        " parent.prepend(more); } }"
    )
    screen.wait_for_function(
        "([each, box]) => { const { x, y } = each.getBoundingClientRect();"
        " return Math.abs(x - box.x) < 0.6 && Math.abs(y - box.y) < 0.6; }",
        arg=[button.element_handle(), before],
    )
    screen.mouse.move(5, 300)
    screen.mouse.up()


def test_what_scrolls_sideways_says_so(screen, calm):
    screen.set_viewport_size({"width": 360, "height": 780})
    open_page(screen, calm, "/settings")
    table = screen.get_by_role("region", name="Robots and links, goes on sideways")
    expect(table).to_have_class(re.compile("more-right"))
    table.focus()
    table.evaluate("each => { each.scrollLeft = each.scrollWidth; }")
    expect(table).to_have_class(re.compile("more-left"))
    expect(table).not_to_have_class(re.compile("more-right"))


def test_a_form_says_beside_its_fields_what_they_lack(screen, calm):
    screen.set_viewport_size({"width": 1600, "height": 950})
    open_page(screen, calm, "/settings")
    people = screen.get_by_role("region", name="People")
    people.get_by_role("button", name="Add a person").click()
    expect(people.get_by_text("Fill this in.")).to_have_count(2)
    name = people.get_by_label("Name")
    expect(name).to_be_focused()
    expect(name).to_have_attribute("aria-invalid", "true")
    name.fill("anna")
    expect(people.get_by_text("Fill this in.")).to_have_count(1)
    open_page(screen, calm, "/data/mini-1")
    panel = screen.locator("form").filter(has_text="Import a recording")
    expect(panel.get_by_text("None chosen")).to_be_visible()
    panel.get_by_label("Files").set_input_files(
        {"name": "glide.csv", "mimeType": "text/csv", "buffer": GLIDE_CSV.encode()}
    )
    expect(panel.get_by_role("status").filter(has_text="3 rows of glide.csv")).to_be_visible()
    panel.get_by_label("Name of the robot that recorded it").fill("")
    panel.get_by_role("button", name="Import 3 rows").click()
    expect(panel.get_by_text("Fill this in.")).to_be_visible()


def test_a_word_is_explained_to_those_who_tap_or_type(screen, calm):
    screen.set_viewport_size({"width": 360, "height": 780})
    open_page(screen, calm, "/map/mini-1")
    word = screen.get_by_role("note").filter(has_text="learned").first
    word.focus()
    bubble = screen.get_by_role("tooltip")
    expect(bubble).to_contain_text("marginal likelihood")
    expect(bubble).to_be_in_viewport(ratio=1)
    screen.keyboard.press("Escape")
    expect(bubble).to_have_count(0)


def test_a_viewer_is_told_why_nothing_can_be_surfaced(screen, calm):
    page = screen.context.new_page()

    def as_viewer(route):
        session = route.fetch().json()
        route.fulfill(json=session | {"role": "viewer"})

    page.route(re.compile("/api/session$"), as_viewer)
    page.set_viewport_size({"width": 360, "height": 780})
    open_page(page, calm, "/plan/mini-1")
    button = page.get_by_role("button", name=re.compile("Surface mini-1 now"))
    expect(button).to_be_disabled()
    why = "Surfacing a robot needs the role of a pilot"
    expect(button).to_have_attribute("title", why)
    expect(page.get_by_text(why, exact=True)).to_be_visible()
    expect(page.get_by_text("You are signed in as a viewer")).to_be_visible()
    page.close()


def test_a_robot_at_the_edge_of_a_map_has_its_name_inside(screen, calm):
    screen.set_viewport_size({"width": 1600, "height": 950})
    open_page(screen, calm, "/")
    site = screen.locator(".leaflet-container").first
    name = site.locator(".map-name")
    expect(name).to_be_visible()
    frame, label = site.bounding_box(), name.bounding_box()
    y = frame["y"] + 0.5 * frame["height"]
    screen.mouse.move(frame["x"] + 20, y)
    screen.mouse.down()
    way = frame["x"] + frame["width"] - label["x"] - 20
    screen.mouse.move(frame["x"] + 20 + way, y, steps=5)
    screen.wait_for_timeout(300)  # a map that is let go while it moves glides on
    screen.mouse.up()
    screen.wait_for_function(
        "each => each.querySelector('.map-name').getBoundingClientRect().right"
        " <= each.getBoundingClientRect().right",
        arg=site.element_handle(),
    )


def test_a_refusal_keeps_off_the_edges_of_its_panel(screen, calm):
    page = screen.context.new_page()
    page.route(re.compile(r"/api/events\?"), lambda route: route.fulfill(status=500, json={}))
    open_page(page, calm, "/log#events")
    notice = page.get_by_role("region", name="Events").locator(".notice")
    expect(notice).to_be_visible()
    panel, box = page.get_by_role("region", name="Events").bounding_box(), notice.bounding_box()
    assert box["x"] - panel["x"] >= 8
    assert panel["x"] + panel["width"] - box["x"] - box["width"] >= 8
    page.close()


def test_an_order_that_is_done_says_so_and_leaves(screen, calm):
    screen.set_viewport_size({"width": 360, "height": 780})
    open_page(screen, calm, "/log")
    hold(screen, re.compile("Surface mini-1 now"))
    done = screen.get_by_text("mini-1 is up, as ordered.")
    expect(done).to_be_visible()
    expect(done).to_have_count(0)
