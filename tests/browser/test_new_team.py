"""The first day of a team: its own vehicle, bay and instruments, from nothing to a map."""

import json
import re
import signal
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from playwright.sync_api import expect

from autonomy.vehicle.config import GRACE3
from autonomy.vehicle.parameter_file import vehicle_document
from server.base.clock_file import start_clock
from server.cli.data_folder import CLOCK_FILE, make_data_folder
from tests.browser.person import Person
from tests.browser.walk import CHROMIUM
from tests.e2e.demo import ROOT
from tests.server.cli.test_process import serve

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.skipif(CHROMIUM is None, reason="needs chromium"),
    pytest.mark.timeout(900),
]
SPEED = 20.0
LEAK_S = 3600
"""Of the robot's life, which begins with the simulator."""
WEST, SOUTH, EAST, NORTH = -123.2500, 48.5000, -123.2430, 48.5045


def bay() -> str:
    """Return the shore, an island to keep off and a dock."""
    ring = [[WEST, SOUTH], [EAST, SOUTH], [EAST, NORTH], [-123.2460, 48.5040], [WEST, NORTH]]
    wreck = [[-123.2450, 48.5010], [-123.2446, 48.5010], [-123.2446, 48.5013]]

    def feature(name: str, kind: str, coordinates: object, **more: object) -> dict[str, object]:
        return {
            "type": "Feature",
            "properties": {"name": name, **more},
            "geometry": {"type": kind, "coordinates": coordinates},
        }

    features = [
        feature("Heron Bay", "Polygon", [[*ring, ring[0]]]),
        feature("Wreck", "Polygon", [[*wreck, wreck[0]]], role="keep_out"),
        feature("Jetty", "Point", [-123.2490, 48.5010], role="dock"),
    ]
    return json.dumps({"type": "FeatureCollection", "features": features})


def soundings() -> str:
    """Return a grid of depths: 22 m in the middle, shoaling to the shores."""
    lines: list[str] = []
    for y in np.linspace(SOUTH, NORTH, 41):
        for x in np.linspace(WEST, EAST, 41):
            across = (x - WEST) / (EAST - WEST) - 0.5
            along = (y - SOUTH) / (NORTH - SOUTH) - 0.5
            depth = 22.0 * (1.0 - (2.0 * across) ** 4) * (1.0 - (2.0 * along) ** 4)
            lines.append(f"{x:.6f} {y:.6f} {depth:.2f}")
    return "\n".join(lines)


def vehicle() -> str:
    """Return a team's own glider, a little heavier and draggier than GRACE 3."""
    drag = GRACE3.parameters.drag_0
    own = replace(
        GRACE3,
        key="heron",
        title="Heron glider",
        note="made up",
        parameters=GRACE3.parameters.model_copy(update={"drag_0": 1.04 * drag}),
    )
    return json.dumps(vehicle_document(own))


@contextmanager
def station(folder):
    """Serve an empty folder, by a clock that goes faster than life."""
    make_data_folder(folder)
    clock = folder / CLOCK_FILE
    start_clock(clock, SPEED)
    process, url = serve(folder, "--clock-file", str(clock), "--simulation")
    try:
        yield url, process.stdout.readline().split()[-1]
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(60)
        process.stdout.close()


@contextmanager
def simulator(folder, robot):
    """Let the team's robot live, with a CTD and a leak to come."""
    words = ("--robots", robot, "--ctd", "--fault", f"{robot}:leak@{LEAK_S}")
    with (folder / "simulator.log").open("w") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "server.cli", "simulate", "--data", str(folder), *words],
            cwd=ROOT, stdout=log, stderr=subprocess.STDOUT,
        )  # fmt: skip
        try:
            yield
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait(60)


def test_a_team_sets_up_its_own_robot_and_bay_and_maps_salinity_until_it_leaks(browser, tmp_path):
    files = {"bay.geojson": bay(), "soundings.xyz": soundings(), "heron.json": vehicle()}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    folder, person = tmp_path / "data", Person()
    with station(folder) as (url, code):
        page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
        page.context.set_default_timeout(120_000)
        faults: list[str] = []
        page.on("pageerror", lambda error: faults.append(str(error)))
        sign_up(page, person, url, code)
        add_bay(page, person, tmp_path)
        add_robot(page, person, tmp_path)
        told(person, "set up")
        with simulator(folder, "heron-1"):
            person.click(page.get_by_role("link", name="Open Heron 1"))
            expect(page.get_by_text("Idle at the surface").first).to_be_visible()
            told(person, "first state")
            person.shoot(page, "team-robot")
            plan_and_send(page, person)
            see_the_map(page, person)
            see_the_leak(page, person)
        page.context.close()
    assert faults == []


