"""Ann and Ben at two browsers with one log book, from the first entry to a signed hand-over."""

import re
import time
from io import BytesIO

import pytest
from PIL import Image
from playwright.sync_api import Locator, Page, expect

from tests.browser.crew import name_of, second_pilot
from tests.browser.figure import Journey
from tests.browser.walk import CHROMIUM, SHOTS, expect_scene, hold, open_page

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]
LOOKS = (("wide", 1440, "dark"), ("tablet", 768, "day"), ("phone", 360, "night-red"),
         ("phone", 360, "day"))  # fmt: skip


def look(page: Page, name: str, part: Locator | None = None) -> None:
    """Take pictures in every theme and at every width, and see that nothing is cut sideways."""
    shown = page if part is None else part
    before = page.viewport_size
    for size, width, theme in LOOKS:
        page.set_viewport_size({"width": width, "height": 900})
        page.evaluate("theme => (document.documentElement.dataset.theme = theme)", theme)
        if part is not None and part.locator("iframe").count() and theme != "night-red":
            expect_scene(page)  # at night it is of one hue, which looks empty to it
        shown.screenshot(path=SHOTS / f"{name}-{size}-{theme}.png", timeout=240_000)
        for area in ("header", "main"):
            wide = page.evaluate(f"document.querySelector('{area}').scrollWidth - innerWidth")
            assert wide <= 0, (name, size, area)
    page.evaluate("document.documentElement.dataset.theme = 'dark'")
    if before is not None:
        page.set_viewport_size(before)


def article(page: Page, text: str) -> Locator:
    return page.get_by_role("article").filter(has_text=text)


def written(page: Page, text: str, *, about: str = "") -> None:
    form = page.get_by_role("form", name="Write in the log book")
    form.get_by_role("textbox", name="Write in the log book").fill(text)
    if about:
        more = form.get_by_role("button", name="Time and tags")
        if more.is_visible():
            more.click()
        form.get_by_label("About").select_option(label=about)
    form.get_by_role("textbox", name="Write in the log book").press("Control+Enter")
    expect(article(page, text).first).to_be_visible()


def picture() -> bytes:
    file = BytesIO()
    Image.linear_gradient("L").save(file, "PNG")
    return file.getvalue()


def edit_at_once(ann: Page, ben: Page) -> None:
    """Ben begins to change an entry that Ann changes meanwhile: he is shown it before he writes."""
    article(ben, "Ballast set.").get_by_role("button", name="Change").click()
    article(ann, "Ballast set.").get_by_role("button", name="Change").click()
    changing = re.compile("^Change entry-")
    ann.get_by_role("form", name=changing).get_by_role("textbox", name=changing).fill(
        "Ballast set to 40 g."
    )
    ann.get_by_role("form", name=changing).get_by_role("textbox", name=changing).press(
        "Control+Enter"
    )
    expect(article(ann, "Ballast set to 40 g.")).to_be_visible()
    told = ben.get_by_role("alert", name="Changed by somebody else")
    expect(told).to_contain_text("Ballast set to 40 g.")
    field = ben.get_by_role("form", name=changing).get_by_role("textbox", name=changing)
    field.fill("Ballast set to 42 g.")
    field.press("Control+Enter")
    expect(told).to_be_visible()
    expect(article(ann, "Ballast set to 40 g.")).to_be_visible()
    told.get_by_role("button", name="Write mine as the next version").click()
    for page in (ann, ben):
        expect(article(page, "Ballast set to 42 g.")).to_contain_text("3 versions")


def hand_over(ann: Page, ben: Page, me: str) -> None:
    """Ann signs and leaves, Ben signs and takes over."""
    for page in (ann, ben):
        page.get_by_role("group", name="Show").get_by_text("Hand-over").click()
    standing = ann.get_by_role("region", name="Hand-over")
    expect(standing).to_contain_text("Open checklists")
    expect(standing).to_contain_text("A hook or a line is at hand")
    look(ann, "log-handover")
    ann.get_by_label("Wind, m/s").fill("4.5")
    ann.get_by_label("Sky").select_option("overcast")
    ann.get_by_label("Remarks").fill("The *hook* is with the boat.")
    hold(ann, re.compile("^Sign .* entries and leave"))
    waiting = ben.get_by_role("button", name=re.compile("^Read page-"))
    expect(waiting).to_be_visible()
    expect(ann.get_by_role("button", name="Begin my watch")).to_be_visible()
    waiting.click()
    page = ben.get_by_role("region", name="Signed page", exact=True)
    expect(page).to_contain_text("wind 4.5 m/s, overcast")
    expect(page).to_contain_text("A hook or a line is at hand")
    page.get_by_role("button", name=re.compile(f"^Sign .* and take over from {me}")).click()
    expect(page).to_contain_text("taken over by ben")
    look(ben, "log-page")


