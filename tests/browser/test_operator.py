"""An operator's first hour in a real browser: sign in, plan, send, watch the map grow, surface.

Screenshots of every page at 1600x950 and 820x1180 are written to ``build/screenshots``.
"""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.walk import (
    CHROMIUM,
    SIZES,
    ask_for_a_sure_plan,
    expect_scene,
    hold,
    open_page,
    requests_of,
    shoot,
)

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]


def test_the_one_time_address_signs_in_and_shows_both_robots(page, demo):
    expect(page).to_have_url(f"{demo.url}/")
    for robot in ("mini-1", "grace-1"):
        expect(page.get_by_text(robot).first).to_be_visible()
    expect(page.get_by_text("SIMULATION")).to_be_visible()
    shoot(page, "fleet")


@pytest.mark.parametrize("path", ["/", "/robot/mini-1", "/plan/mini-1", "/map/mini-1",
                                  "/track/mini-1", "/control/mini-1", "/data/mini-1"])  # fmt: skip
def test_surface_now_is_in_the_window_and_every_page_is_marked(page, demo, path):
    open_page(page, demo, path)
    for width, height in SIZES.values():
        page.set_viewport_size({"width": width, "height": height})
        button = page.get_by_role("button", name=re.compile("Surface mini-1 now"))
        expect(button).to_be_in_viewport(ratio=1)
        expect(page.get_by_text("SIMULATION")).to_be_in_viewport(ratio=1)


def test_the_scene_is_drawn_inside_the_page(page, demo):
    open_page(page, demo, "/robot/mini-1")
    expect_scene(page)


def test_a_survey_is_planned_sent_flown_and_mapped(page, demo, station):
    state = "/api/robots/mini-1/state"
    station.wait("a first report", lambda: station.get(state)["position"], 60.0)
    open_page(page, demo, "/plan/mini-1")
    expect(page.get_by_role("button", name="Plan a survey for mini-1")).to_be_enabled()
    page.get_by_label("Total energy budget").fill("14")
    page.get_by_label("Energy budget of a round").fill("14")
    ask_for_a_sure_plan(page, "mini-1")
    expect(page.get_by_text("No limit is violated.")).to_be_visible(timeout=240_000)
    expect(page.get_by_text("until 14 energy units are spent")).to_be_visible()
    look_at_the_draft(page)
    shoot(page, "plan")
    with requests_of(page) as asked:
        send(page)
        ladder = page.get_by_role("list", name="State of the plan")
        for step in ("Sent", "On board", "Running"):
            expect(ladder.get_by_text(step, exact=True)).to_be_visible()
        running = re.compile(r"Running\s*\d\d:\d\d:\d\dZ")
        expect(ladder).to_contain_text(running, timeout=240_000)
    assert [each for each in asked if each.startswith("GET /api/transfers/")] == []
    open_page(page, demo, "/robot/mini-1")
    expect_scene(page)
    shoot(page, "robot")
    look_at_the_plan_on_board(page)
    open_page(page, demo, "/map/mini-1")
    expect(page.get_by_text("Standard deviation").first).to_be_visible(timeout=240_000)
    expect(page.get_by_text("Against the truth")).to_be_visible(timeout=240_000)
    look_at_the_map(page, demo)
    shoot(page, "map")


def look_at_the_plan_on_board(page):
    """On board or not, a plan is predicted: dashed, and thinner than the best of the track."""
    page.get_by_text("From above", exact=True).click()
    # in one look: the layer is drawn anew while the robot flies, and what was replaced has no style
    page.wait_for_function("""() => {
        const leg = document.querySelector('.map-leg');
        const style = leg && getComputedStyle(leg);
        return style && style.strokeDasharray !== 'none' && parseFloat(style.strokeWidth) < 2.0;
    }""")
    page.get_by_text("3D", exact=True).first.click()


def send(page):
    """Nothing is sent before the summary was read and its button held."""
    page.get_by_role("button", name=re.compile("^Send plan [0-9]+ to mini-1 …")).click()
    summary = page.get_by_role("region", name="Summary of what will be sent")
    expect(summary).to_contain_text("By radio")
    expect(summary).to_contain_text("Nothing is sent before you hold the button")
    ladder = page.get_by_role("list", name="State of the plan")
    expect(ladder).not_to_contain_text(re.compile(r"Sent\s*\d\d:\d\d:\d\dZ"))
    hold(page, re.compile("Send plan [0-9]+ to mini-1 by radio"))
    expect(summary).to_be_hidden()


