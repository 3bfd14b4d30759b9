"""A new signing key as an administrator sees it: after a warning, once, and never again."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.walk import CHROMIUM, SHOTS, hold, open_page

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

SIZES = {"wide": (1600, 950), "phone": (360, 780)}
THEMES = ("dark", "day", "night-red")


def test_the_demos_radios_are_signed_and_a_new_key_is_shown_once(screen, calm):
    open_page(screen, calm, "/settings")
    panel = screen.get_by_role("region", name="Signed radio", exact=True)
    expect(panel.get_by_text("Signed", exact=True)).to_have_count(2)
    expect(screen.get_by_text("not signed", exact=True)).to_have_count(0)

    panel.get_by_role("button", name="New key for grace-1").click()
    expect(panel).to_contain_text("it takes no order by radio, not even to surface")
    hold(screen, re.compile("New key for grace-1. Press and hold"))
    shown = panel.get_by_label("Signing key of grace-1")
    expect(shown).to_contain_text("it is not shown again")
    key = "".join(shown.locator(".key span").all_inner_texts())
    assert re.fullmatch("[0-9a-f]{64}", key)
    assert (calm.data / "secret" / "signing-grace-1").read_text() == key
    code = shown.get_by_role("img", name="QR code of the key of grace-1")
    for size, (width, height) in SIZES.items():
        screen.set_viewport_size({"width": width, "height": height})
        for theme in THEMES:
            screen.evaluate("theme => { document.documentElement.dataset.theme = theme }", theme)
            shown.scroll_into_view_if_needed()
            box = code.bounding_box()
            assert box is not None
            assert box["width"] == pytest.approx(box["height"])
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= width
            assert screen.evaluate("document.documentElement.scrollWidth") <= width
            screen.screenshot(path=SHOTS / f"signing-key-{size}-{theme}.png", timeout=240_000)

    screen.set_viewport_size({"width": 1600, "height": 950})
    screen.reload()
    expect(panel.get_by_text("Signed", exact=True)).to_have_count(2)
    assert key not in screen.content()
    open_page(screen, calm, "/robot/mini-1")
    expect(screen.locator("dd", has_text=re.compile("^signed$"))).to_be_visible()


def test_signing_that_is_turned_off_is_said_on_every_page_that_shows_the_link(screen, calm):
    open_page(screen, calm, "/settings")
    panel = screen.get_by_role("region", name="Signed radio", exact=True)
    panel.get_by_role("button", name="Turn signing off for grace-1").click()
    expect(panel).to_contain_text("Only for a robot that cannot sign")
    hold(screen, re.compile("Turn signing off for grace-1. Press and hold"))
    expect(panel).to_contain_text("Not signed: turned off")
    links = screen.get_by_role("region", name="Robots and links")
    expect(links.get_by_text("not signed", exact=True)).to_be_visible()
    open_page(screen, calm, "/robot/grace-1")
    expect(screen.locator("dd", has_text=re.compile("^not signed$"))).to_be_visible()
