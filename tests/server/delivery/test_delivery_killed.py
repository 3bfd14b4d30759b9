"""A station that is killed while it delivers: no half of anything is offered afterwards."""

import hashlib
import io
import shutil
import signal
import time
import zipfile
from datetime import UTC, datetime, timedelta
from functools import partial

import httpx
import pytest

from db.query.fleet.robots import add_robot
from db.store import Store
from server.access.register import create_token
from server.access.role import Role
from server.base.settings import Settings
from tests.db.conftest import robot_record
from tests.server.cli.test_process import serve
from tests.server.delivery.test_file_api import METADATA
from tests.server.delivery.written import told

pytestmark = pytest.mark.process

ROWS, LIMIT_S = 1000, 240.0
DEPLOYMENT = "/api/deployments/deployment-1"
MOMENTS = {
    "its tables are written": ".*.part/csv/*.csv",
    "its NetCDF file is written": ".*.part/.*.part.nc",
    "it is packed": ".*.part/delivery.zip",
    "it is whole and perhaps not noted": "[0-9a-f]*.zip",
}
"""What lies in the folder of deliveries then."""


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """A data folder with a deployment, and a token."""
    folder = tmp_path_factory.mktemp("prepared")

    def begin(session):
        add_robot(session, robot_record())
        at, lifetime = datetime.now(UTC), timedelta(hours=1)
        return create_token(session, "ann", Role.ADMIN, lifetime, at=at, by="test").secret

    store = Store.open(Settings(data_dir=folder).resolved_database_url)
    token = store.change(begin).result()
    store.append(told(ROWS, ("temperature",))).result()
    store.close()
    return folder, token


class Station:
    """A real station process, and who asks it."""

    def __init__(self, folder, token):
        self.process, url = serve(folder)
        headers = {"Authorization": f"Bearer {token}"}
        self.client = httpx.Client(base_url=url, headers=headers, timeout=60)

    def ask(self, method, path, **more):
        answer = self.client.request(method, path, **more)
        assert answer.is_success, answer.text
        return answer.json()

    def deliver(self):
        return self.ask("POST", f"{DEPLOYMENT}/delivery")["id"]

    def offered(self):
        """Return what is offered, once each of it was fetched and found whole."""
        shown = self.ask("GET", f"{DEPLOYMENT}/delivery")
        names = set()
        for package in shown["packages"]:
            content = self.client.get(f"{DEPLOYMENT}/delivery/{package['id']}").content
            assert hashlib.sha256(content).hexdigest() == package["sha256"]
            with zipfile.ZipFile(io.BytesIO(content)) as archive:
                assert archive.testzip() is None
            names.add(f"{package['sha256']}.zip")
        files = self.ask("GET", f"{DEPLOYMENT}/files")["files"]
        return names, {f"{one['sha256']}.nc" for one in files}

    def end(self, number):
        self.client.close()
        self.process.send_signal(number)
        self.process.wait()
        self.process.stdout.close()


def wait_for(found):
    give_up = time.monotonic() + LIMIT_S
    while not (value := found()):
        assert time.monotonic() < give_up
        time.sleep(0.005)
    return value


@pytest.mark.timeout(900)
def test_what_a_station_that_was_killed_offers_is_whole_and_it_delivers_anew(prepared, tmp_path):
    """Killed at each moment of a delivery, it starts again with what is whole, and goes on."""
    folder, token = prepared
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    station = Station(tmp_path, token)
    try:
        station.ask("PATCH", "/api/config/delivery?robot=mini-1", json=METADATA)
        for moment, pattern in MOMENTS.items():
            job, before = delivering(station, tmp_path, pattern)
            station.end(signal.SIGKILL)
            station = Station(tmp_path, token)
            ended = station.ask("GET", f"/api/jobs/{job}")
            packages, files = station.offered()
            assert new_files(tmp_path, "*", set()) == packages | files, moment
            if packages == before:
                assert (ended["state"], "start it again" in ended["message"]) == ("failed", True)
        again = station.deliver()
        ended = wait_for(partial(end_of, station, again))
        assert ended["state"] == "done", ended["message"]
        after, _ = station.offered()
        assert len(after - packages) == 1
    finally:
        station.end(signal.SIGTERM)


def end_of(station, job):
    """Return a job once it has ended."""
    told = station.ask("GET", f"/api/jobs/{job}")
    return None if told["state"] in {"queued", "running"} else told


def delivering(station, folder, pattern):
    """Deliver until that is seen at a moment; return the job, and what was offered before."""
    while True:
        before, _ = station.offered()
        job = station.deliver()
        if wait_for(partial(moment_or_end, station, job, folder, pattern, before)) == "moment":
            return job, before


def moment_or_end(station, job, folder, pattern, known):
    """Tell whether a delivery is at a moment, or has ended and nobody saw it there."""
    for _ in range(20):
        if new_files(folder, pattern, known):
            return "moment"
        time.sleep(0.005)
    state = station.ask("GET", f"/api/jobs/{job}")["state"]
    assert state in {"queued", "running", "done"}
    return "end" if state == "done" else ""


def new_files(folder, pattern, known):
    """Return the names of what lies in the folder of deliveries but is not known."""
    return {one.name for one in (folder / "delivery").glob(pattern)} - known
