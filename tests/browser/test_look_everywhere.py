"""What holds on every page: nothing cut, what scrolls is announced, all of it is reached by
keyboard, and axe-core finds no fault."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.test_look import SIZES
from tests.browser.walk import CHROMIUM, open_page
from tests.e2e.demo import ROOT

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(900),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

AXE = ROOT / "webui/app/node_modules/axe-core/axe.min.js"
PAGE_SOURCES = ROOT / "webui/app/src/page"
CONTROL = ("settings", "polar", "what-if", "identify", "parameters")


def parts_of(page: str) -> tuple[str, ...]:
    """Return the parts of a page that its address names."""
    if page == "control":
        return CONTROL
    if page == "camera":
        return ("list", "tags")
    if page != "log":
        return ()
    (tabs,) = re.findall(r"TABS = \[([^]]+)\]", (PAGE_SOURCES / "Log.svelte").read_text())
    return tuple(re.findall(r"'([\w-]+)'", tabs))


def pages_of_the_app() -> list[str]:
    """Return the address of every page that the app's own table has, and of its parts."""
    table = (PAGE_SOURCES / "route.ts").read_text().split("as const")[0]
    entries = re.findall(r"\{\s*key: '(\w+)'[^}]*?hasRobot: (true|false)", table)
    found: list[str] = []
    for key, has_robot in entries:
        path = "/" if key == "fleet" else f"/{key}" + ("/mini-1" if has_robot == "true" else "")
        found += [f"{path}#{part}" for part in parts_of(key)] or [path]
    return found


PAGES = pages_of_the_app()
THEMES = ("dark", "day", "night-red")
COUNTED = ("moderate", "serious", "critical")

LOOK = """() => {
  const faults = [];
  const told = each => `${each.className} "${each.innerText.slice(0, 60)}"`;
  for (const each of document.querySelectorAll('body *')) {
    if (each.closest('svg, canvas, iframe, .leaflet-container, .visually-hidden')) continue;
    const box = each.getBoundingClientRect(), style = getComputedStyle(each);
    if (!box.width || !box.height || style.visibility === 'hidden') continue;
    const text = (each.innerText ?? '').trim();
    const isCut = ['hidden', 'clip'].includes(style.overflowX)
      && each.scrollWidth > each.clientWidth + 1;
    const name = each.title || each.getAttribute('aria-label') || '';
    if (isCut && text && !name.includes(text)) faults.push(`cut: ${told(each)}`);
    if (each.tagName === 'SELECT') {
      const pen = document.createElement('canvas').getContext('2d');
      pen.font = style.font;
      const breadth = pen.measureText(each.selectedOptions[0]?.text ?? '').width;
      if (breadth > each.clientWidth - 24) faults.push(`cut choice: ${told(each)}`);
    }
    if (each.matches('select, input') && !each.labels?.length && !each.closest('td, li'))
      faults.push(`no visible label: ${told(each)} ${name}`);
    if (['auto', 'scroll'].includes(style.overflowX) && each.scrollWidth > each.clientWidth + 1
        && !(each.tabIndex === 0 && each.getAttribute('aria-label') && each.matches(
          '.more-left, .more-right')))
      faults.push(`scrolls unannounced: ${told(each)}`);
    if (each.matches('button:disabled, input:disabled, select:disabled') && !each.title
        && !each.getAttribute('aria-describedby')) faults.push(`says not why: ${told(each)}`);
    if (each.matches('.notice')) {
      const panel = each.closest('section.panel')?.getBoundingClientRect();
      if (panel && (box.left - panel.left < 6 || panel.right - box.right < 6))
        faults.push(`no margin: ${told(each)}`);
    }
  }
  if (document.documentElement.scrollWidth > innerWidth) faults.push('wider than the window');
  return faults;
}"""

