"""A new person: the tour by keyboard, the manual with its search, and help on a field."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.test_look import SIZES
from tests.browser.test_look_everywhere import LOOK, THEMES, faults_of_axe
from tests.browser.walk import CHROMIUM, SHOTS, open_page
from tests.e2e.demo import ROOT
from webui.manual import address, read_manual

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(900),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

CHAPTERS = [address(chapter.key) for chapter in read_manual(ROOT / "docs" / "manual")]
PANES = ["Fleet", "Robot", "Surface now", "Plan", "Log"]
APART = """([card, anchor]) => {
  const [a, b] = [card, anchor].map(each => each.getBoundingClientRect());
  const inside = a.left >= 0 && a.top >= 0 && a.right <= innerWidth && a.bottom <= innerHeight;
  return inside && (a.right <= b.left || b.right <= a.left || a.bottom <= b.top
    || b.bottom <= a.top);
}"""


@pytest.fixture
def newcomer(browser, screen):
    """A browser of somebody who is signed in and was not offered the tour yet."""
    context = browser.new_context(storage_state=screen.context.storage_state())
    context.set_default_timeout(120_000)
    page = context.new_page()
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.add_init_script("sessionStorage.began ??= (localStorage.clear(), '1')")
    yield page
    context.close()
    assert faults == []


@pytest.mark.parametrize("size", SIZES, ids=["wide", "tablet", "phone"])
def test_the_tour_goes_through_the_five_panes_by_keyboard_alone(newcomer, calm, size):
    newcomer.set_viewport_size({"width": size[0], "height": size[1]})
    open_page(newcomer, calm, "/")
    offer = newcomer.get_by_role("button", name="Start the tour")
    expect(offer).not_to_be_focused()
    offer.focus()
    newcomer.keyboard.press("Enter")
    card = newcomer.get_by_role("dialog")
    for number, pane in enumerate(PANES, 1):
        expect(card.get_by_text(f"Step {number} of 5")).to_be_visible()
        expect(card.get_by_role("heading", name=re.compile(f"^{pane}:"))).to_be_visible()
        expect(card).to_be_focused()
        stand_beside(newcomer, card, pane)
        button = newcomer.get_by_role("button", name=re.compile("Surface mini-1 now"))
        assert newcomer.evaluate(APART, [card.element_handle(), button.element_handle()])
        SHOTS.mkdir(parents=True, exist_ok=True)
        newcomer.screenshot(path=SHOTS / f"tour-{number}-{size[0]}.png")
        if number < len(PANES):
            newcomer.keyboard.press("ArrowRight")
    newcomer.keyboard.press("ArrowLeft")
    expect(card.get_by_text("Step 4 of 5")).to_be_visible()
    newcomer.keyboard.press("Escape")
    expect(card).to_have_count(0)


ANCHORS = {"Fleet": "facts", "Robot": "gauges", "Surface now": "surface", "Plan": "plan",
           "Log": "log"}  # fmt: skip


def stand_beside(page, card, pane):
    """Wait until the card stands in the window and beside what it explains."""
    anchor = page.locator(f'[data-tour="{ANCHORS[pane]}"]').first
    expect(anchor).to_be_in_viewport()
    page.wait_for_function(APART, arg=[card.element_handle(), anchor.element_handle()])


def test_the_tour_is_offered_once_and_can_be_begun_again(newcomer, calm):
    open_page(newcomer, calm, "/")
    newcomer.get_by_role("button", name="Not now").click()
    expect(newcomer.get_by_text("New here?")).to_have_count(0)
    open_page(newcomer, calm, "/")
    expect(newcomer.get_by_role("article").first).to_be_visible()
    expect(newcomer.get_by_text("New here?")).to_have_count(0)
    newcomer.get_by_role("button", name="Person menu").click()
    newcomer.get_by_role("button", name="Tour", exact=True).click()
    expect(newcomer.get_by_text("Step 1 of 5")).to_be_visible()


def test_whoever_goes_elsewhere_has_ended_the_tour(newcomer, calm):
    open_page(newcomer, calm, "/")
    newcomer.get_by_role("button", name="Start the tour").click()
    expect(newcomer.get_by_text("Step 1 of 5")).to_be_visible()
    newcomer.get_by_role("link", name="Data", exact=True).click()
    expect(newcomer.get_by_role("dialog")).to_have_count(0)


def test_the_manual_is_read_and_searched_without_a_sign_in(browser, calm):
    page = browser.new_context().new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(f"{calm.url}/help")
    expect(page.get_by_role("heading", name="Operator's manual")).to_be_visible()
    page.keyboard.press("/")
    field = page.get_by_role("searchbox", name="Search the manual")
    expect(field).to_be_focused()
    field.fill("robot is not heard")
    found = page.get_by_role("region", name="Found")
    expect(found.get_by_role("link").first).to_have_text("A robot is not heard")
    field.fill("overdue")
    expect(found.get_by_role("link").first).to_have_text("A robot is overdue")
    found.get_by_role("link").first.click()
    expect(page).to_have_url(f"{calm.url}/help/troubleshooting#a-robot-is-overdue")
    expect(page.get_by_role("heading", name="A robot is overdue")).to_be_in_viewport()
    page.get_by_role("searchbox").fill("zeppelin")
    expect(page.get_by_text("Nothing in the manual has these words.")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.get_by_role("heading", name="Troubleshooting")).to_be_visible()
    assert [url for url in asked if not url.startswith(calm.url)] == []
    page.context.close()


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("size", [SIZES[0], SIZES[2]], ids=["wide", "phone"])
def test_no_chapter_has_a_fault(browser, calm, theme, size):
    page = browser.new_context(viewport={"width": size[0], "height": size[1]}).new_page()
    said: list[str] = []
    page.on("console", lambda line: said.append(line.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.add_init_script(
        f"localStorage.setItem('grace.preference', JSON.stringify({{ theme: '{theme}' }}))"
    )
    found = {}
    for path in CHAPTERS:
        page.goto(f"{calm.url}{path}")
        expect(page.get_by_role("searchbox")).to_be_visible()
        assert page.evaluate("document.documentElement.dataset.theme") == theme
        cut = [each for each in page.evaluate(LOOK) if not each.startswith("no visible label")]
        if faults := [*cut, *faults_of_axe(page)]:
            found[path] = faults
    page.screenshot(path=SHOTS / f"manual-{theme}-{size[0]}.png")
    assert found == {}
    assert said == []
    page.context.close()


def test_a_field_explains_itself_to_fingers_and_to_the_keyboard(screen, calm):
    screen.set_viewport_size({"width": 360, "height": 780})
    open_page(screen, calm, "/plan/mini-1")
    field = screen.get_by_label("Total energy budget")
    field.focus()
    screen.keyboard.press("Shift+Tab")
    mark = screen.get_by_role("button", name="Help").filter(visible=True)
    focused = mark.and_(screen.locator(":focus"))
    expect(focused).to_have_attribute("aria-expanded", "false")
    screen.keyboard.press("Enter")
    bubble = screen.locator(".bubble")
    expect(bubble).to_contain_text(re.compile("energy", re.IGNORECASE))
    expect(bubble).to_be_in_viewport(ratio=1)
    screen.keyboard.press("Escape")
    expect(bubble).to_have_count(0)


def test_the_first_stop_of_the_keyboard_leads_past_the_header(screen, calm):
    open_page(screen, calm, "/log")
    screen.keyboard.press("Tab")
    expect(screen.get_by_role("link", name="To the page")).to_be_focused()
    screen.keyboard.press("Enter")
    expect(screen.get_by_role("main")).to_be_focused()


def test_the_person_menu_opens_the_chapter_of_the_page_and_gives_the_keyboard_back(screen, calm):
    screen.set_viewport_size({"width": 1600, "height": 950})
    open_page(screen, calm, "/map/mini-1")
    menu = screen.get_by_role("button", name="Person menu")
    menu.focus()
    screen.keyboard.press("Enter")
    manual = screen.get_by_role("link", name="Manual", exact=True)
    expect(manual).to_have_attribute("href", "/help/maps")
    manual.focus()
    screen.keyboard.press("Escape")
    expect(manual).to_have_count(0)
    expect(menu).to_be_focused()
