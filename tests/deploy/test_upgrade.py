"""A station that another process takes over from, while robots go on talking."""

import asyncio
import contextlib
import os
import pty
import random
import re
import select
import signal
import socket
import sqlite3
import struct
import subprocess
import sys
import threading
import time
import tty
from datetime import UTC, datetime
from pathlib import Path

import httpx
import pytest
from alembic import command

from db.engine import write_engine
from db.migrate import configuration, migrate, schema_version
from robot_link.clock import SystemClock
from robot_link.mavlink import telemetry
from robot_link.mavlink.codec import Codec
from robot_link.mavlink.signing import MemorySigningMemory, Signing
from robot_link.mavlink.wire import grace
from robot_link.messages import LogId
from robot_link.sample_log import Measurement
from server.base.secret import SecretStore
from server.base.settings import Settings
from server.cli.http_server import LAST_REQUEST_S
from server.cli.service.preparation import prepare
from tests.db.old_schema import RowMaker, reflected
from tests.free_port import free_port
from tests.server.cli.test_process import alive

pytestmark = [pytest.mark.process, pytest.mark.timeout(1200)]
ROOT = Path(__file__).parents[2]
GRACE = [sys.executable, "-m", "server.cli"]
LIMIT_S = 300.0
GOING_BACK = re.search(
    r"```bash\n(systemctl stop grace\n.*?)```", (ROOT / "docs/install.md").read_text(), re.DOTALL
)
"""What the page of installation says for the way back from an upgrade that failed."""
MACHINE = f"""
set -e
systemctl() {{ :; }}
install() {{ command install -d -m 700 "${{@: -1}}"; }}
grace() {{ GRACE_DATA_DIR=/var/lib/grace {sys.executable} -m server.cli "$@"; }}
"""
"""Stands for a machine with a service and its user."""
LINE_BYTES_PER_S = 11_520.0
"""A serial line at 115,200 baud, without a pause."""
UDP_BYTES_PER_S = 600.0
KILLED_WHEN = ("said prepared", "heard yours", "said ready", "heard line", "heard end")
FAULTY = """
import os, signal, sys, threading, time
if "--take-over" in sys.orig_argv:
    from server.cli.service.succession import Channel
    fault, word, where = {fault!r}, {word!r}, {where!r}
    say, hear, lock, has_taken = Channel.say, Channel.hear, threading.Lock(), []

    def fail_at(now):
        if now == word:
            open(where, "w").write(str(os.getpid()))
            os.kill(os.getpid(), fault)

    def faulty_say(self, said, *more, **others):
        with lock:
            has_taken.extend([said] * (said == "taken"))
        say(self, said, *more, **others)
        fail_at("said " + said)

    def faulty_hear(self):
        heard = hear(self)
        fail_at("heard " + heard[0]["is"])
        return heard

    def fail_later():
        time.sleep(float(word))
        with lock:
            if not has_taken:
                os.kill(os.getpid(), fault)

    Channel.say, Channel.hear = faulty_say, faulty_hear
    if word.replace(".", "").isdigit():
        threading.Thread(target=fail_later, daemon=True).start()
"""
"""An installation that fails when it says or hears a word, or after so many seconds unless it has
taken over by then."""


def run(*words):
    return subprocess.run(
        [*GRACE, *map(str, words)], cwd=ROOT, capture_output=True, text=True, check=False,
        timeout=LIMIT_S,
    )  # fmt: skip