def look_at_the_draft(page):
    """What is known of a plan before it is sent: its way, its rehearsal, what came close to it."""
    rehearsal = page.get_by_role("region", name="Rehearsal of the plan")
    expect(rehearsal.get_by_role("status")).to_have_text("Rehearsed", timeout=240_000)
    for question in ("Does it fly as expected?", "Does it know where it is?"):
        expect(rehearsal.get_by_text(question)).to_be_visible()
    way = page.get_by_role("img", name=re.compile("Depth and predicted position uncertainty"))
    expect(way).to_be_visible()
    expect(page.get_by_role("img", name="Best objective over planning time")).to_be_visible()
    others = page.get_by_role("region", name="Runners-up")
    expect(others.get_by_role("button", name=re.compile("Use runner-up 2")).first).to_be_enabled()
    expect(others.get_by_role("button", name="Search on")).to_be_enabled()
    expect(page.get_by_role("region", name="Account of the plan")).to_contain_text("of 14")


def look_at_the_map(page, demo):
    """Samples by fidelity, sliders of the 3D view, four models side by side, files to take away."""
    symbols = page.get_by_role("list", name="What the symbols mean")
    expect(symbols).to_contain_text(re.compile("[1-9][0-9]* samples near this slice"))
    page.get_by_text("3D", exact=True).first.click()
    controls = page.get_by_role("region", name="What the 3D view shows")
    for slider in ("Opacity", "Vertical"):
        expect(controls.get_by_label(slider)).to_be_visible(timeout=240_000)
    controls.get_by_label("Samples by fidelity").check()
    controls.get_by_text("Slices", exact=True).click()
    expect(controls.get_by_label("Depth", exact=True)).to_be_visible()
    page.get_by_text("Compare models", exact=True).click()
    page.get_by_role("button", name=re.compile("Compare")).click()
    models = page.get_by_role("region", name="Comparison of models")
    expect(models.get_by_role("columnheader")).to_have_count(5, timeout=240_000)
    expect(models.get_by_role("img", name="Standard deviation")).to_have_count(4)
    page.get_by_text("Slices", exact=True).first.click()
    for kind in ("JSON", "NumPy (npz)", "CSV"):
        link = page.get_by_role("link", name=kind).get_attribute("href")
        assert page.request.get(f"{demo.url}{link}").ok, kind


def test_surface_now_says_what_is_proved(page, demo):
    open_page(page, demo, "/data/grace-1")
    hold(page, re.compile("Surface grace-1 now"))
    outcome = re.compile(r"grace-1 (obeys: it is coming up\.|is up, as ordered\.)")
    expect(page.get_by_text(outcome)).to_be_visible(timeout=240_000)
    for step in ("Queued", "Delivered", "Done"):
        expect(page.get_by_text(step, exact=True)).to_be_visible()
    shoot(page, "surface")
    for name in ("control", "data", "log", "settings"):
        path = f"/{name}/mini-1" if name in {"control", "data"} else f"/{name}"
        open_page(page, demo, path)
        page.wait_for_timeout(800)
        shoot(page, name)


def alarm(number, level):
    return {
        "id": f"alarm-{number}",
        "robot": None,
        "level": level,
        "text": f"Trial alarm {number}.",
        "state": "unacknowledged",
        "raised_at": f"2026-11-21T12:00:0{number}Z",
        "acknowledged_at": None,
        "acknowledged_by": None,
        "cleared_at": None,
    }


def test_a_second_click_acknowledges_nothing_that_nobody_has_read(page, demo):
    """The button rests after each change; here until the test lets that time pass."""
    alarms, seen = [alarm(1, "critical"), alarm(2, "warning")], []

    def answer(route):
        if route.request.method == "POST":
            number = int(re.search(r"alarm-(\d)/ack", route.request.url).group(1))
            seen.append((number, "level=" in route.request.url))
            alarms[number - 1] |= {"state": "acknowledged"}
        route.fulfill(json={"alarms": alarms})

    screen = page.context.new_page()
    screen.route(re.compile("/api/alarms"), answer)
    screen.add_init_script(
        "const later = window.setTimeout; window.rests = [];"
        "window.setTimeout = (work, ms, ...rest) =>"
        " ms === 1200 ? window.rests.push(work) : later(work, ms, ...rest);"
    )
    open_page(screen, demo, "/")
    button = screen.get_by_role("alert").get_by_role("button", name="Acknowledge")
    expect(screen.get_by_role("alert").get_by_text("Trial alarm 1.")).to_be_visible()
    screen.evaluate("window.rests.forEach((work) => work())")
    expect(button).to_be_enabled()
    button.click()
    expect(screen.get_by_role("alert").get_by_text("Trial alarm 2.")).to_be_visible()
    expect(button).to_be_disabled()
    button.click(force=True)
    assert seen == [(1, True)]
    screen.evaluate("window.rests.forEach((work) => work())")
    button.click()
    expect(screen.get_by_role("alert").get_by_text("Trial alarm")).to_have_count(0)
    assert seen == [(1, True), (2, True)]
    screen.close()
