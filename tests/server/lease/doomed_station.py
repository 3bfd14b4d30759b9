"""A station in a process of its own that is killed while somebody asks for a robot.

    python -m tests.server.lease.doomed_station DATA_DIR

ann is in charge of mini-1, ben asks for it, automation is held; then it kills itself with SIGKILL.
"""

import asyncio
import os
import signal
import sys
from pathlib import Path

from tests.server.conftest import open_station
from tests.server.fake_link import World
from tests.server.lease.conftest import act, person_at


async def main(folder: Path) -> None:
    """Live until all of it was answered."""
    async with (
        open_station(folder, World()) as station,
        person_at(station, "ann") as ann,
        person_at(station, "ben") as ben,
    ):
        assert (await act(ann, "take")).status_code == 200
        assert (await act(ben, "request", note="my turn")).status_code == 200
        held = await ben.put("/api/automation", json={"is_held": True})
        assert held.status_code == 200
        os.kill(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1])))