def upgrading(python, data):
    """Begin ``grace upgrade`` as the installation of an interpreter would."""
    verb = (
        "import sys; sys.executable = sys.argv[1]\n"
        "from server.cli.main import main; sys.exit(main(sys.argv[2:]))"
    )
    return subprocess.Popen(
        [sys.executable, "-c", verb, python, "upgrade", "--data", data], cwd=ROOT,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def upgrade_by(python, data):
    with upgrading(python, data) as asked:
        said, failed = asked.communicate(timeout=LIMIT_S)
    return asked.returncode, said, failed


def faulty_python(folder, word, fault=signal.SIGKILL):
    """Return an interpreter whose installation gets a signal when it takes over."""
    folder.mkdir(exist_ok=True)
    where = folder / "where"
    where.unlink(missing_ok=True)
    code = FAULTY.format(fault=int(fault), word=word, where=str(where))
    (folder / "sitecustomize.py").write_text(code)
    wrapper = folder / "python"
    wrapper.write_text(
        f'#!/bin/sh\nPYTHONDONTWRITEBYTECODE=1 PYTHONPATH={folder} exec {sys.executable} "$@"\n'
    )
    wrapper.chmod(0o755)
    return wrapper, where


def until(condition):
    give_up = time.monotonic() + LIMIT_S
    while not (found := condition()):
        assert time.monotonic() < give_up
        time.sleep(0.05)
    return found


class Robot:
    """Sends numbered samples at the full rate of its link, each once, and waits for no answer.

    They are signed, as those of robots are unless somebody decides otherwise.
    """

    def __init__(self, system, bytes_per_s, send, key):
        signing = Signing(key, MemorySigningMemory(), SystemClock())
        self._codec = Codec(system, 1, signing)
        self._bytes_per_s = bytes_per_s
        self._send = send
        self.sent = 0
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        due = time.monotonic()
        while not self._ends.wait(max(0.0, due - time.monotonic())):
            measured = Measurement("chlorophyll", 4.5, (1.0, 1.0, 1.0), 0.5, datetime.now(UTC))
            frame = self._codec.pack(telemetry.sample_message(LogId(7), self.sent, measured))
            self._send(frame)
            self.sent += 1
            due = max(due, time.monotonic() - 1.0) + len(frame) / self._bytes_per_s

    def stop(self):
        self._ends.set()
        self._thread.join()


class Systemd:
    """Hears of a service as systemd does by ``NotifyAccess=main``: whoever else speaks is ignored.

    Source: sd_notify(3), systemd.exec(5).
    """

    def __init__(self, path):
        self._ear = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._ear.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
        self._ear.settimeout(0.1)
        self._ear.bind(str(path))
        self.environment = {"NOTIFY_SOCKET": str(path), "WATCHDOG_USEC": "6000000"}
        self._heard = []
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        while not self._ends.is_set():
            with contextlib.suppress(TimeoutError):
                said, about, *_ = self._ear.recvmsg(4096, socket.CMSG_SPACE(12))
                self._heard.append((struct.unpack("3i", about[0][2])[0], said.decode().split("\n")))

    def service(self, started):
        """Return the main process and its state, by what has been said since it was started."""
        main, state = started, "starting"
        for sender, lines in tuple(self._heard):
            if sender == main:
                named = dict(line.split("=", 1) for line in lines)
                main = int(named.get("MAINPID", main))
                state = "ready" if "READY" in named else state
                state = "reloading" if "RELOADING" in named else state
        return main, state

    def close(self):
        self._ends.set()
        self._thread.join()
        self._ear.close()


class Caller:
    """Asks a page again and again, each time by a new connection.

    A fault is a request that is cut before its time is up, or refused.
    """

    def __init__(self, url):
        self._url = url
        self.faults = []
        self.longest_s = 0.0
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        while not self._ends.wait(0.02):
            began = time.monotonic()
            try:
                httpx.get(f"{self._url}/api/health", timeout=LIMIT_S).raise_for_status()
            except httpx.HTTPError as error:
                if time.monotonic() - began < LAST_REQUEST_S:
                    self.faults.append(error)
            self.longest_s = max(self.longest_s, time.monotonic() - began)

    def stop(self):
        self._ends.set()
        self._thread.join()


def numbers_stored(data, carrier):
    """Return the numbers of the samples of robots over a kind of link, in the order of storage.

    What their signatures did not prove is nobody's, and not among them.
    """
    with sqlite3.connect(
        f"file:{data / 'station.sqlite3'}?mode=ro", uri=True, timeout=LIMIT_S
    ) as database:
        heard = database.execute(
            "SELECT data FROM raw_frame WHERE NOT outgoing AND carrier = ? AND robot_key NOTNULL"
            " ORDER BY key", (carrier,)
        ).fetchall()  # fmt: skip
    codec = Codec(255, 190)
    return [
        message.sequence
        for (packet,) in heard
        for message in codec.unpack(packet).messages
        if isinstance(message, grace.MAVLink_grace_sample_message)
    ]


def read_all(line, ends):
    """Take whatever the station says, as a robot does; a line that nobody reads is given up."""
    while not ends.is_set():
        if select.select([line], [], [], 0.1)[0]:
            os.read(line, 65536)


def write_whole(line, data, ends):
    """Write to a line that may be full, as a robot that obeys RTS and CTS."""
    while data and not ends.is_set():
        if select.select([], [line], [], 0.1)[1]:
            data = data[os.write(line, data) :]


@pytest.fixture
def line(tmp_path):
    """A serial line: what the robot writes to, and the path of the station's end."""
    robot, station = pty.openpty()
    tty.setraw(robot)
    tty.setraw(station)
    os.set_blocking(robot, False)
    path = tmp_path / "line"
    path.symlink_to(os.ttyname(station))
    ends = threading.Event()
    reading = threading.Thread(target=read_all, args=(robot, ends))
    reading.start()
    yield robot, path
    ends.set()
    reading.join()
    os.close(robot)
    os.close(station)


@pytest.fixture
def port():
    return free_port(socket.SOCK_DGRAM)


@pytest.fixture
def systemd(tmp_path):
    systemd = Systemd(tmp_path / "notify")
    yield systemd
    systemd.close()


@pytest.fixture
def station(tmp_path, line, port, systemd):
    """A station with a robot at a serial line and one that speaks by UDP."""
    data = tmp_path / "data"
    udp = f"udp://127.0.0.1:{port}?listen=1"
    for robot, system, link in (("eva", 21, f"serial://{line[1]}"), ("ben", 22, udp)):
        added = run(
            "robot", "add", robot, "--system", system, "--link", link, "--model", "miniglider",
            "--water", "test-tank", "--data", data,
        )  # fmt: skip
        assert added.returncode == 0, added.stderr
    said = tmp_path / "log"
    with said.open("w+") as log:
        process = subprocess.Popen(
            [*GRACE, "serve", "--data", data, "--port", "0"], cwd=ROOT, stdout=log,
            stderr=subprocess.STDOUT, text=True, start_new_session=True,
            env={**os.environ, **systemd.environment},
        )  # fmt: skip
    found = until(lambda: re.search(r"http://\S+:\d+", said.read_text()))
    yield data, process, found[0], said
    with contextlib.suppress(ProcessLookupError):  # all have ended
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@pytest.fixture
def robots(station, line, port):
    """Robots that talk, by the kind of their link; each has been heard."""
    data = station[0]
    given_up = threading.Event()
    keys = SecretStore(data / "secret")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        talking = {
            "serial": Robot(
                21, LINE_BYTES_PER_S, lambda frame: write_whole(line[0], frame, given_up),
                keys.signing_key("eva"),
            ),
            "udp": Robot(
                22, UDP_BYTES_PER_S, lambda f: out.sendto(f, ("127.0.0.1", port)),
                keys.signing_key("ben"),
            ),
        }  # fmt: skip
        until(lambda: all(len(numbers_stored(data, carrier)) > 20 for carrier in talking))
        yield talking
        given_up.set()
        for robot in talking.values():
            robot.stop()


def processes(said):
    """Return the processes that have served, by the log."""
    return [int(pid) for pid in re.findall(r"Started server process \[(\d+)\]", said.read_text())]


def expect_all_stored_once_and_in_order(data, robots):
    for carrier, robot in robots.items():
        robot.stop()
        last = robot.sent - 1
        until(lambda carrier=carrier, last=last: numbers_stored(data, carrier)[-1] == last)
        found = numbers_stored(data, carrier)
        assert found == list(range(found[0], robot.sent)), f"{carrier}, of {robot.sent}"


def test_every_frame_is_stored_once_and_no_page_is_refused_while_others_take_over(
    station, robots, systemd
):
    data, first, url, said = station
    caller = Caller(url)
    for times in (1, 2):  # the second process hands over as the first did
        time.sleep(random.Random().uniform(0.0, 1.0))
        done = run("upgrade", "--data", data)
        assert done.returncode == 0, f"{done.stderr}\n{said.read_text()}"
        sys.stdout.write(
            f"{done.stdout.splitlines()[-1]} The longest answer took {caller.longest_s:.1f} s.\n"
        )
        until(lambda times=times: len(processes(said)) == 1 + times)
        until(lambda: systemd.service(first.pid) == (processes(said)[-1], "ready"))
        before = {carrier: robot.sent for carrier, robot in robots.items()}
        until(lambda before=before: all(numbers_stored(data, c)[-1] > before[c] for c in before))
    assert first.wait(LIMIT_S) == 0
    caller.stop()
    assert caller.faults == []
    expect_all_stored_once_and_in_order(data, robots)


def test_whenever_the_new_version_is_killed_the_running_one_goes_on_and_has_all(
    station, robots, tmp_path
):
    """At three words of the handover, and at a moment that is uniform over its first 12 s."""
    data, _, url, said = station
    seed = random.SystemRandom().getrandbits(32)
    sys.stdout.write(f"seed {seed}\n")
    drawn = random.Random(seed)
    moments = [*drawn.sample(KILLED_WHEN, 3), f"{drawn.uniform(0.0, 12.0):.3f}"]
    for moment in moments:
        python, _ = faulty_python(tmp_path / "site", moment)
        status, told, failed = upgrade_by(python, data)
        if moment in KILLED_WHEN:
            assert status == 1, (moment, told)
        if status == 0:  # it had taken over before the moment came
            continue
        assert "The station goes on as it was" in failed, (moment, seed, said.read_text())
        assert httpx.get(f"{url}/api/health", timeout=LIMIT_S).json()["ready"]
    expect_all_stored_once_and_in_order(data, robots)


def test_a_station_that_is_stopped_while_it_hands_over_ends_with_the_new_process(station, tmp_path):
    data, first, *_ = station
    python, where = faulty_python(tmp_path / "site", "heard yours", signal.SIGSTOP)
    with upgrading(python, data) as asked:
        until(lambda: where.exists() and where.read_text())
        new = int(where.read_text())
        first.terminate()
        assert first.wait(LIMIT_S) == 0
        assert "told to stop" in asked.communicate(timeout=LIMIT_S)[1]
    until(lambda: not alive(new))


@pytest.mark.parametrize(
    ("python", "why"), [("/nowhere/python", "cannot be started"), ("/bin/false", "did not start")]
)
def test_a_version_that_cannot_be_started_disturbs_nobody(station, python, why):
    data, first, url, said = station
    status, _, failed = upgrade_by(python, data)
    assert status == 1
    assert why in failed
    assert processes(said) == [first.pid]
    assert alive(first.pid)
    assert httpx.get(f"{url}/api/health", timeout=LIMIT_S).json()["ready"]


def test_where_no_station_runs_an_upgrade_says_what_to_do(tmp_path):
    (tmp_path / "data").mkdir()
    asked = run("upgrade", "--data", tmp_path / "data")
    assert asked.returncode == 1
    assert "start it with this version instead" in asked.stderr


def test_the_way_back_that_the_page_tells_leads_to_the_old_schema_with_all_that_it_needs(tmp_path):
    data = tmp_path / "data"
    for name in ("log/station.jsonl", "secret/robot-a", "base-maps/lake.pmtiles"):
        (data / name).parent.mkdir(parents=True, exist_ok=True)
        (data / name).write_text("before")
    settings = Settings(data_dir=data)
    engine = write_engine(settings.resolved_database_url)
    with engine.begin() as connection:
        command.upgrade(configuration(connection), "0040")
        RowMaker().add_row(connection, reflected(connection)["robot"])
    asyncio.run(prepare(settings))
    migrate(engine)
    engine.dispose()
    (data / "log/station.jsonl").write_text("before and after")
    (data / "bridge.journal").write_text("after")

    assert GOING_BACK is not None
    script = (MACHINE + GOING_BACK[1]).replace("/var/lib/grace", str(data))
    done = subprocess.run(
        ["bash", "-c", script], cwd=ROOT, capture_output=True, text=True, check=False,
        timeout=LIMIT_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    with engine.connect() as connection:
        assert schema_version(connection) == "0040"
        assert connection.exec_driver_sql("SELECT count(*) FROM robot").scalar() == 1
    engine.dispose()
    found = {name: (data / name).read_text() for name in ("log/station.jsonl", "secret/robot-a")}
    assert set(found.values()) == {"before"}
    assert (data / "base-maps/lake.pmtiles").read_text() == "before"
    assert (data / "bridge.journal").read_text() == "after"
    assert (tmp_path / "data.failed/log/station.jsonl").read_text() == "before and after"
