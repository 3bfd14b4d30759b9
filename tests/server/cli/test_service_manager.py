"""What a service manager hears of a station: a real socket, a real writer, a real process."""

import asyncio
import os
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from db.store import Store
from server.cli.service.manager import ServiceManager, keep_alive

ROOT = Path(__file__).parents[3]
PERIOD_S = 0.3
SILENCE = 10
"""So many periods without a sign of life are no accident."""


@pytest.fixture
def ear(tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heard:
        heard.bind(str(tmp_path / "notify"))
        heard.settimeout(120)
        yield heard


def environment(ear, **more):
    return {"NOTIFY_SOCKET": ear.getsockname(), **more}


def watched(ear):
    microseconds = str(int(PERIOD_S * 1e6))
    return ServiceManager(
        environment(ear, WATCHDOG_USEC=microseconds, WATCHDOG_PID=str(os.getpid()))
    )


def next_word(ear):
    return ear.recv(4096).decode().split("\n")


def is_silent(ear):
    """Tell whether nothing came for long, after what had been said already."""
    ear.setblocking(False)
    while True:
        try:
            ear.recv(4096)
        except BlockingIOError:
            break
    ear.settimeout(SILENCE * PERIOD_S)
    try:
        ear.recv(4096)
    except TimeoutError:
        return True
    finally:
        ear.settimeout(120)
    return False


@pytest.fixture
def store(tmp_path):
    store = Store.open(f"sqlite:///{tmp_path / 'station.sqlite3'}")
    yield store
    store.close()


async def heard(ear, count):
    return [await asyncio.to_thread(next_word, ear) for _ in range(count)]


async def test_signs_of_life_stop_while_the_writer_hangs_and_come_back_after_it(ear, store):
    alive = asyncio.create_task(keep_alive(watched(ear), store))
    assert await heard(ear, 3) == [["WATCHDOG=1"]] * 3
    begun, goes_on = threading.Event(), threading.Event()

    def hang(_session):
        begun.set()
        goes_on.wait()

    hung = store.change(hang)
    await asyncio.to_thread(begun.wait)
    await asyncio.sleep(PERIOD_S)  # what the writer had answered before is said
    assert await asyncio.to_thread(is_silent, ear)
    goes_on.set()
    await asyncio.wrap_future(hung)
    assert await heard(ear, 2) == [["WATCHDOG=1"]] * 2
    alive.cancel()


async def test_signs_of_life_stop_while_the_event_loop_hangs(ear, store):
    alive = asyncio.create_task(keep_alive(watched(ear), store))
    await heard(ear, 2)
    assert is_silent(ear)  # called here, it holds the loop up
    await heard(ear, 1)
    alive.cancel()


def test_a_process_that_is_not_meant_gives_no_signs(ear):
    of_another = environment(ear, WATCHDOG_USEC="1000000", WATCHDOG_PID="1")
    assert ServiceManager(of_another).watchdog_s is None
    assert ServiceManager({}).watchdog_s is None
    ServiceManager({}).ready("to nobody")


def test_a_manager_that_has_gone_away_hinders_nobody(ear, tmp_path):
    manager = ServiceManager(environment(ear))
    (tmp_path / "notify").unlink()
    manager.ready("Serving")


@pytest.mark.process
def test_a_station_says_that_it_serves_reads_its_certificate_anew_and_ends(ear, tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-m", "server.cli", "serve", "--data", tmp_path / "data", "--port", "0"],
        cwd=ROOT, env={**os.environ, **environment(ear, WATCHDOG_USEC="3600000000")},
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    with process:
        assert next_word(ear) == ["READY=1", f"MAINPID={process.pid}", "STATUS=Serving"]
        assert next_word(ear) == ["WATCHDOG=1"]
        process.send_signal(signal.SIGHUP)
        reloading = next_word(ear)
        assert (reloading[0], next_word(ear)[0]) == ("RELOADING=1", "READY=1")
        assert int(reloading[1].removeprefix("MONOTONIC_USEC=")) > 0
        process.terminate()
        assert next_word(ear) == ["STOPPING=1", "STATUS=Stopping"]
        assert process.wait(120) == 0
