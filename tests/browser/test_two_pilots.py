"""Two operators at two browsers, who want the same robot (journey J8 of the watch)."""

import re
from contextlib import contextmanager

import pytest
from playwright.sync_api import expect

from tests.browser.person import Person
from tests.browser.walk import CHROMIUM, hold, open_page

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(900),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]
PASSWORD = "a long pass phrase"
DIVE = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, d]} for d in (0.5, 0.0)]}


@contextmanager
def second_pilot(browser, demo, first):
    """Another person, in a browser of their own."""
    csrf = first.evaluate("fetch('/api/session').then(a => a.json()).then(a => a.csrf_token)")
    person = {"name": "ben", "role": "pilot", "password": PASSWORD}
    made = first.request.post(f"{demo.url}/api/people", data=person, headers={"X-CSRF-Token": csrf})
    assert made.status == 201, made.text()
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    context.set_default_timeout(120_000)
    page = context.new_page()
    page.goto(demo.url)
    page.get_by_label("Name").fill("ben")
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_role("status").get_by_text("Live", exact=True)).to_be_visible()
    yield page
    context.close()


def charge(page, text):
    """What the header says of who is in charge."""
    return page.get_by_role("button", name=re.compile(f"^mini-1: {text}"))


def act(page, button):
    page.get_by_role("region", name="Pilot in charge of mini-1").get_by_role(
        "button", name=button
    ).click()


def test_two_pilots_want_one_robot(browser, calm, screen):
    demo, ann, person = calm, screen, Person()
    me = ann.evaluate("fetch('/api/session').then(a => a.json()).then(a => a.name)")
    with second_pilot(browser, demo, ann) as ben:
        # 1. Both see who is pilot in charge.
        open_page(ann, demo, "/plan/mini-1")
        open_page(ben, demo, "/plan/mini-1")
        expect(charge(ben, "Nobody is in charge")).to_be_visible()
        charge(ann, "Nobody").click()
        act(ann, "Take charge of mini-1")
        expect(charge(ann, "You are in charge")).to_be_visible()
        expect(charge(ben, f"{me} is in charge")).to_be_visible()

        # 2. The second may look and draft; to send is refused with the reason.
        note = ben.get_by_text(f"{me} is in charge of mini-1; request it from them first.")
        expect(note.first).to_be_visible()
        drafted = ben.evaluate(
            """async body => {
                const { csrf_token } = await (await fetch('/api/session')).json();
                const headers = { 'X-CSRF-Token': csrf_token, 'Content-Type': 'application/json' };
                const send = (path, body) => fetch(path, { method: 'POST', headers, body });
                const plan = await send('/api/robots/mini-1/plans', JSON.stringify(body));
                const { id } = await plan.json();
                const sent = await send(`/api/plans/${id}/upload`, '{}');
                return [plan.status, sent.status, (await sent.json()).detail];
            }""",
            DIVE,
        )
        assert drafted[:2] == [202, 409]
        assert f"{me} is in charge of mini-1" in drafted[2]
        person.shoot(ben, "charge-of-another")

        # 3. A request is seen at once, refused, and asked again and granted.
        ben.get_by_role("button", name="Request mini-1").click()
        asked = ann.get_by_role("alert").filter(has_text="ben requests mini-1")
        expect(asked).to_be_visible()
        person.shoot(ann, "charge-asked")
        asked.get_by_role("button", name="Refuse").click()
        expect(asked).to_have_count(0)
        ben.get_by_role("button", name="Request mini-1").click()
        asked.get_by_role("button", name="Grant").click()
        expect(charge(ben, "You are in charge")).to_be_visible()
        expect(charge(ann, "ben is in charge")).to_be_visible()

        # 4. A second save of the same settings is told who changed them; nothing is overwritten.
        saved = ben.evaluate(
            """async () => {
                const { csrf_token } = await (await fetch('/api/session')).json();
                const path = '/api/config/automation?robot=mini-1';
                const etag = (await fetch(path)).headers.get('ETag');
                const headers = { 'X-CSRF-Token': csrf_token, 'If-Match': etag,
                                  'Content-Type': 'application/json' };
                const save = n => fetch(path, { method: 'PATCH', headers,
                                  body: JSON.stringify({ most_sends_per_hour: n }) });
                const first = await save(3), second = await save(5);
                return [first.status, second.status, (await second.json()).detail];
            }"""
        )
        assert saved[:2] == [200, 412]
        assert re.match(r"ben changed it at \d\d:\d\dZ", saved[2])

        # 5. Who is not in charge may surface it at once, and that leaves the lease alone.
        charge(ben, "You are in charge").click()
        act(ben, "Hold automation of the station")
        for page in (ann, ben):
            expect(page.get_by_text("Automation is held")).to_be_visible()
        person.shoot(ann, "charge-held")
        hold(ann, re.compile("Surface mini-1 now"))
        expect(ann.get_by_role("status").filter(has_text=re.compile("urfac")).first).to_be_visible()
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
