"""A flood of alarms on a real station, a page beside it, and three kills in its midst.

20 robots begin to speak one after another within a minute; 500 rules of a team find each of them
beyond a limit: 10,000 causes. The station is killed by SIGKILL three times meanwhile and started
again. What its database holds afterwards is counted: a cause without an alarm is lost, a cause with
two is doubled. Beside it a browser shows the fleet; its pictures a second are held against those of
the same page at rest.
"""

import os
import socket
import sqlite3
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, expect
from sqlalchemy.orm import Session

from autonomy.site import TANK
from benchmarks.field.field import at_most, row
from benchmarks.station.station_process import served, viewer_token
from benchmarks.station.telemetry_fleet import state
from db.query.fleet.robots import RobotRecord, add_robot
from db.query.station.alarm_rules import add_version
from db.query.station.people import add_person
from db.store import Store
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.telemetry import state_message
from robot_link.messages import RobotId, SystemId
from server.access import register
from server.access.role import Role
from server.alarm.rule import AlarmRule
from server.base.settings import Settings
from tests.browser.walk import CHROMIUM, chromium
from tests.robot_link.far_end import heartbeat

AREA = "flood"
ROBOTS, RULES, KILLS = 20, 500, 3
CAUSES = ROBOTS * RULES
FLOOD_S = 60.0
LIMIT_S = 600.0
"""Longest wait for all alarms."""
REST_S = 10.0
FRAMES_BAR = 0.95
_PERSON = "Ann"
_COUNT = """() => {
  window.pictures = 0;
  const next = () => { window.pictures += 1; requestAnimationFrame(next); };
  requestAnimationFrame(next);
}"""


def measure() -> list[dict[str, Any]]:
    """Let the flood come, and count what stands of it.

    Raises:
        NotMeasuredError: If the station does not come back.
    """
    with tempfile.TemporaryDirectory() as name:
        flood = _Flood(Path(name), free_ports(ROBOTS + 1))
        if CHROMIUM is None:
            flood.run(lambda: None, lambda: time.sleep(0.2))
            return flood.rows(None)
        with chromium() as browser:
            context = browser.new_context(viewport={"width": 1440, "height": 900})
            pictures = _Pictures(context.new_page(), flood.page)
            flood.run(pictures.rest, pictures.look)
        return flood.rows(pictures)


class _Pictures:
    """Counts the pictures of a page, at rest and in the flood."""

    def __init__(self, page: Page, address: str) -> None:
        self._page, self._address = page, address
        self.rest_hz = self.flood_hz = 0.0
        self._begun_s, self._before = 0.0, 0

    def rest(self) -> None:
        page = self._page
        page.goto(self._address)
        expect(page.get_by_role("status").get_by_text("Live", exact=True)).to_be_visible()
        page.wait_for_load_state("networkidle")
        page.evaluate(_COUNT)
        page.wait_for_timeout(1e3 * REST_S)
        self._begun_s, self._before = time.monotonic(), page.evaluate("window.pictures")
        self.rest_hz = self._before / REST_S

    def look(self) -> None:
        self._page.wait_for_timeout(200)
        counted = self._page.evaluate("window.pictures") - self._before
        self.flood_hz = counted / (time.monotonic() - self._begun_s)


