"""A robot follows a target in a real browser: held, lost in silence, found again, brought up."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.walk import CHROMIUM, hold, open_page, shoot
from tests.e2e.demo import LASTING

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

ENDED = {"done", "failed", "cancelled", "superseded"}


def is_free(station):
    """Whether mini-1 waits at the surface with no plan and no survey to go on with."""
    [robot] = [each for each in station.get("/api/robots") if each["id"] == "mini-1"]
    missions = station.get("/api/robots/mini-1/missions")
    return robot["mode"] == "idle" and all(
        each["state"] in {"done", "stopped", "failed"} for each in missions
    )


@pytest.fixture(scope="module", autouse=True)
def free(station):
    """An earlier walk may have left mini-1 on its way, and its own settings."""
    station.wait("robot without a mission", lambda: is_free(station), 240.0)
    station.patch("/api/config/planner", LASTING, robot="mini-1")


@pytest.fixture(autouse=True)
def kept_home(station):
    """No walk leaves mini-1 circling."""
    yield
    plans = station.get("/api/robots/mini-1/plans")
    if any(each["kind"] == "track_target" and each["state"] not in ENDED for each in plans):
        station.post("/api/robots/mini-1/commands", {"kind": "surface"})


def fill_in(page):
    """A silence soon counts as a loss, and the time is long enough for all that follows."""
    for group in ("Ranging", "Motion"):
        page.locator("summary", has_text=group).click()
    page.get_by_label("Lost after").fill("30")
    page.get_by_label("Give up after").fill("7000")
    page.get_by_label("Duration").fill("7200")


def test_a_target_is_followed_lost_in_silence_and_found_again(page, demo):
    open_page(page, demo, "/track/mini-1")
    expect(page.get_by_text("mini-1 follows no target")).to_be_visible()
    expect(page.get_by_text("It circles because from a straight course")).to_be_visible()
    teaching = page.get_by_label(re.compile("Teaching: leave the barrier off"))
    teaching.check()
    expect(page.get_by_text("expect the estimate to go wrong")).to_be_visible()
    teaching.uncheck()
    fill_in(page)
    page.get_by_role("button", name="Plan to follow for mini-1").click()

    page.get_by_role("button", name=re.compile("^Send plan [0-9]+ to mini-1 …")).click()
    hold(page, re.compile("Send plan [0-9]+ to mini-1 by radio"))
    band = page.get_by_role("region", name="Hold on the target")
    expect(band).to_contain_text(re.compile("[Hh]as its target"), timeout=240_000)
    expect(band).to_contain_text("Error of the estimate")
    expect(page.get_by_role("group", name=re.compile("Test tank from above"))).to_contain_text(
        "estimate"
    )
    for title in ("How well the target can be known", "Turn rate"):
        expect(page.get_by_role("img", name=re.compile(f"{title} of mini-1"))).to_be_visible()
    shoot(page, "track")

    hold(page, re.compile("Tell mini-1 to stop pinging"))
    order = page.get_by_role("list", name="Progress of the order to ping")
    expect(order).to_contain_text(re.compile(r"Done\s*\d\d:\d\d:\d\dZ"), timeout=240_000)
    expect(band).to_contain_text(re.compile("[Ll]ost its target"), timeout=240_000)
    shoot(page, "track-lost")

    page.get_by_role("button", name="Let mini-1 ping again").click()
    expect(band).to_contain_text(re.compile("[Hh]as its target"), timeout=240_000)

    open_page(page, demo, "/robot/mini-1")
    line = page.get_by_role("region", name="Target", exact=True)
    expect(line).to_contain_text(re.compile("target", re.IGNORECASE))
    line.get_by_role("link").click()
    expect(page).to_have_url(f"{demo.url}/track/mini-1")
    hold(page, re.compile("Surface mini-1 now"))
    ladder = page.get_by_role("list", name="State of the plan")
    expect(ladder).to_contain_text("Cancelled", timeout=240_000)
