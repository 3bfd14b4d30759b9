"""A mission drawn over the lake: dragged, undone, saved by two, compared, and made a plan of."""

import re
from collections.abc import Callable
from io import BytesIO

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Locator, Page, expect

from tests.browser.person import Person
from tests.browser.test_look import SIZES
from tests.browser.test_look_everywhere import AXE, LOOK, THEMES, faults_of_axe
from tests.browser.walk import CHROMIUM, expect_scene, open_page

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1800),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

ROBOT = "grace-1"
WIDE = {"width": 1440, "height": 900}


def kept(page: Page) -> None:
    expect(keeping(page)).to_have_text(re.compile("Kept .*Z"))


def keeping(page: Page) -> Locator:
    return page.get_by_role("status", name="Keeping of the design")


def corner(page: Page, number: int) -> str:
    field = page.get_by_label(f"North and east of corner {number}", exact=True)
    expect(field).to_be_visible()
    return field.input_value()


def drag(page: Page, spot: Locator, right_px: float, down_px: float) -> None:
    """Take hold of a place on the map and let it go elsewhere."""
    box = spot.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + right_px, y + down_px, steps=6)
    page.mouse.up()


@pytest.fixture(scope="module")
def bench(screen: Page, calm) -> Page:
    """A lawnmower over the lake, open, its places in metres."""
    screen.set_viewport_size(WIDE)
    open_page(screen, calm, f"/design/{ROBOT}")
    screen.get_by_role("button", name=re.compile("^Lawnmower")).click()
    kept(screen)
    screen.get_by_text("N, E in m", exact=True).click()
    return screen


def test_a_lawnmower_lies_over_the_lake_with_its_account(bench):
    expect(bench.locator(".map-spot")).to_have_count(4)
    account = bench.get_by_role("region", name="Account of the design")
    expect(account.get_by_role("status")).to_have_text("checked")
    expect(account).to_contain_text("No limit is violated.")
    Person().shoot(bench, "design")


@pytest.mark.skipif(not AXE.exists(), reason="axe-core is not among the app's packages here")
def test_nothing_is_cut_and_axe_finds_nothing_moderate_or_worse(bench):
    found = {}
    for width, height in SIZES:
        bench.set_viewport_size({"width": width, "height": height})
        for theme in THEMES:
            bench.evaluate("theme => document.documentElement.dataset.theme = theme", theme)
            if faults := [*faults_of_axe(bench), *bench.evaluate(LOOK)]:
                found[width, theme] = faults
    bench.evaluate("document.documentElement.dataset.theme = 'dark'")
    bench.set_viewport_size(WIDE)
    assert found == {}


def test_a_drag_is_kept_and_undone_and_redone_after_a_reload(bench):
    before = corner(bench, 3)
    drag(bench, bench.locator(".map-spot").nth(2), 40.0, -20.0)
    expect(bench.get_by_label("North and east of corner 3", exact=True)).not_to_have_value(before)
    moved = corner(bench, 3)
    kept(bench)
    bench.reload()
    kept(bench)
    bench.get_by_text("N, E in m", exact=True).click()
    assert corner(bench, 3) == moved
    field = bench.get_by_label("North and east of corner 3", exact=True)
    bench.get_by_role("button", name="Undo: Moved corner 3").click()
    expect(field).to_have_value(before)
    bench.get_by_role("button", name="Redo: Moved corner 3").click()
    expect(field).to_have_value(moved)
    kept(bench)


def test_a_version_is_saved_and_compared_leg_by_leg(bench):
    bench.get_by_label("Comment").fill("before it is turned")
    bench.get_by_role("button", name="Save a version").click()
    versions = bench.get_by_role("region", name="Versions")
    expect(versions.get_by_role("listitem")).to_contain_text("before it is turned")
    heading = bench.get_by_label("Heading, °")
    heading.fill("45")
    heading.press("Enter")
    kept(bench)
    versions.get_by_role("button", name="Compare version 1 with what is drawn now").click()
    expect(versions).to_contain_text(re.compile(r"\d+ legs? (moved|added|removed)"))
    expect(bench.locator(".map-ghost").first).to_be_attached()
    versions.get_by_role("button", name="Restore version 1").click()
    expect(heading).to_have_value("0")
    kept(bench)


def test_what_the_station_does_not_hear_is_said_and_survives_a_closed_page(bench):
    deaf = re.compile("/api/designs/.*/document")
    bench.route(deaf, lambda route: route.abort())
    spacing = bench.get_by_label("Spacing, m")
    spacing.fill("60")
    spacing.press("Enter")
    expect(keeping(bench)).to_contain_text("Not kept: station does not answer")
    address = bench.url
    bench.on("dialog", lambda dialog: dialog.accept())
    bench.goto("about:blank")
    bench.unroute(deaf)
    bench.goto(address)
    offer = bench.get_by_role("region", name="A change that was not kept")
    expect(offer).to_contain_text("Spacing changed")
    offer.get_by_role("button", name="Bring it back").click()
    expect(spacing).to_have_value("60")
    kept(bench)
    bench.get_by_text("N, E in m", exact=True).click()