def test_two_people_keep_one_log_book_and_hand_their_watch_over(browser, calm, screen):
    demo, ann, journey = calm, screen, Journey("log-book")
    me = name_of(ann)
    with second_pilot(browser, demo, ann) as ben:
        csrf = ann.evaluate("fetch('/api/session').then(a => a.json()).then(a => a.csrf_token)")
        begun = ann.request.post(
            f"{demo.url}/api/robots/mini-1/checklists",
            data={"template": "pre_dive_tank"},
            headers={"X-CSRF-Token": csrf},
        )
        assert begun.status == 201, begun.text()
        open_page(ann, demo, "/robot/mini-1")
        lists = ann.get_by_role("region", name="Checklists of mini-1")
        lists.get_by_role("button", name=re.compile("^Pre-dive, tank")).click()
        expect(lists).to_contain_text("A hook or a line is at hand")
        look(ann, "checklist", lists)
        for page in (ann, ben):
            open_page(page, demo, "/log#book")
        ann.get_by_role("group", name="Show").get_by_text("Hand-over").click()
        ann.get_by_role("button", name="Begin my watch").click()
        expect(ann.get_by_role("button", name="End my watch without a page")).to_be_visible()
        ann.get_by_role("group", name="Show").get_by_text("Log book").click()

        # An entry is seen by the other at once, a picture with it.
        form = ann.get_by_role("form", name="Write in the log book")
        form.locator("input[type=file]").set_input_files(
            {"name": "pump.png", "mimeType": "image/png", "buffer": picture()}
        )
        expect(form.get_by_role("img", name="pump.png")).to_be_visible()
        at = time.monotonic()
        written(ann, "Ballast set.", about="mini-1")
        theirs = article(ben, "Ballast set.")
        expect(theirs).to_be_visible()
        journey.tell("1", "seen by the other at once", f"after {time.monotonic() - at:.1f} s")
        image = theirs.get_by_role("img", name="pump.png")
        expect(image).to_be_visible()
        assert image.evaluate("each => each.naturalWidth") == 256
        written(ben, "Water is clear.")
        expect(article(ann, "Water is clear.")).to_be_visible()

        edit_at_once(ann, ben)
        look(ann, "log-book")
        hand_over(ann, ben, me)

        # What is signed is corrected, never changed.
        for page in (ann, ben):
            page.get_by_role("group", name="Show").get_by_text("Log book").click()
        signed = article(ben, "Ballast set to 42 g.")
        expect(signed).to_contain_text("signed, page-")
        expect(signed.get_by_role("button", name="Change")).to_have_count(0)
        signed.get_by_role("button", name="Correct").click()
        form = ben.get_by_role("form", name=re.compile("^Correct entry-"))
        form.get_by_role("textbox", name=re.compile("^Correct entry-")).fill("It was 45 g.")
        form.get_by_role("textbox", name=re.compile("^Correct entry-")).press("Control+Enter")
        expect(article(ann, "Ballast set to 42 g.")).to_contain_text("corrected by entry-")
        expect(article(ann, "It was 45 g.")).to_contain_text("corrects entry-")

        # The entry opens the replay of its moment.
        article(ann, "Ballast set to 42 g.").get_by_role("link", name="Open this moment").click()
        replay = ann.get_by_role("region", name="Replay")
        expect(replay).to_contain_text("not live")
        expect(ann).to_have_url(re.compile(r"[?]at="))
        replay.get_by_role("button", name="Back to live").click()
        expect(replay).to_have_count(0)

        # The report: one file, which prints.
        open_page(ann, demo, "/log#book")
        with ann.context.expect_page() as opened:
            ann.get_by_label("Report").select_option(label="the last day")
        report = opened.value
        report.wait_for_load_state()
        for words in ("Ballast set to 42 g.", "It was 45 g.", "taken over by", "Depth, m"):
            expect(report.locator("body")).to_contain_text(words)
        assert report.evaluate("performance.getEntriesByType('resource').length") == 0
        pages = report.pdf(path=str(SHOTS / "log-report.pdf"), prefer_css_page_size=True)
        assert pages.startswith(b"%PDF-")
        report.emulate_media(media="print")
        report.set_viewport_size({"width": 690, "height": 1000})
        report.screenshot(path=SHOTS / "log-report.png", full_page=True)
        wide = report.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert wide <= 0, "nothing is cut at the edge of the paper"
        report.close()
