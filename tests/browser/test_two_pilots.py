"""Two operators at two browsers, who want the same robot (journey J8 of the watch)."""

import re
import time

import pytest
from playwright.sync_api import expect

from tests.browser.crew import act, charge, name_of, second_pilot
from tests.browser.figure import Journey
from tests.browser.person import Person
from tests.browser.walk import CHROMIUM, ask_for_a_sure_plan, expect_done, hold, open_page

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(900),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]
SEND = re.compile("^Send plan [0-9]+ to mini-1 …")


def seconds(begun_s):
    return f"{time.monotonic() - begun_s:.1f} s"


def kept(page):
    keeping = page.get_by_role("status", name="Keeping of the design")
    expect(keeping).to_have_text(re.compile("Kept .*Z"))


def edit_one_design(ann, ben, demo, me, person):
    """Both draw the same mission; the one who comes second is shown what the first has done."""
    open_page(ann, demo, "/design/mini-1")
    ann.get_by_role("button", name=re.compile("^Lawnmower")).click()
    kept(ann)
    ben.goto(ann.url)
    kept(ben)
    deaf = re.compile("/api/designs/")
    ben.route(deaf, lambda route: route.abort())  # the moment in which he has not heard of it
    first, second = ann.get_by_label("Spacing, m"), ben.get_by_label("Heading, °")
    first.fill("0.4")
    first.press("Enter")
    kept(ann)
    second.fill("30")
    second.press("Enter")
    keeping = ben.get_by_role("status", name="Keeping of the design")
    expect(keeping).to_contain_text("Not kept")
    ben.unroute(deaf)
    conflict = ben.get_by_role("region", name="Changed by somebody else")
    expect(conflict).to_contain_text(f"{me} changed this design at")
    expect(conflict).to_contain_text("Spacing changed")
    expect(conflict.get_by_role("table").first).to_be_visible()
    expect(ann.get_by_label("Heading, °")).to_have_value("0")
    expect(ann.get_by_label("Spacing, m")).to_have_value("0.4")
    person.shoot(ben, "charge-conflict")
    told = conflict.get_by_role("alert").inner_text()
    conflict.get_by_role("button", name="Put mine on top").click()
    kept(ben)
    versions = ben.get_by_role("region", name="Versions")
    expect(versions).to_contain_text(f"{me}: Spacing changed")
    expect(ann.get_by_label("Heading, °")).to_have_value("30")
    return f"“{told.split('.')[0]}”, with a table of both; {me}'s stays as a version"


def test_two_pilots_want_one_robot(browser, calm, screen):
    demo, ann, person = calm, screen, Person()
    me, journey = name_of(ann), Journey("J8")
    with second_pilot(browser, demo, ann) as ben:
        # 1. Both see who is pilot in charge.
        open_page(ann, demo, "/plan/mini-1")
        open_page(ben, demo, "/plan/mini-1")
        expect(charge(ben, "Nobody is in charge")).to_be_visible()
        charge(ann, "Nobody").click()
        at = time.monotonic()
        act(ann, "Take charge of mini-1")
        expect(charge(ann, "You are in charge")).to_be_visible()
        expect(charge(ben, f"{me} is in charge")).to_be_visible()
        journey.tell("1", "both see who is pilot in charge", f"both after {seconds(at)}")

        # 2. The second may look and draft; to send is refused with the reason.
        note = ben.get_by_text(f"{me} is in charge of mini-1; request it from them first.")
        expect(note.first).to_be_visible()
        ask_for_a_sure_plan(ben, "mini-1")
        send = ben.get_by_role("button", name=SEND)
        expect(send).to_be_disabled()
        state = ben.get_by_role("list", name="State of the plan")
        expect(state).to_contain_text(re.compile(r"Draft\s*\d\d:\d\d:\d\dZ"), timeout=240_000)
        expect(send).to_be_disabled()
        expect(send).to_have_attribute(
            "title", re.compile(f"{re.escape(me)} is in charge of mini-1")
        )
        why = send.get_attribute("title")
        journey.tell("2", "drafts; Send is disabled with the reason", f"drafted; “{why}”")
        person.shoot(ben, "charge-of-another")

        # 3. A request is seen at once, refused, and asked again and granted.
        at = time.monotonic()
        ben.get_by_role("button", name="Request mini-1").click()
        asked = ann.get_by_role("alert").filter(has_text="ben requests mini-1")
        expect(asked).to_be_visible()
        seen = seconds(at)
        person.shoot(ann, "charge-asked")
        asked.get_by_role("button", name="Refuse").click()
        expect(asked).to_have_count(0)
        ben.get_by_role("button", name="Request mini-1").click()
        at = time.monotonic()
        asked.get_by_role("button", name="Grant").click()
        expect(charge(ben, "You are in charge")).to_be_visible()
        expect(charge(ann, "ben is in charge")).to_be_visible()
        told = f"seen after {seen}, refused, asked again, both see the grant after {seconds(at)}"
        journey.tell("3", "a request is granted or refused", told)
        expect(send).to_be_enabled()

        # 4. Of two who draw one mission the second sees what the first did; nothing is overwritten.
        told = edit_one_design(ann, ben, demo, me, person)
        journey.tell("4", "the second save is told who changed it, and sees the difference", told)

        # 5. Who is not in charge may surface it at once, and that leaves the lease alone.
        charge(ben, "You are in charge").click()
        act(ben, "Hold automation of the station")
        for page in (ann, ben):
            expect(page.get_by_text("Automation is held")).to_be_visible()
        person.shoot(ann, "charge-held")
        at = time.monotonic()
        hold(ann, re.compile("Surface mini-1 now"))
        expect_done(ann)
        told = f"the robot obeys {seconds(at)} after the press, which lasts a second, at the latest"
        journey.tell("5", "anyone with pilot right may abort, at once", told)
        ann.get_by_role("button", name="Let it go on").click()
        for page in (ann, ben):
            expect(page.get_by_text("Automation is held")).to_have_count(0)
        expect(charge(ben, "You are in charge")).to_be_visible()

        # 6. All of it is in the log, in order.
        events = ben.evaluate(
            "fetch('/api/events?limit=200').then(a => a.json()).then(a => a.events)"
        )
        story = [
            (one["kind"], one["by"])
            for one in events
            if one["kind"].split(".")[0] in ("lease", "automation")
            or one["kind"] == "command.surface"
        ]
        assert story == [
            ("lease.taken", me),
            ("lease.requested", "ben"),
            ("lease.refused", me),
            ("lease.requested", "ben"),
            ("lease.granted", me),
            ("automation.held", "ben"),
            ("command.surface", me),
            ("automation.resumed", me),
        ]
        journey.tell("6", "all in audit, in order", f"{len(story)} entries, in this order")