MARK = """() => {
  const acts = 'a[href], button, input:not([type=hidden]), select, textarea, summary, '
    + '[role=button], [role=tab], [role=slider], [role=menuitem], [role=treeitem]';
  const isSeen = each => {
    const box = each.getBoundingClientRect();
    return box.width > 0 && box.height > 0 && !each.matches(':disabled') && !each.closest('[inert]')
      && each.checkVisibility({ visibilityProperty: true });
  };
  const oneStop = '[role=tablist], [role=toolbar], [role=radiogroup], [role=menu], [role=tree]';
  const isWithin = each => each.tabIndex < 0
    && each.closest(oneStop)?.querySelector('[tabindex="0"], :checked');
  const isOtherRadio = each => each.type === 'radio' && !each.checked
    && document.querySelector(`input[name="${CSS.escape(each.name)}"]`) !== null;
  const found = [...document.querySelectorAll(acts)]
    .filter(each => isSeen(each) && !isWithin(each) && !isOtherRadio(each));
  found.forEach((each, number) => { each.dataset.act = String(number); });
  const byPointer = [...document.querySelectorAll('body *')].filter(each => isSeen(each)
    && getComputedStyle(each).cursor === 'pointer'
    && !each.closest(`${acts}, label, [tabindex], .leaflet-container`));
  const told = each => `${each.tagName} ${each.className} "${(each.innerText ?? '').slice(0, 40)}"`;
  return [found.map(told), byPointer.map(told)];
}"""
"""Marks what acts; tells that, and what a pointer alone seems to reach. A group of radios or tabs
is one stop of the keyboard, its arrows do the rest."""

FOCUSED = """() => {
  const each = document.activeElement, style = getComputedStyle(each);
  const shows = each.tagName === 'IFRAME' || each === document.body
    || (style.outlineStyle !== 'none' && parseFloat(style.outlineWidth) > 0)
    || style.boxShadow !== 'none';
  return [each.tagName, each.dataset.act ?? null, shows ? null : each.outerHTML.slice(0, 80)];
}"""
STOPS_MAX = 600


@pytest.mark.parametrize("size", [SIZES[0], SIZES[2]], ids=["wide", "phone"])
def test_every_action_is_reached_by_keyboard_and_shows_it(screen, calm, size):
    screen.set_viewport_size({"width": size[0], "height": size[1]})
    found = {}
    for path in PAGES:
        show(screen, calm, path)
        if faults := faults_of_keyboard(screen):
            found[path] = faults
    assert found == {}


def faults_of_keyboard(page):
    """Go through a page by Tab; return what it does not reach, or reaches without showing it."""
    acts, by_pointer = page.evaluate(MARK)
    reached, faults = set(), [f"by pointer alone: {one}" for one in by_pointer]
    for _ in range(STOPS_MAX):
        page.keyboard.press("Tab")
        tag, act, hidden = page.evaluate(FOCUSED)
        if tag == "BODY" or act in reached:
            break
        if act is not None:
            reached.add(act)
        if hidden is not None:
            faults.append(f"no sign of the focus: {hidden}")
    missed = [one for number, one in enumerate(acts) if str(number) not in reached]
    return faults + [f"not reached: {one}" for one in missed]


@pytest.mark.parametrize("size", SIZES, ids=["wide", "tablet", "phone"])
def test_no_page_cuts_words_or_scrolls_unannounced(screen, calm, size):
    screen.set_viewport_size({"width": size[0], "height": size[1]})
    found = {}
    for path in PAGES:
        show(screen, calm, path)
        if faults := screen.evaluate(LOOK):
            found[path] = faults
    assert found == {}


@pytest.mark.skipif(not AXE.exists(), reason="axe-core is not among the app's packages here")
@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("size", [SIZES[0], SIZES[2]], ids=["wide", "phone"])
def test_axe_finds_nothing_moderate_or_worse(screen, calm, theme, size):
    screen.set_viewport_size({"width": size[0], "height": size[1]})
    screen.evaluate(
        "theme => localStorage.setItem('grace.preference',"
        " JSON.stringify({ theme, view: 'above', robot: 'mini-1' }))",
        theme,
    )
    found = {}
    for path in PAGES:
        show(screen, calm, path)
        assert screen.evaluate("document.documentElement.dataset.theme") == theme
        if faults := faults_of_axe(screen):
            found[path] = faults
    assert found == {}


def faults_of_axe(page):
    """Return what axe-core finds on a page: impact, rule, and where."""
    page.evaluate(AXE.read_text())
    faults = page.evaluate(
        "axe.run({ exclude: [['iframe']] }, { resultTypes: ['violations'], iframes: false })"
        ".then(({ violations }) => violations.flatMap(({ id, impact, nodes }) =>"
        " nodes.map(({ html }) => [impact, id, html.slice(0, 160)])))"
    )
    return [fault for fault in faults if fault[0] in COUNTED]


def show(page, demo, path):
    """Open a page anew; one that differs by its section only would not be read again."""
    page.goto("about:blank")
    open_page(page, demo, path)
    expect(page.get_by_text("Loading the page.")).to_have_count(0)
    expect(page.get_by_role("status").get_by_text("Asking the station.")).to_have_count(0)
    page.wait_for_function("document.fonts.ready.then(() => true)")
