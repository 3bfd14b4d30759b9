"""A station that is killed knows afterwards who is in charge, who asked, and what is held."""

import asyncio
import signal
import sys
from pathlib import Path

from tests.server.conftest import open_station
from tests.server.lease.conftest import act, lease_of, person_at

ROOT = Path(__file__).parents[3]


async def test_a_station_that_is_killed_keeps_the_lease_the_request_and_the_hold(tmp_path, world):
    doomed = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "tests.server.lease.doomed_station", str(tmp_path), cwd=ROOT
    )
    assert await asyncio.wait_for(doomed.wait(), 200) == -signal.SIGKILL
    async with open_station(tmp_path, world) as station, person_at(station, "ann") as ann:
        lease = await lease_of(ann)
        assert (lease["holder"], lease["is_mine"], lease["state"]) == ("ann", True, "requested")
        assert (lease["request"]["by"], lease["request"]["note"]) == ("ben", "my turn")
        assert (await ann.get("/api/automation")).json()["by"] == "ben"
        assert (await act(ann, "grant", to="ben")).json()["holder"] == "ben"
