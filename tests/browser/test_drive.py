"""A pilot drives the robot in the tank by keyboard and by the stick on the screen."""

import math
import re

import pytest
from playwright.sync_api import expect

from tests.browser.walk import CHROMIUM, SHOTS, hold, open_page

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

SIZES = {"1440": (1440, 900), "900": (900, 1100), "400": (400, 860)}
BEGIN = re.compile("Hold to drive .* by hand. Press and hold")


@pytest.fixture
def cockpit(screen, calm):
    screen.set_viewport_size({"width": 1440, "height": 900})
    open_page(screen, calm, "/drive/mini-1")
    expect(screen.get_by_role("button", name=BEGIN)).to_be_enabled()
    screen.bring_to_front()
    return screen


def begin(page):
    hold(page, BEGIN)
    expect(page.get_by_text("You drive mini-1")).to_be_visible()


def read(page, what):
    path = f"/api/robots/mini-1/{what}"
    return page.evaluate("path => fetch(path).then((answer) => answer.json())", path)


def place_of(page):
    return read(page, "state")["position"]["ned_m"]


def wait(page, holds):
    for _ in range(600):
        if holds():
            return
        page.wait_for_timeout(100)
    raise AssertionError("it never became true")


def acts_on(page, axis):
    return page.get_by_role("row", name=re.compile(f"^{axis}")).get_by_role("cell").nth(1)


def stop(page):
    page.get_by_role("button", name="Stop", exact=True).click()
    expect(page.get_by_text(re.compile("stopped"))).to_be_visible()
    expect(page.get_by_role("button", name=BEGIN)).to_be_enabled()


def shoot(page, name):
    for size, (width, height) in SIZES.items():
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_timeout(500)
        page.screenshot(path=SHOTS / f"{name}-{size}.png", timeout=240_000)
    for theme in ("day", "night-red", "dark"):
        page.evaluate("theme => (document.documentElement.dataset.theme = theme)", theme)
        page.screenshot(path=SHOTS / f"{name}-{theme}.png", timeout=240_000)


def test_keys_move_nothing_before_the_pilot_held_the_button(cockpit):
    cockpit.keyboard.down("w")
    expect(acts_on(cockpit, "Ahead")).to_have_text("no answer")
    cockpit.keyboard.up("w")
    assert read(cockpit, "state")["mode"] == "idle"
    shoot(cockpit, "drive-before")


def test_the_robot_swims_while_a_key_is_held_and_stops_when_it_is_let_go(cockpit):
    begin(cockpit)
    began = place_of(cockpit)
    cockpit.keyboard.down("w")
    expect(acts_on(cockpit, "Ahead")).to_have_text("60 %")
    wait(cockpit, lambda: math.dist(began[:2], place_of(cockpit)[:2]) > 0.1)
    shoot(cockpit, "drive-keys")
    cockpit.set_viewport_size({"width": 1440, "height": 900})
    cockpit.keyboard.up("w")
    expect(acts_on(cockpit, "Ahead")).to_have_text("0 %")
    expect(cockpit.get_by_role("link", name=re.compile("^by hand: "))).to_be_visible()
    stop(cockpit)


def test_who_holds_nothing_is_silent_and_drives_no_more_after_a_while(cockpit):
    begin(cockpit)
    cockpit.keyboard.down("w")
    expect(acts_on(cockpit, "Ahead")).to_have_text("60 %")
    cockpit.keyboard.up("w")
    expect(acts_on(cockpit, "Ahead")).to_have_text("0 %")
    expect(cockpit.get_by_text("hold nothing, so nothing is sent")).to_be_visible()
    cockpit.set_viewport_size({"width": 400, "height": 860})
    cockpit.screenshot(path=SHOTS / "drive-silent-400.png", timeout=240_000)
    cockpit.set_viewport_size({"width": 1440, "height": 900})
    expect(cockpit.get_by_text(re.compile("No stick came for 10 s|driven no more"))).to_be_visible()
    expect(cockpit.get_by_role("button", name=BEGIN)).to_be_enabled()


def test_the_stick_on_the_screen_turns_and_springs_back(cockpit):
    begin(cockpit)
    field = cockpit.get_by_role("img", name=re.compile("^Stick"))
    field.scroll_into_view_if_needed()
    box = field.bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    cockpit.mouse.move(*middle)
    cockpit.mouse.down()
    cockpit.mouse.move(middle[0] + 200, middle[1])
    expect(acts_on(cockpit, "To starboard")).to_have_text("60 %")
    shoot(cockpit, "drive-stick")
    cockpit.set_viewport_size({"width": 1440, "height": 900})
    cockpit.mouse.up()
    expect(acts_on(cockpit, "To starboard")).to_have_text("0 %")
    stop(cockpit)


GAMEPAD = """() => {
  const axes = [0, 0, 0, 0];
  const buttons = Array.from({ length: 16 }, () => ({ pressed: false, touched: false, value: 0 }));
  const pad = { axes, buttons, connected: true, id: 'Walk pad', index: 0, mapping: 'standard' };
  window.walkPad = pad;
  navigator.getGamepads = () => [{ ...pad, axes: [...axes], timestamp: performance.now() }];
  dispatchEvent(new Event('gamepadconnected'));
}"""
"""A gamepad by the standard mapping, as a browser shows it once a button was pressed."""


def test_a_gamepad_steers_and_its_second_button_stops(cockpit):
    cockpit.evaluate(GAMEPAD)
    begin(cockpit)
    expect(cockpit.get_by_text("Walk pad")).to_be_visible()
    began = place_of(cockpit)
    cockpit.evaluate("() => { walkPad.axes[1] = -1; }")
    expect(acts_on(cockpit, "Ahead")).to_have_text("60 %")
    expect(cockpit.get_by_role("img", name="Stick: ahead 60 %, to starboard 0 %")).to_be_visible()
    wait(cockpit, lambda: math.dist(began[:2], place_of(cockpit)[:2]) > 0.1)
    cockpit.evaluate("() => { walkPad.axes[1] = 0; walkPad.axes[0] = 0.5; }")
    expect(acts_on(cockpit, "Ahead")).to_have_text("0 %")
    expect(acts_on(cockpit, "To starboard")).not_to_have_text("0 %")
    shoot(cockpit, "drive-gamepad")
    cockpit.set_viewport_size({"width": 1440, "height": 900})
    cockpit.evaluate("() => { walkPad.axes[0] = 0; walkPad.buttons[1].pressed = true; }")
    expect(cockpit.get_by_text(re.compile("stopped"))).to_be_visible()
    cockpit.evaluate("() => { walkPad.buttons[1].pressed = false; }")
    expect(cockpit.get_by_role("button", name=BEGIN)).to_be_enabled()


def test_whoever_looks_elsewhere_sends_nothing_and_space_ends_it(cockpit):
    begin(cockpit)
    cockpit.keyboard.down("w")
    expect(acts_on(cockpit, "Ahead")).to_have_text("60 %")
    cockpit.evaluate("document.hasFocus = () => false; dispatchEvent(new Event('blur')); undefined")
    expect(cockpit.get_by_text("You look elsewhere")).to_be_visible()
    expect(acts_on(cockpit, "Ahead")).to_have_text("0 %")
    cockpit.evaluate("delete document.hasFocus; dispatchEvent(new Event('focus')); undefined")
    expect(cockpit.get_by_text("You drive mini-1")).to_be_visible()
    cockpit.keyboard.up("w")
    cockpit.keyboard.press("Space")
    expect(cockpit.get_by_text(re.compile("stopped"))).to_be_visible()


def test_leaving_the_page_ends_the_drive(cockpit, calm):
    begin(cockpit)
    cockpit.get_by_role("link", name="Fleet").click()
    wait(cockpit, lambda: read(cockpit, "drive")["state"] == "free")
    open_page(cockpit, calm, "/robot/mini-1")
    expect(cockpit.get_by_role("region", name="Drive by hand")).to_be_visible()
    shoot(cockpit, "drive-robot-page")
