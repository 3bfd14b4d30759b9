"""A station that is started before its database's server waits, says so, and then works."""

import os
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest

from server.system.database_wait import WaitingPage
from tests.free_port import free_port
from tests.postgresql_server import postgresql_server

ROOT = Path(__file__).parents[3]
LIMIT_S = 120.0


async def test_a_station_that_waits_says_so_to_scripts_and_to_browsers():
    page = WaitingPage()
    transport = httpx.ASGITransport(page)
    async with httpx.AsyncClient(transport=transport, base_url="http://station") as client:
        script = await client.post("/api/plans", json={})
        browser = await client.get("/fleet")
    assert (script.status_code, script.headers["Retry-After"]) == (503, "5")
    assert script.json()["detail"] == page.sentence
    assert browser.status_code == 503
    assert "<h1>The station waits for its database</h1>" in browser.text
    assert f"{page.since:%H:%M:%S} UTC" in browser.text


@pytest.fixture
def postgresql():
    with postgresql_server() as server:
        if server is None:
            pytest.skip("this machine has no PostgreSQL server (apt-get install postgresql)")
        yield server


def answer(port: int, path: str = "/api/health") -> httpx.Response | None:
    try:
        return httpx.get(f"http://127.0.0.1:{port}{path}", timeout=60)
    except httpx.TransportError:
        return None


def wait_for(port: int, status: int) -> httpx.Response:
    give_up = time.monotonic() + LIMIT_S
    while (found := answer(port)) is None or found.status_code != status:
        assert time.monotonic() < give_up
        time.sleep(0.1)
    return found


@pytest.mark.process
@pytest.mark.timeout(1500)
def test_a_station_that_is_started_before_its_server_works_once_that_is_there(postgresql, tmp_path):
    url, port = postgresql.url(postgresql.database()), free_port()
    command = [sys.executable, "-m", "server.cli", "serve", "--port", str(port)]
    with postgresql.down():
        with (tmp_path / "said.txt").open("w") as log:
            station = subprocess.Popen(
                [*command, "--data", str(tmp_path)],
                cwd=ROOT,
                env=os.environ | {"GRACE_DATABASE_URL": url},
                stdout=subprocess.DEVNULL,
                stderr=log,
            )
        told = wait_for(port, 503).json()["detail"]
    try:
        assert told.startswith("The database does not answer since ")
        assert wait_for(port, 200).json()["ready"]
        assert (
            "The station waits: The database does not answer" in (tmp_path / "said.txt").read_text()
        )
    finally:
        station.terminate()
        assert station.wait(LIMIT_S) == 0
