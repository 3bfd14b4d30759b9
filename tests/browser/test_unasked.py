"""The live stream tells a page all that changes: the page itself asks for nothing again."""

import json
import re
from collections import Counter
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import expect

from tests.browser.walk import CHROMIUM, hold, open_page, requests_of

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

MINUTES = 5
"""Tried until one is idle: on a busy machine a robot may seem silent, or the station."""
REQUESTS = 2


@pytest.mark.walk
@pytest.mark.timeout(1200)
def test_a_page_of_an_idle_fleet_asks_for_nothing(screen, calm):
    fleet, robot = screen, screen.context.new_page()
    told: list[str] = []
    for page in (fleet, robot):
        note_changes(page, told)
    open_page(fleet, calm, "/")
    open_page(robot, calm, "/robot/mini-1")
    expect(robot.get_by_text("Idle at the surface")).to_be_visible()
    expect(robot.frame_locator("iframe").locator("canvas").first).to_be_visible(timeout=240_000)
    for page in (fleet, robot):
        page.wait_for_load_state("networkidle")
    for _ in range(MINUTES):
        told.clear()
        with requests_of(fleet) as by_fleet, requests_of(robot) as by_robot:
            robot.wait_for_timeout(60_000)
        if not told:
            break
    robot.close()
    assert told == [], "the station had something to tell in every minute"
    assert len(by_robot) <= REQUESTS, Counter(by_robot).most_common()
    assert len(by_fleet) <= REQUESTS, Counter(by_fleet).most_common()


def note_changes(page, told):
    """Note what the stream tells of the whole station to read again; opened anew, everything.

    What it tells of a robot, such as that its track grew, is no reason here to ask for anything.
    """

    def note(frame):
        told.extend(each for each in json.loads(frame)["changed"] if "/" not in each)

    def follow(socket):
        if urlsplit(socket.url).path == "/api/live":
            told.append("everything")
            socket.on("framereceived", note)

    page.on("websocket", follow)


def test_the_levels_of_an_order_reach_the_page_by_the_live_stream_alone(screen, calm):
    open_page(screen, calm, "/")
    with requests_of(screen) as asked:
        hold(screen, re.compile("Surface mini-1 now"))
        order = screen.get_by_role("list", name="Progress of the order")
        expect(order).to_contain_text(re.compile(r"Done\s*\d\d:\d\d:\d\dZ"))
    assert "POST /api/robots/mini-1/commands" in asked
    assert [each for each in asked if each.startswith("GET /api/commands/")] == []
