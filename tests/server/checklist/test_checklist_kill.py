"""A tick that was answered is there after the station was killed."""

import asyncio
import signal
import sys
from pathlib import Path

from server.access.role import Role
from tests.server.checklist.begun import list_of
from tests.server.conftest import api_client, open_station

ROOT = Path(__file__).parents[3]


async def test_tick_outlives_the_station_that_took_it(tmp_path, world):
    doomed = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "tests.server.checklist.doomed_station",
        str(tmp_path),
        cwd=ROOT,
    )
    await asyncio.wait_for(doomed.wait(), 120)
    assert doomed.returncode == -signal.SIGKILL
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        found = await list_of(client)
        hull = next(one for one in found["items"] if one["key"] == "hull")
        assert (hull["is_done"], hull["tick"]["note"]) == (True, "ring 3")