def told(person, what):
    sys.stdout.write(f"\n{what}: {person.interactions} interactions, {person.minutes:.1f} min\n")


def sign_up(page, person, url, code):
    page.goto(url)
    person.fill(page.get_by_label("Code from the terminal"), code)
    person.fill(page.get_by_label("Name", exact=True), "Ann")
    person.fill(page.get_by_label(re.compile("New password")), "correct horse battery")
    person.click(page.locator("form button").last)
    expect(page.get_by_text("No robots yet")).to_be_visible()
    person.shoot(page, "team-empty")


def add_bay(page, person, files):
    person.click(page.get_by_role("link", name="Settings"))
    person.click(page.get_by_role("button", name="Add a water"))
    editor = page.get_by_role("region", name="Add a water")
    person.give(editor.locator("input[type=file]"), files / "bay.geojson")
    found = editor.get_by_role("region", name="Read from bay.geojson")
    expect(found.get_by_label("Use of Heron Bay")).to_have_value("outline")
    expect(found.get_by_label("Use of Wreck")).to_have_value("keep_out")
    person.give(editor.locator("input[type=file]"), files / "soundings.xyz")
    expect(editor.get_by_role("region", name="Read from soundings.xyz")).to_contain_text("41")
    person.fill(editor.get_by_label("Name", exact=True).first, "Heron Bay")
    person.choose(editor.get_by_label("Kind"), "Open sea")
    person.choose(editor.get_by_label("Channel that surveys map"), "Practical salinity")
    person.shoot(page, "team-water")
    person.click(editor.get_by_role("button", name="Add Heron Bay"))
    waters = page.get_by_role("region", name="Waters")
    expect(waters).to_contain_text("Heron Bay")


def add_robot(page, person, files):
    person.click(page.get_by_role("button", name="Add a robot"))
    form = page.get_by_role("region", name="Add a robot")
    person.click(form.get_by_text("In the simulator"))
    person.fill(form.get_by_label("Name", exact=True), "Heron 1")
    person.give(form.locator("input[type=file]"), files / "heron.json")
    expect(form.get_by_role("combobox", name="Vehicle")).to_have_value("heron")
    person.choose(form.get_by_role("combobox", name="Water"), "Heron Bay")
    person.fill(form.get_by_label("Purpose"), "First salinity map")
    person.shoot(page, "team-add")
    person.click(form.get_by_role("button", name="Add Heron 1"))
    expect(form).to_contain_text(re.compile(r"grace simulate --data \S+ --robots heron-1"))
    person.shoot(page, "team-added")


def plan_and_send(page, person):
    person.click(page.get_by_role("link", name="Plan", exact=True))
    button = page.get_by_role("button", name="Plan a survey for Heron 1")
    expect(button).to_be_enabled()
    person.shoot(page, "team-ask")
    for field in ("Total energy budget", "Energy budget of a round"):
        person.fill(page.get_by_label(field), "12")
    person.fill(page.get_by_label("Planning time"), "2")
    person.click(button)
    send = page.get_by_role("button", name=re.compile("^Send plan [0-9]+ to Heron 1 …"))
    expect(send).to_be_enabled(timeout=240_000)
    person.shoot(page, "team-plan")
    person.click(send)
    held = page.get_by_role("button", name=re.compile("Send plan [0-9]+ to Heron 1 by radio"))
    held.hover()
    page.mouse.down()
    page.wait_for_timeout(1500)
    page.mouse.up()
    person.interactions += 1
    ladder = page.get_by_role("list", name="State of the plan")
    expect(ladder).to_contain_text(re.compile(r"Running\s*\d\d:\d\d:\d\dZ"), timeout=240_000)
    told(person, "running")


def see_the_map(page, person):
    person.click(page.get_by_role("link", name="Map", exact=True))
    expect(page.get_by_text("Practical salinity").locator("visible=true").first).to_be_visible()
    symbols = page.get_by_role("list", name="What the symbols mean")
    expect(symbols).to_contain_text(re.compile("[1-9][0-9]* samples near this slice"))
    told(person, "mapped")
    person.shoot(page, "team-map")


def see_the_leak(page, person):
    alarm = page.get_by_role("alert").get_by_text(re.compile("[Ll]eak|[Ww]ater in the hull"))
    expect(alarm.first).to_be_visible(timeout=240_000)
    told(person, "leak seen")
    person.shoot(page, "team-leak")
    person.click(page.get_by_role("link", name="Robot", exact=True))
    person.shoot(page, "team-leak-robot")
