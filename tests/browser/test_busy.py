"""A pilot's four clicks on a machine of which something else has half: Plan, Plan, Send, hold."""

import os
import re
import subprocess
import sys

import pytest
from playwright.sync_api import expect

from tests.browser.walk import CHROMIUM, browser_page, hold
from tests.e2e.demo import Demo

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

BUSY = "import os\nos.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\nwhile True: pass"
"""Keeps to one core, so that the others are the demo's."""
PROVED = re.compile(r"Running\s*\d\d:\d\d:\d\dZ")


@pytest.fixture
def neighbour():
    """A process that never rests, on one of the machine's cores."""
    process = subprocess.Popen([sys.executable, "-c", BUSY])
    yield process
    assert process.poll() is None
    process.kill()
    process.wait()


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no way to keep to one core")
@pytest.mark.usefixtures("neighbour")
@pytest.mark.parametrize("speed", ["1", "5", "20"])
def test_four_clicks_bring_a_survey_to_its_robot(browser, tmp_path, speed):
    with Demo(tmp_path, "--speed", speed) as demo, browser_page(browser, demo) as page:
        plan = four_clicks(page)
        ladder = page.get_by_role("list", name="State of the plan")
        expect(ladder).to_contain_text(PROVED)
        rehearsal = page.get_by_role("region", name="Rehearsal of the plan")
        expect(rehearsal.get_by_role("status")).to_have_text("Rehearsed")
        told = told_of(page, demo)
    assert told["plan"]["state"] in {"running", "done"}, told["plan"]["message"]
    assert told["plan"]["id"] == f"plan-{plan}"
    assert told["faults"] == []


def four_clicks(page):
    """Return the number of the plan that was sent."""
    page.get_by_role("navigation", name="Pages").get_by_role("link", name="Plan").click()
    page.get_by_role("button", name="Plan a survey for mini-1").click()
    send = page.get_by_role("button", name=re.compile("^Send plan [0-9]+ to mini-1 …"))
    expect(send).to_be_enabled()
    send.click()
    button = page.get_by_role("button", name=re.compile("^Send plan [0-9]+ to mini-1 by radio[.]"))
    expect(button).to_be_enabled()
    plan = re.search("[0-9]+", button.inner_text())[0]
    hold(page, re.compile("^Send plan [0-9]+ to mini-1 by radio[.]"))
    return plan


def told_of(page, demo):
    """Return what the station says that came of it; a robot that lags is another matter."""

    def get(path):
        return page.request.get(f"{demo.url}{path}").json()

    [robot] = [each for each in get("/api/robots") if each["id"] == "mini-1"]
    events = get("/api/events?limit=1000")["events"]
    return {
        "plan": get(f"/api/plans/{robot['plan_id']}"),
        "faults": [each["text"] for each in events if is_fault(each)],
    }


def is_fault(event):
    what = event["kind"].split(".")[0]
    return what in {"plan", "mission", "command", "transfer"} and event["level"] != "info"
