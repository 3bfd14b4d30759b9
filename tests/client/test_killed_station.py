"""A script and a station that is killed: nothing is done twice, and no event is missed."""

import os
import signal
import subprocess
import sys
import threading
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from db.query.station.events import events_after
from db.store import Store
from grace_client import AsyncStation, Patience, Station
from server.access import register
from server.access.role import Role
from server.base.settings import Settings
from tests.free_port import free_port
from tests.server.conftest import MINI, _add_fleet

pytestmark = [pytest.mark.process, pytest.mark.timeout(900)]
ROOT = Path(__file__).parents[2]
LONG = Patience(give_up_s=600.0, longest_s=1.0)
DIVE = [
    {"kind": "dive", "end_ned": [1.2, 0.6, 0.4]},
    {"kind": "dive", "end_ned": [1.2, 0.6, 0.0]},
]


@pytest.fixture
def folder(tmp_path):
    return tmp_path


@pytest.fixture
def token(folder):
    store = Store.open(Settings(data_dir=folder).resolved_database_url)
    store.change(_add_fleet).result()
    issued = store.change(
        lambda session: register.create_token(
            session, "script", Role.PILOT, timedelta(days=1), at=datetime.now(UTC), by="test"
        )
    ).result()
    store.close()
    return issued.secret


@pytest.fixture
def port():
    return free_port()


@contextmanager
def station(folder, port, manner="lives"):
    command = [sys.executable, "-m", "tests.client.doomed_station", str(folder), str(port), manner]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == "ready\n"
        yield process
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def in_thread(work):
    """Begin work beside the test; return what waits for its outcome."""
    outcome = []

    def run():
        try:
            outcome.append(work())
        except Exception as error:  # noqa: BLE001 - raised where it is waited for
            outcome.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()

    def result():
        thread.join(600.0)
        assert outcome, "it goes on"
        if isinstance(outcome[0], Exception):
            raise outcome[0]
        return outcome[0]

    return result


def events(folder):
    store = Store.open(Settings(data_dir=folder).resolved_database_url)
    with store.read() as session:
        found = events_after(session, 0)
    store.close()
    return found


def test_a_plan_is_made_once_though_the_station_dies_before_it_answers(folder, token, port):
    with station(folder, port, "dies") as dying:  # noqa: SIM117 - one dies within the other
        with Station(f"http://127.0.0.1:{port}", token, patience=LONG) as client:
            planned = in_thread(lambda: client.plan(MINI, DIVE))
            assert dying.wait(300.0) == -signal.SIGKILL
            with station(folder, port):
                plan = planned()
                assert [one.id for one in client.ask.plans.list_robot_plans(MINI)] == [plan.id]
                assert plan.id == "plan-1"


def test_a_cursor_misses_no_event_and_tells_none_twice_over_kills(folder, token, port):
    file = folder / "cursor"
    seen = []

    def read(count):
        with Station(f"http://127.0.0.1:{port}", token, patience=LONG) as client:
            for event in client.events(robot=MINI, file=str(file), after=None):
                seen.append(event.cursor)
                if len(seen) >= count:
                    return

    file.write_text("0")
    reading = in_thread(lambda: read(12))  # of each round six are the plans
    for _ in range(2):
        with station(folder, port) as process:
            with Station(f"http://127.0.0.1:{port}", token, patience=LONG) as client:
                for _ in range(2):
                    plan = client.plan(MINI, DIVE)
                    client.ask.plans.cancel_plan(plan.id)
            os.kill(process.pid, signal.SIGKILL)
    with station(folder, port), Station(f"http://127.0.0.1:{port}", token) as client:
        reading()
        known = [one.cursor for one in events(folder) if one.robot == MINI]
        assert seen == known[: len(seen)]
        follower = iter(client.events(robot=MINI, file=str(file)))
        again = next(follower)
        assert again.cursor == seen[-1], "the last one was not done"
        rest = [next(follower).cursor for _ in known[len(seen) :]]
        assert rest == known[len(seen) :]


async def test_both_clients_tell_the_same_of_a_real_station(folder, token, port):
    url = f"http://127.0.0.1:{port}"
    with station(folder, port), Station(url, token) as sync:
        async with AsyncStation(url, token) as other:
            plan = await other.plan(MINI, DIVE)
            assert plan.state == "draft", plan.message
            same = sync.ask.transfers.get_plan(plan.id)
            assert (same.legs, same.points, same.account) == (plan.legs, plan.points, plan.account)
            frames = sync.samples(MINI, "depth_m"), await other.samples(MINI, "depth_m")
            assert frames[0].equals(frames[1])
            assert frames[0].attrs == frames[1].attrs
            assert frames[0].attrs["units"]["depth_m"] == "m"
            assert sync.ask.channels.list_channels() == await other.ask.channels.list_channels()