def test_two_tabs_lose_nothing(bench):
    deaf = re.compile("/api/designs/")
    bench.route(deaf, lambda route: route.abort())
    other = bench.context.new_page()
    other.goto(bench.url)
    kept(other)
    spacing = other.get_by_label("Spacing, m")
    spacing.fill("80")
    spacing.press("Enter")
    kept(other)
    field = bench.get_by_label("North and east of corner 1", exact=True)
    field.fill("150, 150")
    field.press("Enter")
    expect(keeping(bench)).to_contain_text("Not kept")
    bench.unroute(deaf)
    conflict = bench.get_by_role("region", name="Changed by somebody else")
    expect(conflict).to_contain_text("Spacing changed")
    expect(conflict.get_by_role("table").first).to_be_visible()
    Person().shoot(bench, "design-conflict")
    conflict.get_by_role("button", name="Put mine on top").click()
    kept(bench)
    expect(field).to_have_value("150, 150")
    versions = bench.get_by_role("region", name="Versions")
    expect(versions).to_contain_text("demo: Spacing changed")
    expect(other.get_by_label("Spacing, m")).to_have_value("60")
    expect(other.get_by_text("Put on top of a change by demo")).to_be_visible()
    other.close()


def test_what_is_tried_shows_where_it_may_be_and_what_may_happen(bench):
    bench.get_by_text("Move, turn, scale").click()
    bench.get_by_label("Factor").fill("0.4")
    bench.get_by_label("Factor").press("Enter")
    bench.get_by_role("button", name="Scale", exact=True).click()
    kept(bench)
    account = bench.get_by_role("region", name="Account of the design")
    expect(account).to_contain_text(re.compile(r"Battery after\s+[\d.]+ %\s+[\d.]+ to [\d.]+ %"))
    tried = bench.get_by_role("region", name="Try the design")
    tried.get_by_role("button", name="Try it").click()
    expect(tried.get_by_role("status").first).to_contain_text(": draft", timeout=900_000)
    expect(tried).to_contain_text(re.compile(r"(Of|In) \d+ flights ahead"))
    expect(bench.locator(".map-band")).to_have_count(1)
    expect(bench.locator(".map-band-surfacing")).not_to_have_count(0)
    rehearsal = bench.get_by_role("region", name="Rehearsal of the plan")
    expect(rehearsal.get_by_label("Chances")).to_contain_text(re.compile(r"of \d+"))
    ups = rehearsal.get_by_role("table", name="Surfacings of the rehearsal")
    expect(ups.get_by_role("row").nth(1)).to_contain_text(re.compile("min.* to .*min"))
    Person().shoot(bench, "design-tried")


def test_a_band_is_shown_only_of_what_was_tried(bench):
    tried = bench.get_by_role("region", name="Try the design")
    field = bench.get_by_label("North and east of corner 3", exact=True)
    before = field.input_value()
    field.fill("280, 285")
    field.press("Enter")
    expect(bench.locator(".map-band")).to_have_count(0)
    expect(tried).to_contain_text("The design is another now")
    bench.get_by_role("button", name=re.compile("^Undo")).click()
    expect(field).to_have_value(before)
    expect(bench.locator(".map-band")).to_have_count(1)
    expect(tried).not_to_contain_text("The design is another now")
    kept(bench)


def test_a_tried_design_has_its_band_in_3d_and_where_it_is_sent(bench):
    bench.get_by_role("link", name="Send it from Plan").click()
    expect(bench).to_have_url(re.compile(rf"/plan/{ROBOT}#plan-\d+$"))
    expect(
        bench.get_by_role("region", name="Legs of the plan").get_by_role("row")
    ).not_to_have_count(0)
    expect_scene(bench)
    bench.get_by_role("button", name="Layers and sliders").click()
    layers = bench.get_by_role("region", name="What the 3D view shows")
    layer = layers.get_by_role("checkbox", name="Band of flights")
    expect(layers.get_by_title("Nothing to show").get_by_text("Band of flights")).to_have_count(0)
    expect(layer).to_be_checked()
    layers.get_by_role("checkbox", name="Planned uncertainty").uncheck()
    shown = until_still(bench, lambda _: True)
    layer.uncheck()
    until_still(bench, lambda teal: teal < 0.7 * shown)
    layer.check()
    until_still(bench, lambda teal: teal > 0.9 * shown)
    Person().shoot(bench, "design-scene")
    bench.get_by_text("From above", exact=True).click()
    expect(bench.locator(".map-band")).to_have_count(1)
    bench.get_by_role("button", name=re.compile("^Send plan")).click()
    ahead = bench.get_by_role("region", name="Flown ahead")
    expect(ahead.get_by_label("Chances")).to_contain_text("Does not come back")
    expect(ahead).to_contain_text("Not rehearsed: ")
    Person().shoot(bench, "design-sent")


def until_still(page: Page, is_so: Callable[[int], bool]) -> int:
    """Wait for a picture of the 3D view like the one before it; return its bluish green pixels."""
    canvas = page.frame_locator("iframe").locator("canvas").first
    before = -1
    for _ in range(60):
        page.wait_for_timeout(1000)
        picture = Image.open(BytesIO(canvas.screenshot(timeout=120_000))).convert("RGB")
        red, green, blue = (np.asarray(picture)[..., k].astype(int) for k in range(3))
        teal = int(np.sum((green > red + 25) & (blue > red + 15) & (green > blue)))
        if abs(teal - before) <= 0.05 * teal and is_so(teal):
            return teal
        before = teal
    raise AssertionError(f"the 3D view has {before} bluish green pixels")
