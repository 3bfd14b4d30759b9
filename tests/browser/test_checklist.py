"""A pre-dive checklist on a phone: what the robot tells, what a thumb ticks, the depth zeroed."""

import pytest
from playwright.sync_api import expect

from tests.browser.walk import CHROMIUM, open_page

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]
THUMB_PX = 44


def test_a_pre_dive_list_is_ticked_completed_and_the_depth_zeroed_on_a_phone(screen, calm):
    screen.set_viewport_size({"width": 360, "height": 780})
    open_page(screen, calm, "/robot/mini-1")
    panel = screen.get_by_label("Checklists of", exact=False).first
    panel.get_by_role("button", name="Pre-dive, tank").first.click()
    screen.get_by_role("button", name="Begin Pre-dive, tank").click()
    screen.get_by_role("button", name="Zero the depth").click()
    expect(panel.get_by_text("what its depth sensor reads now is the surface")).to_be_visible()
    ticks = panel.get_by_role("checkbox", checked=False)
    for name in ("The hull is closed", "The robot floats level", "Surface now was tried", "Nobody"):
        tick = ticks.and_(panel.get_by_role("checkbox", name=name))
        box = tick.bounding_box()
        assert box is not None
        assert min(box["width"], box["height"]) >= THUMB_PX
        tick.click()
        expect(panel.get_by_role("checkbox", name=name)).to_be_checked()
    screen.get_by_role("button", name="Complete Pre-dive, tank").click()
    expect(panel.get_by_text("completed it").first).to_be_visible()