class _Flood:
    """A station's folder with robots and rules, and the ports of both."""

    def __init__(self, folder: Path, ports: list[int]) -> None:
        self._folder, (self._port, *self._robots) = folder, ports
        self._taken_s, self._load = 0.0, 0.0
        store = Store.open(Settings(data_dir=folder).resolved_database_url)
        try:
            self._token, secret = store.change(self._prepare).result()
        finally:
            store.close()
        self.page = f"http://127.0.0.1:{self._port}/sign-in?token={secret}"

    def _prepare(self, session: Session) -> tuple[str, str]:
        at = datetime.now(UTC)
        for number, port in enumerate(self._robots, 1):
            name = RobotId(f"robot-{number}")
            link = f"udp://127.0.0.1:{port}?listen=1"
            add_robot(
                session,
                RobotRecord(name, name, "miniglider", "real", SystemId(number), (link,), TANK, at),
            )
        for number in range(RULES):
            rule = _rule(number)
            add_version(session, rule.key, rule.model_dump(mode="json"), at, _PERSON)
        add_person(session, _PERSON, Role.ADMIN, None, at)
        link = register.create_sign_in_link(
            session, _PERSON, timedelta(hours=1), at=at, by="benchmark"
        )
        return viewer_token(session), link.secret

    def run(self, begin: Callable[[], None], look: Callable[[], None]) -> None:
        """Let the robots speak, kill the station in between, and wait for every alarm.

        Args:
            begin: Called once the station is there, before anybody speaks.
            look: Called again and again meanwhile; takes a moment.
        """
        with ExitStack() as stack:
            begun_s = 0.0
            for number in range(KILLS + 1):
                with served(self._folder, self._token, self._port) as station:
                    if number == 0:
                        begin()
                        begun_s = time.monotonic()
                        stack.enter_context(_talking(self._robots))
                    self._wait(begun_s, number, look)
                    if number < KILLS:
                        station.process.kill()
                        station.process.wait()
            self._taken_s, self._load = time.monotonic() - begun_s, os.getloadavg()[0]

    def _wait(self, begun_s: float, killed: int, look: Callable[[], None]) -> None:
        """Wait for the next kill; after the last one until every cause has an alarm."""
        is_last = killed == KILLS
        until_s = begun_s + (LIMIT_S if is_last else (killed + 1) * FLOOD_S / (KILLS + 1))
        while time.monotonic() < until_s and not (is_last and len(self._alarms()) >= CAUSES):
            look()

    def _alarms(self) -> list[tuple[str, int]]:
        """Return cause and robot of every alarm of a rule of the flood."""
        query = "select cause, robot_key from alarm where cause like 'flood %'"
        file = f"file:{self._folder}/station.sqlite3?mode=ro"
        with closing(sqlite3.connect(file, uri=True, timeout=60.0)) as database:
            return database.execute(query).fetchall()

    def rows(self, pictures: _Pictures | None) -> list[dict[str, Any]]:
        """Return the rows of this area."""
        alarms = self._alarms()
        lost, doubled = CAUSES - len(set(alarms)), len(alarms) - len(set(alarms))
        rate = f"{CAUSES} causes, {60.0 * len(alarms) / self._taken_s:.0f} a minute, {KILLS} kills"
        share = None if pictures is None else pictures.flood_hz / pictures.rest_hz
        rest = "no chromium" if pictures is None else f"of {pictures.rest_hz:.1f}/s at rest"
        return [
            at_most(AREA, f"Causes without an alarm: {rate}", float(lost), "causes", 0.0),
            at_most(AREA, f"Causes with two alarms: {rate}", float(doubled), "causes", 0.0),
            row(
                AREA,
                f"Pictures of the page meanwhile, load {self._load:.0f}",
                share,
                rest,
                FRAMES_BAR,
                None if share is None else share >= FRAMES_BAR,
            ),
        ]


def _rule(number: int) -> AlarmRule:
    """Return a rule that is beyond its limit as soon as a robot tells of its battery."""
    return AlarmRule.model_validate(
        {
            "key": f"flood {number}",
            "title": f"Flood {number}",
            "reads": "battery",
            "limits": [{"level": "watch", "high": -1.0}],
            "text": "{robot}: {title} is {value}.",
        }
    )


@contextmanager
def _talking(ports: list[int]) -> Iterator[None]:
    """Let a robot at each port tell its state once a second, one after another from its begin."""
    is_over = threading.Event()
    codecs = [Codec(SystemId(number), ROBOT_COMPONENT) for number, _ in enumerate(ports, 1)]

    def talk() -> None:
        begun_s = time.monotonic()
        with ExitStack() as stack:
            callers = [
                stack.enter_context(closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)))
                for _ in ports
            ]
            while not is_over.wait(1.0):
                at_s = time.monotonic() - begun_s
                for number in range(min(len(ports), int(at_s * len(ports) / FLOOD_S) + 1)):
                    codec = codecs[number]
                    for data in (
                        heartbeat(0, codec),
                        codec.pack(state_message(state(number + 1, at_s))),
                    ):
                        callers[number].sendto(data, ("127.0.0.1", ports[number]))

    thread = threading.Thread(target=talk, name="robots")
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()


def free_ports(count: int) -> list[int]:
    """Return ports that nobody has now, the first of TCP and the others of UDP."""
    kinds = [socket.SOCK_STREAM, *[socket.SOCK_DGRAM] * (count - 1)]
    sockets = [socket.socket(socket.AF_INET, kind) for kind in kinds]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports
