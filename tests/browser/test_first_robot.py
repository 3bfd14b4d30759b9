"""From an empty station to the first state of a new robot, by a person who has only the browser."""

import re
import signal
import socket
import sys
import threading
from contextlib import closing, contextmanager
from datetime import UTC, datetime

import pytest
from playwright.sync_api import expect

from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.telemetry import state_message
from robot_link.messages import RobotId, SystemId
from tests.browser.person import Person
from tests.browser.walk import CHROMIUM
from tests.free_port import free_port
from tests.robot_link.far_end import heartbeat
from tests.server.cli.test_process import serve
from tests.server.fake_link import state_report

pytestmark = [
    pytest.mark.walk,
    pytest.mark.skipif(CHROMIUM is None, reason="needs chromium"),
    pytest.mark.timeout(600),
]
INTERACTIONS_MAX, MINUTES_MAX = 40, 5.0


@contextmanager
def calling(port, system):
    """Let an emulated robot that does not sign call a port of the station again and again."""
    is_over = threading.Event()
    codec = Codec(SystemId(system), ROBOT_COMPONENT)

    def call():
        with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as caller:
            while not is_over.wait(0.2):
                state = state_report(RobotId("x"), (5.0, 5.0, 0.0), at=datetime.now(UTC))
                for data in (heartbeat(0, codec), codec.pack(state_message(state))):
                    caller.sendto(data, ("127.0.0.1", port))

    thread = threading.Thread(target=call)
    thread.start()
    yield
    is_over.set()
    thread.join()


def test_an_empty_station_hears_a_new_robot_that_was_added_in_the_browser(browser, tmp_path):
    port = free_port(socket.SOCK_DGRAM)
    process, url = serve(tmp_path)
    person = Person()
    page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
    page.context.set_default_timeout(120_000)
    try:
        code = process.stdout.readline().split()[-1]
        page.goto(url)
        person.fill(page.get_by_label("Code from the terminal"), code)
        person.fill(page.get_by_label("Name", exact=True), "Ann")
        person.fill(page.get_by_label(re.compile("New password")), "correct horse battery")
        person.click(page.locator("form button").last)
        person.click(page.get_by_role("link", name="Add a robot"))
        form = page.get_by_role("region", name="Add a robot")
        person.fill(form.get_by_label("Name", exact=True), "Bay glider")
        vehicle = form.get_by_role("combobox", name="Vehicle")
        person.choose(vehicle, vehicle.locator("option").nth(1).inner_text())
        person.choose(form.get_by_role("combobox", name="Water"), "Practice lake")
        person.choose(form.get_by_label("How link 1 reaches"), "MAVLink by UDP, the robot calls")
        person.fill(form.get_by_label("Where link 1 leads"), f"127.0.0.1:{port}")
        with calling(port, 7):
            expect(form.get_by_text(re.compile("Heard system 7"))).to_be_visible()
            expect(form.get_by_label("MAVLink system id")).to_have_value("7")
            person.click(form.get_by_label(re.compile("Its radio is signed")))
            person.click(form.get_by_role("button", name="Add Bay glider"))
            person.click(page.get_by_role("link", name="Open Bay glider"))
            expect(page.get_by_text("Idle at the surface").first).to_be_visible()
            minutes = person.minutes
        sys.stdout.write(f"\n{person.interactions} interactions, {minutes:.1f} minutes\n")
    finally:
        page.context.close()
        process.send_signal(signal.SIGTERM)
        process.wait(60)
        process.stdout.close()
    assert person.interactions <= INTERACTIONS_MAX
    assert minutes <= MINUTES_MAX
