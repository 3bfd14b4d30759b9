"""A plan for a robot out of radio range: what it costs, every part of its way, and a pulled plug.

What the screen tells is held against REST; a sky that loses messages is flown under in tests/e2e.
"""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.walk import CHROMIUM, browser_page, hold, open_page, shoot
from tests.e2e.demo import LASTING, Demo

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]

ROBOT = "grace-1"
SESSIONS_MS = 300_000
"""Several sessions of the robot at the demo's speed: a lost message waits for another."""
CLOCK = r"\d\d:\d\d:\d\dZ"


@pytest.fixture(scope="module")
def far(tmp_path_factory):
    options = ("--speed", "50", "--far", "--satellite-loss", "0", "--robots", ROBOT)
    demo = Demo(tmp_path_factory.mktemp("far"), *options)
    yield demo
    demo.stop()


@pytest.fixture(scope="module")
def screen(browser, far):
    with browser_page(browser, far) as page:
        cookies = page.context.cookies()
        [cookie] = [each for each in cookies if each["name"].startswith("grace_session")]
        far.client.cookies.set(cookie["name"], cookie["value"])
        far.client.headers["X-CSRF-Token"] = far.get("/api/session")["csrf_token"]
        yield page


@pytest.fixture(scope="module")
def draft(far, screen):
    """A dive where the robot said by satellite that it floats."""
    del screen
    state = f"/api/robots/{ROBOT}/state"
    far.wait("first session", lambda: far.get(state)["position"] is not None, 240.0)
    north_m, east_m, _ = far.get(state)["position"]["ned_m"]
    down = {"kind": "dive", "end_ned": [north_m, east_m, 3.0]}
    up = {"kind": "dive", "end_ned": [north_m, east_m, 0.0]}
    wish = {
        "kind": "primitives",
        "legs": [down, up] * 3,
        "config": LASTING | {"max_uncertainty_m": 60.0},
    }
    plan = far.post(f"/api/robots/{ROBOT}/plans", wish)["id"]
    far.wait("draft", lambda: far.get(f"/api/plans/{plan}")["state"] == "draft", 90.0)
    return plan


@pytest.mark.usefixtures("draft")
def test_each_link_tells_its_state_and_the_strip_by_which_the_robot_was_heard(screen, far):
    open_page(screen, far, f"/robot/{ROBOT}")
    links = screen.get_by_role("region", name=f"Links of {ROBOT}")
    expect(links.get_by_role("switch")).to_have_count(3)
    expect(links).to_contain_text("Never heard")
    expect(links).to_contain_text(re.compile("of [0-9]+ credits sent today"))
    strip = screen.get_by_role("region", name="Robot in hand")
    expect(strip).to_contain_text("by RockBLOCK")


def test_a_plan_is_priced_before_it_is_sent_and_ticked_as_it_is_proved(screen, far, draft):
    name = draft.replace("-", " ")
    open_page(screen, far, f"/plan/{ROBOT}")
    screen.get_by_role("button", name=f"Send {name} to {ROBOT} …").click()
    summary = screen.get_by_role("region", name="Summary of what will be sent")
    quote = far.get(f"/api/plans/{draft}/satellite")
    expect(summary).to_contain_text("By satellite")
    expect(summary).to_contain_text(f"{quote['bytes']} B")
    expect(summary).to_contain_text(f"{quote['credits']} credit")
    expect(summary).to_contain_text("Earliest delivery")
    assert far.get(f"/api/robots/{ROBOT}/satellite")["outgoing"] == []
    shoot(screen, "send-summary")

    hold(screen, re.compile(f"Send {name} to {ROBOT} by satellite"))
    way = screen.get_by_role("region", name=f"Way of the plan to {ROBOT}")
    ladder = way.get_by_role("list", name="How far the plan has come")
    expect(ladder).to_contain_text(re.compile(rf"Queued\s*{CLOCK}"), timeout=240_000)
    expect(way.get_by_role("list", name="Parts")).to_contain_text(re.compile("sent"))
    shoot(screen, "transfer")

    expect(ladder).to_contain_text(re.compile(rf"Applied\s*{CLOCK}"), timeout=SESSIONS_MS)
    told = far.get(f"/api/plans/{draft}")
    assert told["state"] in {"on_board", "running", "done"}
    assert told["ladder"]["on_board_at"] is not None
    expect(ladder).to_contain_text(re.compile(rf"Queued\s*{CLOCK}\s*Radio\s*{CLOCK}"))


@pytest.mark.usefixtures("draft")
def test_every_message_can_be_traced_by_its_numbers(screen, far):
    open_page(screen, far, "/log#satellite")
    messages = screen.get_by_role("region", name="Satellite messages")
    number = messages.get_by_role("note").filter(has_text=re.compile(r"no\. \d+ from it")).first
    number.focus()
    expect(number.get_by_role("tooltip")).to_contain_text("MOMSN")
    expect(messages.get_by_text("Out", exact=True).first).to_be_visible()
    spent = far.get(f"/api/robots/{ROBOT}/satellite")["credits_today"]
    assert spent > 0
    expect(messages).to_contain_text(re.compile(r"[1-9]\d* of \d+ credits sent today"))
    shoot(screen, "log-satellite")


def test_a_plug_is_pulled_knowingly_and_put_back(screen, far):
    open_page(screen, far, f"/robot/{ROBOT}")
    links = screen.get_by_role("region", name=f"Links of {ROBOT}")
    plug = links.get_by_role("switch", name=re.compile("RockBLOCK"))
    plug.click()
    expect(links).to_contain_text("The station hands nothing more to RockBLOCK")
    assert is_plugged(far), "asking what it means pulls no plug"
    button = links.get_by_role("button", name=re.compile("Pull the plug of RockBLOCK"))
    button.scroll_into_view_if_needed()
    hold(screen, re.compile("Pull the plug of RockBLOCK"))
    expect(plug).to_have_attribute("aria-checked", "false")
    expect(links).to_contain_text("Unplugged")
    assert not is_plugged(far)
    plug.click()
    expect(plug).to_have_attribute("aria-checked", "true")
    assert is_plugged(far)


def is_plugged(far):
    links = far.get(f"/api/robots/{ROBOT}/links")
    [satellite] = [link for link in links if link["kind"] == "satellite"]
    return satellite["is_plugged"]


def test_accounts_show_what_came_and_never_a_password(screen, far):
    open_page(screen, far, "/settings")
    gateways = screen.get_by_role("region", name="Satellite gateways")
    expect(gateways).to_contain_text("Account stored")
    gateways.get_by_role("button", name="Change account").click()
    expect(gateways.get_by_label("Password")).to_have_value("")
    expect(gateways.get_by_label("User name")).not_to_have_value("")
    [account] = [
        each for each in far.get("/api/gateways")["gateways"] if each["kind"] == "rockblock"
    ]
    expect(gateways).to_contain_text(account["push_url"])
    assert account["accepted"] > 0
